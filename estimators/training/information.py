"""What a reading is worth, from its labels: the target of the recipes that learn weights of readings."""

from __future__ import annotations

import numpy as np

from simnav.recording import AidStream, Recording
from simnav.sensors.faults import effect_of
from simnav.types import Array

__all__ = ["LASTING", "information"]

#: Time for which the error of a lasting fault is the same, if the fault has no correlation time [s].
LASTING = 30.0


def information(recording: Recording, stream: AidStream) -> Array:
    """The information of each reading as a part of what the datasheet says, at most 1.

    It is ``1 / mean_i((s_i^2 + k f_i^2) / d_i^2)`` over the components i, with the sigma s of the true noise, the
    error f that the faults added, and the sigma d of the datasheet. An error that lasts is the same in many readings,
    so that they have the information of one: k is the number of readings for which it lasts, the correlation time of
    the fault or `LASTING`. It is 1 for gross errors. A noise step is in s and, by what it added, in f as well, so that
    it counts about twice.

    Parameters
    ----------
    recording : Recording
        The run.
    stream : AidStream
        The k readings of one instrument.

    Returns
    -------
    (k,) array
        In (0, 1].
    """
    sheet = recording.instruments[stream.name]
    d = stream.fault_error.shape[1]
    lasts = np.ones(len(stream))
    for j, fault in enumerate(recording.faults):
        if effect_of(fault.kind) not in ("noise", "gross"):
            hit = (stream.faults >> np.uint32(j) & np.uint32(1)).astype(bool)
            seconds = float(fault.parameters.get("correlation_time", LASTING))
            lasts[hit] = np.maximum(lasts[hit], seconds * sheet.rate)
    variance = stream.sigma[:, :d] ** 2 + lasts[:, None] * stream.fault_error**2
    nominal = np.maximum(np.asarray(sheet.sigma)[:d] ** 2, 1e-18)
    worth: Array = np.minimum(1.0, 1.0 / np.maximum(np.mean(variance / nominal, axis=1), 1e-9))
    return worth
