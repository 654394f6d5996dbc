"""Windows of recordings: every reading in its place with its label, equal shapes whatever a run has, and batches."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.environment.windowing import windows
from simnav.leaderboard.results.hidden import without_truth
from simnav.scenario import load
from simnav.source import record

FAMILY = load("training-gnss-faults").model_copy(update={"duration": 40.0})
RUNS = [record(FAMILY, seed) for seed in range(6)]


def entries(one, prefix=""):
    """Every array of a batch, by its path."""
    for name, value in one.items():
        if isinstance(value, dict):
            yield from entries(value, f"{name}.")
        else:
            yield prefix + name, value


@pytest.mark.parametrize(("length", "stride"), [(10.0, None), (10.0, 3.0), (8.0, 4.0), (40.0, None), (1.0, 1.0)])
def test_a_window_holds_what_is_delivered_within_it(length, stride):
    found = next(windows(RUNS[:1], FAMILY, length, stride=stride))
    data, begins = RUNS[0].data, np.arange(0.0, 40.0 - length + 0.5, stride or length)
    np.testing.assert_allclose(found["interval"], np.stack([begins, begins + length], axis=1))
    for i, (begin, end) in enumerate(found["interval"]):
        within = (data.imu.time > begin + 1e-6) & (data.imu.time < end + 1e-6)
        valid = found["imu"]["valid"][i] == 1
        np.testing.assert_array_equal(found["imu"]["time"][i, valid], data.imu.time[within])
        np.testing.assert_array_equal(found["imu"]["angular_rate"][i, valid], data.imu.angular_rate[within])
        np.testing.assert_array_equal(found["imu"]["specific_force"][i, valid], data.imu.specific_force[within])
        for name, s in data.aids.items():
            within = (s.time > begin + 1e-6) & (s.time < end + 1e-6)
            valid = found[name]["valid"][i] == 1
            for key, values in (("time", s.time), ("value", s.value), ("faults", s.faults), ("sigma", s.sigma),
                                ("fault_error", s.fault_error)):  # fmt: skip
                np.testing.assert_array_equal(found[name][key][i, valid], values[within])
                assert not found[name][key][i, ~valid].any()
        k = np.searchsorted(data.truth.time, begin + 1e-6)
        first = RUNS[0].initial_truth.position[0] if begin == 0.0 else data.truth.position[k - 1]
        np.testing.assert_array_equal(found["truth"][i, 0, 0], first)
        np.testing.assert_array_equal(found["truth"][i, 1:, 2], data.truth.attitude[k : k + round(length)])


def test_all_windows_of_a_family_have_the_same_arrays():
    parts = list(windows(RUNS, FAMILY, 10.0))
    assert len({tuple(sorted(run.data.aids)) for run in RUNS}) > 1  # they do not have the same instruments
    shapes = [{path: (a.shape[1:], a.dtype) for path, a in entries(part)} for part in parts]
    assert all(shape == shapes[0] for shape in shapes)
    for run, part in zip(RUNS, parts, strict=True):
        absent = {"gnss", "dvl"} - set(run.data.aids)
        assert not any(part[name]["valid"].any() for name in absent)


def test_faults_of_the_imu_are_labelled():
    family = load("training-motion").model_copy(update={"duration": 150.0})
    run = next(r for r in (record(family, seed) for seed in range(9)) if r.data.imu_labels and
               r.data.imu_labels.faults.any())  # fmt: skip
    found = next(windows([run], family, 10.0))["imu"]
    valid = found["valid"] == 1
    np.testing.assert_array_equal(found["faults"][valid], run.data.imu_labels.faults)
    np.testing.assert_array_equal(found["fault_error"][valid], run.data.imu_labels.fault_error)


def test_batches_hold_the_windows_of_the_runs_in_order():
    whole = [dict(entries(part)) for part in windows(RUNS, FAMILY, 10.0, stride=5.0)]
    batches = [dict(entries(part)) for part in windows(RUNS, FAMILY, 10.0, stride=5.0, batch=9)]
    assert [len(b["seed"]) for b in batches] == [9, 9, 9, 9, 6]
    for path in whole[0]:
        np.testing.assert_array_equal(
            np.concatenate([b[path] for b in batches]), np.concatenate([w[path] for w in whole])
        )


def test_without_a_truth_there_are_no_labels():
    told, hidden = (dict(entries(next(windows([r], FAMILY, 10.0)))) for r in (RUNS[0], without_truth(RUNS[0])))
    gone = {path.rpartition(".")[2] for path in set(told) - set(hidden)}
    assert gone == {"truth", "faults", "fault_error", "sigma"}
    np.testing.assert_array_equal(told["imu.angular_rate"], hidden["imu.angular_rate"])


def test_channels_have_a_slot_each():
    scenario = load("satellites-open-sea").model_copy(update={"duration": 12.0, "faults": ()})
    run = record(scenario, 1)
    stream = run.data.aids["gnss"]
    found = next(windows([run], scenario, 4.0))["gnss"]
    slots = found["valid"].nonzero()[1] % len(stream.channels)
    np.testing.assert_array_equal(slots, stream.channel)
    np.testing.assert_array_equal(found["side"][found["valid"] == 1], stream.side)


def test_late_readings_are_in_the_window_in_which_they_arrive():
    scenario = load("late-aids").model_copy(update={"duration": 30.0})
    run = record(scenario, 1)
    stream = run.data.aids["fix"]
    found = next(windows([run], scenario, 5.0))["fix"]
    counts = np.histogram(stream.arrivals, np.arange(0.0, 31.0, 5.0) + 1e-6)[0]
    np.testing.assert_array_equal(found["valid"].sum(axis=1), counts)
    assert set(found["time"][found["valid"] == 1]) <= set(stream.stamps)
    assert (stream.arrivals > stream.time).all()


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"length": 2.5}, "length = 2.5: a multiple of the step of training-gnss-faults-v2 is wanted, from 1 to 40 s"),
        ({"length": 50.0}, "length = 50.0: .* from 1 to 40 s"),
        ({"length": float("nan")}, "length = nan: "),
        ({"length": 5.0, "stride": 6.0}, "stride = 6.0: .* from 1 to 5 s"),
        ({"length": 5.0, "stride": 0.0}, "stride = 0.0: "),
        ({"length": 5.0, "batch": 0}, "batch = 0: a batch has at least 1 window"),
    ],
)
def test_what_is_not_possible_is_refused(more, message):
    with pytest.raises(ValueError, match=message):
        windows(RUNS, FAMILY, **more)
