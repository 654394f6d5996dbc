"""Models whose instruments can be doubted, and believed again, in mid-run.

A fix that is reflected, drawn aside or off by a constant has an error that lasts, and so has a log that reports zero or
a compass whose ring is out of step. Taken for white noise it pulls the estimate along. As a state it is made observable
by the other instruments and by what was known before. Here every fix, log and compass has bias states, also where its
datasheet has none. While the instruments of a group are believed, their biases are those of the datasheets; while they
are doubted, those of a `BiasDoubt`. The states have the same places, so that the same compiled functions work on both,
and a filter changes its hypothesis without being begun anew. Likewise the noise and the biases of the IMU (`ImuDoubt`).

Source: B. Friedland, *Treatment of bias in recursive filtering*, IEEE TAC 14(4), 1969; A. S. Willsky and H. L. Jones,
*A generalized likelihood ratio approach to the detection and estimation of jumps in linear systems*, IEEE TAC 21(1),
1976.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from simnav.types import Array, Datasheet, InitialState, Instruments, Integers

from .base import ErrorModel
from .equations import equation_of
from .inertial import InertialModel
from .inertial_errors import ERROR
from .propagation import IMU_NOISE
from .ship import ShipModel
from .suitable import Suitable

__all__ = ["IMU", "AttitudeDoubt", "BiasDoubt", "DoubtedInstruments", "DoubtingModel", "ImuDoubt", "group_of"]

#: Group of the IMU.
IMU = "imu"
#: Sigma of a bias over that of the noise, where a datasheet has no bias: it only keeps a place for the state.
_PLACE = 1e-4
#: Places of the biases of the IMU in the error of the inertial model.
_GYROSCOPE = np.arange(ERROR.gyroscope_bias, ERROR.accelerometer_bias)
_ACCELEROMETER = np.arange(ERROR.accelerometer_bias, ERROR.calibration)


@dataclass(frozen=True)
class BiasDoubt:
    """The error that the instruments of a group are suspected of, in each component: a Gauss-Markov process.

    Attributes
    ----------
    group : str
        "fix", "log" or "compass".
    sigma : float
        Stationary standard deviation [m, m/s or rad].
    time : float
        Correlation time [s].
    jump : float
        Standard deviation of what is added at the onset, in the same unit.
    """

    group: str
    sigma: float
    time: float
    jump: float = 0.0

    def begin(self, model: DoubtingModel, covariance: Array, *, heading_seen: bool = True) -> None:
        """Doubt the instruments of the group; the (n, n) covariance is updated."""
        own = model.places[self.group]
        decay, density = model.rates()
        decay[own.rates], density[own.rates] = 1.0 / self.time, 2.0 * self.sigma**2 / self.time
        covariance[own.states, own.states] += self.jump**2


@dataclass(frozen=True)
class ImuDoubt:
    """The error that the IMU is suspected of: biases that jump, and noise.

    Where nothing sees the heading, the vertical gyroscope is not doubted, nor the noise of the gyroscopes.

    Attributes
    ----------
    rate_jump, force_jump : float
        Standard deviation of the jump of each bias at the onset [rad/s], [m/s^2].
    rate, force : float
        Density of the white noise of gyroscopes [rad/s/sqrt(Hz)] and accelerometers [m/s^2/sqrt(Hz)], at least.
    walk : float
        Density of the random walk of the biases over that of the white noise [1/s], at least.
    """

    rate_jump: float
    force_jump: float
    rate: float = 0.0
    force: float = 0.0
    walk: float = 0.2
    group: str = IMU

    def begin(self, model: DoubtingModel, covariance: Array, *, heading_seen: bool = True) -> None:
        """Doubt the IMU; the (n, n) covariance is updated."""
        own = model.imu_noise.view(IMU_NOISE)[0]
        rate, gyroscopes = (self.rate, _GYROSCOPE) if heading_seen else (0.0, _GYROSCOPE[:2])
        for triad, jump, density, at in (
            ("gyroscope", self.rate_jump, rate, gyroscopes),
            ("accelerometer", self.force_jump, self.force, _ACCELEROMETER),
        ):
            own[triad] = max(own[triad], density**2)
            own[f"{triad}_walk"] = max(own[f"{triad}_walk"], (self.walk * density) ** 2)
            covariance[at, at] += jump**2


@dataclass(frozen=True)
class AttitudeDoubt:
    """The attitude is suspected to be wrong, by a disturbance that is over or from the start.

    Attributes
    ----------
    level, heading : float
        Standard deviations that are added [rad]; that of the heading only where something sees it.
    """

    level: float
    heading: float
    group: str = ""

    def begin(self, model: DoubtingModel, covariance: Array, *, heading_seen: bool = True) -> None:
        """Doubt the attitude; the (n, n) covariance is updated."""
        at = np.arange(model.moving.attitude, model.moving.attitude_end)
        heading = self.heading if heading_seen else 0.0
        covariance[at, at] += np.square((self.level, self.level, heading))[: len(at)]


@dataclass(frozen=True)
class _Places:
    """The biases of a group: places among the states and the rates, and what the datasheets say of them."""

    states: Integers
    rates: Integers
    variance: Array
    decay: Array
    density: Array


def group_of(sheet: Datasheet) -> str:
    """Group of an instrument: "fix", "log", "compass", or empty for one that is not doubted."""
    if sheet.role == "fix":
        return "fix"
    equation = equation_of(sheet)
    return "log" if equation.is_log else "compass" if equation.is_heading else ""


class DoubtingModel(ErrorModel):
    """What the models of this module have in common.

    Attributes
    ----------
    places : dict of str to _Places
        The biases of each group that can be doubted.
    groups : dict of str to tuple of str
        The instruments of each group that can be doubted.
    """

    instruments: Instruments
    bias_at: dict[str, int]
    imu_noise: Array

    def rates(self) -> tuple[Array, Array]:
        """Inverse correlation times [1/s] and noise densities of the biases."""
        raise NotImplementedError

    def biases(self) -> Array:
        """The array that holds the values of the biases, with the places of their rates."""
        raise NotImplementedError

    def find_biases(self, covariance: Array, first: int) -> None:
        """Find the biases in a model that has begun; those of the error's index ``first`` have the first rates."""
        self.places: dict[str, _Places] = {}
        self.groups: dict[str, tuple[str, ...]] = {}
        for sheet in self.instruments.values():
            if (group := group_of(sheet)) and sheet.name in self.bias_at and self.observes(sheet):
                self.groups[group] = (*self.groups.get(group, ()), sheet.name)
        decay, density = self.rates()
        for group, names in self.groups.items():
            at = [self.bias_at[n] + k for n in names for k in range(self.components(self.instruments[n]))]
            states: Integers = np.array(at, dtype=np.int64)
            own = states - first
            self.places[group] = _Places(
                states, own, covariance.diagonal()[states].copy(), decay[own].copy(), density[own].copy()
            )

    def believe(self, covariance: Array, group: str) -> None:
        """Give the instruments of a group the errors of their datasheets again; updates the (n, n) covariance.

        Nothing is then known of the biases of fixes, logs and compasses. Those of the IMU stay as they were estimated.
        """
        if group == IMU:
            self.imu_noise[...] = self.stated_noise
            return
        own, (decay, density) = self.places[group], self.rates()
        decay[own.rates], density[own.rates] = own.decay, own.density
        self.biases()[own.rates] = 0.0
        covariance[own.states] = 0.0
        covariance[:, own.states] = 0.0
        covariance[own.states, own.states] = own.variance

    def take_over_doubts(self, other: DoubtingModel) -> None:
        """Copy of another model which instruments are doubted."""
        for mine, theirs in zip((*self.rates(), self.imu_noise), (*other.rates(), other.imu_noise), strict=True):
            mine[...] = theirs

    stated_noise: Array


