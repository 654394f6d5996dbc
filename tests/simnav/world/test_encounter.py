"""The response ``encounter``: gains at the encounter frequency, yaw, and waves in water of a finite depth."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.geometry.rotation import wrap_angle
from simnav.scenario import parse
from simnav.simulation.simulator import Simulator, simulate
from simnav.simulation.steps import SteppedRuns
from simnav.spec import SpecError
from simnav.world import Current, Sea, Ship, Start, Turn, Uuv
from simnav.world.sea import components, spectrum, steady, wave_number
from simnav.world.world import World

SEA = Sea(
    significant_height=2.0, peak_period=8.0, direction=0.0, spreading=0.0, components=64, response="encounter",
    heave_period=7.0, heave_damping=0.3, roll_period=10.0, roll_damping=0.12,
)  # fmt: skip


def sailed(
    heading: float, sea: Sea = SEA, seconds: float = 60.0, rate: float = 20.0, speed: float = 7.0, seed: int = 4, **more
):
    """Motion at the samples: time, down velocity, roll, pitch and yaw off the course."""
    start = Start(latitude=0.9, longitude=0.1, heading=np.radians(heading), speed=speed)
    world = World(start, Ship(), [], sea, None, rate=rate, seed=seed, **more)
    time = np.arange(1, round(seconds * rate) + 1) / rate
    tap = world.advance(seconds, {"here": time}).taps["here"]
    return (
        time,
        tap.velocity[:, 2],
        tap.attitude[:, 0],
        tap.attitude[:, 1],
        wrap_angle(tap.attitude[:, 2] - np.radians(heading)),
    )


@pytest.mark.parametrize("heading", [0.0, 45.0, 90.0, 135.0, 180.0])
def test_motion_is_that_at_the_encounter_frequency(heading: float):
    """Against the sum over the components, each with its gain at its encounter frequency."""
    time, down, roll, pitch, yaw = sailed(heading)
    phase, table = components(SEA, 4)
    psi = np.radians(heading)
    north, east = 7.0 * np.cos(psi), 7.0 * np.sin(psi)
    rate = table[0] - table[1] * north - table[2] * east
    exact = np.array(
        [
            steady(SEA, np.vstack([np.cos(a), np.sin(a), rate]), table, north, east, psi)[:, 0]
            for t in time[::40]
            for a in [np.arctan2(phase[1], phase[0]) + rate * t]
        ]
    )
    found = np.stack([down, roll, pitch, yaw], axis=1)[::40]
    size = np.maximum(np.abs(exact).max(axis=0), 1e-3)
    np.testing.assert_allclose(found / size, exact / size, atol=0.01)


@pytest.mark.parametrize("heading", [0.0, 45.0, 90.0, 135.0, 180.0])
def test_the_energy_of_heave_and_roll_is_at_the_encounter_frequency(heading: float):
    """Within 5 %: the mean frequency of the simulated motion against that of the wave spectrum times the response."""
    sea = SEA.model_copy(update={"components": 256})
    runs = [sailed(heading, sea, 1200.0, rate=4.0, seed=seed) for seed in range(6)]  # each draws its components
    omega = np.linspace(0.4, 5.5, 8000) * 2.0 * np.pi / sea.peak_period  # what the components span
    psi = np.radians(heading)
    encounter = omega + omega**2 / 9.81 * 7.0 * np.cos(psi)  # waves from the north: a ship to the north meets them
    for which, (natural, damping), size in (
        (1, sea.oscillators[0], encounter**2),
        (2, sea.oscillators[1], omega**4),
    ):
        values = np.array([run[which] for run in runs])
        if np.std(values) < 1e-9:  # waves along the keel do not roll the ship
            continue
        answer = natural**2 / np.abs(natural**2 - encounter**2 + 2j * damping * natural * encounter)
        density = spectrum(sea, omega) * answer**2 * size
        wanted = np.sum(np.abs(encounter) * density) / np.sum(density)
        power = np.sum(np.abs(np.fft.rfft(values * np.hanning(values.shape[1]))) ** 2, axis=0)
        frequency = 2.0 * np.pi * np.fft.rfftfreq(values.shape[1], 0.25)
        assert np.sum(frequency * power) / np.sum(power) == pytest.approx(wanted, rel=0.05)


def test_a_following_sea_rolls_a_ship_at_another_period_than_a_head_sea():
    sea = SEA.model_copy(update={"spreading": 0.4})

    def period(heading: float) -> float:
        _, down, _, _, _ = sailed(heading, sea, 600.0, rate=4.0)
        return 600.0 / np.count_nonzero(np.diff(np.sign(down)) > 0)

    assert period(0.0) < 0.7 * period(180.0)


def test_yaw_is_largest_in_quartering_seas_and_absent_ahead_and_abeam():
    size = {heading: np.std(sailed(heading, speed=3.0)[4]) for heading in (0.0, 45.0, 90.0)}
    assert size[45.0] > np.radians(0.05)
    assert size[0.0] < 0.02 * size[45.0]
    assert size[90.0] < 0.02 * size[45.0]


def test_wave_numbers_fulfil_the_dispersion_relation_and_are_those_of_deep_and_of_shallow_water():
    omega = np.array([0.3, 0.7, 1.5, 3.0])
    number = wave_number(omega, 12.0)
    np.testing.assert_allclose(9.81 * number * np.tanh(12.0 * number), omega**2, rtol=1e-12)
    np.testing.assert_allclose(wave_number(omega), omega**2 / 9.81)
    np.testing.assert_allclose(wave_number(omega, 1e4), omega**2 / 9.81, rtol=1e-12)
    assert wave_number(np.array([0.05]), 5.0)[0] == pytest.approx(0.05 / np.sqrt(9.81 * 5.0), rel=1e-3)


def test_shallow_water_makes_waves_shorter_and_steeper():
    _, _, deep, _, _ = sailed(90.0, SEA.model_copy(update={"peak_period": 12.0}), speed=0.0)
    _, _, shallow, _, _ = sailed(90.0, SEA.model_copy(update={"peak_period": 12.0}), speed=0.0, depth=8.0)
    assert np.std(shallow) > 1.3 * np.std(deep)


def test_ideal_samples_follow_the_motion_also_in_a_turn():
    """Mean angular rate of a sample against the difference of the attitudes, with yaw from waves."""
    start = Start(latitude=0.9, longitude=0.1, heading=0.7, speed=6.0)
    world = World(start, Ship(), [Turn(angle=2.0)], SEA, Current(speed=0.5), rate=50.0, seed=2)
    time = np.arange(1, 1501) / 50.0
    block = world.advance(30.0, {"here": time})
    tap = block.taps["here"]
    yaw_rate = np.gradient(np.unwrap(tap.attitude[:, 2]), time)
    roll, pitch = tap.attitude[:, 0], tap.attitude[:, 1]
    body = (np.cos(roll) * np.cos(pitch) * yaw_rate - np.sin(roll) * np.gradient(pitch, time))[5:-5]
    np.testing.assert_allclose(block.imu.angular_rate[5:-5, 2], body, atol=2e-3)


def test_under_water_the_motion_decreases():
    start = Start(latitude=0.9, longitude=0.1, height=-20.0, heading=0.7, speed=2.0)
    deep = World(start, Uuv(), [], SEA, None, rate=10.0, seed=2)
    tap = deep.advance(60.0, {"here": np.arange(1.0, 61.0)}).taps["here"]
    assert np.std(tap.attitude[:, 0]) < 0.4 * np.std(sailed(40.0, speed=2.0)[2])


def test_scenarios_that_do_not_name_it_are_unchanged():
    head = 'name = "a"\nversion = 1\ntitle = "a"\nduration_s = 10.0\n[start]\nlatitude_deg = 1.0\nlongitude_deg = 1.0\n'
    sea = "[sea]\nsignificant_height_m = 1.0\npeak_period_s = 6.0\n"
    depth = "[instruments.depth]\nsigma_m = 0.1\n"
    plain = parse(head + sea + depth)
    assert "response" not in plain.model_dump()["sea"]
    assert "response" in parse(head + sea + 'response = "encounter"\n' + depth).model_dump()["sea"]
    with pytest.raises(SpecError, match="yaw_gain is of no use without response"):
        parse(head + sea + "yaw_gain = 0.2\n" + depth)


def test_one_block_many_blocks_and_steps_give_the_same_numbers():
    head = (
        'name = "a"\nversion = 1\ntitle = "a"\nduration_s = 20.0\nwater_depth_m = 15.0\n[start]\nlatitude_deg = 1.0\n'
        'longitude_deg = 1.0\nspeed_m_s = 5.0\n[[manoeuvre]]\nkind = "turn"\nangle_deg = 90.0\n'
        '[sea]\nsignificant_height_m = 1.5\npeak_period_s = 6.0\nresponse = "encounter"\n'
    )
    scenario = parse(head + "[instruments.gyrocompass]\nrate_hz = 2.0\nsigma_deg = 0.1\n")
    whole = simulate(scenario, 5).data.aids["gyrocompass"].value
    simulator = Simulator(scenario, 5)
    parts = [simulator.advance(t).aids["gyrocompass"].value for t in (3.0, 4.0, 20.0)]
    np.testing.assert_array_equal(np.concatenate(parts), whole)
    runs = SteppedRuns(1)
    runs.begin(0, Simulator(scenario, 5))
    stepped = []
    for _ in range(20):
        runs.advance(np.array([True]))
        stepped += [m.value for m in runs.packet(0).aids]
    np.testing.assert_array_equal(np.array(stepped), whole)
