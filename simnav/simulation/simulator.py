"""The simulator: it makes the recording of a scenario and a seed, in one block or step by step.

A `Simulator` is a state machine. The vessel's trajectory, the errors of the instruments and the faults keep their
state from block to block and draw a fixed number of variates for each sample, so that one long block and many short
ones give the same numbers.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from simnav.recording import AidStream, Block, ImuLabels, Recording
from simnav.scenario import Scenario
from simnav.sensors import DerivedInstrument
from simnav.sensors.channels import ChannelInstrument
from simnav.sensors.faults import build_layers, labels
from simnav.sensors.timing import Clock
from simnav.spec import SpecError
from simnav.timing import TIME_TOLERANCE
from simnav.types import KINDS, Array, InitialState, NavigationStates, TapStates
from simnav.world import Steered, Surroundings, Trajectory, WorldBlock
from simnav.world.initial_state import draw_start
from simnav.world.start import HIGHEST_LATITUDE, POLAR

__all__ = ["Simulator", "ideal", "sample_times", "simulate", "simulate_many"]
#: Rate of the truth where no IMU sets it [Hz].
_RATE_WITHOUT_IMU = 20.0
#: Tap of the ends of the steps; no instrument can have this name.
_STEPS = "step ends"


def sample_times(rate: float, phase: float, start: float, end: float) -> Array:
    """Sample times ``phase + k / rate`` (k = 0, 1, ...) within (start, end].

    Parameters
    ----------
    rate, phase : float
        Sample rate [Hz], and time of the first sample [s].
    start, end : float
        Limits of the interval [s]; the end belongs to it.

    Returns
    -------
    (n,) array
        Ascending times [s].

    Examples
    --------
    >>> sample_times(2.0, 0.25, 0.0, 1.25)
    array([0.25, 0.75, 1.25])
    """
    first = max(0, int(np.floor((start - phase + TIME_TOLERANCE) * rate)) + 1)
    last = int(np.floor((end - phase + TIME_TOLERANCE) * rate))
    return phase + np.arange(first, last + 1) / rate


def _trajectory(scenario: Scenario, seed: int, surroundings: Surroundings) -> Trajectory:
    imu = scenario.imu
    rate = _RATE_WITHOUT_IMU if imu is None else imu.rate
    if abs(rate * scenario.step - round(rate * scenario.step)) > 1e-6:
        raise SpecError(
            f"{scenario.id}: step_s = {scenario.step:g} should be a multiple of the sample interval of the IMU, "
            f"{1.0 / rate:g} s"
        )
    return scenario.craft.trajectory(scenario.voyage(seed, surroundings, rate))


class Simulator:
    """A simulated run.

    Parameters
    ----------
    scenario : Scenario
        A simulated scenario, not a recorded one.
    seed : int
        Seed of the run, non-negative.
    truth : WorldBlock, optional
        The truth of the whole run, if several runs share one truth (`simulate_many`).

    Attributes
    ----------
    instruments : Instruments
        Datasheets of all instruments.
    initial_truth : NavigationStates
        One state: the truth at time 0.
    start : InitialState
        Initial state with errors, which an estimator receives.
    faults : tuple of FaultLabel
        The faults of the run.
    scenario : Scenario
        The scenario of this run, with all values drawn.
    draws : mapping
        The drawn values (`simnav.scenario.Scenario.draws`).
    duration, step, time : float
        Length of the run, length of one step, and present time of the run [s].
    note : str
        Empty. For a log it is the name of the recording.
    imu, aids, layers : Imu or None, dict of str to Instrument, tuple of FaultLayer
        The IMU, the aiding instruments by name, and the faults.
    clocks : dict of str to Clock
        The clocks of the instruments that have the table, by name.
    surroundings : Surroundings
        Sea, current, bottom and other parts of this run.

    Raises
    ------
    SpecError
        If the scenario is a recorded one or its step does not fit the IMU's rate.
    """

    def __init__(self, scenario: Scenario, seed: int, *, truth: tuple[NavigationStates, WorldBlock] | None = None):
        if scenario.recorded:
            raise SpecError(f"{scenario.id} is a recorded run; open it with simnav.source.open_source")
        scenario = scenario.drawn(seed)
        self.scenario, self.seed, self.note = scenario, seed, ""
        self.draws = scenario.draws
        self.duration, self.step, self.time = scenario.duration, scenario.step, 0.0
        self.instruments = scenario.instruments_sheet()
        self.surroundings = scenario.surround(seed)
        self._truth = None if truth is None else truth[1]
        self._trajectory = _trajectory(scenario, seed, self.surroundings) if truth is None else None
        self._steered: Steered | None = None
        self.initial_truth = self._trajectory.state() if truth is None else truth[0]  # type: ignore[union-attr]
        root = scenario.root(seed)
        self.start = draw_start(
            self.initial_truth, scenario.initial_error.covariance(), root, scenario.initial_error.factors()
        )
        actual = scenario.actual()
        self.imu = None if actual.imu is None else actual.imu.build(root)
        self.aids = {name: spec.install(name, root, self.surroundings) for name, spec in actual.aids.items()}
        self.clocks = {n: Clock(spec.timing, n, root) for n, spec in actual.aids.items() if spec.timing is not None}
        kinds = {name: spec.kind for name, spec in scenario.aids.items()}
        self.faults = labels(scenario.faults, scenario.duration, kinds)
        for instrument in self.aids.values():
            if isinstance(instrument, ChannelInstrument) and (own := instrument.own_labels(scenario.duration)):
                instrument.bit = len(self.faults)
                self.faults = (*self.faults, *own)
        self.layers = build_layers(scenario.faults, root)
        self._label_imu = any("imu" in f.instruments for f in scenario.faults)

    def steer_by(self, north: float, east: float, heading: float = 0.0) -> None:
        """Closed loop: set the errors of the position [m] and heading [rad] by which the vessel is steered.

        Raises
        ------
        ValueError
            If the vessel cannot be steered, or several runs share one truth.
        """
        if self._steered is None:
            if not isinstance(self.trajectory, Steered):
                raise ValueError(f"{self.scenario.id}: a vessel of kind {self.scenario.craft.kind!r} cannot be steered")
            self._steered = self.trajectory  # to look at a protocol takes 6 us, once a step
        self._steered.steer_by(north, east, heading)

    @property
    def trajectory(self) -> Trajectory:
        """The trajectory of the vessel. ValueError if several runs share one truth, which nobody may steer."""
        if self._trajectory is None:
            raise ValueError("runs that share one truth cannot be steered")
        return self._trajectory

    def advance(self, until: float) -> Block:
        """Simulate the run up to a time.

        Parameters
        ----------
        until : float
            The end of a step, not before the present time of the run [s].

        Returns
        -------
        Block
            Measurements, labels and truth of the interval.

        Raises
        ------
        SpecError
            If the vessel comes within a degree of a pole.
        """
        start, until = self.time, min(until, self.duration)
        taps = self._taps(start, until)
        block = self._shared(taps) if self._trajectory is None else self._trajectory.advance(until, taps)
        self.time = until
        self._refuse_a_pole(block.taps[_STEPS])
        imu, imu_labels = None, None
        if self.imu is not None:
            # The ideal samples are not needed again, unless other runs share them.
            imu = self.imu.sense(block.imu, overwrite=self._truth is None)
            if self._label_imu:
                imu_labels = ImuLabels(np.zeros(len(imu), dtype=np.uint32), np.zeros((len(imu), 6)))
            for layer in self.layers:
                imu, imu_labels = layer.apply_imu(imu, imu_labels)
        aids: dict[str, AidStream] = {}
        # Those that read others are the last; a stream does not depend on the order.
        for name in sorted(self.aids, key=lambda name: isinstance(self.aids[name], DerivedInstrument)):
            instrument, tap = self.aids[name], block.taps[name]
            if isinstance(instrument, DerivedInstrument):
                stream = instrument.derived(tap.time, aids, self.instruments)
            else:
                stream = instrument.sense(tap)
            for layer in self.layers:
                stream = layer.laid_over(stream)
            aids[name] = stream
        for name, clock in self.clocks.items():
            aids[name] = clock.stamp(aids[name], block.taps[name].time)
        return Block(start, until, imu, imu_labels, {name: aids[name] for name in self.aids}, block.taps[_STEPS])

    def _refuse_a_pole(self, truth: TapStates) -> None:
        polar = np.flatnonzero(np.abs(truth.position[:, 0]) >= HIGHEST_LATITUDE)
        if polar.size:
            raise SpecError(f"{self.scenario.id}: the latitude of the vessel at {truth.time[polar[0]]:g} s {POLAR}")

    def _taps(self, start: float, until: float) -> dict[str, Array]:
        taps = {n: sample_times(s.rate, s.phase, start, until) for n, s in self.scenario.aids.items()}
        taps[_STEPS] = sample_times(1.0 / self.step, self.step, start, until)
        return taps

    def _shared(self, taps: dict[str, Array]) -> WorldBlock:
        truth = self._truth
        assert truth is not None
        if self.time == 0.0 and all(len(t) == len(truth.taps[n]) for n, t in taps.items()):
            return truth
        raise ValueError("runs that share one truth are advanced to their end in one block")


def _recording(simulator: Simulator) -> Recording:
    return Recording(
        simulator.scenario.id,
        simulator.seed,
        simulator.instruments,
        simulator.initial_truth,
        simulator.start,
        simulator.faults,
        simulator.advance(simulator.duration),
        draws=simulator.draws,
        actual=simulator.scenario.actual_sheet(),
        actual_covariance=simulator.scenario.initial_error.actual_covariance(),
        origins={name: origin for name, spec in simulator.scenario.aids.items() if (origin := spec.origin())},
    )


def simulate(scenario: Scenario, seed: int) -> Recording:
    """Simulate a whole run.

    Parameters
    ----------
    scenario : Scenario
        A simulated scenario, not a recorded one.
    seed : int
        Seed of the run, non-negative.

    Returns
    -------
    Recording
        The whole run, with truth and labels.
    """
    return _recording(Simulator(scenario, seed))


def simulate_many(scenario: Scenario, seeds: Iterable[int]) -> Iterator[Recording]:
    """Simulate runs one after the other.

    With ``world_seed`` and without distributions the runs share one truth, which is computed once.

    Yields
    ------
    Recording
        For each seed the same recording as that of `simulate`.
    """
    truth = None
    for seed in seeds:
        if truth is None and scenario.world_seed is not None and not scenario.distributions:
            first = Simulator(scenario, seed)
            truth = first.initial_truth, first.trajectory.advance(first.duration, first._taps(0.0, first.duration))
        yield _recording(Simulator(scenario, seed, truth=truth))


def ideal(scenario: Scenario, seed: int) -> Recording:
    """Simulate a run with ideal instruments. Bounds and Jacobians at the truth are computed from it.

    Parameters
    ----------
    scenario : Scenario
        A simulated scenario, not a recorded one.
    seed : int
        Seed of the run, non-negative.

    Returns
    -------
    Recording
        Truth, datasheets and times of measurements are those of `simulate(scenario, seed)`, also ``sigma`` and
        ``faults`` of each measurement. But every value is without error, ``fault_error`` is zero, and the initial state
        is the truth, with the covariance of the scenario.
    """
    scenario = scenario.drawn(seed)
    first = Simulator(scenario, seed)
    truth = first.initial_truth, first.trajectory.advance(first.duration, first._taps(0.0, first.duration))
    real = _recording(Simulator(scenario, seed, truth=truth))
    instruments = {name: spec.ideal() for name, spec in scenario.instruments.items()}
    perfect = scenario.model_copy(update={"instruments": instruments, "faults": ()})
    clean = _recording(Simulator(perfect, seed, truth=truth)).data
    aids = {}
    for name, stream in real.data.aids.items():
        perfect_one = clean.aids[name]
        value = KINDS[stream.kind].add_error(perfect_one.value, -perfect_one.fault_error)  # without reflections
        value = value[perfect_one.places(stream.time, stream.channel)]
        aids[name] = replace(stream, value=value, fault_error=np.zeros_like(stream.fault_error))
    state, start = real.initial_truth, real.start
    start = InitialState(start.time, state.position[0], state.velocity[0], state.attitude[0], start.covariance)
    return replace(real, start=start, data=replace(real.data, imu=clean.imu, imu_labels=None, aids=aids))
