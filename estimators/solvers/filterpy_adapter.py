"""Filters of filterpy as estimators: four small methods make a row of a `KalmanFilter` or `UnscentedKalmanFilter`.

The adapter works in metres north, east, down of the initial position, takes the measurements in order and each at its
own time, and reads position, velocity, heading and covariance off the filter's state. It was written against filterpy
2.0.

filterpy's unscented filter draws its sigma points in `predict` only. The adapter therefore calls `predict` before every
update, of zero length between measurements of the same time; let the process noise be zero then.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Collection
from typing import Any, ClassVar

import numpy as np

from simnav.estimator import Estimator, UnsuitableScenario, lacking
from simnav.estimators.models.channels import by_channel, instrument_of
from simnav.geometry.earth import displace, relative_position
from simnav.types import (
    COMPONENTS,
    KINDS,
    Array,
    Datasheet,
    Estimate,
    InitialState,
    Instruments,
    Measurement,
    Measurements,
)

from .admission import Admission

__all__ = ["FilterpyEstimator"]


class FilterpyEstimator(Estimator):
    """Base class of estimators whose filter is filterpy's.

    What it needs is said by ``needs``, as of `simnav.estimator.Estimator.needs`; these instruments it uses.

    Attributes
    ----------
    components : tuple of str
        What the first states of the filter are, by their names in `simnav.types.COMPONENTS`; positions in metres from
        the initial position, ``attitude_down`` the heading. States after these are the filter's own.
    uses : tuple of str
        Kinds of instruments that it uses besides, or measurement equations (`simnav.kinds.EQUATIONS`), which stand for
        all kinds that have them.
    """

    components: ClassVar[tuple[str, ...]] = ()
    uses: ClassVar[tuple[str, ...]] = ()

    @abstractmethod
    def build(self, start: InitialState, instruments: Instruments) -> Any:
        """The filter, with ``x`` (1-D) and ``P`` of the initial state; its position is (0, 0, 0)."""

    @abstractmethod
    def predict(self, kf: Any, dt: float) -> None:
        """Call ``kf.predict`` for dt >= 0 seconds."""

    @abstractmethod
    def correct(self, kf: Any, z: Array, sheet: Datasheet) -> None:
        """Call ``kf.update`` with a measurement; positions come as metres north, east(, down)."""

    def observes(self, instruments: Instruments) -> Collection[str] | None:
        """Those of a kind that ``needs`` or ``uses`` names."""
        return [s.name for s in instruments.values() if self._uses(s)]

    def _uses(self, sheet: Datasheet) -> bool:
        needed = (kind for entry in self.needs for kind in ((entry,) if isinstance(entry, str) else entry))
        return sheet.kind in {*self.uses, *needed} or sheet.equation in self.uses

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run."""
        lack = lacking(self.needs, instruments)
        if lack:
            raise UnsuitableScenario(f"{self.name}: {lack}")
        self.origin = np.array(start.position, dtype=np.float64)
        self.sheets = {s.name: s for s in instruments.values() if self._uses(s)}
        for sheet in self.sheets.values():
            if sheet.channels and KINDS[sheet.kind].side:
                raise UnsuitableScenario(
                    f"{self.name} cannot use the channels of {sheet.name!r}: a filter of filterpy receives no side "
                    "information of a reading"
                )
        instruments = by_channel(instruments)
        self.sheets = {s.name: s for s in instruments.values() if instrument_of(s) in self.sheets}
        self.kf = self.build(start, instruments)
        self._time = start.time
        self._admission = Admission(instruments, self.sheets)

    def update(self, measurements: Measurements) -> Estimate:
        """Run the filter through one step."""
        for m in self._admission.admit(measurements, self._time):
            self._advance(m.time)
            self.correct(self.kf, self._local(m), self.sheets[m.instrument])
        self._advance(measurements.time)
        return self._estimate()

    def _advance(self, time: float) -> None:
        self.predict(self.kf, max(0.0, time - self._time))
        self._time = max(self._time, time)

    def _local(self, m: Measurement) -> Array:
        if not KINDS[m.kind].geodetic:
            return m.value
        if len(m.value) == 3:
            return relative_position(m.value, self.origin)
        return relative_position(np.append(m.value, self.origin[2]), self.origin)[:2]

    def _estimate(self) -> Estimate:
        at = [COMPONENTS.index(c) for c in self.components]
        nine, covariance = np.zeros(9), np.zeros((9, 9))
        nine[at] = np.ravel(self.kf.x)[: len(at)]
        P = self.kf.P[: len(at), : len(at)]
        covariance[np.ix_(at, at)] = 0.5 * (P + P.T)
        estimated = np.zeros(9, dtype=bool)
        estimated[at] = True
        return Estimate(
            self._time,
            displace(self.origin, nine[:3]),
            nine[3:6],
            nine[6:9],
            covariance,
            estimated,
            {"skipped": float(self._admission.skipped)},
        )
