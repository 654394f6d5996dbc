"""Pictures with few colours, which take a quarter of the space: figures have few, and their edges some between them."""

from __future__ import annotations

from pathlib import Path

__all__ = ["in_few_colours"]

_COLOURS = 96


def in_few_colours(path: Path) -> None:
    """Write a PNG file again with a palette."""
    from PIL import Image

    with Image.open(path) as picture:
        few = picture.convert("RGB").quantize(_COLOURS, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
    few.save(path, "PNG", optimize=True)
