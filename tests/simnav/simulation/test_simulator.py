"""The simulator: reproducible to the bit, in one block or in many, with independent processes."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from simnav.geometry.earth import displace
from simnav.geometry.rotation import dcm_from_rpy
from simnav.recording import Block, Recording
from simnav.scenario import Scenario, load
from simnav.simulation.simulator import Simulator, ideal, sample_times, simulate, simulate_many
from simnav.spec import SpecError
from simnav.strapdown import integrate
from tests.cases.sorts_of_scenarios import OF_EVERY_SORT


def shortened(name: str, duration: float = 120.0, **changes) -> Scenario:
    return load(name).model_copy(update={"duration": duration, **changes})


def assert_same_block(a: Block, b: Block) -> None:
    assert (a.imu is None) == (b.imu is None)
    if a.imu is not None:
        for field in ("time", "interval", "angular_rate", "specific_force"):
            np.testing.assert_array_equal(getattr(a.imu, field), getattr(b.imu, field))
    if a.imu_labels is not None:
        np.testing.assert_array_equal(a.imu_labels.faults, b.imu_labels.faults)
        np.testing.assert_array_equal(a.imu_labels.fault_error, b.imu_labels.fault_error)
    assert a.aids.keys() == b.aids.keys()
    for name, stream in a.aids.items():
        for field in ("time", "value", "faults", "fault_error", "sigma", "dropped"):
            np.testing.assert_array_equal(
                getattr(stream, field), getattr(b.aids[name], field), err_msg=f"{name}.{field}"
            )
    for field in ("time", "position", "velocity", "attitude"):
        np.testing.assert_array_equal(getattr(a.truth, field), getattr(b.truth, field))


@pytest.mark.parametrize("name", OF_EVERY_SORT)
def test_one_block_and_many_give_the_same_recording(name):
    # Long enough to reach into the first faults of most scenarios
    scenario = shortened(name, min(load(name).duration, 300.0))
    whole = simulate(scenario, 7).data
    simulator, parts = Simulator(scenario, 7), []
    rng = np.random.default_rng(0)
    while simulator.time < scenario.duration:
        parts.append(simulator.advance(simulator.time + scenario.step * int(rng.integers(1, 30))))
    assert_same_block(whole, Block.concatenate(parts))


@pytest.mark.parametrize("name", OF_EVERY_SORT)
def test_seeds_fix_a_run_and_differ(name):
    scenario = shortened(name)
    first, again, other = simulate(scenario, 1), simulate(scenario, 1), simulate(scenario, 2)
    assert_same_block(first.data, again.data)
    np.testing.assert_array_equal(first.start.position, again.start.position)
    assert not np.array_equal(first.start.position, other.start.position)
    assert first.data.aids
    for name, stream in first.data.aids.items():  # a family draws which instruments there are
        if len(stream.value) and name in other.data.aids:
            assert not np.array_equal(stream.value, other.data.aids[name].value)


DIGEST = """
import hashlib
from simnav.scenario import load
from simnav.simulation.simulator import simulate
data = simulate(load("open-sea").model_copy(update={"duration": 60.0}), 3).data
arrays = [data.imu.angular_rate, data.imu.specific_force, data.truth.position, *(s.value for s in data.aids.values())]
print(hashlib.sha256(b"".join(a.tobytes() for a in arrays)).hexdigest())
"""


def test_another_process_gives_the_same_bits(capsys):
    done = subprocess.run([sys.executable, "-c", DIGEST], capture_output=True, text=True, check=True)
    exec(DIGEST, {})
    assert done.stdout == capsys.readouterr().out != ""


def test_switching_an_instrument_or_a_fault_off_changes_no_bit_of_the_others():
    scenario = load("coastal-voyage").model_copy(update={"duration": 200.0})
    whole = simulate(scenario, 4).data
    without = {n: s for n, s in scenario.instruments.items() if n != "dvl"}
    faults = tuple(f for f in scenario.faults if "dvl" not in f.instruments)
    partial = simulate(scenario.model_copy(update={"instruments": without, "faults": faults}), 4).data
    np.testing.assert_array_equal(whole.imu.specific_force, partial.imu.specific_force)
    for name in partial.aids:
        np.testing.assert_array_equal(whole.aids[name].value, partial.aids[name].value)
    clean = simulate(scenario.model_copy(update={"faults": ()}), 4).data
    for name, stream in clean.aids.items():
        untouched = whole.aids[name].faults == 0
        kept = np.isin(np.round(stream.time, 6), np.round(whole.aids[name].time[untouched], 6))
        np.testing.assert_array_equal(stream.value[kept], whole.aids[name].value[untouched])


def test_runs_that_share_one_truth_are_the_runs_themselves():
    scenario = shortened("open-sea", 60.0, world_seed=11)
    shared = list(simulate_many(scenario, [5, 6]))
    assert [r.seed for r in shared] == [5, 6]
    for recording in shared:
        assert_same_block(recording.data, simulate(scenario, recording.seed).data)
    np.testing.assert_array_equal(shared[0].data.truth.position, shared[1].data.truth.position)
    assert not np.array_equal(shared[0].data.imu.angular_rate, shared[1].data.imu.angular_rate)


def test_initial_errors_are_drawn_from_their_covariance():
    from simnav.geometry.earth import relative_position

    scenario = shortened("open-sea", 1.0)
    sigma = np.array(scenario.initial_error.position)
    errors = []
    for seed in range(400):
        simulator = Simulator(scenario, seed)
        errors.append(relative_position(simulator.start.position, simulator.initial_truth.position[0]))
    normalised = np.array(errors) / sigma
    assert np.abs(normalised.mean(axis=0)).max() < 4.0 / np.sqrt(400)
    assert np.abs(normalised.std(axis=0) - 1.0).max() < 4.0 / np.sqrt(800)


def test_packets_hold_every_sample_once_and_in_its_step():
    recording: Recording = simulate(shortened("auv-survey", 90.0), 1)
    packets = list(recording.steps())
    assert len(packets) == 90
    assert sum(len(p.imu) for p in packets) == len(recording.data.imu)
    assert sum(len(p) for p in packets) == sum(len(s) for s in recording.data.aids.values())
    for p in packets:
        times = [m.time for m in p]
        assert times == sorted(times)
        assert all(p.start - 1e-6 < t <= p.time + 1e-6 for t in [*times, *p.imu.time])


def test_sample_times_hit_their_phase_and_split_cleanly():
    np.testing.assert_allclose(sample_times(1.0, 0.3, 0.0, 3.0), [0.3, 1.3, 2.3])
    assert len(sample_times(1.0, 0.0, 0.0, 5.0)) == 5  # not at time 0, which belongs to no step
    whole = sample_times(3.0, 0.1, 0.0, 100.0)
    parts = np.concatenate([sample_times(3.0, 0.1, float(a), float(a + 1)) for a in range(100)])
    np.testing.assert_array_equal(whole, parts)


def test_step_that_does_not_fit_the_imu_is_named():
    with pytest.raises(SpecError, match=r"step_s = 0\.125"):
        Simulator(load("open-sea").model_copy(update={"step": 0.125}), 1)


@pytest.mark.parametrize("seed", [-1, 1.5, "3", True])
def test_bad_seeds_are_named(seed):
    with pytest.raises(ValueError, match="non-negative integer"):
        Simulator(shortened("open-sea", 1.0), seed)


@pytest.mark.parametrize("name", OF_EVERY_SORT)
def test_ideal_run_is_the_run_without_its_errors(name):
    scenario = shortened(name, min(load(name).duration, 300.0))
    real, perfect = simulate(scenario, 3), ideal(scenario, 3)
    np.testing.assert_array_equal(real.data.truth.position, perfect.data.truth.position)
    np.testing.assert_array_equal(perfect.start.position, perfect.initial_truth.position[0])
    np.testing.assert_array_equal(perfect.start.covariance, real.start.covariance)
    for key, stream in perfect.data.aids.items():
        delivered = real.data.aids[key]
        for field in ("time", "faults", "sigma", "dropped"):
            np.testing.assert_array_equal(getattr(stream, field), getattr(delivered, field))
        assert not stream.fault_error.any()
        if stream.kind == "gnss_position":  # the antenna, from the truth at the ends of the steps
            sheet, truth = perfect.instruments[key], perfect.data.truth
            at = np.searchsorted(truth.time, stream.time - 1e-6)
            same = np.abs(truth.time[at] - stream.time) < 1e-6
            lever = dcm_from_rpy(truth.attitude[at]) @ sheet.lever_arm
            antenna = displace(truth.position[at], lever)
            np.testing.assert_allclose(stream.value[same], antenna[same], rtol=0, atol=1e-9)
    if perfect.data.imu is not None:  # perfect samples integrate to the truth
        imu, begin, truth = perfect.data.imu, perfect.initial_truth, perfect.data.truth
        states = integrate(begin.position[0], begin.velocity[0], begin.attitude[0], imu)
        np.testing.assert_allclose(states.velocity[-1], truth.velocity[-1], atol=1e-6)


def northward(latitude_deg: float) -> Scenario:
    """A ship that goes towards the nearer pole with 10 m/s."""
    table = load("ship-straight").to_toml()
    table["start"] |= {
        "latitude_deg": latitude_deg,
        "speed_m_s": 10.0,
        "heading_deg": 0.0 if latitude_deg > 0 else 180.0,
    }
    return Scenario.from_toml(table).model_copy(update={"duration": 30.0})


@pytest.mark.parametrize("latitude_deg", [88.9995, -88.9995])
def test_a_voyage_that_comes_within_a_degree_of_a_pole_is_refused(latitude_deg: float):
    assert len(simulate(northward(0.9999 * latitude_deg), 0).data.truth)
    said = (
        r"ship-straight-v\d+: the latitude of the vessel at 6 s should be less than 89 degrees .* axes north and east"
    )
    with pytest.raises(SpecError, match=said):
        simulate(northward(latitude_deg), 0)


@pytest.mark.parametrize("latitude_deg", [89.0, -89.0, 90.0])
def test_a_start_within_a_degree_of_a_pole_is_refused_with_the_reason(latitude_deg: float):
    said = rf"start.latitude_deg = {latitude_deg}: should be less than 89 degrees .* axes north and east"
    with pytest.raises(SpecError, match=said):
        northward(latitude_deg)
