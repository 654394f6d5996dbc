"""Every id of a task: Gymnasium's checker, make, make_vec, spec, pickling, statistics, pictures."""

from __future__ import annotations

import pickle
from importlib.util import find_spec

import gymnasium
import matplotlib.axis
import matplotlib.legend
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env
from gymnasium.wrappers import FrameStackObservation, RecordEpisodeStatistics, RecordVideo
from matplotlib.figure import Figure

import simnav  # noqa: F401 (it registers)
from simnav.environment import charted
from simnav.environment.rendering import Chart
from simnav.estimator import UnsuitableScenario
from simnav.estimators.learning.environment import FilterTaskEnv
from simnav.log import LogError
from simnav.scenario.catalogue import headers
from tests.cases.sorts_of_scenarios import OF_EVERY_SORT

TASKS = ("Tuning", "Detection", "Correction", "Guidance")
IDS = [name for name in gymnasium.registry if name.startswith("simnav/") and name.split("-")[1] in TASKS]


def made(name, **options):
    try:
        return gymnasium.make(f"simnav:{name}", steps=3, **options)
    except LogError as error:
        pytest.skip(str(error))


def test_every_scenario_has_every_task_that_takes_its_instruments():
    recorded, channels = (sum(getattr(h, what) for h in headers()) for what in ("recorded", "channels"))
    assert 0 < recorded < len(headers()) > channels > 0
    assert len(IDS) == 4 * len(headers()) - recorded - 3 * channels
    assert [name for name in IDS if name.startswith("simnav/SatellitesFjord")] == ["simnav/SatellitesFjord-Guidance-v1"]
    assert "simnav/OpenSea-Tuning-v1" in IDS
    assert not any(name.startswith("simnav/CarKitti-Guidance") for name in IDS)


def test_a_task_around_a_filter_says_that_it_takes_no_channels():
    with pytest.raises(UnsuitableScenario, match="a learning task takes instruments without channels; 'gnss' has"):
        FilterTaskEnv("satellites-fjord", "Tuning")


