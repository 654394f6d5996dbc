"""The environment: the same data as everybody's, one estimate a step, nothing of the truth unless asked."""

from __future__ import annotations

import gc
import math
import tracemalloc
import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from hypothesis import given, settings
from hypothesis import strategies as st

import simnav
from simnav.environment import EstimatorAgent, NavigationEnv, unpack
from simnav.environment import navigation as environment
from simnav.environment.observed_steps import pack
from simnav.estimator import Estimator, make
from simnav.geometry.earth import displace
from simnav.log import LogError
from simnav.recording import AidStream, Block, packets
from simnav.scenario import load, parse
from simnav.scenario.catalogue import headers
from simnav.source import open_source, record
from simnav.trial import run_trial
from simnav.types import Datasheet, Estimate, ImuDatasheet, ImuSamples, Instruments, NavigationStates, TriadDatasheet
from tests.cases.sorts_of_rows import first_of_each_sort
from tests.cases.sorts_of_scenarios import OF_EVERY_SORT

TOML = """
name = "small"
version = 1
title = "everything, for a short while"
duration_s = 40.0
step_s = 1.0
water_depth_m = 80.0
[start]
latitude_deg = 50.0
longitude_deg = -5.0
speed_m_s = 5.0
[sea]
significant_height_m = 1.0
peak_period_s = 7.0
[instruments.imu]
rate_hz = 50.0
gyroscope = { random_walk_deg_sqrt_h = 0.05 }
[instruments.gnss]
kind = "gnss_position"
rate_hz = 0.4
sigma_m = [2.0, 2.0, 4.0]
[instruments.dvl]
rate_hz = 2.5
phase_s = 0.15
sigma_m_s = 0.02
[instruments.gyrocompass]
rate_hz = 10.0
sigma_deg = 0.5
[instruments.depth]
rate_hz = 3.0
sigma_m = 0.1
[[fault]]
kind = "outage"
instruments = ["gnss"]
start_s = 10.0
end_s = 20.0
"""


@pytest.fixture(scope="module")
def scenario():
    return parse(TOML)


def answer(info):
    return info["truth"] if "truth" in info else np.stack([getattr(info["start"], v) for v in VECTORS])


VECTORS = ("position", "velocity", "attitude")


def play(env, seed, steps=None):
    """Observations and rewards of a run answered with its initial state."""
    observation, info = env.reset(seed=seed)
    action = answer(info)
    seen, rewards, truncated = [observation], [], False
    while not truncated and (steps is None or len(rewards) < steps):
        observation, reward, terminated, truncated, _ = env.step(action)
        assert terminated is False
        seen.append(observation)
        rewards.append(reward)
    return seen, rewards


def flat(observation):
    return {
        (name, key): array
        for name, entry in observation.items()
        for key, array in (entry.items() if isinstance(entry, dict) else [("", entry)])
    }


def assert_same(a, b):
    a, b = flat(a), flat(b)
    assert a.keys() == b.keys()
    for key in a:
        np.testing.assert_array_equal(a[key], b[key], err_msg=str(key))


def assert_packets_equal(a, b):
    assert (a.start, a.time) == (b.start, b.time)
    assert (a.imu is None) == (b.imu is None)
    for name in ("time", "interval", "angular_rate", "specific_force") if a.imu is not None else ():
        np.testing.assert_array_equal(getattr(a.imu, name), getattr(b.imu, name))
    assert [(m.time, m.instrument, m.kind) for m in a.aids] == [(m.time, m.instrument, m.kind) for m in b.aids]
    for m, n in zip(a.aids, b.aids, strict=True):
        np.testing.assert_array_equal(m.value, n.value)


# ------------------------------------------------------------------------------------------------- observations

times = st.lists(st.floats(0.001, 10.0), max_size=30).map(sorted)


