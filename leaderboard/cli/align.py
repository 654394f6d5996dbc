"""``simnav align``: delays, lever arms, offsets and scales of the instruments of a log."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from simnav.leaderboard.given import scenario_of
from simnav.leaderboard.log_requests import AlignRequest
from simnav.leaderboard.logs import align
from simnav.leaderboard.ranking import tables

from .console import Output

__all__ = ["show"]


def show(out: Output, request: AlignRequest) -> None:
    """Compare every instrument of a log with the reference."""
    scenario = scenario_of(request.scenario)
    found = align.of(replace(request, scenario=scenario))
    out.document({"scenario": scenario.id, "instruments": [a.to_dict() for a in found]})
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
              "Residuals are correlated, so that the sigmas are rather too small.")  # fmt: skip
