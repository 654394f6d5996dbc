"""Charts for print: a specification with its data, in the colours of paper, as SVG and PNG; no browser is needed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from simnav.leaderboard.figures.appearance import DASHES, INKS, PALETTE
from simnav.leaderboard.results.files import write_whole

from .charts import Chart, Spec
from .library import VEGA_LITE

__all__ = ["filled", "write_figure"]

_PALETTE = tuple(light for light, _ in PALETTE)
_INKS = {
    **{f"${name}": colour for name, colour in INKS["light"].items()},
    "$strong": _PALETTE[0],
    "$second": _PALETTE[1],
    "$scheme": "blues",
}


def filled(chart: Chart, rows: Sequence[str], width: int = 620) -> Spec:
    """A specification with its data, in the colours of print, that shows some rows and a legend."""
    scales: dict[str, Any] = {
        "$colours": {"domain": list(rows), "range": [_PALETTE[k % 8] for k in range(len(rows))]},
        "$banded": list(rows)[:3],
        "$dashes": {"domain": list(rows), "range": [DASHES[k // 8 % 4] for k in range(len(rows))]},
    }

    def fill(item: Any) -> Any:
        if isinstance(item, str):
            return _INKS.get(item, scales.get(item, item))
        if isinstance(item, list):
            return [fill(v) for v in item]
        if isinstance(item, Mapping):
            found = {k: fill(v) for k, v in item.items() if k != "params"}
            if isinstance(item.get("scale"), str):
                found["legend"] = {"title": None, "orient": "bottom", "columns": 3}
            return found
        return item

    datasets = {name: _expanded(d, rows) for name, d in chart.data.items() if name != "frame"}
    given = dict(chart.spec)
    if "layer" in given:  # points that appear on hover have no place on paper; a layer without data spoils the scales
        given["layer"] = [
            x
            for x in given["layer"]
            if not any(p["name"] == "near" for p in x.get("params", ()))
            and datasets.get(x.get("data", {}).get("name"), True)
        ]
    spec = {"$schema": "https://vega.github.io/schema/vega-lite/v6.json", **fill(given)}
    if "facet" in spec:  # panels side by side, three a line
        spec["columns"] = 3
        spec["spec"] |= dict.fromkeys(("width", "height"), width // spec["columns"] - 40)
    else:
        spec.setdefault("width", width)
    spec["datasets"] = datasets
    if chart.equal:
        _one_scale(spec, chart.data["frame"], width)
    return spec


def _expanded(data: Mapping[str, Any], rows: Sequence[str]) -> list[dict[str, Any]]:
    if "rows" not in data:
        return [dict(zip(data, values, strict=True)) for values in zip(*data.values(), strict=True)]
    axis = data.get("axis")
    found = []
    for row in (r for r in rows if r in data["rows"]):
        curves = data["rows"][row]
        for k, values in enumerate(zip(*curves.values(), strict=True)):
            at = {} if axis is None else {data["name"]: axis[k]}
            found.append({"row": row, **at, **dict(zip(curves, values, strict=True))})
    return found


def _one_scale(spec: Spec, frame: Mapping[str, Sequence[float]], width: int) -> None:
    sides = {a: 1.12 * max(frame[a][1] - frame[a][0], 1e-9) for a in ("x", "y")}
    height = max(240.0, min(560.0, width * sides["y"] / sides["x"]))
    metres = max(sides["x"] / width, sides["y"] / height)
    spec["height"] = height
    for a, pixels in (("x", width), ("y", height)):
        middle, half = 0.5 * (frame[a][0] + frame[a][1]), 0.5 * metres * pixels
        spec["encoding"][a]["scale"] = {"domain": [middle - half, middle + half], "nice": False, "zero": False}


def write_figure(spec: Spec, path: Path) -> list[Path]:
    """Write a specification with its data as ``PATH.svg`` and ``PATH.png``, for print."""
    import vl_convert

    svg = vl_convert.vegalite_to_svg(spec, vl_version=VEGA_LITE)
    png = vl_convert.svg_to_png(svg, scale=2.0)
    return [write_whole(path.with_suffix(".svg"), svg), write_whole(path.with_suffix(".png"), png)]
