"""Pictures of the guides: a voyage on which a receiver is deceived, the first estimator of the tutorial, and a sweep.

``python docs/pictures.py`` draws them. The command ``simnav run gnss-spoofing -e ekf,gnc-fgo --plot`` shows all of the
first run. The second picture is that of the command in the tutorial, of the file that is printed there. The third
is made from the sweep that comes with the standard result.
"""

from __future__ import annotations

import json
import math
import re
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

import simnav
from simnav.leaderboard.figures.frames import shade
from simnav.leaderboard.figures.run_figure import fault_spans, fixes, relative_track, true_track
from simnav.leaderboard.figures.style import Style, figure, fitted, save, styled
from simnav.leaderboard.figures.sweep_figure import Line, error_against_dial
from simnav.leaderboard.standard.drawn import DRAWN
from simnav.scoring import errors

SCENARIO, ROWS, SEED = "gnss-spoofing", ("ekf", "gnc-fgo"), 0
DOCS = Path(__file__).parent
PICTURE = DOCS / "figures" / "faulty-voyage"
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


def draw_first_estimator() -> None:
    """Run the estimator of the tutorial as the tutorial does, and write the picture."""
    page = (DOCS / "tutorials" / "first-estimator.md").read_text(encoding="utf-8")
    source = re.search(r"^```python\n(.*?)^```", page, re.DOTALL | re.MULTILINE)
    assert source is not None
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "alpha_beta.py"
        file.write_text(source[1], encoding="utf-8")
        report = simnav.run("ship-straight", [str(file), "ship-ekf"])
    (written,) = save(fitted(report.plot(), 220.0), DOCS / "figures" / "first-estimator", formats=("png",))
    Image.open(written).convert("RGB").quantize(128, dither=Image.Dither.NONE).save(written, optimize=True)


def draw_sweep() -> None:
    """The error against the size of a multipath error, from the sweep of the standard result."""
    found = json.loads((DRAWN / "sweeps" / "sweep-gnss-multipath.json").read_text(encoding="utf-8"))
    by: dict[str, list[tuple[float, float, float, float]]] = {}
    for point in found["points"]:
        error = point["error"]
        row = (point["values"][0], *(math.nan if error[k] is None else error[k] for k in ("value", "low", "high")))
        by.setdefault(point["estimator"], []).append(row)
    lines = [Line(label, *np.array(rows).T) for label, rows in by.items()]
    marks = {
        b["estimator"]: b["value"]["value"]
        for b in found["breaking_points"]
        if b["criterion"] == "twice-clean" and b["value"]["value"] is not None
    }
    (dial,), score = found["dials"], found["score"]
    across, up = f"{dial['title']} [{dial['unit']}]", f"{score['title']} [{score['unit']}]"
    fig = error_against_dial(lines, across, up, found["scenario"], found["limit"], marks)
    save(fig, DOCS / "figures" / "sweep", formats=("png",))


if __name__ == "__main__":
    draw()
    draw_first_estimator()
    draw_sweep()
