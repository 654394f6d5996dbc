"""Measurements that arrive late: each is used at its time of validity, by any estimator that can be copied.

A reading arrives after its time of validity (`simnav.timing`), and one that was taken later may overtake it. Then the
step in which it was valid is over. Here the estimator goes back: it takes up the copy of itself that was made before
that step, and processes the packets since then again, with the late reading in its place. This is what a filter does
that stores its states (Y. Bar-Shalom, "Update with out-of-sequence measurements in tracking: exact solution", IEEE
Transactions on Aerospace and Electronic Systems 38(3), 2002, treats the case of one step in closed form). It is exact
for every solver: the estimate is the one that the same readings in the right order would have given. A window has its
node at the time of the reading, a smoother its stop. Earlier estimates stay as they were given, so nothing is known
before it arrives.

A stamp that is ahead of its step waits for the step in which its time comes. Stamps are corrected before by what the
datasheet says of them: a stamp that is set at arrival is later than the time of validity by the mean latency. Memory is
bounded: copies and packets are kept for the longest latency of the datasheets, or `REACH` where these say nothing. What
arrives later still is left out. A copy takes half a millisecond for a filter. It is made before each step, or before
every few steps where `MOST_COPIES` would not reach back so far: then the steps after the copy are taken once more.
Nothing is copied where no datasheet has a clock and no reading has come late.
"""

from __future__ import annotations

import copy
import math
from collections import defaultdict, deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from simnav.estimator.contract import Estimator, EstimatorError
from simnav.steps import Steps
from simnav.timing import TIME_TOLERANCE
from simnav.types import Estimate, Instruments, Measurement, Measurements

if TYPE_CHECKING:
    from simnav.recording import Recording

__all__ = [
    "LATE",
    "MANNERS",
    "LateArrivals",
    "Manner",
    "TrueTimes",
    "are_untimely",
    "is_untimely",
    "manner_of",
    "parts_of",
    "true_times",
]

#: Name of the parameter.
LATE = "late"
#: What is done with late readings: they are used at their time of validity; as if they were valid at the begin of the
#: step in which they arrive; or not at all.
Manner = Literal["replay", "arrival", "skip"]
MANNERS: tuple[Manner, ...] = ("replay", "arrival", "skip")
#: How many copies reach back as far as the longest latency, and so the memory of a run.
MOST_COPIES = 32
#: How far back it goes where no datasheet says how late readings may be [s].
REACH = 5.0
#: A reading that is older than the begin of its step by less than this counts as of that time [s].
_LATE = 1e-4  # as `simnav.estimators.solvers.admission`
#: Two stamps of an instrument that are equal are this far apart [s].
_APART = 1e-6

#: True times of validity by instrument and stamp, in order of time.
TrueTimes = Mapping[tuple[str, float], list[float]]


def manner_of(value: Any) -> Manner:
    """The value of a parameter ``late``.

    Raises
    ------
    EstimatorError
        If there is no such manner; one sentence.
    """
    if value not in MANNERS:
        raise EstimatorError(f"late = {value!r} should be one of: {', '.join(MANNERS)}")
    manner: Manner = value
    return manner


def is_untimely(measurements: Measurements) -> bool:
    """Whether a packet has a reading from before or after its step."""
    first, last = measurements.start - _LATE, measurements.time + _LATE
    for m in measurements.aids:  # noqa: SIM110 (each step of each run comes here, and any() takes three times as long)
        if not first <= m.time <= last:
            return True
    return False


def are_untimely(steps: Steps) -> bool:
    """Whether one of several packets has a reading from before or after its step."""
    edges, step = np.array([steps.start, *steps.ends]), steps.step
    first, last = edges[step], edges[step + 1]
    return not bool(((first - _LATE <= steps.time) & (steps.time <= last + _LATE)).all())


def true_times(recording: Recording) -> TrueTimes:
    """The true times of validity of the readings whose stamps are wrong, for a reference."""
    found: dict[tuple[str, float], list[float]] = {}
    for name, stream in recording.data.aids.items():
        if stream.has_clock:
            for stamp, time in zip(stream.stamps.tolist(), stream.time.tolist(), strict=True):
                times = found.setdefault((name, stamp), [])
                if time not in times:
                    times.append(time)
    return found


