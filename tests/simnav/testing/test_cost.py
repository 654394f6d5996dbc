"""Time and memory of an epoch are those of the estimator, and of nobody else."""

from __future__ import annotations

import tracemalloc
from functools import partial
from time import process_time

import numpy as np
import pytest

from simnav.estimator import Estimator, make
from simnav.recording import Recording
from simnav.scenario import load
from simnav.source import record
from simnav.testing import measure
from simnav.types import Estimate

EPOCHS = 40


class Idle(Estimator):
    """Holds its first position."""

    def reset(self, start, instruments):
        self.position = start.position.copy()

    def update(self, measurements):
        return Estimate(measurements.time, self.position.copy())


class Busy(Idle):
    """Computes for five milliseconds."""

    def update(self, measurements):
        end = process_time() + 5e-3
        while process_time() < end:
            pass
        return super().update(measurements)


class Hoarder(Idle):
    """Keeps 100 kB of every epoch."""

    def reset(self, start, instruments):
        super().reset(start, instruments)
        self.kept = []

    def update(self, measurements):
        self.kept.append(np.zeros(100_000, dtype=np.uint8))
        return super().update(measurements)


class Vandal(Idle):
    """Writes into what it gets."""

    def reset(self, start, instruments):
        super().reset(start, instruments)
        start.position[:] = np.nan

    def update(self, measurements):
        for m in measurements:
            m.value[:] = np.nan
        return super().update(measurements)


class Unsuited(Idle):
    """Needs what is not there."""

    needs = ("terrain_fix",)


class Broken(Idle):
    """Fails at the end of a run."""

    def smooth(self):
        raise RuntimeError("no")


@pytest.fixture(scope="module")
def recording() -> Recording:
    return record(load("ship-straight").model_copy(update={"duration": float(EPOCHS)}), 1)


def test_time_and_memory_are_those_of_the_estimator(recording: Recording):
    idle, busy, hoarder = measure({"idle": Idle, "busy": Busy, "hoarder": Hoarder}, recording, rounds=2)
    # the time that Busy computes is processor time, too: other processes do not lengthen it
    assert idle.update_median < 5e-3 <= busy.update_median <= busy.update_p95
    assert busy.peak_memory < 50e3
    assert abs(idle.memory_growth) < 1e3
    assert hoarder.memory_growth == pytest.approx(100e3, rel=0.05)
    assert hoarder.peak_memory == pytest.approx(EPOCHS * 100e3, rel=0.05)


def test_memory_of_a_library_in_cpp_is_seen():
    pytest.importorskip("gtsam")
    sea = record(load("open-sea").model_copy(update={"duration": 30.0}), 1)
    (cost,) = measure({"gtsam": partial(make, "gtsam-fixed-lag")}, sea, rounds=1)
    import ctypes

    if not hasattr(ctypes.CDLL(None), "mallinfo2"):
        pytest.skip("only glibc tells")
    assert cost.peak_memory > 500e3  # Python sees less than half of that


def test_the_recording_and_the_others_do_not_suffer(recording: Recording):
    before = recording.data.aids["gnss"].value.copy()
    vandal, good = measure({"vandal": Vandal, "gnss-only": partial(make, "gnss-only")}, recording, rounds=1)
    assert (vandal.status, good.status) == ("ok", "ok")
    np.testing.assert_array_equal(recording.data.aids["gnss"].value, before)
    assert np.isfinite(recording.start.position).all()


def test_what_fails_is_named(recording: Recording):
    told = []
    rows = {"unsuited": Unsuited, "broken": Broken, "idle": Idle}
    unsuited, broken, idle = measure(
        rows, recording, rounds=2, progress=lambda done, total, note="": told.append((done, total, note))
    )
    assert (unsuited.status, unsuited.reason) == ("unsuitable", "it needs terrain_fix; there is none")
    assert (broken.status, broken.reason) == ("error", "RuntimeError: no")
    assert np.isnan([unsuited.update_median, unsuited.peak_memory, broken.peak_memory]).all()
    assert idle.status == "ok"
    assert told[0] == (0, 5, "time, round 1")
    assert told[-1] == (5, 5, "")


def test_a_trace_that_is_under_way_goes_on(recording: Recording):
    (alone,) = measure({"hoarder": Hoarder}, recording, epochs=10, rounds=1)
    tracemalloc.start()
    try:
        held = np.zeros(10_000_000, dtype=np.uint8)
        (cost,) = measure({"hoarder": Hoarder}, recording, epochs=10, rounds=1)
        assert tracemalloc.is_tracing()
        assert tracemalloc.get_traced_memory()[0] >= held.nbytes
    finally:
        tracemalloc.stop()
    assert cost.peak_memory == pytest.approx(alone.peak_memory, rel=0.1)


@pytest.mark.parametrize(("options", "says"), [({"epochs": 1}, "epochs: 1 "), ({"rounds": 0}, "rounds: 0 ")])
def test_too_little_to_measure(recording: Recording, options: dict, says: str):
    with pytest.raises(ValueError, match=says):
        measure({"idle": Idle}, recording, **options)
