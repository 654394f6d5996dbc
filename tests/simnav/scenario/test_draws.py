"""Random draws: the forms, their streams, what a wrong one is told, and all that is done with a drawn scenario."""

from __future__ import annotations

import pickle
import tomllib
from pathlib import Path

import numpy as np
import pytest

import simnav
from simnav.environment import NavigationEnv
from simnav.recording import Recording
from simnav.scenario import TRAINING_ROOT, Scenario, parse
from simnav.scenario.catalogue import headers
from simnav.scenario.draws import Distribution, Template, has_draws, with_values
from simnav.simulation.simulator import Simulator, ideal, simulate
from simnav.spec import SpecError
from simnav.streams import stream
from tests.cases.packages import install_pack

TOML = """
name = "drawn-run"
version = 1
title = "A test"
duration_s = 40.0
water_depth_m = 50.0

[draw]
grade = { log_uniform = [0.1, 1.0] }
begin = { uniform = [10, 20] }
vessel = { choice = ["ship", "uuv"], weights = [3, 1] }

[start]
latitude_deg = { uniform = [-60, 60] }
longitude_deg = 10.0
speed_m_s = { draw = "vessel", cases = { ship = { uniform = [3, 9] }, uuv = 1.5 } }

[vessel]
kind = { draw = "vessel" }

[[manoeuvre]]
kind = "turn"
angle_deg = { choice = [90, -90] }

[instruments.imu]
rate_hz = 50.0

[instruments.imu.gyroscope]
bias_deg_h = { draw = "grade", times = 10.0 }
random_walk_deg_sqrt_h = { draw = "grade" }

[instruments.gnss]
kind = "gnss_position"
rate_hz = { integers = [1, 4] }
sigma_m = [{ log_uniform = [1, 4] }, { log_uniform = [1, 4] }, 5.0]

[instruments.gnss.times_datasheet]
sigma = { log_uniform = [0.3, 3] }

[instruments.depth]
present = { draw = "vessel", cases = { ship = false, uuv = true } }
sigma_m = 0.1

[[fault]]
kind = "outage"
instruments = ["gnss"]
start_s = { draw = "begin" }
end_s = { draw = "begin", plus = { uniform = [5, 20] } }

[[fault]]
choice = [
    { kind = "gross_error", instruments = ["gnss"], probability = { uniform = [0.01, 0.2] }, size_m = [10, 30] },
    { kind = "multipath", instruments = ["gnss"], correlation_time_s = 50.0, sigma_m = { normal = [5, 1] } },
]
"""


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return parse(TOML)


@pytest.mark.parametrize(
    ("table", "low", "high", "mean"),
    [
        ({"uniform": [2.0, 4.0]}, 2.0, 4.0, 3.0),
        ({"log_uniform": [1.0, 100.0]}, 1.0, 100.0, 99.0 / np.log(100.0)),
        ({"normal": [5.0, 0.5]}, 3.0, 7.0, 5.0),
        ({"integers": [1, 4]}, 1, 4, 2.5),
        ({"choice": [1.0, 2.0], "weights": [1, 3]}, 1.0, 2.0, 1.75),
    ],
)
def test_distributions(table, low, high, mean):
    distribution = Distribution.read(table, "x")
    values = np.array([distribution.sample(stream(k, "test")) for k in range(4000)])
    assert low <= values.min() <= values.max() <= high
    assert values.mean() == pytest.approx(mean, abs=5.0 * values.std() / np.sqrt(len(values)))
    assert distribution.ends() == (low, high)
    if table.keys() == {"integers"}:
        assert set(values) == {1, 2, 3, 4}


def test_a_run_has_draws_of_its_own_and_every_draw_a_stream(scenario: Scenario):
    one = scenario.drawn(1)
    assert one == scenario.drawn(1)
    assert one.draws == scenario.drawn(1).draws
    assert one.draws != scenario.drawn(2).draws
    assert not one.distributions
    assert one.drawn(7) is one
    # One more draw, in front of all others, leaves them as they were.
    more = parse(TOML.replace("longitude_deg = 10.0", "longitude_deg = { uniform = [-170, 170] }")).drawn(1)
    assert {k: v for k, v in more.draws.items() if k != "start.longitude_deg"} == one.draws


