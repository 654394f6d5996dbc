"""The papers' figures, drawn from our runs as PNG (`simnav.leaderboard.papers.paper.Figure`).

Figures of one run show the first seed. It is run again for them, because results do not hold whole trajectories.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from simnav.leaderboard.campaign.confinement.attempt import chosen_confinement, try_estimator
from simnav.leaderboard.campaign.confinement.session import Limits
from simnav.leaderboard.campaign.resolution import resolve
from simnav.leaderboard.figures.appearance import HORIZONTAL_ERROR
from simnav.leaderboard.figures.panels import Bar, bars, curves_over_time
from simnav.leaderboard.figures.plots import Band, Curve, error_cdf, error_over_time, trajectory
from simnav.leaderboard.figures.run_figure import fixes, outage_spans, relative_track, true_track
from simnav.leaderboard.figures.style import Style, save
from simnav.leaderboard.ranking.runs import Runs
from simnav.leaderboard.ranking.statistics import Interval, mean, mean_ratio
from simnav.scoring import errors, smoothed_errors
from simnav.types import KINDS, Array

from .comparison import as_gain
from .measures import value_of
from .paper import Figure, Gain, Range, Table, Value
from .ratio_figure import EDGE, ratio_figure, ratios

if TYPE_CHECKING:
    from collections.abc import Iterable

    import matplotlib.figure

    from simnav.recording import Recording
    from simnav.trial import Trial

    from .findings import Findings

__all__ = ["ERRORS", "Drawn", "draw", "write_figures"]

_DEGREES = math.degrees(1.0)
_PIXELS = 96  # of an inch, in CSS
_TIMEOUT, _MEMORY = 900.0, 4 << 30  # of one method's run for a figure

#: Errors of a run: name -> columns of `simnav.scoring.errors` and factor; several columns are shown by their length.
ERRORS: dict[str, tuple[tuple[int, ...], float]] = {
    "north": ((0,), 1.0),
    "east": ((1,), 1.0),
    "down": ((2,), 1.0),
    "velocity_north": ((3,), 1.0),
    "velocity_east": ((4,), 1.0),
    "velocity_down": ((5,), 1.0),
    "tilt_north": ((6,), _DEGREES),
    "tilt_east": ((7,), _DEGREES),
    "heading": ((8,), _DEGREES),
    "horizontal": ((0, 1), 1.0),
    "position": ((0, 1, 2), 1.0),
    "velocity": ((3, 4, 5), 1.0),
    "attitude": ((6, 7, 8), _DEGREES),
}
_SPREAD_FACTORS = {"heading": _DEGREES}

#: A figure, the methods in it, and its caption; `_NOTHING` where nothing can be drawn.
_Made: TypeAlias = "tuple[matplotlib.figure.Figure | None, list[str], str]"
_NOTHING: _Made = (None, [], "")


@dataclass(frozen=True)
class Drawn:
    """The outcome of drawing a figure.

    Attributes
    ----------
    figure : Figure
        The paper's figure.
    path : Path or None
        The file; None if nothing could be drawn.
    caption : str
        Caption.
    width, height : int
        Size in CSS pixels.
    missing : tuple of str
        Methods that are not in the figure, because they are not registered or have no successful run.
    """

    figure: Figure
    path: Path | None
    caption: str = ""
    width: int = 0
    height: int = 0
    missing: tuple[str, ...] = ()


def write_figures(
    found: Findings,
    folder: Path,
    progress: Callable[[int, int, str], None] | None = None,
    *,
    scores_only: bool = False,
) -> list[Drawn]:
    """Draw all figures that can be drawn.

    Parameters
    ----------
    found : Findings
        The comparison.
    folder : Path
        An existing folder.
    progress : callable, optional
        Called with the number of finished figures, the number of all figures, and the next figure.
    scores_only : bool
        Draw only those figures that need scores alone, so that nothing is run.

    Returns
    -------
    list of Drawn
        One for each figure that was to be drawn, in their order.
    """
    figures = [f for f in found.paper.figures if f.draw in ("bars", "gains") or not scores_only]
    figures += [
        Figure("", table.title, "ratios", "", ()) for table in found.paper.tables if _compared_rows(found, table)
    ]
    sketch = _Sketch(found)
    drawn = []
    for k, entry in enumerate(figures):
        if progress is not None:
            progress(k, len(figures), entry.number or entry.what)
        drawn.append(sketch.write(entry, folder))
    if progress is not None:
        progress(len(figures), len(figures), "")
    return drawn


def draw(found: Findings, entry: Figure) -> matplotlib.figure.Figure | None:
    """Draw one of the paper's figures; None if nothing can be drawn."""
    return _Sketch(found).draw(entry)[0]


