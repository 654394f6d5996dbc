"""The filters of solution separation: one for each hypothesis of what is wrong.

A hypothesis is that an instrument, the start or the IMU is wrong. Its filter does without the instrument, believes the
start less, or believes the IMU less. Each filter keeps how well it agrees with the instruments that it uses.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from math import radians

import numpy as np

from simnav.estimators.adaptations.base import Adaptation, Innovation
from simnav.estimators.adaptations.noise import normalised_square
from simnav.estimators.algebra.chi_square import chi_square_limits
from simnav.estimators.solvers.kalman import KalmanEstimator
from simnav.estimators.solvers.state_difference import difference
from simnav.types import Array, Estimate, InitialState, Instruments

__all__ = ["Exclusion", "Hypothesis", "ImuHypothesis", "WatchedFilter", "disturbed_imu", "uncertain_start"]

#: By these factors the sigmas of the start are larger in the filter that does not believe it: position and attitude,
#: velocity. With a velocity that is as uncertain as the heading, the measurements of a log make a filter surer of its
#: heading than it is.
_WRONG_START, _WRONG_VELOCITY = 30.0, 3.0
#: Its attitude is known at least so well, for otherwise a filter is not linear [rad].
_TILT, _HEADING = radians(5.0), radians(45.0)
#: White noise of an IMU that is not believed, of gyroscopes [rad/s/sqrt(Hz)] and accelerometers [m/s^2/sqrt(Hz)].
_DISTURBED_RATE, _DISTURBED_FORCE = radians(0.5), 0.5
#: Factor by which the variances of position and velocity grow where the motion is not believed.
_LOOSENED = 100.0
#: Index of the bias of the vertical gyroscope in the state of an inertial model.
_VERTICAL_GYROSCOPE = 11
#: A measurement less probable than this is a gross error, unless its instrument goes on so for `_PATIENCE` seconds.
_NOT_GROSS, _PATIENCE = 0.99999, 5.0
#: Of a good measurement to agree with the filter.
_AGREES = 0.999


class Exclusion(Adaptation):
    """Leaves the excluded instruments and single gross errors out; notes since when an excluded one has agreed.

    Attributes
    ----------
    excluded : set of str
        Names of the instruments that are left out.
    agrees_since : dict of str to float
        Time since which an excluded instrument has agreed with the filter [s].
    gross : set of (str, float)
        Instrument and time of the gross errors of a step.
    usual : dict of str to float
        What the normalised innovation squared of an instrument is usually, by component; it counts where it is above 1.
    linear : bool
        False while the heading is not known: an improbable measurement is no gross error then.
    """

    def __init__(self) -> None:
        self.excluded: set[str] = set()
        self.agrees_since: dict[str, float] = {}
        self.gross: set[tuple[str, float]] = set()
        self.usual: dict[str, float] = {}
        self.linear = True
        self._failing: dict[str, float] = {}
        self._agrees, self._gross = chi_square_limits(_AGREES), chi_square_limits(_NOT_GROSS)

    def begin_again(self, excluded: Collection[str] = ()) -> None:
        """Forget what was learned of the instruments, and leave other ones out."""
        self.excluded = set(excluded)
        self.agrees_since.clear()
        self.usual.clear()

    def contradicting(self, time: float) -> set[str]:
        """The instruments whose measurements have been improbable for so long that they are no gross errors."""
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
        if nis <= self._gross[m] or not self.linear:
            self._failing.pop(name, None)
        elif time - self._failing.setdefault(name, time) < _PATIENCE:
            self.gross.add((name, time))
            return None
        return innovation.noise


class WatchedFilter(KalmanEstimator):
    """The filter, with the fading mean of the normalised innovation squared by component of each instrument."""

    mean_nis: dict[str, float]

    def take_over(self, other: WatchedFilter) -> None:
        """Go on from the state of another one."""
        self.model.take_over(other.model)
        self.covariance[...] = other.covariance
        self.mean_nis = dict(other.mean_nis)

    def watch(self, estimate: Estimate, components: Mapping[str, int], fading: float) -> None:
        """Take a step into the means; components by instrument."""
        for name, m in components.items():
            nis = float(estimate.diagnostics.get(f"nis.{name}", np.nan))
            if nis == nis:
                self.mean_nis[name] = fading * self.mean_nis.get(name, 1.0) + (1.0 - fading) * nis / m

    def doubt_motion(self) -> None:
        """Believe position, velocity and attitude less; the attitude within the limits of a linear filter."""
        first = self._first_variances.copy()
        attitude = self.model.moving[1]
        first[attitude] = np.maximum(first[attitude], _TILT**2)
        self.model.loosen(self.covariance, _LOOSENED, first)


@dataclass
class Hypothesis:
    """That an instrument or the start is wrong.

    Attributes
    ----------
    name : str
        Of the instrument, the start or the IMU.
    filter : WatchedFilter
        The filter without it.
    start : float
        When it began, from which its age counts [s].
    estimate : Estimate or None
        Its estimate.
    origin : Estimate or None
        The estimate with which it began.
    drift : float
        Variance of the bias of the vertical gyroscope with which it began [(rad/s)^2].
    """

    name: str
    filter: WatchedFilter
    start: float
    estimate: Estimate | None = None
    origin: Estimate | None = None
    drift: float = 0.0

    def begin(self, other: WatchedFilter, estimate: Estimate, start: float) -> None:
        """Begin anew from the state of another filter, with its estimate."""
        self.filter.take_over(other)
        self.estimate = self.origin = estimate
        self.start = start
        variances = other.covariance.diagonal()
        self.drift = float(variances[_VERTICAL_GYROSCOPE]) if len(variances) > _VERTICAL_GYROSCOPE else 0.0

    def turn(self, noise: float) -> None:
        """State the heading no better than gyroscopes alone know it, because nothing else measures it.

        Without fixes and compass, measurements say nothing of the heading: the track since the filter began can be
        turned about its first point. A Kalman filter that linearises along its own estimate still takes some noise for
        information on it (G. P. Huang, A. I. Mourikis and S. I. Roumeliotis, *Observability-based rules for designing
        consistent EKF SLAM estimators*, Int. J. of Robotics Research 29(5), 2010). So the variance of the heading is
        at least that of dead reckoning since then, ::

            P_psi(0) + P_bias(0) t^2 + N^2 t,

        with the variances of the heading and of the gyroscope's bias when it began, the time t since then, and the
        random walk N of the angle. What is missing is added along this turn, to position and velocity, too.

        Parameters
        ----------
        noise : float
            Of the vertical gyroscope: random walk of the angle, squared [rad^2/s].
        """
        one, origin = self.estimate, self.origin
        assert one is not None
        assert origin is not None
        assert one.covariance is not None
        assert origin.covariance is not None
        age = one.time - origin.time
        missing = origin.covariance[8, 8] + self.drift * age**2 + noise * age - one.covariance[8, 8]
        if missing > 0.0:
            since = difference(one, origin)
            assert one.velocity is not None
            turn = np.array([-since[1], since[0], 0.0, -one.velocity[1], one.velocity[0], 0.0, 0.0, 0.0, 1.0])
            one.covariance = one.covariance + missing * np.outer(turn, turn)


@dataclass
class ImuHypothesis(Hypothesis):
    """That the IMU is wrong (or right, once it is excluded); ``exclusion`` has the instruments that are wrong, too."""

    exclusion: Exclusion = field(default_factory=Exclusion)


def uncertain_start(start: InitialState) -> InitialState:
    """The same start with larger sigmas."""
    stated = np.sqrt(np.diag(start.covariance))
    larger = stated * np.repeat((_WRONG_START, _WRONG_VELOCITY, _WRONG_START), 3)
    larger[6:] = np.minimum(larger[6:], np.maximum((_TILT, _TILT, _HEADING), stated[6:]))
    factor = np.divide(larger, stated, out=np.ones(9), where=stated > 0.0)
    return replace(start, covariance=start.covariance * np.outer(factor, factor))


def disturbed_imu(instruments: Instruments) -> Instruments:
    """The same instruments with white noise of the IMU that covers a disturbance; its biases are what they were."""
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
