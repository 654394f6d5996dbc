"""Pictures of the documentation: runs, the first estimator of the tutorial, and a sweep.

``python docs/pictures.py`` draws them. The command ``simnav run gnss-spoofing -e ekf,gnc-fgo --plot`` shows all of the
run on which a receiver is deceived. The estimator of the tutorial, and the scenario of the guide, are those that are
printed there. The sweep is that of the standard result. Other pictures are a part of what ``simnav run`` draws.
"""

from __future__ import annotations

import json
import math
import re
import tempfile
import textwrap
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from PIL import Image

import simnav
from simnav.leaderboard.figures.frames import shade
from simnav.leaderboard.figures.run_figure import fault_spans, fixes, relative_track, true_track
from simnav.leaderboard.figures.stanford import stanford_diagrams
from simnav.leaderboard.figures.style import Style, figure, fitted, save, styled
from simnav.leaderboard.figures.sweep_figure import Line, error_against_dial
from simnav.leaderboard.standard.drawn import DRAWN
from simnav.scoring import errors

SCENARIO, ROWS, SEED = "gnss-spoofing", ("ekf", "gnc-fgo"), 0
DOCS = Path(__file__).parent
PICTURE = DOCS / "figures" / "faulty-voyage"
AROUND = 40.0  # metres around the largest error that the map shows
#: Pictures that are a part of what ``simnav run SCENARIO -e ROWS --plot`` draws: from where to where, as shares of the
#: height from above.
PARTS = {
    "satellites": ("satellites-harbour", ("ekf", "ekf-loose"), (0.685, 1.0)),
    "acoustic-positioning": ("usbl-inspection", ("ekf", "gnc-fgo"), (0.0, 0.44)),
    "hypotheses": ("gnss-spoofing", ("ekf", "mh-ekf"), (0.0, 0.565)),
    "oracle": ("gnss-multipath", ("ekf", "iae", "oracle"), (0.0, 0.48)),
}


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


def printed(page: str, language: str, name: str, folder: str) -> Path:
    """The first file of a page, written into a folder."""
    text = (DOCS / page).read_text(encoding="utf-8")
    source = re.search(rf"^```{language}\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    assert source is not None
    file = Path(folder) / name
    file.write_text(source[1], encoding="utf-8")
    return file


def write(fig: Figure, name: str, part: tuple[float, float] = (0.0, 1.0)) -> None:
    """Write a figure as wide as a page, or a part of its height, with few colours."""
    (written,) = save(fitted(fig, 220.0), DOCS / "figures" / name, formats=("png",))
    image = Image.open(written).convert("RGB")
    image = image.crop((0, int(part[0] * image.height), image.width, int(part[1] * image.height)))
    image.quantize(128, dither=Image.Dither.NONE).save(written, optimize=True)


def draw_parts() -> None:
    """Runs of guides, Stanford diagrams, and the scenario that a guide prints."""
    for name, (scenario, rows, part) in PARTS.items():
        write(simnav.run(scenario, list(rows)).plot(), name, part)
    found = simnav.run("harbour-multipath", ["ekf", "gnc-fgo", "solution-separation"])
    write(stanford_diagrams(found.stanford(), title="harbour-multipath-v1"), "integrity")
    with tempfile.TemporaryDirectory() as folder:
        file = printed("how-to/write-a-scenario.md", "toml", "channel.toml", folder)
        write(simnav.run(str(file), ["ship-ekf", "gnss-only"]).plot(), "channel", (0.0, 0.53))


def draw_first_estimator() -> None:
    """Run the estimator of the tutorial as the tutorial does, and write the picture."""
    with tempfile.TemporaryDirectory() as folder:
        file = printed("tutorials/first-estimator.md", "python", "alpha_beta.py", folder)
        write(simnav.run("ship-straight", [str(file), "ship-ekf"]).plot(), "first-estimator")


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


def draw_learning() -> None:
    """What the recipes of learned rows wrote: losses against steps, and the error of the row against voyages."""
    for file in sorted((DOCS / "figures").glob("learning-*.json")):
        found = json.loads(file.read_text(encoding="utf-8"))
        style, rng = Style((found["row"], *found["others"])), np.random.default_rng(0)
        whole = found["curves"][0]["voyages"]
        with styled():
            fig = figure(9.0, 3.1)
            losses, errors_ = fig.subplots(1, 2)
            for curve in (c for c in found["curves"] if c["voyages"] == whole):
                steps = curve["steps_per_epoch"] * np.arange(1, len(curve["validation"]) + 1)
                first = curve is found["curves"][0]
                for name, line in (("training", "--"), ("validation", "-")):
                    colour = "0.6" if name == "training" else style.colour(found["row"])
                    losses.plot(steps, curve[name], line, color=colour, lw=1.4, label=name if first else None)
            losses.set_xlabel("Steps of the optimizer")
            losses.set_ylabel(textwrap.fill(found["loss"].capitalize(), 36), fontsize=7)
            losses.set_title(f"{found['row']}, {whole} voyages")
            losses.legend(fontsize=7)
            for curve, ratios in zip(found["curves"], found["rows"], strict=True):
                mean, low, high = _geometric_mean(ratios, rng)
                bars = [[mean - low], [high - mean]]
                errors_.errorbar(curve["voyages"], mean, bars, fmt="o", ms=4, color=style.colour(found["row"]))
            for name, ratios in found["others"].items():
                mean, *_ = _geometric_mean(ratios, rng)
                errors_.axhline(mean, color=style.colour(name), lw=1.4, label=name)
            errors_.axhline(1.0, color="0.15", lw=1.0, label="ekf")
            sizes = sorted({curve["voyages"] for curve in found["curves"]})
            errors_.set_xscale("log")
            errors_.set_xlim(0.7 * sizes[0], 1.4 * sizes[-1])
            errors_.set_xticks(sizes, [str(size) for size in sizes])
            errors_.minorticks_off()
            errors_.set_xlabel("Voyages of the training")
            errors_.set_ylabel("Error over that of ekf")
            errors_.set_title(f"{len(found['rows'][0])} validation voyages, 95 % intervals")
            errors_.legend(
                fontsize=7, loc="upper left", frameon=True, facecolor="white", framealpha=0.9, edgecolor="none"
            )
            save(fig, file.with_suffix(""), formats=("png",))


def _geometric_mean(ratios: list[float | None], rng: np.random.Generator) -> tuple[float, float, float]:
    """The geometric mean of ratios, with a bootstrap interval of 95 % over voyages."""
    logs = np.log([r for r in ratios if r is not None])
    means = rng.choice(logs, (2000, len(logs))).mean(axis=1)
    return float(np.exp(logs.mean())), *(float(x) for x in np.exp(np.quantile(means, [0.025, 0.975])))


if __name__ == "__main__":
    draw()
    draw_first_estimator()
    draw_parts()
    draw_sweep()
    draw_learning()
