"""The figures of the site: from the runs of a scenario to files and captions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from simnav.leaderboard.figures.plots import Dot, Style, Track, dots, error_cdf, error_over_time, save, trajectory
from simnav.leaderboard.ranking.runs import Runs, tracks
from simnav.leaderboard.site.content import Image, ScenarioEntry

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["catalogued", "scenario_figures", "write_figure"]

#: More curves than this in one figure cannot be told apart.
MOST_CURVES = 8

_PIXELS = 96  # of an inch, in CSS
_PANELS = (
    ("horizontal", "Horizontal error [m]", 1.0),
    ("vertical", "Vertical error [m]", 1.0),
    ("velocity", "Velocity error [m/s]", 1.0),
    ("heading", "Heading error [deg]", math.degrees(1.0)),
)


def write_figure(folder: Path, fig: Figure, name: str, caption: str, alt: str) -> Image:
    """Write a figure as SVG and PNG."""
    save(fig, folder / "figures" / f"{name}.svg")
    width, height = fig.get_size_inches() * _PIXELS
    return Image(f"figures/{name}", caption, alt, round(width), round(height))


def scenario_figures(folder: Path, scenario: ScenarioEntry, runs: Sequence[Runs], style: Style) -> list[Image]:
    """Draw the figures of a scenario's page.

    Parameters
    ----------
    folder : Path
        Of the site.
    scenario : ScenarioEntry
    runs : sequence of Runs
        Of the estimators that it suits, best first. Curves are drawn of the `MOST_CURVES` best, and of references.
    style : Style

    Returns
    -------
    list of Image
    """
    name, made = Path(scenario.page).stem, []
    count = len(scenario.seeds)
    seed = _seed_to_show(runs, scenario.seeds)
    fixes, outages = _of_recording(scenario.id, seed)
    best = [r for r in runs if not r.reference][:MOST_CURVES]
    drawn = [*best, *(r for r in runs if r.reference)]
    which = f" The {MOST_CURVES} best." if len(drawn) < len(runs) else ""
    truth, estimates = tracks(drawn, seed)
    if truth is not None:
        note = next((r.note for run in runs if (r := run.at(seed)) is not None), "")
        made.append(
            write_figure(
                folder,
                trajectory(truth, estimates, style, fixes=fixes, title=f"Trajectory, seed {seed}"),
                f"{name}-trajectory",
                f"Truth, fixes and estimates of seed {seed}{', ' + note if note else ''}. An estimate that leaves "
                f"the frame has drifted off.{which}",
                f"Chart of seed {seed}: the true track and the estimated tracks",
            )
        )
    quantiles = [b for r in drawn if (b := r.quantiles()) is not None]
    if quantiles:
        made.append(
            write_figure(
                folder,
                error_cdf(quantiles, style, label="Horizontal error [m]", title="Distribution of the error"),
                f"{name}-cdf",
                f"Share of the epochs of all seeds whose horizontal error is below a value.{which}",
                "Cumulative distribution of the horizontal error of every estimator",
            )
        )
    points = [_dot(r) for r in runs]
    if any(math.isfinite(p.value) for p in points):
        made.append(
            write_figure(
                folder,
                dots(points, style, label="Horizontal RMSE [m]", title="Horizontal RMSE: median, 95 % interval"),
                f"{name}-rmse",
                "Faint points: seeds. Hollow: reference.",
                "Horizontal RMSE of every estimator, with its interval",
            )
        )
    panels = {}
    for key, label, factor in _PANELS:
        bands = [b for r in drawn if (b := r.band(key, factor)) is not None]
        if bands:
            panels[label] = bands
    if panels:
        shaded = " Shaded: outages." if outages else ""
        made.append(
            write_figure(
                folder,
                error_over_time(panels, style, outages=outages, title=f"Error over time, {count} seeds"),
                f"{name}-error",
                f"Median over the seeds, and the band from the 5th to the 95th percentile.{shaded}{which}",
                "Error of every estimator over time, with its spread over the seeds",
            )
        )
    return made


def _of_recording(identity: str, seed: int) -> tuple[dict[str, Track], list[tuple[float, float, str]]]:
    """Fixes and outages of one run, made again; nothing where that is not possible any more."""
    from simnav.leaderboard.figures.run_figure import fixes, outage_spans
    from simnav.source import record

    scenario = catalogued(identity)
    if scenario is None:
        return {}, []
    try:
        recording = record(scenario, seed)
    except (ValueError, OSError):
        return {}, []
    return fixes(recording), outage_spans(recording)


def _seed_to_show(runs: Sequence[Runs], seeds: Sequence[int]) -> int:
    """The first seed of those that most estimators got through."""
    return max(seeds, key=lambda s: (sum(r.at(s) is not None for r in runs), -s))


def _dot(runs: Runs) -> Dot:
    score = runs.score("horizontal_rmse")
    note = f"({runs.failed} failed)" if runs.failed else ""
    return Dot(runs.estimator, score.value, score.low, score.high, runs.scores("horizontal_rmse"), runs.reference, note)


def catalogued(identity: str) -> Any:
    """The scenario of the catalogue with this id, or None: results may come from a file that is elsewhere."""
    from simnav.scenario import load

    try:
        scenario = load(identity)
    except (ValueError, LookupError, OSError):
        return None
    return scenario if scenario.id == identity else None