def test_references_cases_and_presence(scenario: Scenario):
    runs = [scenario.drawn(k) for k in range(60)]
    for s in runs:
        assert s.start is not None
        assert s.vessel is not None
        assert s.imu is not None
        assert s.imu.gyroscope.bias == pytest.approx(10.0 / 60.0 * s.imu.gyroscope.random_walk)
        assert ("depth" in s.instruments) == (s.vessel.kind == "uuv")
        assert (s.start.speed == 1.5) == (s.vessel.kind == "uuv")
        assert 5.0 <= s.faults[0].end - s.faults[0].start <= 20.0
        assert s.faults[0].start == s.draws["draw.begin"]
    ships = sum(s.vessel.kind == "ship" for s in runs)  # type: ignore[union-attr]
    assert 35 < ships < 55  # three in four of 60
    assert {s.faults[1].kind for s in runs} == {"gross_error", "multipath"}


def test_draws_are_in_the_recording_and_its_file(scenario: Scenario, tmp_path):
    recording = simulate(scenario, 3)
    assert recording.draws == scenario.drawn(3).draws
    factor = recording.draws["instruments.gnss.times_datasheet.sigma"]
    assert recording.actual is not None
    np.testing.assert_allclose(recording.actual["gnss"].sigma, factor * recording.instruments["gnss"].sigma)
    np.testing.assert_array_equal(recording.data.aids["gnss"].sigma[0], recording.actual["gnss"].sigma)
    recording.save(tmp_path / "r.npz")
    again = Recording.load(tmp_path / "r.npz")
    assert again.draws == recording.draws
    np.testing.assert_array_equal(again.actual["gnss"].sigma, recording.actual["gnss"].sigma)  # type: ignore[index]


def test_the_actual_noise_is_as_large_as_was_drawn():
    text = TOML.replace("sigma = { log_uniform = [0.3, 3] }", "sigma = 7.0").replace(
        "duration_s = 40", "duration_s = 400"
    )
    recording = simulate(parse(text).model_copy(update={"faults": ()}), 0)
    perfect = ideal(parse(text).model_copy(update={"faults": ()}), 0)
    error = recording.data.aids["gnss"].value[:, 2] - perfect.data.aids["gnss"].value[:, 2]
    assert recording.instruments["gnss"].sigma[2] == 5.0
    assert error.std() == pytest.approx(35.0, rel=0.15)


def test_ideal_is_of_the_same_draws(scenario: Scenario):
    assert ideal(scenario, 3).draws == simulate(scenario, 3).draws


def test_a_drawn_scenario_travels(scenario: Scenario):
    for again in (pickle.loads(pickle.dumps(scenario)), Scenario.from_toml(scenario.to_toml())):
        assert again == scenario
        assert again.content_hash() == scenario.content_hash()
        assert again.drawn(4) == scenario.drawn(4)
    other = parse(TOML.replace("log_uniform = [0.1, 1.0]", "log_uniform = [0.1, 1.1]"))
    assert other.content_hash() != scenario.content_hash()


def test_what_python_replaced_is_not_drawn(scenario: Scenario):
    shorter = scenario.model_copy(update={"duration": 30.0, "faults": ()})
    assert (shorter.drawn(0).duration, shorter.drawn(0).faults) == (30.0, ())
    assert shorter.drawn(0).start == scenario.drawn(0).start
    assert shorter.content_hash() != scenario.content_hash()
    assert Scenario.from_toml(shorter.to_toml()).drawn(0).duration == 30.0


def test_values_can_be_set(scenario: Scenario):
    fixed = scenario.with_values({"draw.begin": 12.0, "instruments.gnss.sigma_m[0]": 2.5}).drawn(0)
    assert fixed.faults[0].start == 12.0
    assert fixed.instruments["gnss"].sigma[0] == 2.5  # type: ignore[attr-defined]
    assert "draw.begin" not in fixed.draws
    assert fixed.start == scenario.drawn(0).start
    assert with_values({"gnss": {}}, {"gnss.times_datasheet.sigma": 3}) == {"gnss": {"times_datasheet": {"sigma": 3}}}
    with pytest.raises(SpecError, match=r"there is no key 'draw\.x\.y'"):
        scenario.with_values({"draw.x.y": 1.0})
    with pytest.raises(SpecError, match=r"no 'falt' in it; did you mean 'fault'\?"):
        with_values({"fault": []}, {"falt[0].start_s": 1.0})


