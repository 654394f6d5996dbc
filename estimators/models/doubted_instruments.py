"""Models whose instruments can be doubted and believed again in mid-run.

PROTOTYPE
"""

from __future__ import annotations

from dataclasses import replace
from math import radians
from typing import NamedTuple

import numpy as np

from simnav.types import KINDS, Array, InitialState, Instruments
from simnav.structures import filled

from .base import ErrorModel
from .equations import equation_of
from .inertial import InertialModel
from .propagation import IMU_NOISE
from .ship import ShipModel
from .suitable import Suitable

__all__ = ["Doubt", "DoubtedInstruments", "DoubtingModel"]

_PLACE = 1e-4
_INERTIAL = 15


class Doubt(NamedTuple):
    group: str
    sigma: float
    time: float
    jump: float
    gyro: float = 0.0
    accel: float = 0.0


def group_of(sheet) -> str:
    if sheet.role == "fix":
        return "fix"
    equation = equation_of(sheet)
    return "log" if equation.is_log else "compass" if equation.is_heading else ""


def with_places(instruments: Instruments) -> Instruments:
    sheets = []
    for sheet in instruments.values():
        if group_of(sheet) and not (sheet.processes or np.any(sheet.bias_instability) or np.any(sheet.bias)):
            sheet = replace(sheet, bias=_PLACE * sheet.sigma)
        sheets.append(sheet)
    return Instruments(sheets, instruments.imu, instruments.step)


class DoubtingModel(ErrorModel):
    def _find(self, covariance: Array, first: int) -> None:
        places = self.bias_at
        self.first = first
        self.groups: dict[str, Array] = {}
        for name, sheet in self.instruments.items():
            g = group_of(sheet)
            if g and name in places and self.observes(sheet):
                self.groups.setdefault(g, []).extend(places[name] + k for k in range(self.components(sheet)))
        decay, density = self._rates()
        self.groups = {g: np.array(at, dtype=np.intp) for g, at in self.groups.items()}
        self.known = {
            g: (covariance.diagonal()[at].copy(), decay[at - first].copy(), density[at - first].copy())
            for g, at in self.groups.items()
        }

    @property
    def doubtful(self) -> set[str]:
        return set(self.groups) | ({"imu"} if isinstance(self, _Inertial) else set())

    def doubt(self, covariance: Array, doubt: Doubt) -> None:
        if doubt.group == "imu":
            self._doubt_imu(covariance, doubt)
            return
        at = self.groups[doubt.group]
        decay, density = self._rates()
        decay[at - self.first], density[at - self.first] = 1.0 / doubt.time, 2.0 * doubt.sigma**2 / doubt.time
        covariance[at, at] += doubt.jump**2

    def believe(self, covariance: Array, group: str) -> None:
        if group == "imu":
            self._noise[...] = self._stated
            return
        at, (variance, d, q) = self.groups[group], self.known[group]
        decay, density = self._rates()
        decay[at - self.first], density[at - self.first] = d, q
        self._values()[at - self.first] = 0.0
        covariance[at] = 0.0
        covariance[:, at] = 0.0
        covariance[at, at] = variance

    def take_over_doubts(self, other) -> None:
        for mine, theirs in zip(self._rates(), other._rates(), strict=True):
            mine[...] = theirs
        if isinstance(self, _Inertial):
            self._noise[...] = other._noise


class _Inertial(DoubtingModel, InertialModel):
    def begin(self, start: InitialState, instruments: Instruments) -> Array:
        covariance = super().begin(start, with_places(instruments))
        self._decay, self._density = self._decay.copy(), self._density.copy()
        self._stated = self._noise.copy()
        self._find(covariance, _INERTIAL)
        return covariance

    def _doubt_imu(self, covariance, doubt):
        own = self._noise.view(IMU_NOISE)[0]
        own["gyroscope"] = max(own["gyroscope"], doubt.gyro**2)
        own["accelerometer"] = max(own["accelerometer"], doubt.accel**2)
        own["gyroscope_walk"] = max(own["gyroscope_walk"], (doubt.gyro * doubt.sigma)**2)
        own["accelerometer_walk"] = max(own["accelerometer_walk"], (doubt.accel * doubt.sigma)**2)
        covariance[range(9, 12), range(9, 12)] += (doubt.gyro * doubt.jump) ** 2
        covariance[range(12, 15), range(12, 15)] += (doubt.accel * doubt.jump) ** 2

    def _rates(self):
        return self._decay, self._density

    def _values(self):
        return self.calibration


class _Ship(DoubtingModel, ShipModel):
    def begin(self, start: InitialState, instruments: Instruments) -> Array:
        covariance = super().begin(start, with_places(instruments))
        self._find(covariance, 0)
        return covariance

    def _rates(self):
        return self.decay, self.density

    def _values(self):
        return self.x


class DoubtedInstruments(Suitable):
    def choose(self, instruments: Instruments, name: str) -> ErrorModel:
        model = _Ship() if instruments.imu is None else _Inertial()
        return model.choose(instruments, name)
