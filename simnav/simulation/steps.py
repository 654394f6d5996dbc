"""Many runs at once, step by step: compiled passes over shared arrays advance worlds, instruments and faults.

The random numbers of instruments and faults depend on the times only. They are drawn for several steps in advance (a
batch), by the classes of the block form (`Simulator.advance`), from the same streams, in the same order. Two kernels,
`simnav.world.motion.advance` and `sense`, compute all that depends on the motion, for all runs. The numbers are those
of the block form, bit for bit.

Vessels, instruments and faults of third parties have the block form only, and so have instruments with channels or with
named error processes. A run with one of them is advanced in blocks of one step.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from simnav.arrivals import Arrivals
from simnav.recording import AidStream, packets
from simnav.sensors.faults.layer import DISTURBS_IMU, STEPS_NOISE, FaultLayer
from simnav.sensors.observation import NUMBERS, CompiledInstrument
from simnav.sensors.stepwise import (
    BLOCKS,
    COMPILED,
    DUE,
    HELD,
    INERTIAL,
    LAYOUT,
    NOISE_STEP,
    OPERATION,
    UNTOUCHED,
    AidDraws,
    BatchProgress,
    Delivered,
    FaultLayers,
    ImuDraws,
    ImuSteps,
    SampleTimes,
    TriadTables,
    begin_step,
    sense,
    sense_imu,
    sort_out,
)
from simnav.simulation.simulator import Simulator
from simnav.timing import TIME_TOLERANCE
from simnav.true_state import TRUE_NUMBERS
from simnav.types import ImuSamples, Measurement, Measurements
from simnav.world import World, motion

__all__ = ["SteppedRuns"]

#: Number of steps that are drawn in advance the first time. The number is doubled each time.
FIRST_BATCH, LONGEST_BATCH = 4, 64
#: Attributes that hold shared arrays in records.
_RECORDS = (
    "delivered",
    "imu_steps",
    "_requested",
    "_times",
    "_triads",
    "_imu_draws",
    "_aid_draws",
    "_fault_layers",
)


class SteppedRuns:
    """n runs, each advanced by one step at a time.

    Parameters
    ----------
    n : int
        Number of runs that can be advanced together.

    Attributes
    ----------
    simulators : list of Simulator
        The simulator of each run; its vessel may be steered if it can.
    x : (n, k) array
        States of the worlds (`simnav.world.motion.STATE`), for runs whose trajectory is a `simnav.world.World`.
    step : (n,) int array
        Number of steps of each run so far.
    truth : (n, 9) array
        Position, velocity, roll, pitch and yaw at the end of the last step.
    count : (n,) int array
        Number of measurements in the last step, each reading of a channel by itself. For measurement k of run b:
        ``who[b, k]`` is the number of its instrument in ``names[b]``, ``when[b, k]`` its time [s], ``value[b, k]`` its
        value and ``faults[b, k]`` its label.
    samples : (n,) int array
        Number of IMU samples in the last step. The samples of run b are ``imu_time[b]``, ``imu_interval[b]``,
        ``rate[b]`` and ``force[b]``.
    """

    def __init__(self, n: int):
        self.n = n
        self.simulators: list[Simulator | None] = [None] * n
        self.names: list[list[str]] = [[] for _ in range(n)]
        self.kinds: list[list[str]] = [[] for _ in range(n)]
        self.step, self.truth = np.zeros(n, np.int64), np.zeros((n, 9))
        self.samples, self.count = np.zeros(n, np.int64), np.zeros(n, np.int64)
        # The last step of runs that have only the block form.
        self._packets: list[Measurements | None] = [None] * n
        self._streams: list[dict[str, AidStream]] = [{} for _ in range(n)]
        self._arrivals = [Arrivals() for _ in range(n)]
        self._compiled, self._batch = np.zeros(n, np.bool_), np.zeros(n, np.int64)
        self._at, self._end = np.zeros(n, np.int64), np.zeros(n, np.int64)  # step in the batch, and its length
        self._imu = np.zeros(n, np.bool_)
        # Of one step: see `simnav.sensors.stepwise.sort_out` and `begin_step`.
        self._which = (np.zeros(n, np.bool_), np.zeros(n, np.bool_), np.zeros(n, np.bool_))
        self._limits = (np.zeros(n, np.int64), np.zeros(n, np.int64), np.zeros(n, np.int64))
        self._taps = np.zeros((n, 1, TRUE_NUMBERS))
        self._layers = np.zeros(n, np.int64)
        self._room(8)

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> NDArray[Any]:
            """The shared arrays are attributes, made by `_grown`."""

    # ------------------------------------------------------------------------------------------- runs

    def begin(self, b: int, simulator: Simulator) -> None:
        """Start a run at index b. Its simulator must be at time 0."""
        self.simulators[b] = simulator
        self.step[b] = self._at[b] = self._end[b] = self.count[b] = self.samples[b] = 0
        self._batch[b], self._packets[b], self._streams[b] = FIRST_BATCH, None, {}
        self._arrivals[b] = Arrivals()
        aids = simulator.aids
        self.names[b], self.kinds[b] = list(aids), [a.kind for a in aids.values()]
        layers = [layer for layer in simulator.layers if layer.operation != DISTURBS_IMU]
        self._imu[b] = simulator.imu is not None
        world = simulator.trajectory
        known = (
            isinstance(world, World)
            and all(isinstance(a, CompiledInstrument) and a.in_kernel and a.total is None for a in aids.values())
            and all(layer.operation is not None for layer in simulator.layers)
            and (simulator.imu is None or simulator.imu.effects is None)
            and not simulator.clocks
        )
        self._compiled[b] = known
        state = simulator.initial_truth
        self.truth[b] = np.concatenate([state.position[0], state.velocity[0], state.attitude[0]])
        if not isinstance(world, World):
            return
        for name, array in world.share_state().items():
            self._put(name, b, array)
        if known:
            self._put_instruments(b, simulator, layers)
        world.use_state(self.x[b], self.index[b])

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        for b, simulator in enumerate(self.simulators):  # a copy no longer shares its arrays with the worlds
            if simulator is not None and isinstance(simulator.trajectory, World):
                simulator.trajectory.use_state(self.x[b], self.index[b])

    def _put(self, name: str, b: int, value: Any) -> None:
        """Store an array of run b. If it does not fit, the shared array is enlarged for all runs."""
        value = np.asarray(value)
        array = self._grown(name, value.shape, value.dtype)
        place: Any = (b, *(slice(0, m) for m in value.shape))
        array[place] = value

    def _grown(self, name: str, shape: tuple[int, ...], dtype: Any) -> NDArray[Any]:
        """The shared array, enlarged to the shape for each run, with its previous content."""
        arrays = self.__dict__
        old: NDArray[Any] | None = arrays.get(name)
        if old is None:
            old = arrays[name] = np.zeros((self.n, *shape), dtype)
        if any(m > c for m, c in zip(shape, old.shape[1:], strict=True)):
            most = tuple(max(m, c) for m, c in zip(shape, old.shape[1:], strict=True))
            new = np.zeros((self.n, *most), old.dtype)
            new[tuple(slice(0, m) for m in old.shape)] = old
            old = arrays[name] = new
            self._forget()
        return old

    def _forget(self) -> None:
        """Forget the records, which hold an array that was replaced."""
        for name in _RECORDS:
            self.__dict__.pop(name, None)

    def _put_instruments(self, b: int, simulator: Simulator, layers: list[FaultLayer]) -> None:
        aids = list(simulator.aids.values())
        i, k = len(aids), len(layers)
        numbers, layout = np.zeros((i, NUMBERS)), np.zeros((i, 1), LAYOUT)
        sizes, held = np.zeros((i, k, 1), NOISE_STEP), np.zeros((i, k, 1), HELD)
        for a, aid in enumerate(aids):
            assert isinstance(aid, CompiledInstrument)
            numbers[a] = aid.numbers
            d = len(aid.sigma)
            positions, cyclic = aid.definition.layout
            layout[a] = aid.code, d, positions, cyclic
            for j, layer in enumerate(layers):
                if layer.operation == STEPS_NOISE and layer.touches_kind(aid.name, aid.kind):
                    factor: float | None = layer.spec.factor  # type: ignore[attr-defined]
                    sizes["factor"][a, j] = 0.0 if factor is None else factor
                    if factor is None:
                        sizes["sigma"][a, j, 0, :d] = layer.spec.size("sigma", aid.kind)
        operation = [(layer.operation, layer.index, bool(layer.spec.intervals)) for layer in layers]
        self._layers[b] = k
        self._put("operations", b, np.array(operation, OPERATION).reshape(k, 1).view(np.int64))
        self._put("numbers", b, numbers)
        self._put("layout", b, layout.view(np.int64))
        self._put("sizes_of_noise", b, sizes.view(np.float64))
        self._put("held", b, held.view(np.float64))
        self.held[b] = 0.0
        imu = simulator.imu
        if imu is not None:
            triads = [imu.gyroscope, imu.accelerometer]
            self._put("matrix", b, np.stack([t.matrix for t in triads]))
            self._put("bias", b, np.stack([t.bias for t in triads]))
            self._put("residual", b, np.stack([t.residual for t in triads]))
            for name in ("density", "range", "step"):
                self._put(name + "_of_triad", b, np.array([getattr(t, name) for t in triads], np.float64))
            self._put("instability_per_second", b, np.array([t.instability.per_second for t in triads], np.float64))
            self._put("walk_per_second", b, np.array([t.walk.per_second for t in triads], np.float64))

    # ------------------------------------------------------------------------------------------- steps

    def advance(self, active: NDArray[np.bool_]) -> None:
        """Advance some runs by one step each."""
        compiled, inertial, due = self._which
        found = sort_out(active, self._progress, self._which)
        if found & BLOCKS:
            for b in np.flatnonzero(active & ~self._compiled).tolist():
                self._block(b)
        if not found & COMPILED:
            return
        if found & DUE:
            for b in np.flatnonzero(due).tolist():
                self._draw(b)
        place = self._limits[0]
        drawn = self.edge, self.samples_a_step
        most = begin_step.unchecked(compiled, drawn, (self._at, self.step, self.samples), self._limits)
        if most > self._taps.shape[1]:
            self._taps = np.zeros((self.n, most, TRUE_NUMBERS))
            self._forget()
        # Their arrays are made here, of the right types.
        motion.advance.unchecked(
            compiled,
            (self.x, self.index),
            self.p,
            self.sizes,
            (self.rows, self.points),
            (self.phase, self.table, self.eddies),
            self._requested,
            (self.samples, self.rate, self.force),
        )
        if found & INERTIAL:
            disturbances = self.disturbed, self.disturbance
            sense_imu.unchecked(
                inertial, place, self._triads, self._imu_draws, disturbances, self.clock, self.imu_steps
            )
        instruments = self.layout, self.numbers
        sense.unchecked(
            compiled, self._times, self._aid_draws, instruments, self._fault_layers, self.delivered, self.truth
        )

    # The arrays by their names; `_grown` forgets a record where it replaces an array. Only the first ``number`` of a
    # run's measurements and IMU samples are those of its last step.

    @cached_property
    def delivered(self) -> Delivered:
        """The measurements of the last step of all runs."""
        return Delivered(self.count, self.who, self.when, self.value, self.faults)

    @cached_property
    def imu_steps(self) -> ImuSteps:
        """The IMU samples of the last step of all runs."""
        return ImuSteps(self.samples, self.imu_time, self.imu_interval, self.rate, self.force)

    @cached_property
    def _progress(self) -> BatchProgress:
        return BatchProgress(self._compiled, self._imu, self._at, self._end)

    @cached_property
    def _requested(self) -> motion.RequestedStates:
        _, first, last = self._limits
        return motion.RequestedStates(self.tap_time, first, last, self._taps)

    @cached_property
    def _times(self) -> SampleTimes:
        _, first, last = self._limits
        return SampleTimes(first, last, self.tap_time, self._taps, self.owner)

    @cached_property
    def _triads(self) -> TriadTables:
        return TriadTables(
            self.matrix,
            self.bias,
            self.density_of_triad,
            self.range_of_triad,
            self.step_of_triad,
            self.instability_per_second,
            self.walk_per_second,
            self.residual,
        )

    @cached_property
    def _imu_draws(self) -> ImuDraws:
        return ImuDraws(
            self.variates,
            self.instability,
            self.walk,
            self.instability_rows,
            self.instability_first,
            self.walk_rows,
            self.walk_first,
        )

    @cached_property
    def _aid_draws(self) -> AidDraws:
        return AidDraws(self.error, self.white, self.interval, self.fault)

    @cached_property
    def _fault_layers(self) -> FaultLayers:
        return FaultLayers(self._layers, self.operations, self.sizes_of_noise, self.held)

    def interval_of(self, b: int) -> tuple[float, float]:
        """Beginning and end of the last step of a run [s]."""
        simulator, k = self.simulators[b], int(self.step[b])
        assert simulator is not None
        rate = 1.0 / simulator.step  # as `simnav.simulation.simulator.sample_times`
        return simulator.step + (k - 2) / rate if k > 1 else 0.0, simulator.step + (k - 1) / rate

    def packet(self, b: int) -> Measurements:
        """The measurements of the last step of a run, in arrays of their own."""
        packet = self._packets[b]
        if packet is not None:
            return packet
        simulator, n = self.simulators[b], int(self.samples[b])
        assert simulator is not None
        imu = None
        if self._imu[b]:
            arrays = (self.imu_time, self.imu_interval, self.rate, self.force)
            imu = ImuSamples(*(a[b, :n].copy() for a in arrays))
        widths = [len(a.definition.components) for a in simulator.aids.values()]
        aids = [
            Measurement(
                self.when[b, j].item(), self.names[b][i], self.kinds[b][i], self.value[b, j, : widths[i]].copy()
            )
            for j, i in enumerate(self.who[b, : self.count[b]].tolist())
        ]
        return Measurements(*self.interval_of(b), imu, aids)

    def streams(self, b: int) -> dict[str, AidStream]:
        """The readings of the last step of a run by instrument, if the run has only the block form; else nothing."""
        return self._streams[b]

    def _draw(self, b: int) -> None:
        """Draw the random numbers of the instruments and faults of a run for the next batch of steps."""
        simulator = self.simulators[b]
        assert simulator is not None
        steps, done = int(self._batch[b]), int(self.step[b])
        self._batch[b] = min(2 * steps, LONGEST_BATCH)
        self._at[b], self._end[b] = 0, steps
        ends = np.arange(done + 1, done + steps + 1) * simulator.step
        start = done * simulator.step
        times, owners, at = [], [], []
        for i, spec in enumerate([*simulator.scenario.aids.values(), None]):
            rate, phase = (1.0 / simulator.step, simulator.step) if spec is None else (spec.rate, spec.phase)
            # As `simnav.simulation.simulator.sample_times` of each step.
            first = max(0, int(np.floor((start - phase + TIME_TOLERANCE) * rate)) + 1)
            last = np.maximum(np.floor((ends - phase + TIME_TOLERANCE) * rate), first - 1)
            number = np.arange(first, int(last[-1]) + 1)
            times.append(phase + number / rate)
            at.append(np.searchsorted(last, number))
            owners.append(np.full(len(number), -1 if spec is None else i))
        time, owner, step = np.concatenate(times), np.concatenate(owners), np.concatenate(at)
        order = np.lexsort((time, step))  # stable: ties keep the scenario's order of instruments
        edge = np.searchsorted(step[order], np.arange(steps + 1))
        self._room(int(np.diff(edge).max()))
        self._put("edge", b, edge)
        self._put("tap_time", b, time[order])
        self._put("owner", b, owner[order])
        n, layers = len(time), [layer for layer in simulator.layers if layer.operation != DISTURBS_IMU]
        error, white = np.zeros((n, 3)), np.zeros((n, 3))
        interval, fault = np.full((n, len(layers)), UNTOUCHED, np.int64), np.zeros((n, len(layers), 3))
        begin = 0
        for own, aid in zip(times, simulator.aids.values(), strict=False):
            part = slice(begin, begin + len(own))
            begin += len(own)
            d = len(aid.sigma)
            error[part, :d], white[part, :d] = aid.ahead(own)
            for j, layer in enumerate(layers):
                if layer.touches_kind(aid.name, aid.kind):
                    interval[part, j], fault[part, j, :d] = layer.ahead(aid.name, aid.kind, own)
        for name, value in (("error", error), ("white", white), ("interval", interval), ("fault", fault)):
            self._put(name, b, value[order])
        self._draw_imu(b, simulator, steps, done)

    def _draw_imu(self, b: int, simulator: Simulator, steps: int, done: int) -> None:
        world = simulator.trajectory
        assert isinstance(world, World)  # `begin`
        rate = world.rate
        samples = round(rate * simulator.step)
        self._put("samples_a_step", b, samples)
        first, n = done * samples, steps * samples
        for name in ("imu_time", "imu_interval"):
            self._put(name, b, np.zeros(samples))
        for name in ("rate", "force"):
            self._put(name, b, np.zeros((samples, 3)))
        imu = simulator.imu
        if imu is None:
            return
        time = np.arange(first + 1, first + n + 1) / rate
        variates = self._grown("variates", (2, n, 3), np.float64)
        both = (imu.gyroscope, imu.accelerometer)
        triads = [t.ahead(variates[b, i, :n], float(time[-1])) for i, t in enumerate(both)]
        self._put("clock", b, np.array([first, rate], np.float64))
        for name, held in zip(("instability", "walk"), zip(*triads, strict=True), strict=True):
            table = np.zeros((2, max(len(t.rows) for t in held), 3))
            for i, t in enumerate(held):
                table[i, : len(t.rows)] = t.rows
            self._put(name, b, table)
            self._put(name + "_rows", b, np.array([len(t.rows) for t in held], np.int64))
            self._put(name + "_first", b, np.array([t.first for t in held], np.int64))
        found = [layer.ahead_imu(time) for layer in simulator.layers if layer.operation == DISTURBS_IMU]
        active = np.stack([f[0] for f in found]) if found else np.zeros((0, n), np.bool_)
        errors = np.stack([f[1] for f in found]) if found else np.zeros((0, n, 6))
        self._put("disturbed", b, active)
        self._put("disturbance", b, errors)
        self.disturbed[b, len(found) :] = False

    def _room(self, most: int) -> None:
        """Enlarge the arrays to hold ``most`` measurements in a step."""
        self._grown("who", (most,), np.int64)
        self._grown("when", (most,), np.float64)
        self._grown("value", (most, 3), np.float64)
        self._grown("faults", (most,), np.uint32)

    def _block(self, b: int) -> None:
        """Advance a run that has only the block form by one step."""
        simulator = self.simulators[b]
        assert simulator is not None
        k = int(self.step[b]) + 1
        block = simulator.advance(min(k * simulator.step, simulator.duration))
        self.step[b] = k
        truth = block.truth
        self.truth[b] = np.concatenate([truth.position[-1], truth.velocity[-1], truth.attitude[-1]])
        block = self._arrivals[b].of(block)
        (packet,) = packets(block, truth.time)
        self._packets[b] = Measurements(*self.interval_of(b), packet.imu, packet.aids)
        self._streams[b] = block.aids
        self.samples[b] = 0
        if packet.imu is not None:
            imu = packet.imu
            self.samples[b] = len(imu)
            for name, array in (
                ("imu_time", imu.time), ("imu_interval", imu.interval), ("rate", imu.angular_rate),
                ("force", imu.specific_force),
            ):  # fmt: skip
                self._put(name, b, array)
        self.count[b] = n = len(packet.aids)
        self._room(n)
        value, faults = np.zeros((n, 3)), np.zeros(n, np.uint32)
        rows = {}
        for name, stream in block.aids.items():
            order, _ = stream.delivered(truth.time + TIME_TOLERANCE)
            rows[name] = iter(stream.faults[order].tolist())
        for j, m in enumerate(packet.aids):  # it has all rows of the block, those of a stream in their order
            value[j, : len(m.value)] = m.value
            faults[j] = next(rows[m.instrument])
        self._put("who", b, np.array([self.names[b].index(m.instrument) for m in packet.aids], np.int64))
        self._put("when", b, np.array([m.time for m in packet.aids]))
        self._put("value", b, value)
        self._put("faults", b, faults)
