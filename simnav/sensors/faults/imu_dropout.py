"""Fault of the IMU: lost samples (dropouts)."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from simnav.recording import ImuLabels
from simnav.sensors.faults.fault import FaultSpec, register_fault
from simnav.sensors.faults.imu_faults import ImuFaultSpec, ReplacedSamples
from simnav.sensors.faults.layer import FaultLayer
from simnav.types import Array, ImuSamples

__all__ = ["HeldSamples", "ImuDropout"]


@register_fault
class ImuDropout(ImuFaultSpec):
    """Samples of the IMU are lost. In their place it repeats the last one before, reads zero, or gives none.

    With ``mean_active_s`` and ``mean_gap_s`` they are lost in random bursts.

    Attributes
    ----------
    output : str
        What it gives in place of lost samples: ``last``, ``zero``, or ``missing`` for nothing. Missing samples have no
        labels. An estimator sees that they are missing.
    """

    kind: Literal["imu_dropout"] = "imu_dropout"
    output: Literal["last", "zero", "missing"] = "last"

    def build(self, index: int, seed: int, occurrence: int | None = None) -> FaultLayer:
        """See `FaultSpec.build`."""
        layer = {"last": HeldSamples, "zero": _ZeroSamples, "missing": _MissingSamples}[self.output]
        return layer(self, index, seed, self.key_of_streams(index, occurrence))


class HeldSamples(ReplacedSamples):
    """Repeats the last sample before each interval, or the first within it if there is none.

    Parameters
    ----------
    spec, index, seed, key
        See `FaultLayer`.
    columns : sequence of int, optional
        Which of angular rate (0 to 2) and specific force (3 to 5) are repeated; by default all.
    """

    def __init__(self, spec: FaultSpec, index: int, seed: int, key: str, columns: tuple[int, ...] = tuple(range(6))):
        super().__init__(spec, index, seed, key)
        self._columns = list(columns)
        self._before: Array | None = None
        self._held: tuple[int, Array] | None = None

    def replaced(self, samples: ImuSamples, value: Array, rows: NDArray[np.intp], interval: NDArray[np.intp]) -> Array:
        """See `ReplacedSamples.replaced`."""
        changed = value[rows]
        for number in np.unique(interval):
            here = np.flatnonzero(interval == number)
            if self._held is None or self._held[0] != number:
                first = int(rows[here[0]])
                before = value[first - 1] if first > 0 else self._before
                self._held = int(number), (value[first] if before is None else before).copy()
            changed[np.ix_(here, self._columns)] = self._held[1][self._columns]
        return changed

    def seen(self, value: Array) -> None:
        """See `ReplacedSamples.seen`."""
        if len(value):
            self._before = value[-1].copy()


class _ZeroSamples(ReplacedSamples):
    def replaced(self, samples: ImuSamples, value: Array, rows: NDArray[np.intp], interval: NDArray[np.intp]) -> Array:
        return np.zeros((len(rows), 6))


class _MissingSamples(FaultLayer):
    """Takes samples away, after all other faults: these draw for the samples that are then lost, too."""

    last: ClassVar[bool] = True

    def apply_imu(self, samples: ImuSamples, labels: ImuLabels | None) -> tuple[ImuSamples, ImuLabels | None]:
        """See `FaultLayer.apply_imu`."""
        found = self.activity.locate(samples.time)
        if found is None:
            return samples, labels
        kept = np.delete(np.arange(len(samples)), found[0])
        names = ("time", "interval", "angular_rate", "specific_force")
        remaining = ImuSamples(*(getattr(samples, name)[kept] for name in names))
        return remaining, None if labels is None else ImuLabels(labels.faults[kept], labels.fault_error[kept])
