"""The posterior Cramer-Rao bounds of a scenario, of all kinds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from simnav.leaderboard.figures.panels import curves_over_time
from simnav.leaderboard.figures.plots import Curve
from simnav.leaderboard.figures.style import Style
from simnav.leaderboard.results.errors import mistakes
from simnav.leaderboard.results.frame import frame
from simnav.leaderboard.results.shown import Shown
from simnav.types import COMPONENTS, Array

from . import tables

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.table import Table

    from simnav.estimators.bound import Bound
    from simnav.scenario import Scenario

__all__ = ["BoundReport", "bounds_of"]

#: Epochs that the table shows.
_ROWS = 12


@dataclass(frozen=True, eq=False, repr=False)
class BoundReport(Shown):
    """The bounds of a scenario.

    Attributes
    ----------
    scenario : str
        Versioned id.
    runs : int
        Seeds over which they are averaged.
    smoothed : bool
        Whether the bound is for smoothed output; otherwise for output in real time.
    bounds : tuple of simnav.estimators.bound.Bound
        ``clean``: without faults; ``flags``: faults known as they come; ``mix``: only their statistics known.
    """

    scenario: str
    runs: int
    smoothed: bool
    bounds: tuple[Bound, ...]

    def headline(self) -> str:
        """Of which error, and over how many seeds."""
        error = "horizontal error of smoothed output" if self.smoothed else "horizontal error"
        return f"{self.scenario}: bound on the RMS {error} [m], {self.runs} seeds"

    def shown(self) -> Sequence[Table]:
        """A dozen epochs and the whole run."""
        at = np.unique(np.linspace(0, len(self.time) - 1, _ROWS).astype(int))
        rows = [[f"{self.time[i]:g}", *(tables.number(float(b.horizontal[i])) for b in self.bounds)] for i in at]
        rows.append(["whole run", *(tables.number(b.horizontal_rms) for b in self.bounds)])
        return [tables.table(self.headline(), ["time [s]", *(b.kind for b in self.bounds)], rows)]

    @property
    def time(self) -> Array:
        """(T,) array: ends of the steps [s]."""
        return self.bounds[0].time

    def to_dict(self) -> dict[str, Any]:
        """What ``simnav bound --json`` prints, but for the file."""
        return {
            "scenario": self.scenario,
            "runs": self.runs,
            "smoothed": self.smoothed,
            "bounds": [
                {**b.summary(), "time": b.time.tolist(), "horizontal": b.horizontal.tolist()} for b in self.bounds
            ],
        }

    def columns(self) -> dict[str, Array]:
        """Time [s] and the bound on the standard deviation of each component [m, m/s, rad], as ``KIND_COMPONENT``."""
        sigmas = {f"{b.kind}_{c}": b.sigma[:, i] for b in self.bounds for i, c in enumerate(COMPONENTS)}
        return {"time": self.time, **sigmas}

    def to_frame(self) -> Any:
        """`columns`, a row an epoch; see `simnav.leaderboard.results.frame.frame`."""
        columns = {name: values.tolist() for name, values in self.columns().items()}
        return frame([dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)])

    def plot(self) -> Figure:
        """The bound on the RMS horizontal error over time."""
        curves = [Curve(b.kind, b.time, b.horizontal) for b in self.bounds]
        title = f"{self.scenario}: bound on the error, {self.runs} seeds"
        return curves_over_time({"Horizontal error [m]": curves}, Style([c.label for c in curves]), title=title)


def bounds_of(
    scenario: Scenario, runs: int = 12, smoothed: bool = False, progress: Callable[..., None] | None = None
) -> BoundReport:
    """Compute the bounds of all kinds; see `simnav.leaderboard.interface.bound`."""
    from simnav.estimators.bound import KINDS, bound

    report = progress or (lambda *_, **__: None)
    found = []
    with mistakes(ValueError, FileNotFoundError):
        for k, kind in enumerate(KINDS):
            report(k, len(KINDS), note=kind)
            found.append(bound(scenario, range(runs), kind, smoothed))
    report(len(KINDS), len(KINDS))
    return BoundReport(scenario.id, runs, smoothed, tuple(found))