@settings(max_examples=60)
@given(imu=times, fixes=times, headings=st.lists(st.integers(1, 40).map(lambda k: k / 4), max_size=30).map(sorted))
def test_an_observation_holds_the_packet_of_its_step_whatever_the_timing(imu, fixes, headings):
    rng = np.random.default_rng(0)

    def stream(name, kind, t, d):
        zero = np.zeros((len(t), d))
        labels = np.zeros(len(t), np.uint32)
        return AidStream(name, kind, np.array(t), rng.random((len(t), d)), labels, zero, zero, np.empty(0))

    ends = np.arange(1.0, 11.0)
    aids = {"b": stream("b", "gnss_position", fixes, 3), "a": stream("a", "gyrocompass", headings, 1)}
    n = len(imu)
    samples = ImuSamples(np.array(imu), np.full(n, 0.1), rng.random((n, 3)), rng.random((n, 3)))
    states = NavigationStates(ends, *rng.random((3, 10, 3)))
    block = Block(0.0, 10.0, samples, None, aids, states)
    sheets = Instruments(
        [Datasheet("b", "gnss_position", 30.0, np.ones(3)), Datasheet("a", "gyrocompass", 30.0, np.ones(1))],
        imu=ImuDatasheet(30.0, TriadDatasheet(), TriadDatasheet()),
    )
    observed = pack(block, 0.0, {"imu": 30, "a": 30, "b": 30})
    for i, packet in enumerate(packets(block, ends)):
        observation = {"interval": observed.intervals[i]}
        observation |= {name: {k: v[i] for k, v in columns.items()} for name, columns in observed.columns.items()}
        assert_packets_equal(unpack(observation, sheets), packet)
        for entry in (observation["imu"], observation["a"], observation["b"]):
            for array in entry.values():
                assert not array[entry["valid"] == 0].any()


def test_too_many_samples_in_a_step_are_an_error_and_not_lost():
    t = np.array([0.1, 0.2, 0.3])
    stream = AidStream("log", "speed_log", t, t[:, None], np.zeros(3, np.uint32), t[:, None], t[:, None], np.empty(0))
    states = NavigationStates(np.array([1.0]), *np.zeros((3, 1, 3)))
    with pytest.raises(ValueError, match="log delivered 3 samples in one step"):
        pack(Block(0.0, 1.0, None, None, {"log": stream}, states), 0.0, {"log": 2})


def test_stepping_gives_the_recording_bit_for_bit(scenario):
    recording = record(scenario, 11)
    seen, _ = play(NavigationEnv(scenario), 11)
    steps = list(recording.steps())
    assert len(seen) == len(steps) + 1 == 41
    for observation, packet in zip(seen, steps, strict=False):
        assert_packets_equal(unpack(observation, recording.instruments), packet)
    assert seen[-1]["interval"].tolist() == [40.0, 40.0]
    assert not any(array.any() for key, array in flat(seen[-1]).items() if key[0] != "interval")


@pytest.mark.parametrize("name", [*OF_EVERY_SORT, *(h.name for h in headers() if h.recorded)])
def test_the_first_steps_of_every_sort_of_scenario_are_those_of_its_recording(name):
    env = made(name)
    seen, _ = play(env, 5, steps=40)
    source = simnav.open_source(env.scenario, 5)
    block = source.advance(40 * source.step)
    for observation, packet in zip(seen, packets(block, block.truth.time), strict=False):
        assert_packets_equal(unpack(observation, source.instruments), packet)


def test_every_observation_is_in_the_space(scenario):
    env = NavigationEnv(scenario)
    seen, _ = play(env, 3)
    assert all(observation in env.observation_space for observation in seen)
    assert seen[0]["gyrocompass"]["value"].shape == (10, 1)
    assert seen[0]["dvl"]["valid"].shape == (3,)


def test_a_scenario_with_short_steps(scenario):
    env = NavigationEnv(scenario.model_copy(update={"step": 0.1, "duration": 3.0}))
    seen, rewards = play(env, 1)
    assert len(rewards) == 30
    assert [o["imu"]["valid"].sum() for o in seen] == [5] * 30 + [0]


def test_an_observation_does_not_lead_to_the_steps_to_come():
    env = NavigationEnv(parse(TOML))
    observation, _ = env.reset(seed=3)
    assert all(array.base is None for array in flat(observation).values())


def test_observations_do_not_share_memory(scenario):
    seen, _ = play(NavigationEnv(scenario), 2)
    first = [{k: v.copy() for k, v in flat(o).items()} for o in seen]
    for array in flat(seen[5]).values():
        array[...] = 1
    for i, before in enumerate(first):
        if i != 5:
            for key, array in flat(seen[i]).items():
                np.testing.assert_array_equal(array, before[key])


