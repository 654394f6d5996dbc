"""Base of the models: a state with a local error that is propagated, observed and corrected."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from types import MappingProxyType
from typing import ClassVar, NamedTuple

import numpy as np

from simnav.estimator.needs import Needs
from simnav.estimators.algebra.joseph import joseph_update, project
from simnav.geometry.rotation import left_jacobian
from simnav.types import (
    NO_SIDE,
    Array,
    Datasheet,
    Estimate,
    ImuSamples,
    InitialState,
    Instruments,
    Measurement,
    TriadDatasheet,
)

from .own_observation import OwnObservation

__all__ = [
    "ErrorModel", "GaussMarkov", "Linearised", "Observation", "aid_biases", "gauss_markov", "is_fast", "stationary",
    "triad_bias",
]  # fmt: skip

#: A measurement of m components with the covariance P of n states: innovation (m,), P H' (n, m), H P H' (m, m) and
#: noise (m, m).
Observation = tuple[Array, Array, Array, Array]


class Linearised(NamedTuple):
    """A measurement of m components, linearised at a state of n error components.

    Attributes
    ----------
    innovation : (m,) array
        Measured minus predicted, in the units of ``KINDS[kind].errors``.
    jacobian : (m, n) array
        Jacobian of the prediction with respect to the error (estimate minus truth).
    noise : (m, m) array
        Covariance of the measurement noise, including errors without a state.
    """

    innovation: Array
    jacobian: Array
    noise: Array

    def project(self, covariance: Array) -> Observation:
        """The measurement with ``P H'`` and ``H P H'`` of an (n, n) ``covariance`` P."""
        d, n = self.jacobian.shape
        cross, predicted = np.empty((n, d)), np.empty((d, d))
        project(covariance, np.ascontiguousarray(self.jacobian, dtype=np.float64), cross, predicted)
        return self.innovation, cross, predicted, self.noise


class ErrorModel(ABC):
    """A state, and the dynamics and measurement equations of its error of n components.

    Errors are estimate minus truth. A correction ``dx`` is added to the estimate.

    Attributes
    ----------
    size : int
        Number n of components of the error.
    time : float
        Time of the state [s].
    own : mapping of str to OwnObservation
        The observed instruments whose kind has a measurement equation of its own.
    """

    size: int
    time: float
    own: Mapping[str, OwnObservation] = MappingProxyType({})
    #: Names of the arrays that `correct` changes.
    state: ClassVar[tuple[str, ...]] = ()
    #: Names of further arrays that `propagate` keeps from one call to the next.
    memory: ClassVar[tuple[str, ...]] = ()
    #: Indices of the attitude, a rotation vector, in the error; None for a model without attitude.
    attitude_at: ClassVar[int | None] = None
    #: Indices of position and velocity, and of the attitude, which `loosen` inflates. Here all states and none.
    moving: ClassVar[tuple[slice, slice]] = (slice(None), slice(0, 0))

    @property
    def needs(self) -> Needs:
        """The instruments without which the model cannot work, see `simnav.estimator.Estimator.needs`."""
        return ()

    def choose(self, instruments: Instruments, name: str) -> ErrorModel:
        """The model for a set of instruments, which is itself.

        Parameters
        ----------
        instruments : Instruments
            Datasheets of the run's instruments.
        name : str
            Name of the estimator, for the message.

        Raises
        ------
        UnsuitableScenario
            If an instrument that the model needs is missing.
        """
        return self

    @abstractmethod
    def begin(self, start: InitialState, instruments: Instruments) -> Array:
        """Set the state; return the (n, n) covariance of its error. Raises UnsuitableScenario."""

    @abstractmethod
    def observes(self, instrument: Datasheet) -> bool:
        """Whether the model can use the measurements of an instrument."""

    def load(self, imu: ImuSamples | None) -> None:  # noqa: B027 (most models have no IMU)
        """Receive the IMU samples of the next step."""

    @abstractmethod
    def propagate(self, covariance: Array, until: float) -> None:
        """Advance the state to a time, and its covariance in place."""

    @abstractmethod
    def measure(self, measurement: Measurement) -> Linearised | None:
        """Linearise a measurement at the present state; None if it cannot be used."""

    def observe_own(
        self, name: str, time: float, value: Array, state: tuple[Array, ...], side: Array = NO_SIDE
    ) -> tuple[Array, Array] | None:
        """Innovation and Jacobian of a measurement of an instrument in ``own``, at any state.

        Parameters
        ----------
        name : str
            Name of the instrument.
        time : float
            Time of validity [s].
        value : (d,) array
            The measured value.
        state : tuple of array
            The arrays that describe a state of this model, as its chain keeps them.
        side : (s,) array
            Side information of the reading (`simnav.kinds.Kind.side`).

        Returns
        -------
        innovation : (d,) array
            Measured minus predicted.
        jacobian : (d, n) array
            Derivative of the prediction. None in place of both where the state has no reading.
        """
        raise NotImplementedError(f"{type(self).__name__} observes no instrument with an equation of its own")

    def nominal_noise(self, measurement: Measurement) -> Array | None:
        """The noise of `measure` alone, or None. A model may compute it without linearisation."""
        linearised = self.measure(measurement)
        return None if linearised is None else linearised.noise

    @abstractmethod
    def correct(self, dx: Array) -> None:
        """Add a correction to the state."""

    def innovate(self, measurement: Measurement, covariance: Array) -> Observation | None:
        """Linearise a measurement and project the covariance; a model may have a faster implementation."""
        linearised = self.measure(measurement)
        return None if linearised is None else linearised.project(covariance)

    def absorb(self, observation: Observation, covariance: Array, correction: Array) -> float:
        """Correct the state and its covariance by a measurement.

        Parameters
        ----------
        observation : tuple
            The linearised measurement, with the noise that is used.
        covariance : (n, n) array
            Covariance of the model's error, updated.
        correction : (n,) array
            Overwritten with the correction of the state.

        Returns
        -------
        float
            Normalised innovation squared; -1 if the innovation covariance is singular, and then nothing is changed.
        """
        innovation, cross, predicted, noise = observation
        nis: float = joseph_update(covariance, cross, predicted + noise, innovation, correction)
        if nis >= 0.0:
            self.correct(correction)
        return nis

    def assimilate(self, measurement: Measurement, covariance: Array, correction: Array) -> tuple[float, float] | None:
        """Use a measurement with its nominal noise: `innovate` and `absorb` in one step.

        Parameters
        ----------
        measurement : Measurement
            The measurement to be used.
        covariance : (n, n) array
            Covariance of the model's error, updated.
        correction : (n,) array
            Overwritten with the correction of the state.

        Returns
        -------
        (float, float) or None
            Normalised innovation squared (-1 if nothing was changed), and the norm of the innovation. None if the
            model has no faster implementation than `innovate` and `absorb`.
        """
        return None

    def loosen(self, covariance: Array, inflation: float, first: Array) -> None:
        """Inflate the covariance of position, velocity and attitude in place, if the motion is wrong.

        The prediction is wrong if the motion does not follow the model, or if the IMU is disturbed. Position and
        velocity are then uncertain. The errors of the instruments have not changed. If their covariance were inflated,
        too, they would follow the first wrong measurement.

        Parameters
        ----------
        covariance : (n, n) array
            Covariance P of the model's error, updated.
        inflation : float
            Factor on the variances, above 1.
        first : (n,) array
            Variances at the start of the run. The variance of the attitude is not inflated beyond this, so that
            corrections stay in the linear range.
        """
        motion, attitude = self.moving
        factors = np.ones(self.size)
        factors[motion] = inflation
        factors[attitude] = np.clip(first[attitude] / covariance.diagonal()[attitude], 1.0, inflation)
        sigmas = np.sqrt(factors)
        covariance *= sigmas[:, None] * sigmas

    def by_correction(self, jacobian: Array, correction: Array) -> Array:
        """A (m, n) Jacobian at the corrected state, taken with respect to the correction that led there.

        Its derivative of the error by the correction is the identity, but the left Jacobian of SO(3) for the attitude.
        """
        taken = jacobian.copy()
        if self.attitude_at is not None:
            attitude = slice(self.attitude_at, self.attitude_at + 3)
            taken[:, attitude] = taken[:, attitude] @ left_jacobian(correction[attitude])
        return taken

    def to_corrected(self, covariance: Array, correction: Array) -> None:
        """Bring a covariance of the correction to the corrected state, in place."""
        if self.attitude_at is not None:
            attitude = slice(self.attitude_at, self.attitude_at + 3)
            J = left_jacobian(correction[attitude])
            covariance[attitude] = J @ covariance[attitude]
            covariance[:, attitude] = covariance[:, attitude] @ J.T

    def snapshot(self) -> list[Array]:
        """Copies of the arrays that `correct` changes, for `restore`; TypeError if the model does not name them."""
        if not self.state:
            raise TypeError(f"{type(self).__name__}.state is to name the arrays that `correct` changes; it names none")
        return [getattr(self, name).copy() for name in self.state]

    def restore(self, snapshot: list[Array]) -> None:
        """Take corrections back."""
        for name, value in zip(self.state, snapshot, strict=True):
            getattr(self, name)[...] = value

    def take_over(self, other: ErrorModel) -> None:
        """Copy the state of another model of the same kind with the same instruments, between steps."""
        for name in (*self.state, *self.memory):
            getattr(self, name)[...] = getattr(other, name)
        self.time = other.time

    def carry(self, error: Array, elapsed: float) -> None:
        """Propagate an (n,) error, or (n, k) errors, through the last propagation of ``elapsed`` seconds, in place."""
        raise NotImplementedError(f"{type(self).__name__} has no transition matrix to carry an error with")

    @abstractmethod
    def estimate(self, covariance: Array) -> Estimate:
        """The state as an estimate at the present time."""


class GaussMarkov(NamedTuple):
    """A first-order Gauss-Markov bias, and white noise in place of faster errors.

    Attributes
    ----------
    variance : float
        Initial variance [x^2].
    decay : float
        Inverse of the correlation time [1/s].
    noise : float
        Density of the driving noise [x^2/s].
    white : float
        Density of white noise in the output [x^2 s].
    """

    variance: float
    decay: float
    noise: float
    white: float


def gauss_markov(
    bias: float, instability: float, correlation_time: float, rate_random_walk: float = 0.0, *, shortest: float = 1.0
) -> GaussMarkov:
    """One Gauss-Markov state for a turn-on bias and an in-run bias together.

    With the sigma b of the turn-on bias and the sigma s and correlation time tau of the in-run bias, their sum has the
    autocovariance ``b^2 + s^2 exp(-t/tau)``. One state with the variance ``b^2 + s^2`` and the correlation time
    ``tau (b^2 + s^2) / s^2`` has the same value and the same slope at lag 0, and a smaller autocovariance at all other
    lags, so its variance after averaging is not too small. It is exact if b or s is zero.

    Parameters
    ----------
    bias : float
        Turn-on bias, one sigma [x].
    instability, correlation_time : float
        Stationary sigma [x] and correlation time [s] of the in-run bias; where the time is infinite it is a random walk
        of ``instability`` per sqrt(s).
    rate_random_walk : float
        Density of the random walk of the bias [x/sqrt(s)].
    shortest : float
        A correlation time below this [s] is white noise of the same density at low frequency, 2 s^2 tau.
    """
    constant, moving = bias * bias, instability * instability
    walk = rate_random_walk * rate_random_walk
    if np.isinf(correlation_time):
        return GaussMarkov(constant, 0.0, moving + walk, 0.0)
    if correlation_time < shortest:
        return GaussMarkov(constant, 0.0, walk, 2.0 * moving * max(correlation_time, 0.0))
    if moving == 0.0:
        return GaussMarkov(constant, 0.0, walk, 0.0)
    total = constant + moving
    return GaussMarkov(total, moving / (total * correlation_time), 2.0 * moving / correlation_time + walk, 0.0)


def stationary(sigma: float, correlation_time: float) -> GaussMarkov:
    """A state of a stationary sigma and a correlation time [s], which begins with that sigma."""
    return GaussMarkov(sigma**2, 1.0 / correlation_time, 2.0 * sigma**2 / correlation_time, 0.0)


def is_fast(sheet: Datasheet) -> bool:
    """Whether the in-run bias of an aid changes from sample to sample, so that it is white noise."""
    return sheet.correlation_time < 0.5 / sheet.rate


def aid_biases(sheet: Datasheet) -> list[GaussMarkov]:
    """The bias state of each component of an aid; a bias that `is_fast` has no part in it."""
    return [
        gauss_markov(b, s, sheet.correlation_time, shortest=0.5 / sheet.rate)
        for b, s in zip(sheet.bias, sheet.bias_instability)
    ]


def triad_bias(triad: TriadDatasheet, extra: float = 0.0) -> GaussMarkov:
    """The bias state of three gyroscopes or accelerometers; ``extra`` adds to the turn-on bias."""
    return gauss_markov(
        float(np.hypot(triad.bias, extra)), triad.bias_instability, triad.correlation_time, triad.rate_random_walk
    )
