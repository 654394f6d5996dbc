"""A vessel of a third party, which follows given poses, in one file and a scenario."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from simnav.environment import NavigationEnv, NavigationVectorEnv
from simnav.estimator import make
from simnav.estimators.learning.guidance import GuidanceEnv
from simnav.geometry.earth import relative_position
from simnav.geometry.rotation import wrap_angle
from simnav.plugins import PluginError
from simnav.scenario import load, parse
from simnav.scoring import score
from simnav.sensors import Dvl
from simnav.simulation.simulator import Simulator, ideal
from simnav.simulation.steps import SteppedRuns
from simnav.source import record
from simnav.spec import SpecError
from simnav.strapdown import integrate
from simnav.trial import run_trial
from simnav.world import SampledTrajectory, Trajectory, World, register_vessel

ORIGIN = np.array([np.radians(54.0), np.radians(7.9), 0.0])


@pytest.fixture
def towed(plugins):
    return load(plugins / "poses.toml")


@pytest.fixture
def text(plugins):
    return (plugins / "poses.toml").read_text()


def test_the_ideal_samples_integrate_to_the_truth(towed):
    run = ideal(towed, 1)
    first, truth = run.initial_truth, run.data.truth
    found = integrate(first.position[0], first.velocity[0], first.attitude[0], run.data.imu)
    at = np.searchsorted(found.time, truth.time - 1e-6)
    np.testing.assert_allclose(relative_position(found.position[at], truth.position), 0.0, atol=1e-7)
    np.testing.assert_allclose(found.velocity[at], truth.velocity, atol=1e-10)
    np.testing.assert_allclose(wrap_angle(found.attitude[at] - truth.attitude), 0.0, atol=1e-11)


def test_the_truth_goes_through_the_poses(towed):
    vessel, truth = towed.vessel, ideal(towed, 1).data.truth
    at = np.searchsorted(truth.time, [15.0, 30.0, 45.0, 60.0])
    places = np.stack([vessel.north, vessel.east, vessel.down], axis=1)[1:]
    np.testing.assert_allclose(relative_position(truth.position[at], ORIGIN), places, atol=2e-3)
    np.testing.assert_allclose(truth.attitude[at, 2], vessel.heading[1:], atol=1e-12)


def test_instruments_see_the_trajectory_between_the_samples(towed):
    run = ideal(towed, 1)
    spline = CubicSpline(towed.vessel.time, np.stack([towed.vessel.north, towed.vessel.east], axis=1))
    gnss = run.data.aids["gnss"]
    np.testing.assert_allclose(relative_position(gnss.value, ORIGIN)[:, :2], spline(gnss.time), atol=2e-3)
    log, truth = run.data.aids["speed_log"], run.data.truth
    c = [np.cos(truth.attitude[:, 2]) * np.cos(truth.attitude[:, 1]),
         np.sin(truth.attitude[:, 2]) * np.cos(truth.attitude[:, 1]), -np.sin(truth.attitude[:, 1])]  # fmt: skip
    flow = 0.5 * np.array([np.cos(np.radians(30.0)), np.sin(np.radians(30.0)), 0.0])
    through = ((truth.velocity - flow) * np.transpose(c)).sum(axis=1)
    np.testing.assert_allclose(log.value[:, 0], through[: len(log.value)], atol=1e-9)


def test_the_division_into_blocks_does_not_change_the_numbers(towed):
    whole = record(towed, 1).data
    simulator, parts = Simulator(towed, 1), []
    for until in (1.0, 2.0, 17.0, 60.0):
        parts.append(simulator.advance(until))
    for name in ("time", "interval", "angular_rate", "specific_force"):
        joined = np.concatenate([getattr(p.imu, name) for p in parts])
        np.testing.assert_array_equal(joined, getattr(whole.imu, name), name)
    np.testing.assert_array_equal(np.concatenate([p.truth.position for p in parts]), whole.truth.position)
    for name, stream in whole.aids.items():
        np.testing.assert_array_equal(np.concatenate([p.aids[name].value for p in parts]), stream.value, name)


def test_an_estimator_follows_it(towed):
    recording = record(towed, 1)
    trial = run_trial(make("ekf"), recording)
    assert trial.status == "ok"
    assert score(trial, recording)["horizontal_rmse"] < 2.5


def test_environments_and_steps_play_it(towed):
    packets = Simulator(towed, 5).advance(60.0)
    env = NavigationEnv(towed, reveal_truth=True)
    _, info = env.reset(seed=5)
    np.testing.assert_array_equal(info["truth"][0], packets.truth.position[0])
    vector = NavigationVectorEnv(towed, num_envs=2)
    vector.reset(seed=[5, 6])
    runs = SteppedRuns(1)
    runs.begin(0, Simulator(towed, 5))
    for k in range(3):
        runs.advance(np.ones(1, np.bool_))
        np.testing.assert_array_equal(runs.truth[0, :3], packets.truth.position[k])


def test_what_needs_a_vessel_that_can_be_steered_says_so(towed):
    with pytest.raises(ValueError, match="a vessel of kind 'poses' follows a given track and cannot steer"):
        NavigationEnv(towed, closed_loop=True)
    with pytest.raises(ValueError, match="a vessel of kind 'poses' takes no commands"):
        GuidanceEnv(towed)
    with pytest.raises(ValueError, match="a vessel of kind 'poses' cannot be steered"):
        Simulator(towed, 1).steer_by(1.0, 0.0)


def test_tables_round_trip_and_go_to_another_process(towed):
    assert type(towed).from_toml(towed.to_toml()) == towed
    assert pickle.loads(pickle.dumps(towed)).vessel == towed.vessel


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('kind = "poses"', 'kind = "pose"', "vessel.kind = 'pose' is unknown; did you mean 'poses'"),
        ("north_m", "north", "unknown key 'vessel.north'.*'north_m'"),
        ("down_m = [10.0, ", "down_m = [", "vessel: down has 4 numbers, time_s has 5"),
        ("[vessel]", "[start]\nlatitude_deg = 54.0\nlongitude_deg = 7.9\n[vessel]", "leave .start. out"),
        (
            "[current]",
            '[[manoeuvre]]\nkind = "hold"\nduration_s = 9.0\n[current]',
            "'hold': a vessel of kind 'poses' follows no manoeuvres",
        ),
    ],
)
def test_mistakes_in_the_scenario_are_one_sentence(plugins, text, old, new, message):
    assert old in text
    with pytest.raises(SpecError, match=message):
        parse(text.replace(old, new, 1), source="poses.toml", folder=plugins)


def test_mistakes_in_the_code_name_the_vessel(plugins, text):
    longer = text.replace("duration_s = 60.0", "duration_s = 90.0")
    with pytest.raises(SpecError, match=r"'poses' \(Poses in poses.py\).*from 0 to 60 s, the run takes more"):
        record(parse(longer, source="poses.toml", folder=plugins), 1)


@pytest.mark.parametrize(
    ("velocity", "message"),
    [(np.zeros(3), r"a velocity of shape \(3,\), where \(1, 3\)"), (np.full((1, 3), np.nan), "nan.* should be finite")],
)
def test_a_motion_that_cannot_be_is_refused(towed, velocity, message):
    class Wrong(SampledTrajectory):
        def motion(self, time):
            return velocity, np.zeros((len(time), 3))

    voyage = towed.voyage(1, towed.surround(1), 100.0)
    with pytest.raises(SpecError, match=message):
        Wrong(ORIGIN, voyage)


def test_only_vessels_are_registered_and_ours_are():
    with pytest.raises(PluginError, match=r"not a subclass of simnav.world.Vessel"):
        register_vessel(Dvl)
    assert issubclass(World, Trajectory)
