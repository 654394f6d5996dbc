"""The figures of an instrument's specification: their types, and the factors by which a datasheet is wrong."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, TypeVar

from pydantic import BeforeValidator

from simnav.spec import NonNegative, Spec, Vector

__all__ = [
    "PROCESSES", "ZERO", "Pair", "SigmaPair", "SigmaTriple", "Triple", "figures_of", "times_datasheet",
]  # fmt: skip

T = TypeVar("T", bound=Spec)

#: The key of ``times_datasheet`` for the sizes of all processes, which is also that of their tables.
PROCESSES = "error"
#: Default of a vector.
ZERO: Vector = (0.0, 0.0, 0.0)


def _spread(n: int) -> BeforeValidator:
    return BeforeValidator(lambda x: (x,) * n if isinstance(x, (int, float)) and not isinstance(x, bool) else x)


#: Two or three numbers, one for each axis; TOML may have one number for all axes. One-sigma figures are not negative.
Pair = Annotated[tuple[float, float], _spread(2)]
Triple = Annotated[Vector, _spread(3)]
SigmaPair = Annotated[tuple[NonNegative, NonNegative], _spread(2)]
SigmaTriple = Annotated[tuple[NonNegative, NonNegative, NonNegative], _spread(3)]


def figures_of(cls: type[Spec], errors: Sequence[str]) -> list[str]:
    """The fields of a specification whose datasheet value may be wrong (``times_datasheet``)."""
    stems = tuple(errors)
    return [n for n in cls.model_fields if n in stems or any(n.startswith(f"{stem}_") for stem in stems)]


def times_datasheet(spec: T) -> T:
    """A specification with its figures multiplied by its ``times_datasheet``; the same object without them."""
    factors: Mapping[str, float] = getattr(spec, "times_datasheet", {})
    if not factors:
        return spec
    changes: dict[str, Any] = {"times_datasheet": {}}
    for name, factor in factors.items():
        if name == PROCESSES:
            changes["processes"] = tuple(process.scaled(factor) for process in spec.processes)  # type: ignore[attr-defined]
            continue
        value = getattr(spec, name)
        changes[name] = tuple(factor * v for v in value) if isinstance(value, tuple) else factor * value
    return spec.model_copy(update=changes)