def parts_of(recording: Recording) -> Sequence[object]:
    """A recording and the objects in it, which copies of a reference share."""
    found: dict[int, Any] = {}
    waiting: list[Any] = [recording]
    while waiting:
        part = waiting.pop()
        if id(part) in found or isinstance(part, (str, int, float, type(None))):
            continue
        found[id(part)] = part
        if isinstance(part, Mapping):
            waiting += part.values()
        elif isinstance(part, tuple):
            waiting += part
        elif not hasattr(part, "dtype"):
            waiting += getattr(part, "__dict__", {}).values()
    return tuple(found.values())


@dataclass
class _Step:
    packet: Measurements
    before: Estimator | None  # a copy, from before the packet; not every step has one


def _forget(estimator: Estimator | None) -> None:
    """Let go what a copy holds: it may refer to itself, and Python looks for such circles seldom."""
    getattr(estimator, "__dict__", {}).clear()


class LateArrivals:
    """The late readings of one run.

    Parameters
    ----------
    instruments : Instruments
        The datasheets, with what is known of the clocks.
    manner : "replay", "arrival" or "skip"
        What is done with late readings.
    truth : TrueTimes, optional
        For a reference: the times of validity, in place of what follows from stamps and datasheets.
    shared : sequence of object
        Objects that a copy has in common with the estimator: what a reference knows of the truth.

    Attributes
    ----------
    used, missed : int
        Number of late readings that were used, and that were not.
    """

    def __init__(
        self,
        instruments: Instruments,
        manner: Manner,
        truth: TrueTimes | None = None,
        shared: Sequence[object] = (),
    ):
        self.manner = manner
        self._truth = {key: list(times) for key, times in (truth or {}).items()}
        self._knows = bool(truth)
        #: What copies of the estimator share: it does not write into its input.
        self._shared = (*shared, instruments, instruments.imu, *instruments.values())
        self._order = {
            (name, channel): (i, j)
            for i, (name, sheet) in enumerate(instruments.items())
            for j, channel in enumerate(sheet.channels or ("",))
        }
        self._clocks = {name: sheet.timing for name, sheet in instruments.items() if sheet.timing is not None}
        reaches = [clock.longest for clock in self._clocks.values()]
        self.reach = (max(reaches) if reaches and len(reaches) == len(self._clocks) else REACH) + instruments.step
        self._apart = max(1, math.ceil(self.reach / (MOST_COPIES * instruments.step)))  # steps from copy to copy
        self._history: deque[_Step] = deque()
        self._oldest = math.inf  # begin of the first step to which it goes back
        self._made: Estimator | None = None  # the copy that has gone back last
        self._waiting: list[Measurement] = []
        self._newest: dict[str, float] = defaultdict(lambda: -math.inf)
        self._stamps: dict[tuple[str, float], float] = {}
        self.used = self.missed = 0

    def __deepcopy__(self, memo: dict[int, Any]) -> LateArrivals:
        """A copy; what is shared stays so."""
        memo.update({id(part): part for part in self._shared})
        made = object.__new__(type(self))
        memo[id(self)] = made
        for name, value in vars(self).items():
            vars(made)[name] = value if name == "_shared" else copy.deepcopy(value, memo)
        return made

    def update(self, estimator: Estimator, measurements: Measurements) -> tuple[Estimator, Estimate]:
        """Process one step.

        Parameters
        ----------
        estimator : Estimator
            The estimator; afterwards it is not to be used any more.
        measurements : Measurements
            The packet of the step.

        Returns
        -------
        estimator : Estimator
            In its place: itself, or a copy that has gone back.
        estimate : Estimate
            Of the end of the step.
        """
        packet, late = self._sorted(measurements)
        flagged: list[tuple[str, float]] = []
        if late and self._history:
            before, estimator = estimator, self._replay(late, flagged)
            if before is self._made:
                _forget(before)
            self._made = estimator
        if self.manner == "replay":
            self._keep(packet, estimator)
        estimate = estimator.update(packet)
        self._describe(estimate, flagged)
        return estimator, estimate

    # --------------------------------------------------------------------------------------- stamps

    def _sorted(self, measurements: Measurements) -> tuple[Measurements, list[Measurement]]:
        """The packet of the present step, and the readings that belong to earlier ones."""
        start, end = measurements.start, measurements.time
        present, late = [], []
        ahead, self._waiting = self._waiting, []
        for m in [*ahead, *(self._timed(m, end) for m in measurements.aids)]:
            time = m.time
            if time > end + _LATE:
                self._waiting.append(m.kept())
            elif time > start + TIME_TOLERANCE or (not self._history and time >= start - _LATE):
                present.append(m)
            elif self.manner == "arrival":
                while any(other.source == m.source and other.time == start for other in present):
                    start += _APART
                self._stamps[m.source, start] = self._stamps.pop((m.source, time), time)
                present.append(m._replace(time=start))
                start = measurements.start
                self.used += 1
            elif self.manner == "replay" and self._history and time > self._oldest + TIME_TOLERANCE:
                late.append(m)
                self.used += 1
            else:
                self.missed += 1
        present.sort(key=self._place)
        return Measurements(start, end, measurements.imu, present), late

    def _timed(self, m: Measurement, end: float) -> Measurement:
        """A reading at its time of validity; one from a far future is of the end of the step."""
        time = self._validity(m)
        if time > end + self.reach:
            time = end
        if time == m.time:
            return m
        self._stamps[m.source, time] = m.time
        return m._replace(time=time)

    def _validity(self, m: Measurement) -> float:
        """When a reading was valid, as far as that is known."""
        if self._knows:
            times = self._truth.get((m.instrument, m.time))
            if times is None:
                return m.time
            return times[0] if m.channel or len(times) == 1 else times.pop(0)
        clock = self._clocks.get(m.instrument)
        time = m.time if clock is None else m.time - clock.expected
        newest = self._newest[m.source]
        if clock is not None and clock.resolution and time <= newest < time + 0.5 * clock.resolution:
            time = newest + _APART  # its stamp is that of the reading before
        self._newest[m.source] = max(newest, time)
        return time

    # --------------------------------------------------------------------------------------- replay

    def _copy(self, estimator: Estimator) -> Estimator:
        return copy.deepcopy(estimator, {id(part): part for part in self._shared})

    def _keep(self, packet: Measurements, estimator: Estimator) -> None:
        """Remember the packet, and the estimator before it; forget what is older than the longest latency."""
        steps = self._history
        since = next((k for k, step in enumerate(reversed(steps), 1) if step.before is not None), self._apart)
        try:
            before = self._copy(estimator) if since >= self._apart else None
        except Exception:  # a graph of GTSAM cannot be copied: its late readings count when they arrive
            self.manner = "arrival"
            steps.clear()
            return
        steps.append(_Step(packet.kept(), before))
        self._oldest = next(x.packet.start for x in steps if x.packet.time >= packet.time - self.reach)
        copies = [k for k, x in enumerate(steps) if x.before is not None and x.packet.start <= self._oldest]
        for _ in range(copies[-1]):
            _forget(steps.popleft().before)
        self._stamps = {key: stamp for key, stamp in self._stamps.items() if key[1] > self._oldest - 1.0}

    def _replay(self, late: list[Measurement], flagged: list[tuple[str, float]]) -> Estimator:
        """Put late readings into their steps, and process these and all later ones again."""
        steps, first = self._history, len(self._history)
        for m in late:
            k = next(k for k in reversed(range(len(steps))) if m.time > steps[k].packet.start + TIME_TOLERANCE)
            old = steps[k].packet
            aids = sorted([*old.aids, m.kept()], key=self._place)
            steps[k].packet = Measurements(old.start, old.time, old.imu, aids)
            first = min(first, k)
        wanted = {(m.source, m.time) for m in late}
        begin = next(k for k in range(first, -1, -1) if steps[k].before is not None)
        known = steps[begin].before
        assert known is not None
        estimator = self._copy(known)
        for k in range(begin, len(steps)):
            if k > first and steps[k].before is not None:
                _forget(steps[k].before)
                steps[k].before = self._copy(estimator)
            flagged += [flag for flag in estimator.update(steps[k].packet).flagged if tuple(flag) in wanted]
        return estimator

    def _describe(self, estimate: Estimate, flagged: list[tuple[str, float]]) -> None:
        """Add what was flagged among late readings, and give all flags the stamps that came with the readings."""
        flags = [*flagged, *estimate.flagged]
        if flags:
            estimate.flagged = [(source, self._stamps.get((source, time), time)) for source, time in flags]
        counts = {"late": float(self.used), "late_missed": float(self.missed)}
        estimate.diagnostics = {**estimate.diagnostics, **counts}

    def _place(self, m: Measurement) -> tuple[float, int, int]:
        """The order of readings in a packet: by time, instrument and channel."""
        return m.time, *self._order.get((m.instrument, m.channel), (0, 0))
