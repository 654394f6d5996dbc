"""The papers' figures over time, drawn from our runs."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from leaderboard.figures import Band, Style, error_over_time, save
from leaderboard.summary import Runs

if TYPE_CHECKING:
    from leaderboard.reproduce.paper import Curves
    from leaderboard.reproduce.reproduction import Reproduction
    from simnav.recording import Recording

__all__ = ["write_figures"]


def write_figures(found: Reproduction, folder: Path) -> list[Path]:
    """Draw what there is to draw; one PNG each.

    Returns
    -------
    list of Path
    """
    written = []
    for curves in found.paper.curves:
        labels = [r.label for m in curves.methods if (r := found.stands_for[m]) is not None]
        noise = any("." in name for name in curves.series.values())
        bands = _noise(found, curves) if noise else _errors(found, curves, labels)
        if not any(bands.values()):
            continue
        style = Style(labels, ["truth"] if noise else [])
        fig = error_over_time(bands, style, title=f"Paper {found.paper.key}: {curves.title}")
        written += save(fig, folder / curves.name, formats=("png",))
    return written


def _errors(found: Reproduction, curves: Curves, labels: Iterable[str]) -> dict[str, list[Band]]:
    """Errors of all seeds, from the results."""
    scenario = found.paper.scenario(curves.scenario).id
    runs = []
    for label in labels:
        results = [r for r in found.results if (r.scenario, r.estimator) == (scenario, label)]
        if results:
            runs.append(Runs(results))
    return {panel: [b for r in runs if (b := r.band(series)) is not None] for panel, series in curves.series.items()}


def _noise(found: Reproduction, curves: Curves) -> dict[str, list[Band]]:
    """Diagnostics of the first seed, which results do not hold: run again, with the true sigma beside it."""
    from simnav.estimator import make
    from simnav.source import record
    from simnav.trial import run_trial

    recording = record(found.paper.scenario(curves.scenario), found.seeds[0])
    trials = []
    for method in curves.methods:
        request = found.stands_for[method]
        if request is not None:
            trials.append((request.label, run_trial(make(request.name, **request.parameters), recording)))
    panels: dict[str, list[Band]] = {}
    for panel, name in curves.series.items():
        panels[panel] = [
            Band(label, trial.time, trial.diagnostics[name][None, :])
            for label, trial in trials
            if name in trial.diagnostics
        ]
        if panels[panel]:
            panels[panel] += _truth(recording, name)
    return panels


def _truth(recording: Recording, name: str) -> Iterator[Band]:
    from simnav.types import KINDS

    quantity, _, instrument = name.partition(".")
    stream = recording.data.aids[instrument]
    column = KINDS[stream.kind].errors.index(quantity.removeprefix("sigma_"))
    yield Band("truth", stream.time, np.ascontiguousarray(stream.sigma[:, column])[None, :])