# ------------------------------------------------------------------------------------------------- seeds


def test_a_seed_fixes_the_run(scenario):
    env = NavigationEnv(scenario)
    a, rewards = play(env, 4)
    b, again = play(env, 4)
    c, _ = play(env, 5)
    assert rewards == again
    for x, y in zip(a, b, strict=True):
        assert_same(x, y)
    assert not np.array_equal(a[0]["gyrocompass"]["value"], c[0]["gyrocompass"]["value"])


def test_without_a_seed_every_run_is_another_and_its_seed_is_told(scenario):
    env = NavigationEnv(scenario)
    env.reset(seed=1)
    first, info = env.reset()
    _, other = env.reset()
    assert info["seed"] != other["seed"]
    again, _ = NavigationEnv(scenario).reset(seed=info["seed"])
    assert_same(first, again)


# ------------------------------------------------------------------------------------------------- rewards and truth


def test_the_truth_is_only_told_where_it_is_asked_for(scenario):
    env = NavigationEnv(scenario)
    _, info = env.reset(seed=1)
    assert set(info) == {"seed", "start", "instruments", "note"}
    assert env.step(answer(info))[4] == {}


def test_answering_with_the_truth_costs_nothing(scenario):
    env = NavigationEnv(scenario, reveal_truth=True, reward=dict.fromkeys(environment.REWARDS, 1.0))
    _, info = env.reset(seed=1)
    truth = record(scenario, 1).data.truth
    for k in range(40):
        np.testing.assert_array_equal(info["truth"], np.stack([getattr(truth, v)[k] for v in VECTORS]))
        _, reward, _, truncated, info = env.step(info["truth"])
        assert reward == pytest.approx(0.0, abs=1e-7)
    assert truncated
    np.testing.assert_array_equal(info["truth"][0], truth.position[-1])


def test_what_the_reference_lacks_counts_nothing(scenario, monkeypatch):
    class Gaps:
        """A run whose reference has no height and no attitude, and nothing at all at 3 s."""

        def __init__(self, source):
            self.source = source

        def __getattr__(self, name):
            return getattr(self.source, name)

        def advance(self, until):
            block = self.source.advance(until)
            block.truth.position[:, 2] = np.nan
            block.truth.attitude[...] = np.nan
            block.truth.position[block.truth.time == 3.0] = np.nan
            return block

    monkeypatch.setattr("simnav.source.open_source", lambda *args: Gaps(open_source(*args)))
    plain = NavigationEnv(scenario, render_mode="rgb_array")
    weighted = NavigationEnv(scenario, reward={"horizontal": 1.0, "vertical": 1.0, "position": 1.0, "attitude": 1.0})
    _, rewards = play(plain, 1, steps=6)
    assert [r < 0 for r in rewards] == [True, True, False, True, True, True]
    assert play(weighted, 1, steps=6)[1] == rewards
    assert plain.render().std() > 0


@pytest.mark.parametrize(
    ("reward", "cost"),
    [
        ("horizontal", 5.0),
        ("vertical", 12.0),
        ("position", 13.0),
        ("velocity", 0.7),
        ("attitude", 0.02),
        ({"horizontal": 2.0, "velocity": 10.0}, 17.0),
    ],
)
def test_rewards_are_minus_the_error(scenario, reward, cost):
    env = NavigationEnv(scenario, reveal_truth=True, reward=reward)
    _, info = env.reset(seed=1)
    truth = info["truth"]
    position = displace(truth[0], np.array([3.0, -4.0, 12.0]))
    action = np.stack([position, truth[1] + [0.2, -0.3, 0.6], truth[2] + [0.0, 0.0, 0.02 + math.tau]])
    # yaw alone turns about the down axis, by as much whatever roll and pitch
    assert env.step(action)[1] == pytest.approx(-cost, rel=1e-6)


def test_longitudes_are_compared_around_the_globe(scenario):
    env = NavigationEnv(scenario, reveal_truth=True)
    _, info = env.reset(seed=1)
    action = info["truth"].copy()
    action[0, 1] += math.tau
    assert env.step(action)[1] == pytest.approx(0.0, abs=1e-6)


