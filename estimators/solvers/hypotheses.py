"""The filters of solution separation: one for each fault hypothesis.

A hypothesis says that an instrument, the initial state or the IMU is wrong. Its filter does not use the instrument, has
a larger initial covariance, or has a larger noise of the IMU. Each filter records how well it agrees with the
instruments that it uses.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from math import radians, sqrt

import numpy as np

from simnav.estimators.adaptations.base import Adaptation, Innovation
from simnav.estimators.algebra.chi_square import chi_square_limits, normal_quantile
from simnav.estimators.algebra.direct_update import normalised_square
from simnav.estimators.algebra.inflation import inflate_motion
from simnav.estimators.models.inertial_errors import ERROR, PART
from simnav.types import Array, Estimate, InitialState, Instruments

from .kalman import KalmanEstimator
from .state_difference import difference

__all__ = ["Exclusion", "Hypothesis", "ImuHypothesis", "WatchedFilter", "disturbed_imu", "uncertain_start"]

#: Factors on the initial sigmas in the filter with a wrong initial state: of position and attitude, and of velocity. If
#: the velocity were as uncertain as the heading, the measurements of a log would make the heading variance too small.
_WRONG_START, _WRONG_VELOCITY = 30.0, 3.0
#: Largest initial sigma of the attitude in this filter; above it the filter is not in its linear range [rad].
_TILT, _HEADING = radians(5.0), radians(45.0)
#: White noise of an IMU that is assumed to be wrong: gyroscopes [rad/s/sqrt(Hz)], accelerometers [m/s^2/sqrt(Hz)].
_DISTURBED_RATE, _DISTURBED_FORCE = radians(0.5), 0.5
#: Factor on the variances of position and velocity if the motion is assumed to be wrong.
_LOOSENED = 100.0
#: A measurement less probable than this is a gross error, unless its instrument goes on so for `_PATIENCE` seconds.
_NOT_GROSS, _PATIENCE = 0.99999, 5.0
#: Probability that two improbable measurements of white noise are not found to have a common direction.
_DIRECTED = 0.9
#: Of a good measurement to agree with the filter.
_AGREES = 0.999


class Exclusion(Adaptation):
    """Rejects excluded instruments and single gross errors; records since when an excluded instrument has agreed.

    Attributes
    ----------
    excluded : set of str
        Names of the instruments that are left out.
    agrees_since : dict of str to float
        Time since which an excluded instrument has agreed with the filter [s].
    gross : set of (str, float)
        Instrument and time of the gross errors of a step.
    usual : dict of str to float
        Long-term mean of the normalised innovation squared of an instrument, by component; it is used if above 1.
    linear : bool
        False while the heading is not known. An improbable measurement is then not taken as a gross error.
    alone : dict of str to float
        The fixes that no other fix or log is heard beside, and the time after which one is news [s], at most
        `_PATIENCE`. Whether they or the prediction are wrong, only their own measurements before can tell: a gross
        error is single. So one is believed where the one before is older, or was improbable in about the same
        direction.
    """

    def __init__(self) -> None:
        self.excluded: set[str] = set()
        self.agrees_since: dict[str, float] = {}
        self.gross: set[tuple[str, float]] = set()
        self.usual: dict[str, float] = {}
        self.linear = True
        self.alone: dict[str, float] = {}
        self._before: dict[str, tuple[float, Array | None]] = {}
        self._failing: dict[str, float] = {}
        self._agrees, self._gross = chi_square_limits(_AGREES), chi_square_limits(_NOT_GROSS)
        self._directed = normal_quantile(_DIRECTED)

    def begin_again(self, excluded: Collection[str] = ()) -> None:
        """Reset the records of the instruments, and set the excluded ones."""
        self.excluded = set(excluded)
        self.agrees_since.clear()
        self.usual.clear()

    def contradicting(self, time: float) -> set[str]:
        """The instruments whose measurements have been improbable for longer than a gross error lasts."""
        return {name for name, since in self._failing.items() if time - since >= _PATIENCE}

    def adapt(self, innovation: Innovation) -> Array | None:
        """The nominal noise, or None."""
        name, time = innovation.measurement.instrument, innovation.measurement.time
        nis = normalised_square(innovation.residual, innovation.predicted, innovation.noise)
        nis /= max(self.usual.get(name, 1.0), 1.0)
        m = len(innovation.residual)
        if name in self.excluded:
            if nis <= self._agrees[m]:
                self.agrees_since.setdefault(name, time)
            else:
                self.agrees_since.pop(name, None)
            return None
        improbable = nis > self._gross[m]
        believed = name in self.alone and self._is_course(innovation, improbable)
        if not improbable or not self.linear:
            self._failing.pop(name, None)
        elif believed:
            self._failing.setdefault(name, time)
        elif time - self._failing.setdefault(name, time) < _PATIENCE:
            self.gross.add((name, time))
            return None
        return innovation.noise

    def _is_course(self, innovation: Innovation, improbable: bool) -> bool:
        """Whether the measurement before does not show that this one is a gross error; record it."""
        name, time = innovation.measurement.instrument, innovation.measurement.time
        sigma = np.sqrt(innovation.predicted.diagonal() + innovation.noise.diagonal())
        standard = innovation.residual / sigma
        before, its = self._before.get(name, (-np.inf, None))
        self._before[name] = time, standard if improbable else None
        if time - before > min(self.alone[name], _PATIENCE):
            return True
        if its is None or not improbable:
            return False
        cosine = float(standard @ its) / float(np.linalg.norm(standard) * np.linalg.norm(its))
        return cosine * sqrt(len(standard)) > self._directed


class WatchedFilter(KalmanEstimator):
    """The filter, with the fading mean of the normalised innovation squared by component of each instrument."""

    mean_nis: dict[str, float]

    def take_over(self, other: WatchedFilter) -> None:
        """Copy the state of another filter."""
        self.model.take_over(other.model)
        self.covariance[...] = other.covariance
        self.mean_nis = dict(other.mean_nis)

    def watch(self, estimate: Estimate, components: Mapping[str, int], fading: float) -> None:
        """Update the means with a step; ``components`` are those of each instrument."""
        for name, m in components.items():
            nis = float(estimate.diagnostics.get(f"nis.{name}", np.nan))
            if nis == nis:
                self.mean_nis[name] = fading * self.mean_nis.get(name, 1.0) + (1.0 - fading) * nis / m

    def inflate_motion(self) -> None:
        """Inflate the covariance of position, velocity and attitude; the attitude within the linear range."""
        first = self.dynamics.first_variances.copy()
        moving = self.model.moving
        attitude = slice(moving.attitude, moving.attitude_end)
        first[attitude] = np.maximum(first[attitude], _TILT**2)
        inflate_motion(self.covariance, _LOOSENED, first, moving)


@dataclass
class Hypothesis:
    """The hypothesis that an instrument or the initial state is wrong.

    Attributes
    ----------
    name : str
        Name of the instrument, the initial state or the IMU.
    filter : WatchedFilter
        The filter under this hypothesis.
    start : float
        Time of the last start of the filter [s].
    estimate : Estimate or None
        Last estimate of the filter.
    origin : Estimate or None
        Estimate at the last start of the filter.
    drift : float
        Variance of the bias of the vertical gyroscope at the last start [(rad/s)^2].
    """

    name: str
    filter: WatchedFilter
    start: float
    estimate: Estimate | None = None
    origin: Estimate | None = None
    drift: float = 0.0

    def begin(self, other: WatchedFilter, estimate: Estimate, start: float) -> None:
        """Restart from the state and the estimate of another filter."""
        self.filter.take_over(other)
        self.estimate = self.origin = estimate
        self.start = start
        variances, vertical_gyroscope = other.covariance.diagonal(), ERROR.gyroscope_bias + 2
        self.drift = float(variances[vertical_gyroscope]) if len(variances) > vertical_gyroscope else 0.0

    def turn(self, noise: float) -> None:
        """Increase the variance of the heading to at least that of the gyroscopes alone.

        Without fixes and compass the heading is not observable: the track since the start of the filter can be rotated
        about its first point. A Kalman filter that linearises along its own estimate still gains false information on
        the heading from noise (G. P. Huang, A. I. Mourikis and S. I. Roumeliotis, *Observability-based rules for
        designing consistent EKF SLAM estimators*, Int. J. of Robotics Research 29(5), 2010). So the variance of the
        heading is at least that of dead reckoning since then, ::

            P_psi(0) + P_bias(0) t^2 + N^2 t,

        with the initial variances of the heading, P_psi(0), and of the gyroscope's bias, P_bias(0), the time t since
        the start, and the angle random walk N. The missing variance is added along the rotation of the track, so also
        to position and velocity.

        Parameters
        ----------
        noise : float
            Square of the angle random walk of the vertical gyroscope, N^2 [rad^2/s].
        """
        one, origin = self.estimate, self.origin
        assert one is not None
        assert origin is not None
        assert one.covariance is not None
        assert origin.covariance is not None
        age = one.time - origin.time
        variance, known = origin.covariance.diagonal()[ERROR.heading], one.covariance.diagonal()[ERROR.heading]
        missing = variance + self.drift * age**2 + noise * age - known
        if missing > 0.0:
            since = difference(one, origin)
            assert one.velocity is not None
            turn = np.array([-since[1], since[0], 0.0, -one.velocity[1], one.velocity[0], 0.0, 0.0, 0.0, 1.0])
            one.covariance = one.covariance + missing * np.outer(turn, turn)


@dataclass
class ImuHypothesis(Hypothesis):
    """The hypothesis that the IMU is wrong (or right, after its exclusion); ``exclusion`` holds wrong instruments."""

    exclusion: Exclusion = field(default_factory=Exclusion)


def uncertain_start(start: InitialState, attitude: bool = True) -> InitialState:
    """The same start with larger sigmas; of the position alone, if not of the ``attitude``, too."""
    stated = np.sqrt(np.diag(start.covariance))
    larger = stated * np.repeat((_WRONG_START, _WRONG_VELOCITY, _WRONG_START), 3)
    larger[PART.attitude] = np.minimum(
        larger[PART.attitude], np.maximum((_TILT, _TILT, _HEADING), stated[PART.attitude])
    )
    if not attitude:
        for part in (PART.velocity, PART.attitude):
            larger[part] = stated[part]
    factor = np.divide(larger, stated, out=np.ones(9), where=stated > 0.0)
    return replace(start, covariance=start.covariance * np.outer(factor, factor))


def disturbed_imu(instruments: Instruments) -> Instruments:
    """The same instruments with an IMU whose white noise covers a disturbance; its biases are not changed."""
    imu = instruments.imu
    if imu is None:
        return instruments
    rate, force = imu.gyroscope, imu.accelerometer
    noisy = replace(
        imu,
        gyroscope=replace(rate, random_walk=max(rate.random_walk, _DISTURBED_RATE)),
        accelerometer=replace(force, random_walk=max(force.random_walk, _DISTURBED_FORCE)),
    )
    return Instruments(list(instruments.values()), noisy, instruments.step)
