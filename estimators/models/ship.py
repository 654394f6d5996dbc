"""The ship dead-reckoning model: position, speed, heading, turn rate and current, for a ship without an INS.

State: latitude and longitude; forward speed u through the water; heading psi; turn rate r; current c (north, east);
and, if the datasheets give them, a bias for each compass and log, a scale factor for each log, and the blocks of states
that instruments bring along (`simnav.blocks`), but for clocks. Motion, with the horizontal position p, the correlation
time T of a state, and ' for the time derivative:

- p' = u (cos psi, sin psi) + c
- u' = white noise; psi' = r; r' = -r/T + noise; c' = -c/T + noise; biases as in
  `simnav.estimators.models.error_states.merged`

Speed and heading are states, and log and compass are measurements of them. So their biases are estimated while there is
GNSS, and the position is propagated through an outage. Height, roll and pitch are not estimated. A lever arm is turned
by the heading only; the effect of heel is noise. Sideways motion through the water (waves, leeway) is noise of measured
velocities and of the estimate's velocity.

After Jiang et al. (2026), J. Mar. Sci. Eng. 14(5), 472: position, speed, heading, log bias, compass bias, 1 Hz. The
turn rate and the current are additions, because a log measures the speed through the water.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, radians, sin

import numpy as np

from simnav import kinds
from simnav.blocks import StateBlock
from simnav.estimator import UnsuitableScenario
from simnav.estimator.needs import Needs
from simnav.estimators.algebra.inflation import NO_STATES
from simnav.structures import filled
from simnav.types import KINDS, NO_SIDE, Array, Datasheet, Estimate, InitialState, Instruments, Measurement

from .base import ErrorModel, Linearised
from .channel_readings import channel_readings_of
from .declared_errors import bias_of
from .equations import equation_of
from .error_states import merged_states, with_variance
from .filtering import Aid, AidTable, Dynamics, ModelFunctions, aid_table
from .flat_state import FlatStateModel
from .inertial_errors import ERROR
from .lever_arms import has_measurement_function, with_lever_arms
from .measurement_functions import PredictedReading
from .measurements import wrap
from .moving_chain import MovingModel
from .named_state import NamedState
from .ship_functions import SHIP_FUNCTIONS, SHIP_MOTION, SHIP_NUMBERS, ship_state
from .ship_kernels import (
    BODY_VELOCITY,
    HEADING,
    LOG,
    POSITION,
    SHIP,
    SHIP_NOISE,
    VELOCITY,
    correct_ships,
    describe_ship,
    differ_ships,
    observe_ship,
    sail_ships,
)
from .ship_observation import HEEL, VERTICAL_SPEED, PlacedShip, ShipObservation, ShipReadings
from .state_blocks import StateBlocks

__all__ = ["OBSERVED", "POSITIONS", "ShipModel"]

#: Measurement equations (`simnav.kinds.EQUATIONS`) that the model knows.
POSITIONS = (kinds.POSITION, kinds.HORIZONTAL_POSITION)
VELOCITIES = (kinds.VELOCITY, kinds.BODY_VELOCITY, kinds.WATER_SPEED)
OBSERVED = (*POSITIONS, *VELOCITIES, kinds.HEADING)


class ShipModel(FlatStateModel, MovingModel):
    """The model of the module.

    Parameters
    ----------
    acceleration : float
        Noise density of the speed [m/s/sqrt(s)].
    turn_rate_deg, turn_time : float
        Sigma [deg/s] and correlation time [s] of the turn rate.
    current, current_time : float
        Sigma of each component of the current [m/s], and its correlation time [s].
    sway : float
        Sigma of the sideways velocity through the water [m/s].

    Attributes
    ----------
    turn_rate : float
        Sigma of the turn rate [rad/s].
    position : (3,) array
        Latitude, longitude [rad] and height [m].
    x : (n,) array
        The other states; the first two numbers are zero.
    transition : (n, n) array
        Transition matrix of the last propagation.
    decay, density : (n,) array
        Inverse correlation times of the states [1/s], and their noise densities.
    aids : dict of str to Aid
        Parameters of each observed instrument for `simnav.estimators.models.ship_kernels`.
    own : dict of str to ShipObservation
        The observed instruments whose kind has a measurement equation of its own.
    bias_at, scale_at : dict of str to int
        Index in the state of an instrument's first bias, and of its scale factor.
    """

    state = ("position", "x")
    equations = SHIP_FUNCTIONS
    moving = NO_STATES  # there is no IMU: the process noise covers manoeuvres

    def __init__(
        self,
        acceleration: float = 0.05,
        turn_rate_deg: float = 0.6,
        turn_time: float = 10.0,
        current: float = 0.3,
        current_time: float = 3600.0,
        sway: float = 0.2,
    ):
        self.acceleration = acceleration
        self.turn_rate, self.turn_time = radians(turn_rate_deg), turn_time
        self.current, self.current_time = current, current_time
        self.sway = sway

    def _bind(self) -> None:
        """Name the blocks of the flat state."""
        _, self.position, self.x = ship_state.function(self.numbers)

    def functions(self) -> ModelFunctions | None:
        """As `ErrorModel.functions`; None if an instrument has an equation of its own."""
        return self.equations if not self.own else None

    def dynamics(self, covariance: Array, names: Sequence[str]) -> Dynamics:
        """As `ErrorModel.dynamics`."""
        return Dynamics(
            numbers=self.numbers, covariance=covariance, transition=self.transition, process_noise=np.empty((0, 0)),
            constants=self.constants, decay=self.decay, density=self.density,
            first_variances=covariance.diagonal().copy(), correction=np.empty(self.size),
            next_sample=np.zeros(1, np.int64), aids=self.table(names),
            moving=self.moving,
        )  # fmt: skip

    def table(self, names: Sequence[str]) -> AidTable:
        """The instruments in the order of their names; those with an equation of their own have no components."""
        aids = [self.aids.get(name) for name in names]
        components = [0 if aid is None else components_of(aid) for aid in aids]
        return aid_table(aids, components, [self._noise.get(name, np.empty(0)) for name in names])

    def observes(self, instrument: Datasheet) -> bool:
        """Whether it is a position, velocity, speed or heading, or has an observation of its own and no clock."""
        if any(block.process == "clock" for block in instrument.blocks):
            return False  # its states have independent errors
        return instrument.equation in OBSERVED or KINDS[instrument.kind].observation is not None

    @property
    def needs(self) -> Needs:
        """A heading, and a position or a speed."""
        return (tuple(kinds.kinds_with(kinds.HEADING)), tuple(kinds.kinds_with(*POSITIONS, *VELOCITIES)))

    def choose(self, instruments: Instruments, name: str) -> ErrorModel:
        """Itself; UnsuitableScenario without a heading, or without a position and a speed."""
        if not instruments.of_equation(kinds.HEADING):
            compasses = " or ".join(kinds.kinds_with(kinds.HEADING))
            raise UnsuitableScenario(f"{name} needs a compass ({compasses}); there is none")
        if not instruments.of_equation(*POSITIONS, *VELOCITIES):
            raise UnsuitableScenario(f"{name} needs GNSS, a terrain fix, a speed log or a DVL; there is none")
        return self

    def begin(self, start: InitialState, instruments: Instruments) -> Array:
        """Set the state; UnsuitableScenario if there is nothing that gives a speed and a heading."""
        self.instruments = instruments = with_lever_arms(instruments, drifting=False)
        if not any(self.observes(s) for s in instruments.values()):
            raise UnsuitableScenario("the ship model needs GNSS, a compass or a log; there is none of them")
        self.blocks = StateBlocks(SHIP.speed)
        for block in self._motion():
            self.blocks.add("ship", block.name, block.rates())
        self.bias_at: dict[str, int] = {}
        self.scale_at: dict[str, int] = {}
        for sheet in instruments.values():
            self._calibrate(sheet)
        self.blocks.bring(s for s in instruments.values() if has_measurement_function(s) and self.observes(s))
        self.size = n = self.blocks.size
        variance, decay, density = self.blocks.columns(SHIP.speed)
        self.decay, self.density = (
            np.concatenate([np.zeros(SHIP.speed), decay]),
            np.concatenate([np.zeros(SHIP.speed), density]),
        )
        self.transition, self.constants = np.eye(n), filled(SHIP_MOTION, turn_time=self.turn_time)
        self._height_variance = float(start.covariance[ERROR.height, ERROR.height])
        self.numbers = np.zeros(SHIP_NUMBERS + n)
        self._bind()
        self.time = start.time
        self.position[:] = start.position
        self._tabulate()
        psi = float(start.attitude[2])
        self.x[SHIP.heading] = psi
        P = np.zeros((n, n))
        P[:2, :2] = start.covariance[:2, :2]
        P[range(SHIP.speed, n), range(SHIP.speed, n)] = variance
        P[SHIP.heading, SHIP.heading] = start.covariance[ERROR.heading, ERROR.heading]
        # The initial velocity over ground is a measurement of u and c; the prior of u has no information.
        P[SHIP.speed, SHIP.speed] = 1e4
        north, east = start.velocity[:2].tolist()
        self.x[SHIP.speed] = cos(psi) * north + sin(psi) * east
        residual, H, noise = np.empty(2), np.zeros((2, n)), np.empty((2, 2))
        ground = Aid(VELOCITY)
        observe_ship(ground, filled(SHIP_NOISE), self.position, self.x, north, east, residual, H, noise)
        cross = P @ H.T
        horizontal = slice(ERROR.velocity, ERROR.velocity + 2)
        noise = start.covariance[horizontal, horizontal] + self.sway**2 * np.eye(2)
        gain = np.linalg.solve(H @ cross + noise, cross.T).T
        self.x += gain @ residual
        joseph = np.eye(n) - gain @ H
        P = joseph @ P @ joseph.T + gain @ noise @ gain.T
        return np.ascontiguousarray(P)

    def _motion(self) -> tuple[StateBlock, ...]:
        """The states of the ship behind its position. Those of speed and heading at the start are set in `begin`."""
        return (
            StateBlock("speed", 1, "m_s", 0.0, "random_walk", self.acceleration),
            StateBlock("heading", 1, "deg", 0.0),
            StateBlock.stationary("turn_rate", 1, "deg_s", self.turn_rate, self.turn_time),
            StateBlock.stationary("current", 2, "m_s", self.current, self.current_time),
        )

    def _calibrate(self, sheet: Datasheet) -> None:
        """The states of an instrument where the compiled loops expect them: the bias of what it measures, and scale."""
        equation, own = equation_of(sheet), has_measurement_function(sheet)
        if own and not self.observes(sheet):
            return
        if not own and not (equation.is_heading or equation.is_position or equation.through_water):
            return
        states = merged_states(sheet)
        bias = states.get("bias", [])[: None if own else 2 if equation.is_position else 1]
        if any(rates.variance or rates.noise for rates in bias):
            self.bias_at[sheet.name] = self.blocks.add(sheet.name, "bias", bias)
        if "scale" in states:
            self.scale_at[sheet.name] = self.blocks.add(sheet.name, "scale", states["scale"])

    def _tabulate(self) -> None:
        """The instruments: those for the kernels, and those with an equation of their own."""
        self.aids: dict[str, Aid] = {}
        self._noise: dict[str, Array] = {}
        self.own: dict[str, ShipObservation] = {}
        for name, sheet in self.instruments.items():
            if not self.observes(sheet):
                continue
            if has_measurement_function(sheet):
                white, places = _white(sheet), self.blocks.places(name, 0)
                self.own[name] = ShipObservation(sheet, places, white, self._height_variance, self.sway**2)
            else:
                code, self._noise[name] = _noise(sheet, self.sway)
                arm = np.array(sheet.lever_arm, dtype=np.float64)
                self.aids[name] = Aid(code, arm, self.bias_at.get(name, -1), self.scale_at.get(name, -1))
        self.names = list(self.aids)
        self.many = channel_readings_of(self.own, self.bias_at, ShipReadings)

    def components(self, instrument: Datasheet) -> int:
        """Without the height and the velocity down."""
        known = self.aids.get(instrument.name)
        return super().components(instrument) if known is None else components_of(known)

    def carry(self, error: Array, elapsed: float) -> None:
        """Take an error, or several in columns, through the last propagation, in place."""
        error[...] = self.transition @ error

    def measure(self, measurement: Measurement) -> Linearised | None:
        """Linearise one measurement."""
        if measurement.instrument in self.own:
            name, state = measurement.instrument, PlacedShip(self.position, self.x)
            found = self._compare_own(name, measurement.time, measurement.value, state, measurement.side)
            if found is None:
                return None
            noise = self.own[name].noise(found, float(self.x[SHIP.heading]))
            return Linearised(found.innovation, found.jacobian, noise)
        return super().measure(measurement)

    def observe_own(
        self, name: str, time: float, value: Array, state: NamedState, side: Array = NO_SIDE
    ) -> tuple[Array, Array] | None:
        """As `ErrorModel.observe_own`, at a `PlacedShip`."""
        assert isinstance(state, PlacedShip)
        found = self._compare_own(name, time, value, state, side)
        return None if found is None else (found.innovation, found.jacobian)

    def _compare_own(
        self, name: str, time: float, value: Array, state: PlacedShip, side: Array
    ) -> PredictedReading | None:
        own = self.own[name]
        return own.compare(own.point(time, state, side), value, state.x, 0, self.bias_at.get(name, -1))

    def move_all(self, states: tuple[Array, ...], elapsed: Array, jacobian: Array | None = None) -> None:
        """As `MovingModel.move_all`."""
        if jacobian is None:
            jacobian = np.empty((len(elapsed), self.size, self.size))
        position, x = states
        sail_ships(position, x, elapsed, self.decay, self.turn_time, jacobian)

    def difference_all(self, states: tuple[Array, ...], others: tuple[Array, ...]) -> Array:
        """As `MovingModel.difference_all`."""
        (position, x), (other, other_x), difference = states, others, np.empty_like(states[1])
        differ_ships(position, x, other, other_x, difference)
        return difference

    def retract_all(self, states: tuple[Array, ...], steps: Array) -> None:
        """As `MovingModel.retract_all`."""
        position, x = states
        correct_ships(position, x, steps)

    def estimate(self, covariance: Array) -> Estimate:
        """Horizontal position and velocity, and heading."""
        psi = float(self.x[SHIP.heading])
        velocity, full = np.zeros(3), np.zeros((9, 9))
        describe_ship(self.x, covariance, self.sway, velocity, full)
        full[ERROR.height, ERROR.height] = self._height_variance
        full[ERROR.sinking, ERROR.sinking] = VERTICAL_SPEED**2
        for angle in range(ERROR.attitude, ERROR.heading):
            full[angle, angle] = HEEL**2
        attitude = np.array([0.0, 0.0, wrap(psi)])
        estimate = Estimate(self.time, self.position.copy(), velocity, attitude, full, ESTIMATED)
        if self.blocks.brought or self.reports_all:
            estimate.states = self.blocks.report(self.x, 0, covariance, self.reports_all)
        return estimate


def components_of(aid: Aid) -> int:
    """Number of components of an instrument that the model predicts."""
    return 1 if aid.code in (HEADING, LOG) else 2


def _noise(sheet: Datasheet, sway: float) -> tuple[int, Array]:
    """Measurement equation of an instrument, and its noise, for `simnav.estimators.models.ship_kernels`."""
    lz = float(sheet.lever_arm[2])
    white, equation = _white(sheet), equation_of(sheet)
    if equation.is_heading or equation.through_water:
        return LOG if equation.through_water else HEADING, filled(SHIP_NOISE, first=white[0])
    if equation.is_position:
        first, second = white[:2] + (HEEL * lz) ** 2
        return POSITION, filled(SHIP_NOISE, first=first, second=second)
    first, second = with_variance(white, bias_of(sheet).slow)[:2]  # a velocity's bias has no state
    if equation.is_fix:
        return VELOCITY, filled(SHIP_NOISE, first=first, second=second, sway=sway**2)
    aside = (HEEL * sway) ** 2
    return BODY_VELOCITY, filled(
        SHIP_NOISE, first=first + aside, second=second + aside, sway=sway**2, scale=sheet.scale**2,
        misalignment=float(sheet.misalignment[2]) ** 2,
    )  # fmt: skip


def _white(sheet: Datasheet) -> Array:
    """(d,) variances of the white noise."""
    return np.asarray(sheet.sigma**2 + bias_of(sheet).white_variance())


#: North, east, their velocities, and heading.
ESTIMATED = np.array([True, True, False, True, True, False, False, False, True])
