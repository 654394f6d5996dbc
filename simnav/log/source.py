"""A recorded log with the same interface as the simulator.

The measurements and the reference are those of the log; a seed chooses the recording and draws the initial error, the
faults and the instruments that are simulated from the reference.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Protocol, Self

import numpy as np

from simnav.geometry.earth import gravity
from simnav.kinds import HEADING
from simnav.log.channel import Series, list_recordings, read_channel, skip_of
from simnav.log.imu_series import ImuSeries, read_imu
from simnav.log.quality import Quality, graded
from simnav.log.reference import Reference
from simnav.log.table import LogError, LogWarning
from simnav.recording import AidStream, Block, ImuLabels
from simnav.sensors import build_layers, labels
from simnav.streams import stream as random_stream
from simnav.timing import TIME_TOLERANCE
from simnav.types import KINDS, Array, ImuSamples, NavigationStates, ReferenceStates, TapStates
from simnav.world.initial_state import draw_start

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from simnav.log.spec import RecordedSpec
    from simnav.sensors import AidSpec, AnyFault
    from simnav.types import Instruments
    from simnav.world import Surroundings

__all__ = ["LogSource"]
#: Below this speed the course says nothing about the heading [m/s].
_LEAST_SPEED = 1.0
#: A vessel moves if it has this speed over so long [s].
_MOVING = 5.0
#: A heading is unknown where its initial standard deviation is at least this [rad].
_UNKNOWN_HEADING = math.radians(90.0)
#: How late the first measured heading may be, to be that of a vessel that lies still [s].
_EARLY = 60.0
#: How long the accelerometers are averaged for roll and pitch [s].
_LEVELLING = 2.0


class RecordedScenario(Protocol):
    """What a source reads of a `simnav.scenario.Scenario`, which is on a floor above."""

    @property
    def id(self) -> str:
        """Name and version."""
        ...

    @property
    def log(self) -> RecordedSpec | None:
        """The files."""
        ...

    @property
    def duration(self) -> float:
        """Length of the run [s]."""
        ...

    @property
    def step(self) -> float:
        """From one estimate to the next [s]."""
        ...

    @property
    def aids(self) -> Mapping[str, AidSpec]:
        """The aiding instruments."""
        ...

    @property
    def faults(self) -> Sequence[AnyFault]:
        """The faults."""
        ...

    @property
    def initial_error(self) -> Any:
        """Standard deviations of the initial state."""
        ...

    @property
    def draws(self) -> Mapping[str, Any]:
        """The drawn values."""
        ...

    def drawn(self, seed: int) -> Self:
        """The scenario of one run."""
        ...

    def root(self, seed: int) -> int:
        """The number from which random streams start."""
        ...

    def surround(self, seed: int) -> Surroundings:
        """The surroundings of one run."""
        ...

    def instruments_sheet(self) -> Instruments:
        """The datasheets."""
        ...

    def actual_sheet(self) -> Instruments | None:
        """The true datasheets."""
        ...


class LogSource:
    """One run over one recording of a log.

    Time 0 is the first epoch of the reference that the IMU covers (after ``log.skip``). The run is as long as the
    scenario says, or as the recording reaches. White noise labels (``AidStream.sigma``) of real measurements are those
    of the datasheet, since the true ones are not known.

    Parameters
    ----------
    scenario : Scenario
        With a ``[log]``.
    seed : int
        Recording number ``seed`` modulo their count; and the run's randomness.

    Attributes
    ----------
    recording : str
        Name of the recording.
    note : str
        Which recording this is, and what in it is not measured.
    surroundings : Surroundings
        The surroundings of the run.
    instruments, start, initial_truth, faults, duration, step
        As of the simulator. Components that the reference lacks are NaN in ``initial_truth`` and in the truth of the
        blocks; in ``start`` they are made from the motion and the accelerometers.

    Raises
    ------
    LogError
        If the log is absent or cannot be used: one sentence with file, line and column.
    """

    def __init__(self, scenario: RecordedScenario, seed: int):
        scenario = scenario.drawn(seed)
        self.scenario: Any = scenario
        root = scenario.root(seed)
        log = scenario.log
        if log is None:
            raise LogError(f"the scenario {scenario.id!r} has no [log]; it is simulated")
        if log.rows_by_seed:
            log = log.with_rows(int(random_stream(root, "rows of a log").integers(1 << 30)))
        names = list_recordings(log)
        self.recording = names[seed % len(names)]
        self.instruments = scenario.instruments_sheet()
        self.step = float(scenario.step)
        imu = None if log.imu is None else read_imu(log, log.imu, self.recording)
        reference, self._quality = _reference(log, self.recording, imu)
        begin = _begin(log, self.recording, reference, imu)
        end = min(reference.time[-1], math.inf if imu is None else imu.edge[-1])
        self.duration = self._length(scenario.duration, float(end - begin))
        self._reference, self._begin, self._now = reference, begin, 0.0
        self._imu = None
        notes = [f"recording {self.recording!r}"] if self.recording else []
        if self._quality is not None and self._quality.sentence:
            notes.append(self._quality.sentence)
        if imu is not None and log.imu is not None:
            self._imu, resampled = _regrid(imu, begin, self.instruments.imu.rate, self.duration)  # type: ignore[union-attr]
            notes.append(f"IMU samples were {log.imu.samples}" + (", resampled" if resampled else ""))
        self.initial_truth = self._states(np.zeros(1))
        self.surroundings = scenario.surround(seed)
        self._aids = self._measure(scenario, log, root, self.surroundings)
        heading = _measured_heading(self._aids)
        if heading is None and scenario.initial_error.attitude[2] >= _UNKNOWN_HEADING:
            heading = 0.0, "unknown"
        true_start, made = _start(reference, self.initial_truth, imu, begin, heading)
        aligned = imu is not None and scenario.initial_error.unknown
        if "heading (unknown)" in made and not aligned:
            warnings.warn(
                f"{self._called()}: the heading at the start is unknown; only estimators that search it can use such a "
                "start, as their lines in 'simnav list estimators' say; the others take it as nearly known. With an "
                "IMU and attitude_deg = [., ., 180] of [initial_error] all rows of simnav find it",
                LogWarning,
                2,
            )
        if made:
            notes.append(f"start {' and '.join(made)} not from the reference")
        simulated = [n for n, i in log.instruments.items() if i.source == "reference"]
        if simulated:
            notes.append(f"simulated from the reference: {', '.join(simulated)}")
        self.note = "; ".join(notes)
        self.start = draw_start(true_start, scenario.initial_error.covariance(), root, scenario.initial_error.factors())
        self._imu_labels: ImuLabels | None = None
        if self._imu is not None and any("imu" in f.instruments for f in scenario.faults):
            n = len(self._imu)
            self._imu_labels = ImuLabels(np.zeros(n, np.uint32), np.zeros((n, 6)))
        self.faults = labels(scenario.faults, self.duration, {n: s.kind for n, s in scenario.aids.items()})
        for layer in build_layers(scenario.faults, root):
            self._aids = {n: layer.laid_over(s) for n, s in self._aids.items()}
            if self._imu is not None:
                self._imu, self._imu_labels = layer.apply_imu(self._imu, self._imu_labels)

    def _called(self) -> str:
        return f"recording {self.recording!r}" if self.recording else "the recording"

    def _length(self, wanted: float, available: float) -> float:
        if wanted <= available + TIME_TOLERANCE:
            return float(wanted)
        steps = math.floor(available / self.step + 1e-9)
        if steps < 1:
            raise LogError(f"{self._called()}: IMU and reference have only {available:.3f} s in common")
        length = steps * self.step
        message = f"{self._called()}: the run ends at {length:g} s, where the log does ({wanted:g} s are wanted)"
        warnings.warn(message, LogWarning, 3)
        return length

    def taps(self, time: Array) -> TapStates:
        """What an instrument should see at n times of the run [s]; ValueError if the reference has no attitude."""
        return replace(self._reference.taps(self._begin + time), time=time)

    def _states(self, time: Array) -> NavigationStates:
        found = replace(self._reference.states(self._begin + time), time=time)
        if self._quality is None:
            return found
        sigma, solution = self._quality.at(self._begin + time)
        return ReferenceStates(found.time, found.position, found.velocity, found.attitude, sigma, solution)

    def reference_states(self, time: Array) -> NavigationStates:
        """The reference at n times on the clock of the log [s]; NaN where it has nothing to say."""
        return self._reference.states(time)

    def _measure(
        self, scenario: RecordedScenario, log: RecordedSpec, seed: int, surroundings: Surroundings
    ) -> dict[str, AidStream]:
        """The streams of all aiding instruments, without faults."""
        streams = {}
        for name, spec in scenario.aids.items():
            where = log.instruments[name]
            sheet = self.instruments[name]
            if where.source == "reference":
                first = 1 if spec.phase <= TIME_TOLERANCE else 0
                count = math.floor((self.duration - spec.phase) * spec.rate + 1e-9) + 1
                time = spec.phase + np.arange(first, count) / spec.rate
                try:
                    tap = self.taps(time)
                except ValueError as error:
                    raise LogError(f"instruments.{name}: {error}") from None
                streams[name] = spec.actual().install(name, seed, surroundings).sense(tap)
                continue
            series = read_channel(log, where.channel(), spec.kind, self.recording)
            time = series.time - self._begin
            inside = (time > TIME_TOLERANCE) & (time <= self.duration + TIME_TOLERANCE)
            if not inside.any():
                raise LogError(
                    f"{series.source}: none of the {len(time)} measurements of {name!r} lies within the run; they are "
                    f"at {time[0]:.3f} to {time[-1]:.3f} s of it (check time_unit, clock and offset_s)"
                )
            often = float(np.median(np.diff(time[inside]))) if inside.sum() > 2 else math.inf
            if often * sheet.rate < 0.8:
                warnings.warn(
                    f"{series.source}: {name!r} is measured every {often:.3g} s, but rate_hz = {sheet.rate:g}, and the "
                    f"environment has room for no more; set rate_hz = {1.0 / often:.3g}, or take every "
                    f"{round(1.0 / (often * sheet.rate))}th row (every)",
                    LogWarning,
                    3,
                )
            value = series.value[inside]
            sigma = np.tile(sheet.sigma, (len(value), 1))
            if series.sigma is not None:
                stated = series.sigma[inside]
                sigma = np.where(np.isfinite(stated), stated, sigma)
            nothing = np.zeros(len(value), np.uint32)
            stream = AidStream(name, spec.kind, time[inside], value, nothing, np.zeros_like(sigma), sigma, np.empty(0))
            streams[name] = stream if series.sigma is None else replace(stream, side=sigma.copy())
        return streams

    def advance(self, until: float) -> Block:
        """The next stretch of the run, up to a time [s] (at most the duration)."""
        until = min(float(until), self.duration)
        begin, self._now = self._now, until
        if until < begin - TIME_TOLERANCE:
            raise ValueError(f"the run is at {begin:g} s and cannot go back to {until:g} s")
        first, last = (math.floor(t / self.step + 1e-6) for t in (begin, until))
        aids = {n: _cut(s, begin, until) for n, s in self._aids.items()}
        imu, labels = None, None
        if self._imu is not None:
            a, b = np.searchsorted(self._imu.time, [begin + TIME_TOLERANCE, until + TIME_TOLERANCE], side="right")
            imu = self._imu[a:b]
            if self._imu_labels is not None:
                labels = ImuLabels(self._imu_labels.faults[a:b], self._imu_labels.fault_error[a:b])
        truth = self._states(self.step * np.arange(first + 1.0, last + 1.0))
        return Block(begin, until, imu, labels, aids, truth)


def _cut(s: AidStream, begin: float, until: float) -> AidStream:
    edges = [begin + TIME_TOLERANCE, until + TIME_TOLERANCE]
    a, b = np.searchsorted(s.time, edges, side="right")
    c, d = np.searchsorted(s.dropped, edges, side="right")
    return replace(s.rows(slice(a, b)), dropped=s.dropped[c:d])


def _reference(log: RecordedSpec, recording: str, imu: ImuSeries | None) -> tuple[Reference, Quality | None]:
    spec = log.reference

    def series(name: str) -> Series | None:
        channel = getattr(spec, name)
        return None if channel is None else read_channel(log, channel, name, recording)

    position = series("position")
    assert position is not None
    position, quality = graded(log, recording, position)
    found = Reference(position, series("velocity"), series("attitude"), spec.max_gap, spec.lever_arm, imu)
    return found, quality


def _begin(log: RecordedSpec, recording: str, reference: Reference, imu: ImuSeries | None) -> float:
    """The first epoch of the reference that the IMU covers and at which all that it has is there."""
    earliest = float(reference.time[0] if imu is None else imu.edge[0]) + skip_of(log, recording)
    time = reference.time[reference.time >= earliest - TIME_TOLERANCE]
    if imu is not None:
        time = time[time < imu.edge[-1]]
    states = reference.states(time)
    whole = np.isfinite(states.position).all(axis=1)
    if log.reference.velocity is not None:
        whole &= np.isfinite(states.velocity[:, :2]).all(axis=1)
    if log.reference.attitude is not None:
        whole &= np.isfinite(states.attitude[:, 2])
    if not whole.any():
        other = "" if imu is None else f" and of the IMU ({imu.source}: {imu.edge[0]:.3f} to {imu.edge[-1]:.3f} s)"
        raise LogError(
            f"the clocks of the reference ({reference.time[0]:.3f} to {reference.time[-1]:.3f} s){other} have no epoch "
            f"in common that has all parts of the reference; check time_unit, scale, offset_s, spacing_s and skip_s"
        )
    if log.begin == "moving":
        speed = np.hypot(*reference.velocity_ahead(time, _MOVING).T)
        whole &= speed >= _LEAST_SPEED
        if not whole.any():
            raise LogError(
                f"[log] begin = 'moving': the reference never moves by {_LEAST_SPEED:g} m/s (at most "
                f"{np.max(speed, initial=0.0):.2g} m/s); leave 'begin' out"
            )
    return float(time[whole][0])


def _regrid(imu: ImuSeries, begin: float, rate: float, duration: float) -> tuple[ImuSamples, bool]:
    """The samples on the grid of the run, and whether they had to be resampled.

    Resampling interpolates the integral linearly, which keeps every increment that falls into a step.
    """
    count = round(duration * rate)
    grid = np.arange(count + 1) / rate
    edge = imu.edge - begin
    interval = np.full(count, 1.0 / rate)
    first = int(np.searchsorted(edge, -TIME_TOLERANCE))
    here = edge[first : first + count + 1]
    if len(here) == count + 1 and np.max(np.abs(here - grid)) < 1e-6:
        mean, resampled = imu.mean[first : first + count], False
    else:
        integral = np.zeros((len(edge), 6))
        np.cumsum(imu.mean * np.diff(edge)[:, None], axis=0, out=integral[1:])
        on_grid = np.stack([np.interp(grid, edge, column) for column in integral.T], axis=-1)
        mean, resampled = np.diff(on_grid, axis=0) * rate, True
    rates, forces = np.ascontiguousarray(mean[:, :3]), np.ascontiguousarray(mean[:, 3:])
    return ImuSamples(grid[1:], interval, rates, forces), resampled


def _measured_heading(aids: Mapping[str, AidStream]) -> tuple[float, str] | None:
    """The first heading that an instrument measured in the first minute, and its name."""
    for name, aid in aids.items():
        if KINDS[aid.kind].equation == HEADING and len(aid) and aid.time[0] <= _EARLY:
            return float(aid.value[0, 0]), name
    return None


def _start(
    reference: Reference,
    truth: NavigationStates,
    imu: ImuSeries | None,
    begin: float,
    heading: tuple[float, str] | None,
) -> tuple[NavigationStates, list[str]]:
    """The state at time 0, complete, and what of it is not the reference's.

    The heading is that of the reference, else the course of a vessel that moves, else the one that is given.
    """
    velocity, attitude, made = truth.velocity[0].copy(), truth.attitude[0].copy(), []
    derived = reference.motion(np.array([begin]))[0][0]
    if not np.isfinite(velocity[:2]).all():
        made.append("velocity (differentiated positions)")
    velocity = np.where(np.isfinite(velocity), velocity, derived)
    if not np.isfinite(attitude[2]):
        ahead = reference.velocity_ahead(np.array([begin]), _MOVING)[0]
        forward = velocity if np.hypot(velocity[0], velocity[1]) >= _LEAST_SPEED else ahead
        speed = float(np.hypot(forward[0], forward[1]))
        if speed >= _LEAST_SPEED:
            attitude[2] = math.atan2(forward[1], forward[0])
            made.append("heading (course over ground)")
        elif heading is not None:
            attitude[2] = heading[0]
            made.append(f"heading ({heading[1]})")
        else:
            raise LogError(
                f"the reference has no attitude, the vessel is too slow at the start for a heading from its course "
                f"({speed:.2g} m/s, {_LEAST_SPEED:g} are wanted), and no instrument measures one; leave out the part "
                f"before by begin = 'moving' or skip_s of [log], or give the estimators an unknown heading: "
                f"attitude_deg = [., ., 180] of [initial_error]"
            )
    if not np.isfinite(attitude[:2]).all():
        attitude[:2] = 0.0
        if imu is not None:
            attitude[:2] = _level(reference, imu, begin, attitude[2], truth.position[0])
            made.append("roll and pitch (accelerometers)")
        else:
            made.append("roll and pitch (zero)")
    return NavigationStates(truth.time, truth.position, velocity[None], attitude[None]), made


def _level(reference: Reference, imu: ImuSeries, begin: float, heading: float, position: Array) -> Array:
    """Roll and pitch from the mean specific force over a short time, less the acceleration of the reference."""
    middle = 0.5 * (imu.edge[1:] + imu.edge[:-1])
    here = (middle > begin) & (middle < begin + _LEVELLING)
    if not here.any():
        return np.zeros(2)
    time = middle[here]
    course, acceleration = reference.motion(time)
    turned = np.arctan2(course[:, 1], course[:, 0])
    turned += heading - turned[0]
    c, s = np.cos(turned), np.sin(turned)
    level = np.stack(
        [
            c * acceleration[:, 0] + s * acceleration[:, 1],
            c * acceleration[:, 1] - s * acceleration[:, 0],
            acceleration[:, 2] - gravity(position[0], position[2]),
        ],
        axis=-1,
    ).mean(axis=0)
    force = imu.mean[here, 3:].mean(axis=0)
    # Small tilts: the force that is missing forward is gravity on the pitch, the one to starboard on the roll.
    g = -level[2]
    pitch = math.asin(max(-1.0, min(1.0, (force[0] - level[0]) / g)))
    roll = -math.asin(max(-1.0, min(1.0, (force[1] - level[1]) / g)))
    return np.array([roll, pitch])
