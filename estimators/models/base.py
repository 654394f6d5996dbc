"""Base of the models: a state with a local error that is propagated, observed and corrected."""

from __future__ import annotations

import copy
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from simnav.estimates import Estimates
from simnav.estimator.needs import Needs
from simnav.estimators.algebra.inflation import ALL_STATES, MotionStates
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
)

from .channel_readings import ChannelReadings
from .filtering import Dynamics, ModelFunctions, aid_table
from .measurement_functions import MeasurementFunction
from .named_state import NamedState
from .propagation import NO_SAMPLES, Samples

__all__ = ["ErrorModel", "Linearised"]


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


class ErrorModel(ABC):
    """A state, and the dynamics and measurement equations of its error of n components.

    Errors are estimate minus truth. A correction ``dx`` is added to the estimate.

    Attributes
    ----------
    size : int
        Number n of components of the error.
    time : float
        Time of the state [s].
    numbers : (s,) array
        The flat state, of a model with `functions`.
    own : mapping of str to MeasurementFunction
        The observed instruments whose kind has a measurement equation of its own.
    many : sequence of ChannelReadings
        Of these, the instruments with channels whose kind can predict many readings at one time.
    """

    size: int
    time: float
    numbers: Array
    own: Mapping[str, MeasurementFunction] = MappingProxyType({})
    many: Sequence[ChannelReadings] = ()
    #: Whether `estimate` reports all states of instruments (`simnav.types.Estimate.states`), or only the blocks that
    #: instruments bring along.
    reports_all: bool = False
    #: The IMU samples of the step, for `functions`.
    samples: Samples = NO_SAMPLES
    #: Whether it observes nothing by design: inertial navigation alone.
    unaided: ClassVar[bool] = False
    #: Names of the arrays that `correct` changes.
    state: ClassVar[tuple[str, ...]] = ()
    #: Names of further arrays that `propagate` keeps from one call to the next.
    memory: ClassVar[tuple[str, ...]] = ()
    #: Indices of the attitude, a rotation vector, in the error; None for a model without attitude.
    attitude_at: ClassVar[int | None] = None
    #: The states whose covariance is inflated where the motion is wrong.
    moving: ClassVar[MotionStates] = ALL_STATES
    #: Names of attributes that do not change in a run, and that copies have in common: an estimator that takes late
    #: readings is copied in each step.
    constant: ClassVar[tuple[str, ...]] = ()

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        """A copy, with what is `constant` in common."""
        made = object.__new__(type(self))
        memo[id(self)] = made
        own = vars(self)
        memo |= {id(own[name]): own[name] for name in self.constant if name in own}
        state: Any = copy.deepcopy(self.__getstate__(), memo)
        if hasattr(made, "__setstate__"):
            made.__setstate__(state)
        elif state is not None:
            vars(made).update(state)
        return made

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

    def components(self, instrument: Datasheet) -> int:
        """Number of components of an observed instrument that the model predicts."""
        return len(instrument.sigma)

    def holds(self, instrument: Datasheet) -> bool:
        """Whether the model has a state for each block that an instrument brings along."""
        return True

    def load(self, imu: ImuSamples | None) -> None:  # noqa: B027 (most models have no IMU)
        """Receive the IMU samples of the next step."""

    @abstractmethod
    def propagate(self, covariance: Array, until: float) -> None:
        """Advance the state to a time, and its covariance in place."""

    @abstractmethod
    def measure(self, measurement: Measurement) -> Linearised | None:
        """Linearise a measurement at the present state; None if it cannot be used."""

    def observe_own(
        self, name: str, time: float, value: Array, state: NamedState, side: Array = NO_SIDE
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
        state : NamedState
            A state of this model.
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

    def nominal_noises(self, measurements: Sequence[Measurement]) -> Array | None:
        """`nominal_noise` of k readings of one time of the channels of one instrument, by one call.

        Parameters
        ----------
        measurements : sequence of Measurement
            Readings of channels of one instrument (`many`).

        Returns
        -------
        (k, m, m) array or None
            The noises. None where each reading has to be asked for by itself.
        """
        return None

    def functions_of(self, name: str) -> ModelFunctions | None:
        """The kernels that predict and correct by an instrument, even where others need the methods of the model."""
        return None

    def functions(self) -> ModelFunctions | None:
        """The equations as kernels over `dynamics`; None where a filter has to call the methods of the model."""
        return None

    def dynamics(self, covariance: Array, names: Sequence[str]) -> Dynamics:
        """The state, its covariance, and what `functions` need to know of them and of the instruments.

        Parameters
        ----------
        covariance : (n, n) array
            Covariance of the error.
        names : sequence of str
            The instruments of the filter, in the order of their rows.
        """
        nothing, none = np.empty(0), np.empty((0, 0))
        return Dynamics(
            numbers=nothing, covariance=covariance, transition=none, process_noise=none, constants=nothing,
            decay=nothing, density=nothing, first_variances=covariance.diagonal().copy(),
            correction=np.empty(len(covariance)), next_sample=np.zeros(1, np.int64),
            aids=aid_table([], [], []), moving=self.moving,
        )  # fmt: skip

    @abstractmethod
    def correct(self, dx: Array) -> None:
        """Add a correction to the state."""

    def measure_together(self, measurements: Sequence[Measurement]) -> Linearised | None:
        """Linearise k measurements of one time at the present state, as `measure` does one, with the nominal noise.

        Parameters
        ----------
        measurements : sequence of Measurement
            Readings of channels of one instrument (`many`).

        Returns
        -------
        Linearised or None
            Innovations (k, m), Jacobians (k, m, n) and noise (k, m, m); None if they have to be measured one by one.
        """
        return None

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

    def estimates(self, numbers: Array, covariances: Array) -> Estimates:
        """`estimate` at several states, for a model with `functions`.

        Parameters
        ----------
        numbers : (t, s) array
            The flat states.
        covariances : (t, n, n) array
            Their covariances.
        """
        present = self.numbers.copy()
        found = Estimates.of(
            self.estimate(covariance) for self.numbers[:], covariance in zip(numbers, covariances, strict=True)
        )
        self.numbers[:] = present
        return found
