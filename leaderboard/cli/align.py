"""``simnav log align``: delays, lever arms, offsets and scales of the instruments of a log."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from simnav.leaderboard.arguments import scenario_of
from simnav.leaderboard.figures.log_figures import DelayCurve, delay_panels
from simnav.leaderboard.figures.style import save_as
from simnav.leaderboard.logs import align
from simnav.leaderboard.ranking import tables

from .commands import AlignCommand
from .console import Output
from .options import absolute, require_figure

__all__ = ["show"]


def show(out: Output, request: AlignCommand) -> None:
    """Compare every instrument of a log with the reference."""
    require_figure("--plot", request.plot)
    scenario = scenario_of(request.scenario)
    found = align.of(replace(request, scenario=scenario))
    out.document({"scenario": scenario.id, "instruments": [a.to_dict() for a in found]})
    curves = [DelayCurve(a.instrument, a.curve, a.delay, a.delay_sigma) for a in found if a.curve]
    rows = []
    for a in found:
        late = "" if not np.isfinite(a.delay) else f"{a.delay:.2f} +- {a.delay_sigma:.2g}"
        told = [f"{n} {v:.4g} +- {s:.2g}" for n, (v, s) in a.parameters.items()]
        left = ", ".join(f"{n} {v:.3g}" for n, v in a.residual.items())
        rows.append([a.instrument, a.rows, late, "\n".join(told), left, a.remark])
    columns = ["instrument", "rows", "late by [s]", "beyond the scenario", "left over", "remark"]
    out.print(tables.table(f"{scenario.id} against its reference (SI units, radians)", columns, rows),
              "A delay d is taken out by offset_s = -d of the channel; a lever arm adds to lever_arm_m of the "
              "instrument.",
              "A mounting is relative to the axes of [log.imu]; in degrees it is mounting_deg, if there was none.",
              "The sigmas allow for residuals that change slowly.")  # fmt: skip
    if request.plot is not None and curves:
        title = f"{scenario.id}: rms of what is left, over its smallest value"
        out.print(f"figure: {save_as(delay_panels(curves, title), absolute(request.plot))}")
