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
    error f that faults other than noise added, and the sigma d of the datasheet. An error that lasts is the same in
    many readings, so that they have the information of one: k is the number of readings for which it lasts, the
    correlation time of the fault or `LASTING`. It is 1 for gross errors.

    Faults that raise the noise are in s. The label has what all faults added together. Where another fault has the
    same reading, f is therefore the mean of the label over these k readings, and the variance which the noise has in
    this mean is subtracted from its square.

    Parameters
    ----------
    recording : Recording
        The run.
    stream : AidStream
        The k readings of one instrument without channels.

    Returns
    -------
    (k,) array
        In (0, 1].
    """
    sheet = recording.instruments[stream.name]
    d, times = stream.fault_error.shape[1], stream.time
    seconds, noisy, other = np.zeros(len(stream)), np.zeros(len(stream), bool), np.zeros(len(stream), bool)
    for j, fault in enumerate(recording.faults):
        hit = (stream.faults >> np.uint32(j) & np.uint32(1)).astype(bool)
        effect = effect_of(fault.kind)
        if effect == "noise":
            noisy |= hit
        else:
            other |= hit
            if effect != "gross":
                seconds[hit] = np.maximum(seconds[hit], float(fault.parameters.get("correlation_time", LASTING)))
    true = (recording.actual or recording.instruments)[stream.name]
    added = np.maximum(stream.sigma[:, :d] ** 2 - np.asarray(true.sigma)[:d] ** 2, 0.0)
    square = stream.fault_error**2
    square[noisy & ~other] = 0.0
    for i in np.flatnonzero(noisy & other):
        near = other & noisy & (np.abs(times - times[i]) <= 0.5 * seconds[i])
        noise = added[near].mean(axis=0) / np.count_nonzero(near)
        square[i] = np.maximum(stream.fault_error[near].mean(axis=0) ** 2 - noise, 0.0)
    variance = stream.sigma[:, :d] ** 2 + np.maximum(seconds * sheet.rate, 1.0)[:, None] * square
    nominal = np.maximum(np.asarray(sheet.sigma)[:d] ** 2, 1e-18)
    worth: Array = np.minimum(1.0, 1.0 / np.maximum(np.mean(variance / nominal, axis=1), 1e-9))
    return worth
