"""The first picture of the README: a voyage on which receivers are deceived, and two estimators that part there.

``python docs/voyage.py`` draws it. The command ``simnav run gnss-spoofing -e ekf,gnc-fgo --plot`` shows all of the run.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import simnav
from simnav.leaderboard.figures.frames import shade
from simnav.leaderboard.figures.run_figure import fault_spans, fixes, relative_track, true_track
from simnav.leaderboard.figures.style import Style, figure, save, styled
from simnav.scoring import errors

SCENARIO, ROWS, SEED = "gnss-spoofing", ("ekf", "gnc-fgo"), 0
PICTURE = Path(__file__).parent / "figures" / "faulty-voyage"
AROUND = 40.0  # metres around the largest error that the map shows


def draw() -> None:
    """Run the voyage, and write the picture."""
    report = simnav.run(SCENARIO, list(ROWS), seed=SEED)
    recording, style = report.recording, Style(ROWS)
    spans = fault_spans(recording)
    with styled():
        fig = figure(9.0, 3.1)
        track, error = fig.subplots(1, 2, width_ratios=[1.0, 1.5])
        truth = true_track(recording)
        for found in fixes(recording).values():
            track.plot(found.east, found.north, ".", color="0.7", ms=3, label="GNSS fixes")
        track.plot(truth.east, truth.north, color="0.15", lw=2.4, label="true track")
        worst, centre = 0.0, (0.0, 0.0)
        for run in report.estimators:
            label, size = run.estimator, np.hypot(*errors(run.trial, recording)[:, :2].T)
            path = relative_track(label, run.trial.position, recording)
            colour = style.colour(label)
            track.plot(path.east, path.north, color=colour, lw=1.6, label=label)
            error.plot(run.trial.time, size, color=colour, lw=1.6, label=label)
            k = int(np.nanargmax(size))
            if size[k] > worst:
                worst, centre = float(size[k]), (float(path.east[k]), float(path.north[k]))
        track.set_xlim(centre[0] - 1.6 * AROUND, centre[0] + 1.6 * AROUND)
        track.set_ylim(centre[1] - AROUND, centre[1] + AROUND)
        track.set_aspect("equal", adjustable="datalim")
        track.set_xlabel("East [m]")
        track.set_ylabel("North [m]")
        track.set_title("Where they are furthest apart")
        track.legend(fontsize=7, loc="best")
        shade(error, (), 1.0, named=True, faults=spans)
        error.set_xlim(0.0, recording.duration)
        error.set_ylim(bottom=0.0)
        error.set_xlabel("Time [s]")
        error.set_ylabel("Horizontal error [m]")
        error.set_title("Shaded: the receiver is deceived")
        error.legend(fontsize=7, loc="best")
        save(fig, PICTURE, formats=("png",))


if __name__ == "__main__":
    draw()