# ------------------------------------------------------------------------------------------------- bad input


@pytest.mark.parametrize(
    ("action", "message"),
    [
        (np.zeros(9), r"\(3, 3\) array .* not one of shape \(9,\)"),
        (np.zeros((3, 2)), "shape"),
        (np.full((3, 3), np.nan), "finite"),
        ([[0, 0, 0], [0, np.inf, 0], [0, 0, 0]], "finite"),
        ("north", "array of numbers"),
        (None, "shape|numbers"),
    ],
)
def test_a_bad_action_is_one_sentence_and_changes_nothing(scenario, action, message):
    env = NavigationEnv(scenario)
    _, info = env.reset(seed=1)
    with pytest.raises(ValueError, match=message):
        env.step(action)
    good, *_ = env.step(answer(info))
    assert good["interval"].tolist() == [1.0, 2.0]


def test_stepping_needs_a_run(scenario):
    env = NavigationEnv(scenario)
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(np.zeros((3, 3)))
    play(env, 1)
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(np.zeros((3, 3)))
    env.close()
    env.close()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"reward": "speed"}, "reward is one of horizontal, .*'speed' is unknown"),
        ({"reward": {}}, "empty"),
        ({"reward": {"velocity": math.nan}}, "finite"),
        ({"render_mode": "ansi"}, "render_mode"),
    ],
)
def test_bad_options(scenario, options, message):
    with pytest.raises(ValueError, match=message):
        NavigationEnv(scenario, **options)


# ------------------------------------------------------------------------------------------------- closed loop


WAYPOINTS = """
[[manoeuvre]]
kind = "waypoints"
points_m = [[5000.0, 0.0]]
"""


def test_in_closed_loop_a_wrong_estimate_puts_the_vessel_off_its_track(scenario):
    steered = parse(TOML.replace("duration_s = 40.0", "duration_s = 300.0").split("[[fault]]")[0] + WAYPOINTS)

    def last_position(east_error, closed_loop=True):
        env = NavigationEnv(steered, reveal_truth=True, closed_loop=closed_loop)
        _, info = env.reset(seed=8)
        truncated = False
        while not truncated:
            action = info["truth"].copy()
            action[0] = displace(action[0], np.array([0.0, east_error, 0.0]))
            _, reward, _, truncated, info = env.step(action)
            assert reward == pytest.approx(-abs(east_error), abs=1e-6)
        return info["truth"][0]

    right, wrong, deaf = last_position(0.0), last_position(200.0), last_position(200.0, closed_loop=False)
    off = (wrong[1] - right[1]) * 6378e3 * math.cos(right[0])
    assert -200.0 < off < -50.0  # it believes to be east of the track, and steers west
    assert abs(deaf[1] - right[1]) * 4100e3 < 20.0


def test_a_log_cannot_be_steered():
    recorded = [h.id for h in headers() if load(h.id).recorded]
    if not recorded:
        pytest.skip("there is no recorded scenario in the catalogue")
    with pytest.raises(ValueError, match="recorded log"):
        NavigationEnv(recorded[0], closed_loop=True)


# ------------------------------------------------------------------------------------------------- estimators


class Complementary(Estimator):
    """Uses every entry of a packet, so that a wrong or missing one changes the numbers."""

    def reset(self, start, instruments):
        self.position, self.velocity, self.yaw = start.position.copy(), start.velocity.copy(), start.attitude[2]

    def update(self, measurements):
        step = (measurements.imu.angular_rate * measurements.imu.interval[:, None]).sum(axis=0)
        self.yaw += step[2]
        self.velocity = self.velocity + 1e-3 * measurements.imu.specific_force.mean(axis=0)
        for m in measurements:
            if m.kind == "gnss_position":
                self.position = 0.5 * (self.position + m.value)
            elif m.kind == "gyrocompass":
                self.yaw += 0.1 * math.remainder(m.value[0] - self.yaw, math.tau)
            elif m.kind == "dvl":
                self.velocity = 0.9 * self.velocity + 0.1 * m.value
            else:
                self.position = self.position - np.array([0.0, 0.0, 1e-3 * m.value[0] * m.time])
        attitude = np.array([np.nan, np.nan, self.yaw])
        mask = np.array([True] * 6 + [False, False, True])
        return Estimate(measurements.time, self.position, self.velocity, attitude, estimated=mask)


