"""The 15-state inertial error model: position, velocity, attitude, gyroscope and accelerometer bias.

The state is propagated by `simnav.strapdown` at IMU rate, its error in blocks of up to 0.2 s, and the covariance once a
measurement (`simnav.estimators.models.propagation`).

Error: estimate minus truth; position ``(R_M + h) dlat, (R_N + h) cos(lat) dlon, -dh`` [m], velocity [m/s] and the
rotation vector phi of C_est C_true' [rad], all in north-east-down, and the biases [rad/s], [m/s^2]. The dynamics of
the error are in the phi-angle form (Groves 2013, section 14.2.4, with his signs turned to estimate minus truth). With
the position, velocity and attitude errors dr, dv and phi, the bias errors db_g and db_a and db for both of them,
the specific force f_n, the Earth rate w_ie, the transport rate w_en, w_in = w_ie + w_en and their errors dw, the
velocity v, gravity g, the Earth's radius R, the correlation time T and the direction cosine matrix C they are

- dr' = dv + (curvature terms of order v/R) dr
- dv' = -[f_n x] phi - C db_a - (2 w_ie + w_en) x dv - (2 dw_ie + dw_en) x v + 2 g/R dr_D
- phi' = -w_in x phi - dw_in - C db_g
- db' = -db/T + noise

In addition there are calibration states that depend on the datasheets: a bias for every component of an aiding
instrument with a bias or an in-run instability, a DVL's scale factor and misalignment, a speed log's scale factor, and
the current, north and east, for a speed log. The current has a fixed direction over ground: when the vessel turns, its
component along the keel changes at once, which a bias along the keel could not describe. Last come the blocks of states
that instruments bring along (`simnav.blocks`). If all instruments have white noise only, bring no blocks, and there is
no log, n is 15. With ``calibrate=False`` n is always 15, and these errors count as white noise.

An IMU's scale factor and misalignment are not states. On a level vehicle the errors of the accelerometers act like a
bias under gravity, which is added to the turn-on bias. The errors of the gyroscopes act in turns, as noise in
proportion to the turn rate, averaged over `TURN_TIME` so that wave motion does not count. The quantization residual is
added to the next increment, so that its sum stays within one step; it is neglected.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import atan2, hypot
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from simnav.estimates import Estimates
from simnav.estimator import UnsuitableScenario
from simnav.estimator.needs import AID, IMU, Needs
from simnav.estimators.algebra.inflation import MotionStates
from simnav.geometry.rotation import dcm_from_rpy
from simnav.structures import filled
from simnav.types import (
    KINDS,
    NO_SIDE,
    Array,
    Datasheet,
    Estimate,
    ImuDatasheet,
    ImuSamples,
    InitialState,
    Instruments,
    Measurement,
)

from .base import ErrorModel, Linearised
from .channel_readings import channel_readings_of
from .covariance_propagation import carry_errors
from .declared_errors import CURRENT, bias_of, bias_of_triad
from .delayed import is_delayed
from .equations import EQUATIONS, equation_of
from .error_states import merged, merged_states
from .filtering import Aid, AidTable, Dynamics, ModelFunctions, aid_table
from .flat_lines import FlatLineTest
from .flat_state import FlatStateModel
from .inertial_errors import ERROR, PART
from .inertial_functions import INERTIAL_FUNCTIONS
from .lever_arms import has_measurement_function, with_lever_arms
from .measurement_functions import MeasurementFunction, PredictedReading
from .measurements import (
    HEADING,
    State,
    has_heading,
)
from .named_state import NamedState, at_row
from .propagation import (
    CLOCK,
    IMU_NOISE,
    INERTIAL_STATE,
    MOTION_NUMBERS,
    TURN_TIME,
    motion_of,
)
from .state_blocks import StateBlocks

__all__ = ["InertialModel", "roll_pitch_yaw"]

#: Components of the error without calibration states, and without the biases of the IMU.
_NAV, _MOTION = ERROR.calibration, ERROR.gyroscope_bias
_GRAVITY = 9.81


class InertialModel(FlatStateModel):
    """The model of the module.

    Parameters
    ----------
    calibrate : bool
        False: exactly 15 states; biases, scale factor and misalignment of the aids then count as white noise.

    Attributes
    ----------
    position, velocity : (3,) array
        Latitude, longitude [rad] and height [m]; velocity north, east, down [m/s].
    dcm : (3, 3) array
        Rotation from body to north-east-down.
    bias : (6,) array
        Biases of gyroscopes [rad/s] and accelerometers [m/s^2].
    calibration : (n - 15,) array
        Calibration states of the aiding instruments.
    bias_at, scale_at : dict of str to int
        Index in the error state of an instrument's first bias, and of its scale factor.
    aid_parameters : dict of str to Aid
        Parameters of each instrument for `simnav.estimators.models.measurements.observe_inertial`: code, lever arm, and
        the indices of its first bias and of its scale factor (-1: none).
    own : dict of str to MeasurementFunction
        The instruments whose kind has a measurement equation of its own; their code is `OWN`.
    noise : dict of str to (d, d) array
        Covariance of the white noise of each instrument.
    uncalibrated : set of str
        Instruments whose noise grows with the velocity (`simnav.estimators.models.equations`).
    delayed : bool
        Whether the delay of an instrument is among the states.
    raw_rate, raw_force : (3,) array
        Angular rate at the time of the state (extrapolated) and specific force of the last IMU sample, as measured.
    transition, process_noise : (15, 15) array
        Transition matrix and process noise of the last propagation.
    """

    delayed: bool = False
    state = ("position", "velocity", "dcm", "bias", "calibration")
    memory = ("numbers", "flat_line_memory")
    constant: ClassVar[tuple[str, ...]] = (
        "instruments", "bias_at", "scale_at", "uncalibrated", "own", "many", "_many_of", "_beyond", "_fused",
    )  # fmt: skip
    attitude_at = ERROR.attitude
    equations = INERTIAL_FUNCTIONS
    moving = MotionStates(ERROR.position, ERROR.attitude, ERROR.attitude, ERROR.gyroscope_bias)
    #: True if the kernels of `simnav.estimators.models.inertial_functions` may replace `measure` and
    #: `correct`. A model with another form of one of these methods, or of those of points, sets it to False.
    fused: ClassVar[bool] = True

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        own = {"measure", "correct", "propagate_points", "observe_points"} & vars(cls).keys()
        if own and cls.fused and "fused" not in vars(cls):
            raise TypeError(f"{cls.__name__} has {', '.join(sorted(own))} of its own; it has to say: fused = False")

    def __init__(self, calibrate: bool = True):
        self.calibrate = calibrate

    @property
    def needs(self) -> Needs:
        """An IMU, and anything to aid it."""
        return (IMU, AID)

    def _bind(self) -> None:
        """Name the blocks of the flat state."""
        self.motion = motion = motion_of.function(self.numbers)
        self.position, self.velocity, self.dcm, self.bias = motion.position, motion.velocity, motion.dcm, motion.bias
        self.calibration = self.numbers[MOTION_NUMBERS:]
        clock = motion.clock.view(CLOCK)
        self.raw_rate, self.raw_force = clock["rate"][0], clock["mean_force"][0]
        self._time, self._held = clock["time"], clock["held"]
        self._viewed = State(self.position, self.velocity, self.dcm, self.raw_rate, self.bias, self.calibration)

    @property
    def flat_line_memory(self) -> Array:
        """What the flat-line test of the IMU remembers."""
        return self.flat_lines.memory

    @property
    def time(self) -> float:
        """Time of the state [s]."""
        return float(self._time[0])

    @time.setter
    def time(self, time: float) -> None:
        self._time[0] = time

    def choose(self, instruments: Instruments, name: str) -> ErrorModel:
        """Itself; UnsuitableScenario without an IMU or without anything to aid it."""
        if instruments.imu is None:
            raise UnsuitableScenario(f"{name} needs an IMU and at least one other instrument; there is not an IMU")
        if not instruments:
            raise UnsuitableScenario(
                f"{name} needs an IMU and at least one other instrument; there is not an instrument beside the IMU"
            )
        return self

    def begin(self, start: InitialState, instruments: Instruments) -> Array:
        """Set the state; UnsuitableScenario without an IMU."""
        imu = instruments.imu
        if imu is None:
            raise UnsuitableScenario("it needs an IMU")
        self.instruments = instruments = with_lever_arms(instruments)
        self.transition, self.process_noise = np.empty((_NAV, _NAV)), np.empty((_NAV, _NAV))
        self.next_sample, self._since = np.zeros(1, np.int64), start.time
        self.flat_lines = FlatLineTest(imu)
        self.load(None)
        self.blocks = StateBlocks(_MOTION)
        self._imu(imu)
        self._aids()
        n = self.size = self.blocks.size
        variance, decay, density = self.blocks.columns(_MOTION)
        self._decay, self._density = decay[6:], density[6:]
        self.numbers = np.zeros(MOTION_NUMBERS + n - _NAV)
        self._bind()
        self.position[:], self.velocity[:], self.dcm[:] = start.position, start.velocity, dcm_from_rpy(start.attitude)
        self._time[0], self.motion.clock.view(CLOCK)["used"] = start.time, -1e9
        self.names = list(self.noise)
        covariance = np.zeros((n, n))
        covariance[:_MOTION, :_MOTION] = start.covariance
        covariance[range(_MOTION, n), range(_MOTION, n)] = variance
        return covariance

    def _imu(self, imu: ImuDatasheet) -> None:
        """The biases of the IMU and its noise."""
        g, a = imu.gyroscope, imu.accelerometer
        # A level vehicle: gravity on the vertical axis, and on the others through their misalignment.
        level, vertical = (
            bias_of_triad(replace(a, bias=float(np.hypot(a.bias, share * _GRAVITY))), "m_s2")
            for share in (a.misalignment, a.scale)
        )
        gyro, acceleration = bias_of_triad(g, "deg_s"), [*merged(level)[:2], merged(vertical)[2]]
        turning = merged(gyro)
        self.blocks.add(imu.name, "gyroscope_bias", turning)
        self.blocks.add(imu.name, "accelerometer_bias", acceleration)
        dt = 1.0 / imu.rate
        gyro_white = g.random_walk**2 + float(gyro.white_density()[0])
        self._noise = filled(
            IMU_NOISE, gyroscope=gyro_white, accelerometer=a.random_walk**2 + float(level.white_density()[0]),
            gyroscope_decay=turning[0].decay, gyroscope_walk=turning[0].noise,
            accelerometer_decay=min(x.decay for x in acceleration),
            accelerometer_walk=max(x.noise for x in acceleration),
            scale=g.scale**2 * TURN_TIME, misalignment=g.misalignment**2 * TURN_TIME, interval=dt,
        )  # fmt: skip
        self._rate_variance = 2.5 * gyro_white / dt  # of 3/2 of a sample less 1/2 of the one before

    def _aids(self) -> None:
        """Calibration states and white noise of the aiding instruments."""
        self.bias_at: dict[str, int] = {}
        self.scale_at: dict[str, int] = {}
        self.noise: dict[str, Array] = {}
        self.uncalibrated: set[str] = set()
        self.aid_parameters: dict[str, Aid] = {}
        self.own: dict[str, MeasurementFunction] = {}
        observed = [sheet for sheet in self.instruments.values() if self.observes(sheet)]
        for sheet in observed:
            bias, equation, states = bias_of(sheet), equation_of(sheet), merged_states(sheet)
            white = bias.white_variance()
            if self.calibrate:
                at = {name: self.blocks.add(sheet.name, name, rates) for name, rates in states.items()}
                for places, name in ((self.bias_at, "bias"), (self.scale_at, "scale")):
                    if name in at:
                        places[sheet.name] = at[name]
            else:
                along_keel = CURRENT**2 if equation.through_water else 0.0
                white = white + [rates.variance + along_keel for rates in merged(bias)]
                if "scale" in states:
                    self.uncalibrated.add(sheet.name)
            self.noise[sheet.name] = equation.white_noise(sheet, white, self._rate_variance)
            self.aid_parameters[sheet.name] = Aid(
                equation.code, np.array(sheet.lever_arm, dtype=np.float64),
                self.bias_at.get(sheet.name, -1), self.scale_at.get(sheet.name, -1),
            )  # fmt: skip
        self._more_blocks()
        own = [sheet for sheet in observed if has_measurement_function(sheet)]
        if self.calibrate:
            self.blocks.bring(own)
        for sheet in own:
            self.own[sheet.name] = MeasurementFunction(sheet, self.blocks.places(sheet.name, _NAV), self._since)
        self.delayed = any(is_delayed(sheet) for sheet in own)
        self.many = channel_readings_of(self.own, self.bias_at)
        self._many_of = {name: many for many in self.many for name in many.sources}
        #: Of these: the noise without that of the datasheet, and a unit matrix.
        self._beyond: dict[str, tuple[Array, Array]] = {}
        for name in self._many_of:
            sigma = self.instruments[name].sigma
            unit = np.eye(len(sigma))
            self._beyond[name] = self.noise[name] - sigma**2 * unit, unit
        self._fused = set(self.noise) - self.uncalibrated - set(self.own) if self.fused else set()

    def _more_blocks(self) -> None:
        """A hook: append further blocks of calibration states."""

    def observes(self, instrument: Datasheet) -> bool:
        """Every kind of instrument that has a measurement equation."""
        return instrument.equation in EQUATIONS or KINDS[instrument.kind].observation is not None

    def holds(self, instrument: Datasheet) -> bool:
        """Whether blocks of an instrument are states, and not white noise."""
        return self.calibrate or not instrument.blocks

    def arrays(self, names: Sequence[str]) -> dict[str, NDArray[Any]] | None:
        """The state and the constants, for a kernel that goes through many filters.

        Parameters
        ----------
        names : sequence of str
            Instruments, in the order in which the kernel counts them.

        Returns
        -------
        dict of str to array, or None
            The state under the names of its attributes; ``sensors``, the noise of the IMU (`accumulate_error`); by
            instrument the fields of `AidTable`, and ``limits`` (values of this size are not plausible). None where the
            model uses an instrument in a way of its own, or channel by channel.
        """
        if self._fused != set(self.noise) or not self.noise.keys() <= set(names):
            return None
        table = self.table(names)
        limits = np.zeros((len(names), 3))
        for i, name in enumerate(names):
            if name in self.noise:
                limits[i, : len(self.noise[name])] = KINDS[self.instruments[name].kind].limits
        return {
            "position": self.position, "velocity": self.velocity, "dcm": self.dcm, "memory": self.motion.increments,
            "bias": self.bias, "turn": self.motion.turn, "clock": self.motion.clock, "sensors": self._noise,
            "calibration": self.calibration, "decay": self._decay, "density": self._density,
            "limits": limits, **table._asdict(),
        }  # fmt: skip

    def functions_of(self, name: str) -> ModelFunctions | None:
        """As `ErrorModel.functions_of`."""
        return self.equations if name in self._fused else None

    def functions(self) -> ModelFunctions | None:
        """As `ErrorModel.functions`; None if an instrument has an equation or a clock of its own."""
        return self.equations if self._fused == set(self.noise) and not self.blocks.clocks else None

    def dynamics(self, covariance: Array, names: Sequence[str]) -> Dynamics:
        """As `ErrorModel.dynamics`."""
        return Dynamics(
            numbers=self.numbers, covariance=covariance, transition=self.transition, process_noise=self.process_noise,
            constants=self._noise, decay=self._decay, density=self._density,
            first_variances=covariance.diagonal().copy(), correction=np.empty(self.size), next_sample=self.next_sample,
            aids=self.table(names), moving=self.moving,
        )  # fmt: skip

    def table(self, names: Sequence[str]) -> AidTable:
        """The instruments in the order of their names."""
        noise = [self.noise.get(name, np.empty((0, 0))) for name in names]
        return aid_table(list(map(self.aid_parameters.get, names)), list(map(len, noise)), [n.ravel() for n in noise])

    def load(self, imu: ImuSamples | None) -> None:
        """Take the IMU samples of the step that follows."""
        self.next_sample[0] = 0
        self.samples = self.flat_lines.samples(imu)

    def propagate(self, covariance: Array, until: float) -> None:
        """Advance the state and its covariance through the samples loaded."""
        elapsed = until - self.time
        super().propagate(covariance, until)
        if elapsed > 0.0 and self.blocks.clocks:
            self.blocks.carry_values(self.calibration, _NAV, elapsed)
            self.blocks.carry_covariance(covariance, elapsed)

    def carry(self, error: Array, elapsed: float) -> None:
        """Take an error, or several in columns, through the last propagation, in place."""
        if error.ndim == 2 and error.flags.carray:
            carry_errors.unchecked(self.transition, self._decay, elapsed, error)
        else:
            m = len(self.transition)
            error[:m] = self.transition @ error[:m]
            if len(self._decay):
                error.T[..., m:] *= np.exp(-self._decay * elapsed)
        if self.blocks.clocks:
            self.blocks.carry(error, elapsed)

    @property
    def held(self) -> float:
        """Seconds without usable IMU data so far."""
        return float(self._held[0])

    def measure(self, measurement: Measurement) -> Linearised | None:
        """Linearise one measurement (`simnav.estimators.models.measurements`)."""
        name = measurement.instrument
        if name in self.own:
            state = self.state_of_own()
            found = self._compare_own(name, measurement.time, measurement.value, state, measurement.side)
            if found is None:
                return None
            noise, more = self.noise[name], self.own[name].spread(found.own, found.point)
            return Linearised(found.innovation, found.jacobian, noise if more is None else noise + more)
        linearised = super().measure(measurement)
        if linearised is None or name not in self.uncalibrated:
            return linearised
        sheet, predicted = self.instruments[name], measurement.value - linearised.innovation
        return linearised._replace(noise=linearised.noise + equation_of(sheet).uncalibrated_noise(sheet, predicted))

    def _state(self) -> State:
        return self._viewed

    def state_of_own(self) -> State:
        """The state for `observe_own`: with delays among the states, the rate has the specific force behind it."""
        if not self.delayed:
            return self._state()
        inertial = np.concatenate([self.raw_rate, self.raw_force])
        return State(self.position, self.velocity, self.dcm, inertial, self.bias, self.calibration)

    def observe_own(
        self, name: str, time: float, value: Array, state: NamedState, side: Array = NO_SIDE
    ) -> tuple[Array, Array] | None:
        """As `ErrorModel.observe_own`, at a `State`."""
        assert isinstance(state, State)
        found = self._compare_own(name, time, value, state, side)
        return None if found is None else (found.innovation, found.jacobian)

    def _compare_own(self, name: str, time: float, value: Array, state: State, side: Array) -> PredictedReading | None:
        own = self.own[name]
        return own.compare(own.point(time, state, side), value, state.calibration, _NAV, self.bias_at.get(name, -1))

    def nominal_noise(self, measurement: Measurement) -> Array | None:
        """The noise of the datasheet; None if the noise depends on the state."""
        name = measurement.instrument
        if name in self._fused:
            return None if self.aid_parameters[name].code == HEADING and not has_heading(self.dcm) else self.noise[name]
        if name in self.own and (more := self.own[name].noise_without_state(measurement.side)) is not None:
            return self.noise[name] + more
        return super().nominal_noise(measurement)

    def nominal_noises(self, measurements: Sequence[Measurement]) -> Array | None:
        """As `ErrorModel.nominal_noises`, for a kind that predicts many readings at one time."""
        name = measurements[0].instrument
        many = self._many_of.get(name)
        more = None if many is None else many.more_noise([m.side for m in measurements])
        return None if more is None else self.noise[name] + more

    def measure_together(self, measurements: Sequence[Measurement]) -> Linearised | None:
        """As `ErrorModel.measure_together`, where a kind predicts many readings at one time."""
        times, names, _, values, _, sides = zip(*measurements)
        many = self._many_of.get(names[0])
        if many is None or many.biased or many.has_noise or not self.fused:
            return None
        k, side, (beyond, unit) = len(names), np.array(sides), self._beyond[names[0]]
        noise = beyond + many.noise(side)[:, :, None] * unit
        innovation, jacobian = many.linearise(
            np.array(times), np.array(values), many.channels(names), at_row(self._state(), None),
            np.zeros(k, dtype=np.intp), side,
        )  # fmt: skip
        return Linearised(innovation, jacobian, noise)

    def estimate(self, covariance: Array) -> Estimate:
        """The state as an estimate, all nine components."""
        attitude, nine = roll_pitch_yaw(self.dcm), covariance[PART.navigation, PART.navigation].copy()
        estimate = Estimate(self.time, self.position.copy(), self.velocity.copy(), attitude, nine)
        if self.blocks.brought or self.reports_all:
            values = np.concatenate([self.bias, self.calibration])
            estimate.states = self.blocks.report(values, _MOTION, covariance, self.reports_all)
        return estimate

    def estimates(self, numbers: Array, covariances: Array) -> Estimates:
        """As `ErrorModel.estimates`."""
        if self.blocks.brought or self.reports_all or type(self).estimate is not InertialModel.estimate:
            return super().estimates(numbers, covariances)
        states = numbers[:, :MOTION_NUMBERS].view(INERTIAL_STATE)[:, 0]
        attitude = np.array([_angles(elements) for elements in states["dcm"].reshape(-1, 9).tolist()])
        time = states["clock"].view(CLOCK)["time"][:, 0]
        nine = covariances[:, PART.navigation, PART.navigation]
        return Estimates(time, states["position"], states["velocity"], attitude, nine)


def roll_pitch_yaw(dcm: Array) -> Array:
    """(3,) array: `simnav.geometry.rotation.rpy_from_dcm` of one matrix, without the overhead of stacks."""
    return np.array(_angles(dcm.ravel().tolist()))


def _angles(dcm: Sequence[float]) -> tuple[float, float, float]:
    """Roll, pitch and yaw from the elements of a matrix, row by row."""
    c00, _, _, c10, _, _, c20, c21, c22 = dcm
    return atan2(c21, c22), atan2(-c20, hypot(c21, c22)), atan2(c10, c00)