def _with_biases(instruments: Instruments) -> Instruments:
    """The datasheets, with a bias for every instrument that can be doubted."""

    def change(sheet: Datasheet) -> Datasheet:
        stated = sheet.processes or np.any(sheet.bias_instability) or np.any(sheet.bias)
        return sheet if stated or not group_of(sheet) else replace(sheet, bias=_PLACE * sheet.sigma)

    return instruments.changed(change)


class _Inertial(DoubtingModel, InertialModel):
    """The inertial model."""

    constant = (*InertialModel.constant, "places", "groups", "stated_noise")

    def begin(self, start: InitialState, instruments: Instruments) -> Array:
        """Set the state; UnsuitableScenario without an IMU."""
        covariance = super().begin(start, _with_biases(instruments))
        self._decay, self._density = self._decay.copy(), self._density.copy()  # not those of the blocks
        self.imu_noise, self.stated_noise = self._noise, self._noise.copy()
        self.find_biases(covariance, ERROR.calibration)
        self.groups[IMU] = (IMU,) if instruments.imu is None else (instruments.imu.name,)
        return covariance

    def rates(self) -> tuple[Array, Array]:
        """As `DoubtingModel.rates`."""
        return self._decay, self._density

    def biases(self) -> Array:
        """As `DoubtingModel.biases`."""
        return self.calibration


class _Ship(DoubtingModel, ShipModel):
    """The ship model."""

    def begin(self, start: InitialState, instruments: Instruments) -> Array:
        """Set the state; UnsuitableScenario without a position and a speed."""
        covariance = super().begin(start, _with_biases(instruments))
        self.imu_noise = self.stated_noise = np.empty(0)
        self.find_biases(covariance, 0)
        return covariance

    def rates(self) -> tuple[Array, Array]:
        """As `DoubtingModel.rates`."""
        return self.decay, self.density

    def biases(self) -> Array:
        """As `DoubtingModel.biases`."""
        values: Array = self.x
        return values


class DoubtedInstruments(Suitable):
    """The inertial model where there is an IMU, else the ship model, with instruments that can be doubted."""

    def choose(self, instruments: Instruments, name: str) -> ErrorModel:
        """A new model; UnsuitableScenario where neither will do."""
        model = _Ship() if instruments.imu is None else _Inertial()
        return model.choose(instruments, name)
