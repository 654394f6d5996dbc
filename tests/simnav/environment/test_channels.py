"""Instruments with channels in the environment: a fixed slot for each, and the same packets for an agent."""

from __future__ import annotations

import copy

import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from simnav.environment import NavigationEnv, NavigationVectorEnv, NormaliseObservation
from simnav.environment.agent import unpack
from simnav.geometry.earth import relative_position
from simnav.simulation.simulator import Simulator
from simnav.simulation.steps import SteppedRuns
from simnav.source import record
from tests.cases.fjord import WITH_CHANNELS, fjord

FAULTS = """
[[fault]]
kind = "outage"
instruments = "beacons"
channels = ["A", "C"]
start_s = 4.0
end_s = 9.0
[[fault]]
kind = "frozen"
instruments = "beacons"
channels = "B"
mean_active_s = 3.0
mean_gap_s = 3.0
[[fault]]
kind = "gross_error"
instruments = "beacons"
probability = 0.3
size_m = [20.0, 40.0]
"""


@pytest.fixture
def scenario(plugins):
    scenario = fjord(plugins, "beacons", duration=20.0, tables=FAULTS)
    fast = scenario.aids["beacons"].model_copy(update={"rate": 2.0 / scenario.step})
    return scenario.model_copy(update={"instruments": {**scenario.instruments, "beacons": fast}})


def known(scenario) -> np.ndarray:
    """A constant action near the start."""
    start = Simulator(scenario, 1).initial_truth
    return np.stack([start.position[0], start.velocity[0], start.attitude[0]])


def assert_same(own, expected):
    assert [(*m[:3], m.channel) for m in own.aids] == [(*m[:3], m.channel) for m in expected.aids]
    for mine, theirs in zip(own.aids, expected.aids, strict=True):
        assert np.array_equal(mine.value, theirs.value)
        assert np.array_equal(mine.side, theirs.side)


def test_a_channel_has_its_own_slots(scenario):
    env = NavigationEnv(scenario)
    space = env.observation_space["beacons"]
    assert {key: part.shape for key, part in space.items()} == {
        "time": (10,), "valid": (10,), "value": (10, 1), "side": (10, 4),
    }  # fmt: skip
    stream, action = record(scenario, 3).data.aids["beacons"], known(scenario)
    observation, info = env.reset(seed=3)
    over, seen = False, 0
    while not over:
        entry = observation["beacons"]
        assert env.observation_space.contains(observation)
        for i in np.flatnonzero(entry["valid"]):
            row = int(stream.places(entry["time"][i : i + 1], np.array([i % 5], np.int16))[0])
            assert (stream.time[row], stream.channel[row]) == (entry["time"][i], i % 5)
            assert np.array_equal(entry["value"][i], stream.value[row])
            assert np.array_equal(entry["side"][i], stream.side[row])
            seen += 1
        absent = entry["valid"] == 0
        assert not any(entry[key][absent].any() for key in ("time", "value", "side"))
        observation, _, _, over, _ = env.step(action)
    assert seen == len(stream)
    assert info["instruments"]["beacons"].channels == stream.channels


@pytest.mark.parametrize("case", WITH_CHANNELS)
def test_an_agent_receives_the_packets_of_the_recording(plugins, case):
    scenario = fjord(plugins, case, duration=20.0)
    recording, env, action = record(scenario, 2), NavigationEnv(scenario), known(scenario)
    observation, info = env.reset(seed=2)
    for packet in recording.steps():
        assert_same(unpack(observation, info["instruments"]), packet)
        observation = env.step(action)[0]


def test_closed_loop_has_the_same_slots(scenario):
    loop = NavigationEnv(scenario, closed_loop=True)
    observation, info = loop.reset(seed=4)
    action, over, k = known(scenario), False, 0
    while not over:
        assert_same(unpack(observation, info["instruments"]), loop._runs.packet(0))
        k += 1
        if k == 5:  # a copy goes on by itself
            again = copy.deepcopy(loop)
            again.step(action)
            assert np.array_equal(loop._observed.columns["beacons"]["side"][4], observation["beacons"]["side"])
        observation, _, _, over, _ = loop.step(action)
    assert k == round(20.0 / scenario.step)


def test_step_by_step_gives_the_numbers_of_blocks(scenario):
    runs, simulator = SteppedRuns(2), Simulator(scenario, 5)
    runs.begin(0, Simulator(scenario, 5))
    runs.begin(1, Simulator(scenario, 6))
    recording = record(scenario, 5)
    stream = recording.data.aids["beacons"]
    labels = []
    for k, packet in enumerate(recording.steps()):
        for each in (*runs.simulators, simulator):
            each.steer_by(0.0, 0.0)
        runs.advance(np.ones(2, bool))
        own = runs.packet(0)
        assert (own.start, own.time) == pytest.approx((packet.start, packet.time))
        assert_same(own, packet)
        names = [runs.names[0][i] for i in runs.who[0, : runs.count[0]]]
        labels += [f for f, name in zip(runs.faults[0], names, strict=False) if name == "beacons"]
        assert k < 1000
    assert labels == stream.faults.tolist()
    assert {1 << j for j in range(3)} - set(labels) == {1}  # an outage leaves no label on a reading


def test_the_vector_form_has_an_axis_of_runs(scenario):
    env = NavigationVectorEnv(scenario, 2)
    observation, _ = env.reset(seed=7)
    assert observation["beacons"]["side"].shape == (2, 10, 4)
    single, _ = NavigationEnv(scenario).reset(seed=8)
    assert np.array_equal(observation["beacons"]["value"][1], single["beacons"]["value"])


def test_a_normalised_observation_has_places_from_the_start(scenario):
    plain = NavigationEnv(scenario)
    observation, info = plain.reset(seed=1)
    env = NormaliseObservation(NavigationEnv(scenario))
    normalised, _ = env.reset(seed=1)
    assert env.observation_space.contains(normalised)
    entry = observation["beacons"]
    i = int(np.flatnonzero(entry["valid"])[0])
    place = relative_position(entry["side"][i, :3], info["start"].position) / 1000.0
    assert normalised["beacons.side"][i, :3] == pytest.approx(place, abs=1e-6)
    assert not normalised["beacons.side"][entry["valid"] == 0].any()


@pytest.mark.parametrize("closed_loop", [False, True])
def test_gymnasium_accepts_it(scenario, closed_loop):
    check_env(NavigationEnv(scenario, closed_loop=closed_loop), skip_render_check=True)