def test_an_estimator_gives_the_same_numbers_as_an_agent_and_on_its_own(scenario):
    trial = run_trial(Complementary(), record(scenario, 21))
    env, agent = NavigationEnv(scenario), EstimatorAgent(Complementary())
    observation, info = env.reset(seed=21)
    agent.reset(info)
    truncated, k = False, 0
    while not truncated:
        action = agent.act(observation)
        np.testing.assert_array_equal(action[0], trial.position[k])
        np.testing.assert_array_equal(action[1], trial.velocity[k])
        assert action[2, 2] == trial.attitude[k, 2]
        np.testing.assert_array_equal(action[2, :2], info["start"].attitude[:2])  # not estimated
        observation, _, _, truncated, _ = env.step(action)
        k += 1
    assert k == len(trial) == 40


@pytest.mark.parametrize("name", [n for n in first_of_each_sort() if not make(n).reference])
def test_every_sort_of_estimator_navigates_in_the_environment_as_in_a_trial(name):
    for where in ("open-sea", "ship-straight", "satellites-open-sea", "auv-and-ship", "terrain-rough"):
        short = load(where).model_copy(update={"duration": 60.0})
        trial = run_trial(make(name), record(short, 4))
        if trial.status != "unsuitable":
            break
    assert trial.status == "ok", trial.reason
    env, agent = NavigationEnv(short), EstimatorAgent(make(name))
    observation, info = env.reset(seed=4)
    agent.reset(info)
    for k in range(60):
        action = agent.act(observation)
        for vector in VECTORS:
            given = getattr(agent.estimate, vector)
            expected = getattr(trial, vector)[k]
            np.testing.assert_array_equal(np.full(3, np.nan) if given is None else given, expected)
        if trial.covariance is not None:
            block = np.ix_(trial.estimated[k], trial.estimated[k])
            np.testing.assert_array_equal(agent.estimate.covariance[block], trial.covariance[k][block])
        observation, *_ = env.step(action)


def test_a_reference_is_no_agent():
    class Oracle(Complementary):
        reference = True

    with pytest.raises(ValueError, match="told the truth"):
        EstimatorAgent(Oracle())


# ------------------------------------------------------------------------------------------------- Gymnasium


def made(name, **options):
    """The environment of a scenario, or a visible skip where its recorded data are absent."""
    scenario = load(name)
    if not scenario.recorded:
        return NavigationEnv(scenario, **options)
    try:
        env = NavigationEnv(scenario, **options)
        env.reset(seed=0)
    except LogError as error:
        if "SIMNAV_DATA" not in str(error):
            raise
        pytest.skip(f"data of {name} are absent: {error}")
    return env


def hash_of(name):
    """A number that stays the same."""
    return sum(name.encode())


#: Whose pictures are looked at, too, which takes longer than all the rest: a vessel, a ship, a family, a log.
DRAWN = ("open-sea-v1", "coastal-voyage-v1", "random-voyages-v1", "ship-nbp1406-v1")


@pytest.mark.parametrize("header", [h for h in headers() if h.id in DRAWN or not hash_of(h.id) % 7], ids=lambda h: h.id)
def test_check_env_passes_without_a_warning(header, monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "Agg")
    made(header.id)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = gymnasium.make(f"simnav:{header.gym_id}").unwrapped
        check_env(env, skip_render_check=header.id not in DRAWN)
        env.close()


def test_memory_does_not_grow_with_the_run(scenario):
    env = NavigationEnv(scenario.model_copy(update={"duration": 20_000.0}))
    _, info = env.reset(seed=1)
    action = answer(info)
    for _ in range(2_000):
        env.step(action)
    tracemalloc.start()
    try:
        for _ in range(1_000):
            env.step(action)
        gc.collect()
        before, _ = tracemalloc.get_traced_memory()
        for _ in range(10_000):
            env.step(action)
        gc.collect()
        after, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    # one batch of steps more or less may be alive; 10,000 steps of this scenario are 50 MB
    assert after - before < 2e6
