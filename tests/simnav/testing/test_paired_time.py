"""The multiple of a plain estimator is that of the two, whatever else slows both."""

from __future__ import annotations

from functools import partial
from time import process_time

import numpy as np
import pytest

from simnav.estimator import Estimator, UnsuitableScenario, make
from simnav.recording import Recording
from simnav.scenario import load
from simnav.source import record
from simnav.testing import multiple
from simnav.types import Estimate


class Clock:
    """A clock that estimators advance themselves, at a speed that a disturbance changes."""

    def __init__(self):
        self.now, self.reads = 0.0, 0

    def __call__(self) -> float:
        self.reads += 1
        return self.now


class Working(Estimator):
    """Needs a given time for an epoch, and for the smoother."""

    clock: Clock
    slow = staticmethod(lambda now: 1.0)

    def __init__(self, epoch: float = 1.0, smoother: float = 0.0, first: float = 0.0):
        self.epoch, self.smoother, self.first = epoch, smoother, first

    def reset(self, start, instruments):
        self.position, self.count = start.position.copy(), 0

    def update(self, measurements):
        self.clock.now += (self.epoch + (self.first if self.count == 0 else 0.0)) * self.slow(self.clock.now)
        self.count += 1
        for m in measurements:
            m.value[:] = np.nan  # writes into what it gets
        return Estimate(measurements.time, self.position.copy())

    def smooth(self):
        self.clock.now += self.smoother
        return None


class Unsuited(Working):
    needs = ("terrain_fix",)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    made = Clock()
    monkeypatch.setattr(Working, "clock", made, raising=False)
    return made


@pytest.fixture(scope="module")
def recording() -> Recording:
    return record(load("ship-straight").model_copy(update={"duration": 130.0}), 1)


def test_the_multiple_is_the_ratio_of_the_times(recording: Recording, clock: Clock):
    found = multiple(partial(Working, 3.0), Working, recording, rounds=3, clock=clock)
    assert (found.value, found.low, found.high) == pytest.approx((3.0, 3.0, 3.0))
    assert multiple(Working, Working, recording, rounds=3, clock=clock).value == pytest.approx(1.0)


def test_the_first_epochs_do_not_count(recording: Recording, clock: Clock):
    assert multiple(partial(Working, first=1e6), Working, recording, rounds=2, clock=clock).value == pytest.approx(1.0)


def test_the_smoother_counts_where_it_is_asked_for(recording: Recording, clock: Clock):
    smoother = partial(Working, 1.0, 360.0)
    assert multiple(smoother, Working, recording, epochs=120, rounds=2, clock=clock).value == pytest.approx(1.0)
    found = multiple(smoother, Working, recording, epochs=120, rounds=2, smooth=True, clock=clock)
    assert found.value == pytest.approx(480.0 / 120.0)


def test_other_work_of_the_machine_slows_both(recording: Recording, clock: Clock, monkeypatch: pytest.MonkeyPatch):
    """A speed that drifts by a factor of four, and disturbances of a turn: measured apart, the ratio would be lost."""

    def slow(now: float) -> float:
        return 1.0 + 3.0 * np.sin(now / 0.04) ** 2 + (200.0 if int(now / 5e-4) % 300 == 7 else 0.0)

    monkeypatch.setattr(Working, "slow", staticmethod(slow))
    found = multiple(partial(Working, 3e-5), partial(Working, 1e-5), recording, rounds=31, clock=clock)
    assert found.rounds == 31
    assert found.low <= found.value <= found.high
    assert found.value == pytest.approx(3.0, rel=0.05)
    assert found.high > found.low


def test_slow_estimators_have_fewer_rounds(recording: Recording, clock: Clock):
    assert multiple(Working, Working, recording, rounds=40, clock=clock).rounds == 5


def test_an_estimator_beside_itself_takes_as_long(recording: Recording):
    """With the clock of the processor; the tolerance is wide, for the machine does other work."""
    row = partial(make, "ship-ekf")
    found = multiple(row, row, recording, rounds=15)
    assert 0.7 < found.value < 1.4
    assert found.rounds == 15


def test_two_updates_take_twice_as_long_as_one(recording: Recording):
    class Busy(Working):
        def update(self, measurements):
            end = process_time() + 2e-4
            while process_time() < end:
                pass
            return Estimate(measurements.time, self.position)

    class Twice(Busy):
        def update(self, measurements):
            super().update(measurements)
            return super().update(measurements)

    assert multiple(Twice, Busy, recording, epochs=60, rounds=5).value == pytest.approx(2.0, rel=0.25)


def test_what_cannot_be_measured_is_refused(recording: Recording, clock: Clock):
    with pytest.raises(ValueError, match="epochs: 1 "):
        multiple(Working, Working, recording, epochs=1)
    with pytest.raises(ValueError, match="rounds: 0 "):
        multiple(Working, Working, recording, rounds=0)
    with pytest.raises(UnsuitableScenario, match="terrain_fix"):
        multiple(Unsuited, Working, recording, clock=clock)
