"""The parameters that are varied, and between which bounds."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, TypeAlias, get_args

from simnav.estimator import describe
from simnav.estimator.parameters import former_names
from simnav.leaderboard.campaign.request import EstimatorRequest
from simnav.leaderboard.results.errors import RequestError

__all__ = ["Range", "Scale", "read_range", "space_of", "what_to_vary"]

Scale: TypeAlias = Literal["linear", "log", "integer"]


@dataclass(frozen=True)
class Range:
    """A parameter and its bounds.

    Attributes
    ----------
    name : str
        Name of the parameter.
    low, high : float
        Bounds, both included.
    scale : str
        ``linear``, ``log`` (the logarithm is varied) or ``integer``.
    """

    name: str
    low: float
    high: float
    scale: Scale = "linear"

    def __post_init__(self) -> None:
        text = f"{self.name} = {self.low:g}:{self.high:g}"
        if not (math.isfinite(self.low) and math.isfinite(self.high) and self.low < self.high):
            raise RequestError(f"{text}: the first bound should be below the second, and both finite")
        if self.scale == "log" and not self.low > 0.0:
            raise RequestError(f"{text}: bounds of a logarithmic scale are above 0")
        if self.scale == "integer" and not (float(self.low).is_integer() and float(self.high).is_integer()):
            raise RequestError(f"{text}: bounds of whole numbers are whole numbers")

    @property
    def bounds(self) -> tuple[float, float]:
        """In what is varied."""
        return (math.log(self.low), math.log(self.high)) if self.scale == "log" else (self.low, self.high)

    def value(self, x: float) -> float | int:
        """The parameter's value, of what is varied: to three digits, as it will be written down."""
        if self.scale == "integer":
            return round(min(max(x, self.low), self.high))
        y = math.exp(x) if self.scale == "log" else x
        return float(f"{min(max(y, self.low), self.high):.3g}")

    def position(self, value: float) -> float:
        """What is varied, of a value, within the bounds."""
        inside = min(max(float(value), self.low), self.high)
        return math.log(inside) if self.scale == "log" else inside

    def __str__(self) -> str:
        end = "" if self.scale == "linear" else f":{self.scale}"
        return f"{self.name}={self.low:g}:{self.high:g}{end}"


def read_range(text: str) -> Range:
    """A range as it is typed: ``name=low:high``, ``name=low:high:log`` or ``name=low:high:integer``.

    Examples
    --------
    >>> read_range("dof=2:50:log")
    Range(name='dof', low=2.0, high=50.0, scale='log')
    """
    found = re.fullmatch(r"\s*(\w+)\s*=\s*([^:\s]+)\s*:\s*([^:\s]+)\s*(?::\s*(\w+)\s*)?", text)
    help_ = f"--vary {text}: it should be name=low:high, or with :log or :integer behind, like dof=2:50:log"
    if found is None:
        raise RequestError(help_)
    name, low, high, scale = found.groups()
    scales: dict[str, Scale] = {s: s for s in get_args(Scale)}
    if scale is not None and scale not in scales:
        raise RequestError(f"--vary {text}: {scale!r} is no scale; there are: {', '.join(scales)}")
    try:
        return Range(name, float(low), float(high), scales[scale or "linear"])
    except ValueError as error:
        raise error if isinstance(error, RequestError) else RequestError(help_) from None


def what_to_vary(request: EstimatorRequest) -> str:
    """One sentence for who has not said what to vary: how it is said, with the numbers that the row has."""
    numbers = {
        p.name: p.default
        for p in describe(request.name).parameters
        if isinstance(p.default, int | float) and not isinstance(p.default, bool) and p.name not in request.parameters
    }
    if not numbers:
        return f"{request.label} has no number that could be varied"
    name, value = next(((n, v) for n, v in numbers.items() if v > 0), ("name", 1.0))
    return (
        f"{request.label} ships without a tuning: say what to vary between which values, like "
        f"--vary {name}={0.5 * value:g}:{2.0 * value:g} (vary= in Python); its numbers are: {', '.join(numbers)}"
    )


def space_of(request: EstimatorRequest, ranges: Sequence[str | Range]) -> tuple[tuple[Range, ...], Mapping[str, Any]]:
    """The ranges, and the present value of each.

    Parameters
    ----------
    request : EstimatorRequest
        The row; a parameter that it sets holds, and is not varied.
    ranges : sequence of str or Range
        What is varied; as text, ``"name=low:high"`` with ``:log`` or ``:integer``. Former names of parameters are
        replaced by the present ones.

    Raises
    ------
    RequestError
        If there is no such parameter, it is no number or outside of its range, or it is set or varied twice.
    """
    about = describe(request.name)
    known, formerly = {p.name: p.default for p in about.parameters}, former_names(about.cls)
    given = [r if isinstance(r, Range) else read_range(r) for r in ranges]
    space = tuple(replace(r, name=formerly.get(r.name, r.name)) for r in given)
    if not space:
        raise RequestError(f"no parameter is varied; {request.label} has: {', '.join(known) or 'none'}")
    present = {}
    for r in space:
        if r.name not in known:
            raise RequestError(f"{request.label} has no parameter {r.name!r}; it has: {', '.join(known) or 'none'}")
        if r.name in present or r.name in request.parameters:
            raise RequestError(f"{request.label}: the parameter {r.name!r} is set or varied twice")
        default = known[r.name]
        if isinstance(default, bool) or not isinstance(default, int | float):
            raise RequestError(f"{request.label}: {r.name} = {default!r} is no number that could be varied")
        if not r.low <= default <= r.high:
            raise RequestError(f"{request.label}: the present {r.name} = {default:g} is not within {r}")
        present[r.name] = default
    return space, present
