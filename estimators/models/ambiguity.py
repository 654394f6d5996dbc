"""Readings of which a constant is not known: the clock of a receiver that is stepped.

Many receivers let their clock run freely, and step it by a millisecond when its error exceeds half of one. Then all
pseudoranges step by 300 km from one epoch to the next. The state of the clock need not follow: a pseudorange is known
but for a multiple of the step, so the innovation is brought into half a step, as that of a heading is into half a turn.
The state goes on as the error of a clock that was never stepped. This holds while the innovation is below half a step,
150 km.

A datasheet says so by the detail ``clock_step`` (`simnav.sensors.gnss_raw`). It concerns the first component.
"""

from __future__ import annotations

import numpy as np

from simnav.kinds import Kind
from simnav.satellites.orbit import SPEED_OF_LIGHT
from simnav.types import Array, Datasheet

__all__ = ["innovation_of"]


def innovation_of(kind: Kind, sheet: Datasheet, value: Array, reading: Array) -> Array:
    """Measured minus predicted, without the steps of the instrument's clock.

    Parameters
    ----------
    kind : Kind
        Kind of the instrument.
    sheet : Datasheet
        Its datasheet.
    value, reading : (..., d) array
        What was measured, and what is predicted.
    """
    innovation = kind.difference(value, reading)
    step = SPEED_OF_LIGHT * sheet.details.get("clock_step", 0.0)
    if step:
        innovation[..., 0] -= step * np.round(innovation[..., 0] / step)
    return innovation