def test_an_environment_has_room_for_every_run(scenario: Scenario):
    env = NavigationEnv(scenario)
    kinds = set()
    for seed in range(8):
        observation, info = env.reset(seed=seed)
        assert env.observation_space.contains(observation)
        kinds.add("depth" in info["instruments"])
        if "depth" not in info["instruments"]:
            assert not observation["depth"]["valid"].any()
    assert kinds == {True, False}


def test_training_shares_no_stream_with_the_board(scenario: Scenario):
    training = scenario.model_copy(update={"training": True})
    # Seeds of a campaign are below the root, so that no seed of one is a seed of the other.
    assert training.root(0) == TRAINING_ROOT > 2**63 - 1
    assert scenario.root(5) == 5
    assert training.drawn(5).draws != scenario.drawn(5).draws
    plain = scenario.drawn(5)
    a, b = Simulator(plain.model_copy(update={"training": True}), 5), Simulator(plain, 5)
    np.testing.assert_array_equal(a.initial_truth.position, b.initial_truth.position)
    assert not np.array_equal(a.start.position, b.start.position)
    assert not np.array_equal(a.advance(40.0).aids["gnss"].value, b.advance(40.0).aids["gnss"].value)


def test_a_scenario_without_draws_has_none():
    table = tomllib.loads(TOML)
    assert has_draws(table)
    plain = Template(table, "x").drawn(0)[0]
    assert not has_draws(plain)
    s = Scenario.from_toml(plain)
    assert s.drawn(1) is s
    assert simulate(s, 1).draws == {}


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("[0.1, 1.0]", "[1.0, 0.1]", "f.toml: draw.grade.log_uniform = [1.0, 0.1]: the lowest should be less than"),
        ("[0.1, 1.0]", "[0, 1.0]", "draw.grade.log_uniform = [0, 1.0]: the lowest should be greater than 0"),
        ("[0.1, 1.0]", "[1.0]", "draw.grade.log_uniform = [1.0] should be [lowest, highest], two finite numbers"),
        ("integers = [1, 4]", "integers = [1.5, 4]", "rate_hz.integers = [1.5, 4] should be two whole"),
        ("normal = [5, 1]", "normal = [5, 0]", "sigma_m.normal = [5, 0]: the sigma should be greater than 0"),
        ("weights = [3, 1]", "weights = [3]", "draw.vessel.weights = [3] should be 2 numbers, one an option"),
        ("weights = [3, 1]", "weight = [3, 1]", "beside 'choice' there is no key 'weight'"),
        ("choice = [90, -90]", "choice = []", "manoeuvre[0].angle_deg.choice = [] should be an array of options"),
        ('draw = "grade" }', 'draw = "grad" }', "there is no such draw in [draw]; did you mean 'grade'?"),
        ("uuv = 1.5 }", "auv = 1.5 }", "start.speed_m_s.cases: there is none for vessel = 'uuv'; did you mean 'auv'?"),
        ("ship = false", 'ship = "no"', "instruments.depth.present = 'no' should be true or false"),
        ("begin = { uniform = [10, 20] }", 'begin = { draw = "begin" }', "draw.begin refers to itself"),
        ('draw = "grade", times = 10.0', 'draw = "vessel", times = 10.0', "draw.vessel = 'ship' should be a number"),
        ("uniform = [-60, 60]", "unifrom = [-60, 60]", "a number, or a distribution like { uniform = [1, 2] }"),
        # Only some draws are wrong: the message says which.
        ("uniform = [5, 20]", "uniform = [-5, 20]", "(5.0 s) before it starts (10.0 s) (for some draws: "),
        ("uniform = [10, 20]", "uniform = [10, 60]", "it starts at 60 s, but duration_s = 40 (for some draws: "),
        ("normal = [5, 1]", "normal = [5, 2]", "sigma_m is not negative (for some draws: "),
        ("uniform = [-60, 60]", "uniform = [-60, 95]", "turn too fast (for some draws: "),
    ],
)  # fmt: skip
def test_a_bad_distribution_gets_a_sentence(old: str, new: str, sentence: str):
    assert old in TOML
    with pytest.raises(SpecError) as error:
        parse(TOML.replace(old, new), source="f.toml")
    assert sentence in str(error.value)
    assert str(error.value).startswith("f.toml: ")
    assert "\n" not in str(error.value)