@pytest.fixture(scope="module")
def chart():
    """A seventh as wide as usual."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Figure, "set_dpi", lambda figure, dpi: setattr(figure, "dpi", 14))
        return Chart("every id", 60.0)


@pytest.fixture
def small_pictures(monkeypatch, chart):
    """One chart without ticks and legend for all: most of the time goes into what does not depend on the id."""
    monkeypatch.setattr(charted, "Chart", lambda title, duration, human: chart)
    monkeypatch.setattr(chart, "close", lambda: None)
    for artist in (matplotlib.axis.Axis, matplotlib.legend.Legend):
        monkeypatch.setattr(artist, "draw", lambda self, renderer: None)


#: Scenarios of different sorts, which have every task here.
WHOLE = ("OpenSea", "CoastalVoyage", "RandomVoyages", "TrainingShips", "ShipNbp1406", "CarKitti", "TwelveHours")


def some_ids():
    """All tasks of some scenarios, and one task, in turn, of each that stands for a sort."""
    of = {}
    for name in IDS:
        of.setdefault(name.split("/")[1].split("-")[0], []).append(name)
    others = ("".join(map(str.capitalize, name.split("-"))) for name in OF_EVERY_SORT)
    chosen = {scenario: of[scenario] for scenario in WHOLE}
    yield from (name for ids in chosen.values() for name in ids)
    yield from (of[scenario][k % len(of[scenario])] for k, scenario in enumerate(others) if scenario not in chosen)


@pytest.mark.filterwarnings("ignore::simnav.log.LogWarning")
@pytest.mark.filterwarnings("ignore:.*not within:UserWarning")
@pytest.mark.parametrize("name", list(some_ids()))
def test_ids_of_every_task_and_scenario(name, tmp_path, small_pictures):
    """The checker, a spec that makes the same environment again, statistics, a film, the vector form."""
    try:
        env = made(name, render_mode="rgb_array")
        check_env(env.unwrapped, skip_render_check=True, skip_close_check=True)  # these: below, once a task
    except LogError as error:
        pytest.skip(str(error))
    assert env.spec.id == name
    assert pickle.loads(pickle.dumps(EnvSpec.from_json(env.spec.to_json()))).kwargs == env.spec.kwargs
    scenario = env.unwrapped.options.scenario  # to read it again takes as long as all the rest
    env = RecordEpisodeStatistics(env)
    if films := find_spec("moviepy"):  # Gymnasium makes films with it
        env = RecordVideo(env, str(tmp_path / "films"), video_length=1, gc_trigger=None, disable_logger=True)
    first, _ = env.reset(seed=1)
    envs = gymnasium.make_vec(name, 1, vectorization_mode="vector_entry_point", steps=3, scenario=scenario)
    np.testing.assert_array_equal(envs.reset(seed=1)[0][0], first)
    env.action_space.seed(1)
    rewards, over = [], False
    while not over:
        observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
        assert observation in env.observation_space
        rewards.append(reward)
        over = terminated or truncated
    env.close()
    assert not films or (tmp_path / "films" / "rl-video-episode-0.mp4").stat().st_size > 1000
    assert info["episode"]["r"] == pytest.approx(sum(rewards))
    assert np.isfinite(rewards).all()
    assert len(rewards) == 3


@pytest.mark.parametrize("task", TASKS)
def test_many_at_once_a_film_a_pickle_and_a_window(task, tmp_path):
    name = "simnav:" + next(n for n in IDS if n.startswith(f"simnav/GnssNoiseStep-{task}-"))
    envs = gymnasium.make_vec(name, num_envs=2, steps=3)
    observation, _ = envs.reset(seed=1)
    assert observation in envs.observation_space
    envs.step(envs.action_space.sample())
    env = gymnasium.make(name, steps=3)
    check_env(env.unwrapped)  # each render mode, and closing twice
    assert gymnasium.make(pickle.loads(pickle.dumps(env.spec))).spec == env.spec
    env.reset(seed=1)
    copy = pickle.loads(pickle.dumps(env))
    action = env.action_space.sample()
    np.testing.assert_array_equal(env.step(action)[0], copy.step(action)[0])
    stacked = FrameStackObservation(gymnasium.make(name, steps=3), 4)
    assert stacked.reset(seed=1)[0].shape == (4, *env.observation_space.shape)
    pytest.importorskip("moviepy", reason="Gymnasium makes films with moviepy")
    film = RecordVideo(
        gymnasium.make(name, steps=3, render_mode="rgb_array"), str(tmp_path / "films"), disable_logger=True
    )
    film.reset(seed=1)
    over = False
    while not over:
        *_, over, _ = film.step(film.action_space.sample())
    film.close()
    assert list(tmp_path.glob("films/*.mp4"))


def test_a_frame_shows_the_track_a_fault_the_error_and_the_ellipse(windows):
    env = FilterTaskEnv("gnss-noise-step", render_mode="rgb_array")
    env.reset(seed=1)
    assert env.render().shape == (720, 720, 3)
    env.close()
    env = FilterTaskEnv("gnss-noise-step", render_mode="human")
    env.reset(seed=1)
    for _ in range(200):
        env.step(np.zeros(2, np.float32))
    track, error, close_up = (axes.lines for axes in windows[0].axes)
    named = {line.get_label(): line.get_xydata() for line in track}
    assert len(named["truth"]) == len(named["estimate"]) == 200
    assert len(named["fix, faulty"]) > 30
    assert max(len(line.get_xydata()) for line in error) > 100
    (outline,) = (line.get_xydata() for line in close_up if len(line.get_xydata()) == 49)
    assert np.isfinite(outline).all()
    np.testing.assert_allclose(outline[-1], outline[0])
    env.close()
