"""An inertial error model that is linearised about the truth, with a state for each error that the simulator draws.

It is the model of the oracles. Their bound is that of the problem linearised about the truth, so an oracle must not
linearise at another point: with a heading that is wrong by a radian an extended Kalman filter does this, and may
diverge.

The state is a **nominal** trajectory, and the error vector y (estimate minus nominal). The nominal trajectory starts
each step of the run at the truth, and follows the IMU samples to the end of the step, less their mean errors in it.
These are the nominal biases, with which it also ends at the truth. With the errors left in, a large bias would be a
specific force that the vessel has not: turned by a wrong heading, it would seem to tell the heading. With the
transition matrix Phi, the Jacobian H and the innovation r at the nominal trajectory::

    y(t + dt) = Phi y(t),    y += old minus new nominal  (where a step begins),    innovation = r - H y

So the estimate, nominal plus y, is that of a linear Kalman filter for any size of y. The effect of the samples' errors
is in y, by the nominal biases. If the truth is not known (NaN in a recorded log), the estimate itself is the next
nominal state, as in an extended Kalman filter, and the nominal biases stay.

`simnav.estimators.models.inertial` combines some errors in one state. This model also has separate states for

- the turn-on bias beside the in-run bias, of the IMU and of each aid
- scale factors and misalignments of the IMU: they act as a bias in proportion to the rate or force
- the scale factor of each velocity and depth, the misalignment of a DVL, the deviation of a magnetic compass
- the processes that a datasheet declares by name, of first or second order, with their factors

If the velocity of the water is given, it is treated as known. A speed log then measures the velocity over the ground.

The states that instruments bring along (`simnav.blocks`) have no known truth. Where a step begins, their estimate is
the next nominal value, as in an extended Kalman filter.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import islice
from math import remainder, tau
from typing import NamedTuple

import numpy as np

from simnav.geometry.earth import principal_radii
from simnav.geometry.rotation import dcm_from_rpy, rotation_vector_from_dcm, skew
from simnav.types import (
    Array,
    Datasheet,
    Estimate,
    ImuSamples,
    InitialState,
    Instruments,
    Measurement,
    NavigationStates,
    TriadDatasheet,
)

from .base import ErrorModel, Linearised
from .declared_errors import errors_of, errors_of_triad
from .equations import equation_of
from .error_states import merged, separate_states
from .inertial import InertialModel, roll_pitch_yaw
from .inertial_errors import ERROR, PART
from .propagation import correct_inertial
from .state_blocks import StateBlocks
from .truth_linearised_factors import TruthLinearisedFactors

__all__ = ["TruthLinearisedModel"]

_NAV, _INERTIAL = ERROR.gyroscope_bias, ERROR.calibration
#: Velocity and attitude, and the biases of the IMU that change them in a step.
_MOVING, _BIASES = slice(ERROR.velocity, _NAV), slice(_NAV, _INERTIAL)
#: Times closer than this are one and the same [s].
_SAME = 1e-6
#: Three less the trace of a rotation matrix that is a vector product to third order: an angle of 3 mrad.
_SMALL = 1e-5


class _ImuError(NamedTuple):
    """A state that acts as a bias of one axis of the IMU (0 to 5), times the motion along ``times`` (-1: times 1)."""

    axis: int
    times: int


class _AidErrors(NamedTuple):
    """Places of an aid's states in y; -1 or empty where it has none. ``bias`` holds (component, place).

    ``processes`` are those that the datasheet declares by name: component, place, and factors of the state.
    """

    bias: list[tuple[int, int]]
    scale: int
    misalignment: int
    deviation: int
    processes: list[tuple[int, int, TruthLinearisedFactors]]


class TruthLinearisedModel(ErrorModel):
    """The model of the module.

    Parameters
    ----------
    truth : NavigationStates
        The n true states at the start of the run and at the ends of all steps.
    water : (n, 3) array, optional
        Velocity of the water at these times, north-east-down [m/s]. None: not known; the current along the keel is a
        state of each speed log.
    """

    def __init__(self, truth: NavigationStates, water: Array | None = None):
        self.truth, self.water = truth, water
        self._known = np.all(np.isfinite(np.hstack([truth.position, truth.velocity, truth.attitude])), axis=1)
        self._dcm = dcm_from_rpy(truth.attitude)
        meridian, prime = principal_radii(truth.position[:, 0])
        height = truth.position[:, 2]
        #: Metres a radian to the north and to the east, and a metre of height down.
        self._metres = np.stack(
            [meridian + height, (prime + height) * np.cos(truth.position[:, 0]), -np.ones(len(truth))], axis=1
        )

    def begin(self, start: InitialState, instruments: Instruments) -> Array:
        """Set the state; UnsuitableScenario without an IMU."""
        self._imu_errors: list[_ImuError] = []
        self._aids: dict[str, _AidErrors] = {}
        self.blocks = StateBlocks(_INERTIAL)
        imu = instruments.imu
        if imu is not None:
            triads = [
                self._triad(f"{imu.name}.{name}", triad, unit, first)
                for name, triad, unit, first in (
                    ("gyroscope", imu.gyroscope, "deg_s", 0), ("accelerometer", imu.accelerometer, "m_s2", 3),
                )
            ]  # fmt: skip
            imu = replace(imu, gyroscope=triads[0], accelerometer=triads[1])
        sheets = [self._aid(sheet) for sheet in instruments.values()]
        self.nominal = InertialModel()
        own = self.nominal.begin(start, Instruments(sheets, imu, instruments.step))
        self.sheets, self.time = instruments, start.time
        self.blocks.bring(s for s in instruments.values() if s.name in self.nominal.own)
        #: Places of the blocks in y, and in the error of the nominal state, where their values are.
        self._block_at = [(self.blocks.at[label], self.nominal.blocks.at[label]) for label in self.blocks.brought]
        n = self.size = self.blocks.size
        variance, _, _ = self.blocks.columns(_INERTIAL)
        covariance = np.zeros((n, n))
        covariance[:_INERTIAL, :_INERTIAL] = own[:_INERTIAL, :_INERTIAL]
        covariance[range(_INERTIAL, n), range(_INERTIAL, n)] = variance
        self._unused = np.zeros_like(own)
        self._axes = np.array([_NAV + e.axis for e in self._imu_errors], dtype=np.intp)
        self._times = np.array([e.times for e in self._imu_errors], dtype=np.intp)
        self.transition = np.eye(n)
        self.y = np.zeros(n)
        self._integral: tuple[Array, Array] | None = None
        self._anchor()
        return covariance

    def _triad(self, name: str, triad: TriadDatasheet, unit: str, first: int) -> TriadDatasheet:
        """Make the states of a triad; return its datasheet with what is left for the inertial model.

        The inertial model has a state for each in-run bias. Beside one, the rest of the bias is a state here.
        """
        errors = errors_of_triad(triad, unit)
        bias = errors["bias"]
        beside = tuple(p for p in bias.slow if p.process != "gauss_markov")
        if beside and len(beside) < len(bias.slow):
            self.blocks.add(name, "bias", merged(replace(bias, processes=beside)))
            self._imu_errors += [_ImuError(axis, -1) for axis in range(first, first + 3)]
            triad = replace(triad, bias=0.0, rate_random_walk=0.0)
        scale, misalignment = (iter(separate_states(errors[name])) for name in ("scale", "misalignment"))
        for axis in range(first, first + 3):
            for other in range(first, first + 3):
                for _, _, rates in islice(scale if other == axis else misalignment, 1):
                    self.blocks.add(name, f"axis_{axis - first}_by_{other - first}", [rates])
                    self._imu_errors.append(_ImuError(axis, other))
        return replace(triad, scale=0.0, misalignment=0.0)

    def _aid(self, sheet: Datasheet) -> Datasheet:
        """Make the states of an aid; return its datasheet with what is left for the inertial model."""
        name, errors, bias = sheet.name, errors_of(replace(sheet, processes=())), []
        for process, component, rates in separate_states(errors["bias"]):
            bias.append((component, self.blocks.add(name, f"{process.name}_{component}", [rates])))
        if "current" in errors and self.water is None:  # along the keel
            bias.append((0, self.blocks.add(name, "current", merged(errors["current"])[:1])))
        at = {
            error: self.blocks.add(name, error, merged(errors[error]))
            for error in ("scale", "misalignment", "deviation")
            if error in errors and errors[error].processes
        }
        scale, misalignment, deviation = (at.get(error, -1) for error in ("scale", "misalignment", "deviation"))
        self._aids[name] = _AidErrors(bias, scale, misalignment, deviation, self._processes(sheet))
        none = np.zeros_like(sheet.bias)
        white = sheet.bias_instability if errors["bias"].fast else none
        return replace(
            sheet, bias=none, bias_instability=white, scale=0.0, misalignment=np.zeros(3), processes=(),
            timing=None,  # the times of validity are known
        )  # fmt: skip

    def _processes(self, sheet: Datasheet) -> list[tuple[int, int, TruthLinearisedFactors]]:
        """Make the states of the processes that a datasheet declares by name, each as it is."""
        found = []
        for process in sheet.processes:
            factors = TruthLinearisedFactors(process.factors, self.truth)
            block = process.block if process.exact is None else process.exact
            for component, rates in enumerate(block.rates()):
                label = f"{process.name}_of_{component}"
                if process.second_order and rates.variance:
                    found.append(
                        (component, self.blocks.add_second_order(sheet.name, label, process, component), factors)
                    )
                elif rates.variance or rates.noise:
                    found.append((component, self.blocks.add(sheet.name, label, [rates]), factors))
        return found

    def _anchor(self) -> None:
        """Where a step begins: go on from the truth; where it is not known, from the estimate."""
        k = self._epoch()
        if k < 0:
            return
        nominal, y = self.nominal, self.y
        for mine, theirs in self._block_at:
            nominal.calibration[theirs.start - _INERTIAL : theirs.stop - _INERTIAL] += y[mine]
            y[mine] = 0.0
        if not self._known[k]:
            position, velocity, dcm = self._navigation()
            y[:_NAV] = 0.0
        else:
            position, velocity, dcm = self.truth.position[k], self.truth.velocity[k], self._dcm[k]
            y[:_NAV] += self._off(k)
        nominal.position[:], nominal.velocity[:], nominal.dcm[:] = position, velocity, dcm

    def _epoch(self) -> int:
        """Index of the present time among those of the truth; -1 between them."""
        k = min(int(np.searchsorted(self.truth.time, self.time - _SAME)), len(self.truth) - 1)
        return k if abs(self.truth.time[k] - self.time) <= _SAME else -1

    def _off(self, k: int) -> Array:
        """(9,) nominal state minus the truth of an epoch [m, m/s, rad]."""
        nominal = self.nominal
        position, turn = nominal.position - self.truth.position[k], nominal.dcm @ self._dcm[k].T
        position[1] = remainder(position[1], tau)
        if turn[0, 0] + turn[1, 1] + turn[2, 2] < 3.0 - _SMALL:
            about = rotation_vector_from_dcm(turn)
        else:
            about = 0.5 * np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
        return np.concatenate([position * self._metres[k], nominal.velocity - self.truth.velocity[k], about])

    def _reach_truth(self) -> None:
        """Choose the nominal biases with which the nominal trajectory ends the step at the truth, by going there once.

        They stay where samples are missing: what the velocity is off there is no error of samples.
        """
        k, nominal = self._epoch(), self.nominal
        if k < 0 or self._known[k : k + 2].sum() < 2:
            return
        numbers, held = nominal.numbers.copy(), nominal.held
        self._unused[:] = 0.0
        nominal.propagate(self._unused, self.truth.time[k + 1])
        off, complete = self._off(k + 1)[_MOVING], nominal.held == held
        nominal.numbers[:], nominal.next_sample[0] = numbers, 0
        if complete:
            change = np.linalg.solve(nominal.transition[_MOVING, _BIASES], off)
            nominal.bias -= change
            self.y[_BIASES] += change

    def _navigation(self) -> tuple[Array, Array, Array]:
        """Position, velocity and attitude matrix of the estimate."""
        nominal = self.nominal
        position, velocity, dcm = nominal.position.copy(), nominal.velocity.copy(), nominal.dcm.copy()
        correct_inertial(position, velocity, dcm, np.empty(6), np.empty(0), np.ascontiguousarray(self.y[:_INERTIAL]))
        return position, velocity, dcm

    def observes(self, instrument: Datasheet) -> bool:
        """As the inertial model."""
        return self.nominal.observes(instrument)

    def load(self, imu: ImuSamples | None) -> None:
        """Take the IMU samples of the step that follows."""
        self._anchor()
        self.nominal.load(imu)
        self._reach_truth()
        self._integral = None
        if imu is not None and len(imu) and any(e.times >= 0 for e in self._imu_errors):
            measured = np.hstack([imu.angular_rate, imu.specific_force])
            increments = (measured - self.nominal.bias) * imu.interval[:, None]
            total = np.vstack([np.zeros(6), np.cumsum(increments, axis=0)])
            self._integral = np.concatenate([[imu.time[0] - imu.interval[0]], imu.time]), total

    def _motion(self, first: float, last: float) -> Array:
        """(6,) mean angular rate and specific force over a part of the step."""
        if self._integral is None:
            return np.zeros(6)
        time, total = self._integral
        k = np.clip(np.searchsorted(time, (first, last)), 1, len(time) - 1)
        share = np.clip((np.array([first, last]) - time[k - 1]) / (time[k] - time[k - 1]), 0.0, 1.0)
        begin, end = total[k - 1] + share[:, None] * (total[k] - total[k - 1])
        mean: Array = (end - begin) / (last - first)
        return mean

    def propagate(self, covariance: Array, until: float) -> None:
        """Advance the state and its covariance."""
        elapsed = until - self.time
        if elapsed <= 0.0:
            return
        self._unused[:] = 0.0
        self.nominal.propagate(self._unused, until)
        phi, m = self.transition, _INERTIAL
        phi[:m, :m] = self.nominal.transition
        index = np.arange(m, self.size)
        decay, noise = self.blocks.step(elapsed)
        phi[index, index] = decay
        for at in self.blocks.clocks:
            phi[at, at + 1] = elapsed
        self.blocks.couple(phi, elapsed)
        if self._imu_errors:
            motion = self._motion(self.time, until)
            factor = np.append(motion, 1.0)[self._times]  # -1, for a bias, is the last
            phi[:_NAV, m : m + len(factor)] = factor * phi[:_NAV, self._axes]
        covariance[:] = phi @ covariance @ phi.T
        covariance[:m, :m] += self.nominal.process_noise
        covariance[index, index] += noise
        self.blocks.add_noise(covariance, elapsed)
        covariance[:] = 0.5 * (covariance + covariance.T)
        self.y = phi @ self.y
        self.time = until

    def carry(self, error: Array, elapsed: float) -> None:
        """Take an error, or several in columns, through the last propagation, in place."""
        error[:] = self.transition @ error

    def measure(self, measurement: Measurement) -> Linearised | None:
        """Linearise one measurement at the nominal state."""
        own = self.nominal.measure(measurement)
        if own is None:
            return None
        d, m = len(own.innovation), _INERTIAL
        innovation, jacobian = own.innovation.copy(), np.zeros((d, self.size))
        jacobian[:, :m] = own.jacobian[:, :m]
        if measurement.instrument in self.nominal.own:
            jacobian[:, PART.gyroscope_bias] = self._by_bias(measurement)
        for k, error in enumerate(self._imu_errors):
            if error.times < 0:
                jacobian[:, m + k] = jacobian[:, _NAV + error.axis]
        sheet, errors = self.sheets[measurement.instrument], self._aids[measurement.instrument]
        for mine, theirs in self._block_at:
            jacobian[:, mine] = own.jacobian[:, theirs]
        for component, at in errors.bias:
            jacobian[component, at] = 1.0
        for component, at, factors in errors.processes:
            reading = measurement.value - innovation  # what it should read
            jacobian[component, at] = factors.at(measurement.time, self.nominal, reading)[component]
        equation = equation_of(sheet)
        if equation.has_scale:
            u = measurement.value - innovation  # what it should read
            if equation.through_water and self.water is not None:
                forward = self.nominal.dcm[:, 0]
                water = np.array([np.interp(measurement.time, self.truth.time, w) for w in self.water.T])
                along = forward @ water
                u, innovation = u - along, innovation + along
                jacobian[0, PART.attitude] -= np.cross(forward, water)
            if errors.scale >= 0:
                jacobian[:, errors.scale] = u
            if errors.misalignment >= 0:
                jacobian[:, errors.misalignment : errors.misalignment + 3] = skew(u)
        if errors.deviation >= 0:
            heading = np.arctan2(self.nominal.dcm[1, 0], self.nominal.dcm[0, 0])
            jacobian[0, errors.deviation : errors.deviation + 2] = np.sin(heading), np.cos(heading)
        return Linearised(innovation - jacobian @ self.y, jacobian, own.noise)

    def _by_bias(self, measurement: Measurement) -> Array:
        """(d, 3) derivative of a reading that is predicted by a function, by the biases of the gyroscopes."""
        own = self.nominal.own[measurement.instrument]
        point = own.point(measurement.time, self.nominal.state_of_own(), measurement.side)
        return -own.by_angular_rate(point)

    def correct(self, dx: Array) -> None:
        """Add a correction to the state."""
        self.y += dx

    def snapshot(self) -> list[Array]:
        """Copies of what `correct` changes, and of the nominal state that it is an error of."""
        return [array.copy() for array in self._arrays()]

    def restore(self, snapshot: list[Array]) -> None:
        """Take corrections back."""
        for array, stored in zip(self._arrays(), snapshot, strict=True):
            array[:] = stored

    def _arrays(self) -> tuple[Array, ...]:
        nominal = self.nominal
        return self.y, nominal.position, nominal.velocity, nominal.dcm, nominal.bias, nominal.calibration

    def estimate(self, covariance: Array) -> Estimate:
        """The state as an estimate, all nine components."""
        position, velocity, dcm = self._navigation()
        estimate = Estimate(self.time, position, velocity, roll_pitch_yaw(dcm), covariance[:_NAV, :_NAV].copy())
        if self.blocks.brought or self.reports_all:
            values = self.y.copy()
            values[_BIASES] += self.nominal.bias
            for mine, theirs in self._block_at:
                values[mine] += self.nominal.calibration[theirs.start - _INERTIAL : theirs.stop - _INERTIAL]
            estimate.states = self.blocks.report(values, 0, covariance, self.reports_all)
        return estimate