def test_a_whole_file_is_not_drawn():
    """Found by `python -m tests.audit security`: a line moved out of the table of an instrument."""
    path = Path(__file__).parents[2] / "cases" / "presence_of_a_file.toml"
    with pytest.raises(SpecError, match=r"present = .* a whole file is not drawn; this belongs into a table"):
        parse(path.read_text(encoding="utf-8"))


def test_keys_that_look_like_paths_have_draws_of_their_own():
    table = {"a": {"b": {"choice": [1, 2]}}, "a.b": {"choice": [{"c": {"uniform": [3, 4]}}]}, "": {"uniform": [5, 6]}}
    drawn, draws = Template(table, "test").drawn(0)
    assert drawn["a"]["b"] in (1, 2)
    assert 3 < drawn["a.b"]["c"] < 4
    assert 5 < drawn[""] < 6
    assert set(draws) == {"a.b", '"a.b"', '"a.b".choice[0].c', '""'}


def test_a_case_may_have_the_name_of_a_distribution():
    table = {"draw": {"x": {"choice": ["choice"]}}, "y": {"draw": "x", "cases": {"choice": 3, "uniform": 4}}}
    assert Template(table, "test").drawn(0)[0] == {"y": 3}


def test_a_draw_that_is_absent_leaves_its_key_out():
    table = {"draw": {"x": {"present": False}}, "y": {"draw": "x"}, "z": 1}
    assert Template(table, "test").drawn(0)[0] == {"z": 1}


def test_the_head_of_a_file_with_a_drawn_duration(tmp_path, monkeypatch):
    text = TOML.replace("duration_s = 40.0", "duration_s = { integers = [40, 60] }")
    text = text.replace('title = "A test"', 'title = "A"\ndescription = """\n[x]\n"""')
    install_pack(tmp_path, "mypack", {"mypack/__init__.py": "", "mypack/drawn-run.toml": text})
    monkeypatch.syspath_prepend(tmp_path)
    (header,) = (h for h in headers() if h.name == "drawn-run")
    assert (header.duration, header.title) == (50.0, "A")
    assert {parse(text).drawn(k).duration for k in range(30)} <= set(range(40, 61))


def test_a_start_is_worse_than_told_and_the_oracle_knows():
    worse = TOML.replace("[vessel]", "[initial_error.times_told]\nposition = 20.0\n\n[vessel]", 1)
    errors, told = [], 0.0
    for seed in range(40):
        simulator = Simulator(parse(worse).drawn(seed), seed)
        plain = Simulator(parse(TOML).drawn(seed), seed)
        height = simulator.initial_truth.position[0, 2]
        errors.append(simulator.start.position[2] - height)
        assert errors[-1] == pytest.approx(20.0 * (plain.start.position[2] - height), abs=1e-6)
        told = float(np.sqrt(simulator.start.covariance[2, 2]))
    assert told == 2.0
    assert np.std(errors) == pytest.approx(40.0, rel=0.4)
    recording = simulate(parse(worse), 0)
    assert recording.actual_covariance is not None
    np.testing.assert_allclose(recording.actual_covariance[:3, :3], 1600.0 * np.eye(3))
    oracle = simnav.make("oracle")
    oracle.reveal(recording)
    oracle.reset(recording.start, recording.instruments)
    first = oracle.update(next(recording.steps()))
    assert first.covariance is not None
    assert first.covariance[2, 2] > 10.0
    assert simulate(parse(TOML), 0).actual_covariance is None
