"""Base of the models: a state with a local error that is propagated, observed and corrected."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from types import MappingProxyType
from typing import ClassVar, NamedTuple

import numpy as np

from simnav.estimator.needs import Needs
from simnav.estimators.algebra.joseph import joseph_update, project
from simnav.estimators.models.own_observation import OwnObservation
from simnav.geometry.rotation import left_jacobian
from simnav.types import Array, Datasheet, Estimate, ImuSamples, InitialState, Instruments, Measurement, TriadDatasheet

__all__ = [
    "ErrorModel", "GaussMarkov", "Linearised", "Observation", "aid_biases", "gauss_markov", "is_fast", "stationary",
    "triad_bias",
]  # fmt: skip

#: Of m components and n states: innovation (m,), P H' (n, m), H P H' (m, m) and noise (m, m).
Observation = tuple[Array, Array, Array, Array]


class Linearised(NamedTuple):
    """A measurement of m components, linearised at a state of n error components.

    Attributes
    ----------
    innovation : (m,) array
        Measured minus predicted, in the units of ``KINDS[kind].errors``.
    jacobian : (m, n) array
        Of the prediction with respect to the error (estimate minus truth).
    noise : (m, m) array
        Covariance of what the state does not explain.
    """

    innovation: Array
    jacobian: Array
    noise: Array

    def project(self, covariance: Array) -> Observation:
        """The Jacobian times an (n, n) ``covariance``: ``P H'`` and ``H P H'``."""
        d, n = self.jacobian.shape
        cross, predicted = np.empty((n, d)), np.empty((d, d))
        project(covariance, np.ascontiguousarray(self.jacobian, dtype=np.float64), cross, predicted)
        return self.innovation, cross, predicted, self.noise


class ErrorModel(ABC):
    """A state, kept by the model, and what a solver needs to know of its n-component error.

    Errors are estimate minus truth; a correction ``dx`` is what is to be added to the estimate.

    Attributes
    ----------
    size : int
        n.
    time : float
        Of the state [s].
    own : mapping of str to OwnObservation
        The instruments observed whose kind has a measurement equation of its own.
    """

    size: int
    time: float
    own: Mapping[str, OwnObservation] = MappingProxyType({})
    #: Names of the arrays that `correct` changes.
    state: ClassVar[tuple[str, ...]] = ()
    #: Names of further arrays that `propagate` keeps from one call to the next.
    memory: ClassVar[tuple[str, ...]] = ()
    #: Place of the attitude, a rotation vector, in the error; None for a model without one.
    attitude_at: ClassVar[int | None] = None
    #: Places of position and velocity, and of the attitude: what `loosen` inflates. Here all states and none.
    moving: ClassVar[tuple[slice, slice]] = (slice(None), slice(0, 0))

    @property
    def needs(self) -> Needs:
        """The instruments without which it cannot work, as of `simnav.estimator.Estimator.needs`."""
        return ()

    def choose(self, instruments: Instruments, name: str) -> ErrorModel:
        """The model for a set of instruments, which is itself.

        Parameters
        ----------
        instruments : Instruments
            Datasheets of the run's instruments.
        name : str
            Of the estimator, for the message.

        Raises
        ------
        UnsuitableScenario
            If an instrument is lacking that the model needs.
        """
        return self

    @abstractmethod
    def begin(self, start: InitialState, instruments: Instruments) -> Array:
        """Set the state; return the (n, n) covariance of its error. Raises UnsuitableScenario."""

    @abstractmethod
    def observes(self, instrument: Datasheet) -> bool:
        """Whether `measure` knows what to do with an instrument."""

    def load(self, imu: ImuSamples | None) -> None:  # noqa: B027 (most models have no IMU)
        """Take the IMU samples of the step that follows."""

    @abstractmethod
    def propagate(self, covariance: Array, until: float) -> None:
        """Advance the state to a time, and its covariance in place."""

    @abstractmethod
    def measure(self, measurement: Measurement) -> Linearised | None:
        """Linearise at the present state; None where the measurement says nothing usable."""

    def observe_own(
        self, name: str, time: float, value: Array, state: tuple[Array, ...]
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

        Returns
        -------
        innovation : (d,) array
            Measured minus predicted.
        jacobian : (d, n) array
            Derivative of the prediction. None in place of both where the state has no reading.
        """
        raise NotImplementedError(f"{type(self).__name__} observes no instrument with an equation of its own")

    def nominal_noise(self, measurement: Measurement) -> Array | None:
        """The noise alone, or None, as of `measure`; a model may know it without linearising."""
        linearised = self.measure(measurement)
        return None if linearised is None else linearised.noise

    @abstractmethod
    def correct(self, dx: Array) -> None:
        """Add a correction to the state."""

    def innovate(self, measurement: Measurement, covariance: Array) -> Observation | None:
        """`measure`, projected; a model may have a faster way than one after the other."""
        linearised = self.measure(measurement)
        return None if linearised is None else linearised.project(covariance)

    def absorb(self, observation: Observation, covariance: Array, correction: Array) -> float:
        """Update a covariance and `correct` the state by what a measurement says.

        Parameters
        ----------
        observation : tuple
            With the noise that is to be used.
        covariance : (n, n) array
            Updated.
        correction : (n,) array
            Overwritten with what was added to the state.

        Returns
        -------
        float
            Normalised innovation squared; -1 where its covariance is singular, and nothing is changed.
        """
        innovation, cross, predicted, noise = observation
        nis: float = joseph_update(covariance, cross, predicted + noise, innovation, correction)
        if nis >= 0.0:
            self.correct(correction)
        return nis

    def assimilate(self, measurement: Measurement, covariance: Array, correction: Array) -> tuple[float, float] | None:
        """Use a measurement with its nominal noise: `innovate` and `absorb` in one go.

        Parameters
        ----------
        measurement : Measurement
            The measurement to be used.
        covariance : (n, n) array
            Updated.
        correction : (n,) array
            Overwritten with what was added to the state.

        Returns
        -------
        (float, float) or None
            Normalised innovation squared, or -1 where nothing was changed, and the norm of the innovation. None where
            the model has no faster way than one after the other.
        """
        return None

    def loosen(self, covariance: Array, inflation: float, first: Array) -> None:
        """Doubt the motion of the state: inflate its covariance in place, and that of nothing else.

        A prediction is wrong where the vessel, or an IMU that is disturbed, has not moved as the model says. Position
        and velocity are then anywhere. The errors of the instruments are what they were: whoever inflates them, too,
        lets them follow the first measurement that is wrong.

        Parameters
        ----------
        covariance : (n, n) array
            P, of the model's error; changed in place.
        inflation : float
            Of the variances, above 1.
        first : (n,) array
            Variances at the start of the run. No attitude is doubted beyond its own, for which corrections are linear.
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
        """Copies of what `correct` changes, for `restore`; TypeError where the model does not name it."""
        if not self.state:
            raise TypeError(f"{type(self).__name__}.state is to name the arrays that `correct` changes; it names none")
        return [getattr(self, name).copy() for name in self.state]

    def restore(self, snapshot: list[Array]) -> None:
        """Take corrections back."""
        for name, value in zip(self.state, snapshot, strict=True):
            getattr(self, name)[...] = value

    def take_over(self, other: ErrorModel) -> None:
        """Go on from the state of another model of the same kind, begun with the same instruments, between steps."""
        for name in (*self.state, *self.memory):
            getattr(self, name)[...] = getattr(other, name)
        self.time = other.time

    def carry(self, error: Array, elapsed: float) -> None:
        """Take an (n,) error, or (n, k) errors, through the last propagation, of ``elapsed`` seconds, in place."""
        raise NotImplementedError(f"{type(self).__name__} has no transition matrix to carry an error with")

    @abstractmethod
    def estimate(self, covariance: Array) -> Estimate:
        """The state as an estimate at the present time."""


class GaussMarkov(NamedTuple):
    """A first-order Gauss-Markov bias and the white noise that stands for what is faster than it.

    Attributes
    ----------
    variance : float
        At the start [x^2].
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

    The two have the autocovariance ``b^2 + s^2 exp(-t/tau)``. One state of variance ``b^2 + s^2`` and correlation
    time ``tau (b^2 + s^2) / s^2`` has the same value and the same slope at lag 0, and falls off faster everywhere
    else, so that it promises no more than the two. It is exact where either is zero.

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
