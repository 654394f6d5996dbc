"""The oracle's adaptation: the noise and the faults that a measurement really had."""

from __future__ import annotations

import numpy as np

from estimators.adaptations.base import Adaptation, Innovation
from simnav.recording import AidStream, Recording
from simnav.types import Array, Instruments

__all__ = ["TrueNoise", "imu_faults"]

#: A fault that added more than this many sigma to a component is worth no weight at all.
LIMIT = 3.0


class TrueNoise(Adaptation):
    """Takes the true sigma of each measurement, and leaves out or de-weights what a fault touched.

    A measurement is left out where a fault added more than `LIMIT` true sigmas to a component; otherwise the square of
    what it added is added to its noise. (Oracle O1: knows noise and flags, not the realised white noise.)
    """

    def __init__(self) -> None:
        self._streams: dict[str, tuple[AidStream, Array]] = {}
        self._quiet: set[int] = set()

    def reveal(self, recording: Recording) -> None:
        """Take the labels of a recording."""
        self._streams = {n: (s, np.asarray(s.time)) for n, s in recording.data.aids.items()}
        # A noise step changes the sigma, which is known: it is no fault to be left out.
        self._quiet = {j for j, f in enumerate(recording.faults) if f.kind == "noise_step"}

    def reset(self, instruments: Instruments) -> None:
        """Begin a run."""
        self._sheets = instruments

    def adapt(self, innovation: Innovation) -> Array | None:
        """The true noise, or None."""
        m = innovation.measurement
        stream, times = self._streams[m.instrument]
        k = min(int(np.searchsorted(times, m.time - 1e-9)), len(times) - 1)
        d = len(innovation.residual)
        sigma = stream.sigma[k, :d]
        noise = innovation.noise + np.diag(sigma**2 - self._sheets[m.instrument].sigma[:d] ** 2)
        bits = int(stream.faults[k])
        if bits & ~sum(1 << j for j in self._quiet):
            added = stream.fault_error[k, :d]
            if np.any(np.abs(added) > LIMIT * np.maximum(sigma, 1e-12)):
                return None
            noise = noise + np.diag(added**2)
        return noise


def imu_faults(recording: Recording) -> tuple[Array, Array] | None:
    """Times and (n, 6) fault errors of the IMU samples, or None where no fault touches the IMU."""
    data = recording.data
    if data.imu is None or data.imu_labels is None:
        return None
    return data.imu.time, data.imu_labels.fault_error