class _Sketch:
    """What the figures of a paper share: style, recordings and trials of the first seed."""

    def __init__(self, found: Findings):
        self.found, self.paper = found, found.paper
        self.style = Style([m.name for m in found.paper.methods], ["truth"])
        self.recordings: dict[str, Recording] = {}
        self.trials: dict[tuple[str, str], Trial | None] = {}

    def draw(self, entry: Figure) -> _Made:
        """Draw one figure."""
        draw = {
            "track": self._track,
            "run": self._run,
            "spread": self._spread,
            "bars": self._bars,
            "gains": self._gains,
            "distribution": self._distribution,
            "ratios": self._ratios,
        }[entry.draw]
        return draw(entry)

    def write(self, entry: Figure, folder: Path) -> Drawn:
        """Draw one figure and write it."""
        fig, shown, caption = self.draw(entry)
        missing = tuple(m for m in entry.methods if m not in shown)
        path = folder / f"{entry.name}.png"
        if fig is None:
            path.unlink(missing_ok=True)  # of an earlier run, when there was something
            return Drawn(entry, None, missing=missing)
        save(fig, path, formats=("png",))
        width, height = fig.get_size_inches() * _PIXELS
        note = f" Missing: {', '.join(missing)}." if missing else ""
        return Drawn(entry, path, caption + note, round(width), round(height), missing)

    def _heading(self, entry: Figure, runs: str) -> str:
        number = f", {entry.full_number}" if entry.number else ""
        return f"{self.paper.short}{number}: {entry.title} ({runs})"

    # -- one run ---------------------------------------------------------------------------------

    def _recording(self, scenario: str) -> Recording:
        from simnav.source import record

        if scenario not in self.recordings:
            self.recordings[scenario] = record(self.paper.scenario(scenario), self.found.seeds[0])
        return self.recordings[scenario]

    def _trial(self, scenario: str, method: str) -> Trial | None:
        """A method's run of the first seed, in a process of its own; None where it is not there or gives nothing."""
        request = self.found.stands_for[method]
        if request is None:
            return None
        key = (scenario, request.label)
        if key not in self.trials:
            confinement = chosen_confinement()
            entrant = resolve(request, confinement, ())
            made = try_estimator(entrant, self._recording(scenario), Limits(_TIMEOUT, _MEMORY), confinement)
            self.trials[key] = (
                made.trial if made.status == "ok" and made.trial is not None and len(made.trial) else None
            )
        return self.trials[key]

    def _seed(self) -> str:
        return f"seed {self.found.seeds[0]}"

    def _track(self, entry: Figure) -> _Made:
        recording = self._recording(entry.scenario)
        tracks = []
        for method in entry.methods:
            trial = self._trial(entry.scenario, method)
            if trial is None:
                continue
            position = np.where(trial.estimated[:, :3], trial.position, np.nan)
            if self.paper.method(method).smoothed and trial.smoothed is not None:
                position = trial.smoothed.position.copy()
            tracks.append(relative_track(method, position, recording))
        if entry.methods and not tracks:
            return _NOTHING
        title = self._heading(entry, self._seed())
        fig = trajectory(true_track(recording), tracks, self.style, fixes=fixes(recording), title=title)
        return fig, [t.label for t in tracks], f"One run ({self._seed()}): the true track, the fixes and the estimates."

    def _run(self, entry: Figure) -> _Made:
        recording = self._recording(entry.scenario)
        panels: dict[str, list[Curve]] = {}
        for label, name in entry.series.items():
            curves = [c for m in entry.methods if (c := self._curve(entry.scenario, m, name)) is not None]
            if curves and name.startswith("sigma_"):
                curves += _true_sigma(recording, name)
            panels[label] = curves
        shown = {c.label for curves in panels.values() for c in curves}
        if not shown:
            return _NOTHING
        spans = outage_spans(recording)
        title = self._heading(entry, self._seed())
        fig = curves_over_time(panels, self.style, outages=spans, title=title)
        shaded = " Shaded: outages." if spans else ""
        return fig, [m for m in entry.methods if m in shown], f"One run ({self._seed()}).{shaded}"

    def _curve(self, scenario: str, method: str, name: str) -> Curve | None:
        trial = self._trial(scenario, method)
        if trial is None:
            return None
        if name in ERRORS:
            columns, factor = ERRORS[name]
            smooth = self.paper.method(method).smoothed
            error = smoothed_errors(trial, self._recording(scenario)) if smooth else None
            if error is None:
                error = errors(trial, self._recording(scenario))
            e = factor * error[:, columns]
            values = e[:, 0] if len(columns) == 1 else np.linalg.norm(e, axis=1)
        elif name in trial.diagnostics:
            values = np.asarray(trial.diagnostics[name], dtype=np.float64)
            if values.ndim > 1:  # of an array, its length
                values = np.linalg.norm(values.reshape(len(trial), -1), axis=1)
        else:
            return None
        return Curve(method, trial.time, values) if np.isfinite(values).any() else None

    # -- all runs --------------------------------------------------------------------------------

    def _runs(self, scenario: str, method: str) -> Runs | None:
        request = self.found.stands_for[method]
        if request is None:
            return None
        of = (self.paper.scenario(scenario).id, request.label)
        results = [r for r in self.found.results if (r.scenario, r.estimator) == of]
        return Runs(results) if results else None

    def _all(self, entry: Figure) -> Iterator[tuple[str, Runs]]:
        for method in entry.methods:
            runs = self._runs(entry.scenario, method)
            if runs is not None and runs.good:
                yield method, runs

    def _count(self) -> str:
        return f"{len(self.found.seeds)} runs"

    def _spread(self, entry: Figure) -> _Made:
        panels: dict[str, list[Band]] = {}
        for label, name in entry.series.items():
            bands = ((m, r.band(name, _SPREAD_FACTORS.get(name, 1.0))) for m, r in self._all(entry))
            panels[label] = [Band(m, b.time, b.values) for m, b in bands if b is not None]
        shown = {b.label for bands in panels.values() for b in bands}
        if not shown:
            return _NOTHING
        spans = outage_spans(self._recording(entry.scenario))
        fig = error_over_time(panels, self.style, outages=spans, title=self._heading(entry, self._count()))
        caption = f"{self._count()}: median of the error's size, and the band from the 5th to the 95th percentile."
        return fig, [m for m in entry.methods if m in shown], caption

    def _distribution(self, entry: Figure) -> _Made:
        bands = [Band(m, q.time, q.values) for m, r in self._all(entry) if (q := r.quantiles()) is not None]
        if not bands:
            return _NOTHING
        fig = error_cdf(bands, self.style, label=HORIZONTAL_ERROR, title=self._heading(entry, self._count()))
        caption = f"Share of the epochs of {self._count()} whose horizontal error is below a value."
        return fig, [b.label for b in bands], caption

    def _bars(self, entry: Figure) -> _Made:
        panels: dict[str, list[Bar]] = {}
        for label, score in entry.series.items():
            papers = {r.method: r.paper for r in self.paper.rows()
                      if isinstance(r, Value) and r.paper is not None
                      and (r.scenario, r.score) == (entry.scenario, score)}  # fmt: skip
            panels[label] = []
            for method, runs in self._all(entry):
                values = [value_of(r, score) for r in runs.good]
                panels[label].append(_bar(method, mean(values), values, papers.get(method)))
        return self._compared(entry, panels, zero=False)

    def _gains(self, entry: Figure) -> _Made:
        first, *others = entry.methods
        ours = self._runs(entry.scenario, first)
        panels: dict[str, list[Bar]] = {}
        for label, score in entry.series.items():
            papers = {
                r.than: r.paper
                for r in self.paper.rows()
                if isinstance(r, Gain)
                and r.paper is not None
                and (r.scenario, r.method, r.score) == (entry.scenario, first, score)
            }
            panels[label] = []
            for method, runs in self._all(entry):
                if method not in others or ours is None or not ours.good:
                    continue
                a, b = ({r.seed: value_of(r, score) for r in of.good} for of in (ours, runs))
                gain = as_gain(mean_ratio(a, b))
                ours_in_percent = Interval(100.0 * gain.value, 100.0 * gain.low, 100.0 * gain.high, gain.runs)
                each = [100.0 * (1.0 - a[s] / b[s]) for s in a if s in b and b[s] > 0.0]
                paper = papers.get(method)
                panels[label].append(_bar(method, ours_in_percent, each, None if paper is None else 100.0 * paper))
        fig, shown, caption = self._compared(entry, panels, zero=True)
        return fig, [first, *shown] if shown else [], caption

    def _ratios(self, entry: Figure) -> _Made:
        """All figures of a table that the paper and we have, ours over the paper's."""
        rows = ratios([f for f in self.found.findings if f.table == entry.what])
        fig = ratio_figure(rows, f"{self.paper.short}: {entry.what}")
        caption = (
            "Our figures as multiples of the paper's; of a gain, the ratio of the two errors. Thick: the 95 % interval "
            "of our mean. Thin: the range of 95 % of our single runs. A figure beyond a factor of "
            f"{EDGE:g} is written as a number."
        )
        return fig, [], caption

    def _compared(self, entry: Figure, panels: dict[str, list[Bar]], *, zero: bool) -> _Made:
        shown = {b.label for of in panels.values() for b in of if math.isfinite(b.value)}
        if not shown:
            return _NOTHING
        fig = bars(panels, self.style, title=self._heading(entry, self._count()), zero=zero)
        caption = f"Mean over {self._count()} with its 95 % interval, the runs (faint), and the paper's figure."
        return fig, [m for m in entry.methods if m in shown], caption


def _compared_rows(found: Findings, table: Table) -> int:
    """How many rows of a table can be drawn beside the paper's."""
    return len(ratios([f for f in found.findings if f.table == table.title]))


def _bar(label: str, ours: Interval, runs: Iterable[float], paper: Range | None) -> Bar:
    ends = (math.nan, math.nan) if paper is None else paper if isinstance(paper, tuple) else (paper, paper)
    return Bar(label, ours.value, ours.low, ours.high, list(runs), ends)


def _true_sigma(recording: Recording, name: str) -> Iterator[Curve]:
    quantity, _, instrument = name.partition(".")
    stream = recording.data.aids[instrument]
    column = KINDS[stream.kind].errors.index(quantity.removeprefix("sigma_"))
    values: Array = np.ascontiguousarray(stream.sigma[:, column])
    yield Curve("truth", stream.time, values)
