"""The surroundings of a run: what the parts of simnav answer, and parts of a third party in one file."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from simnav.plugins import PluginError
from simnav.scenario import load, parse
from simnav.sensors import Dvl
from simnav.sensors.instrument import InstrumentError
from simnav.simulation.simulator import Simulator
from simnav.simulation.steps import SteppedRuns
from simnav.source import record
from simnav.spec import SpecError
from simnav.world import Current, Sea, Ship, Start, Surroundings, World, register_surrounding
from simnav.world.surroundings import surround

START = Start(latitude=0.94, longitude=0.138, heading=0.7, speed=5.0)


def sailed(sea, current, seconds=200.0):
    """The world of a straight voyage, its surroundings, and its states twice a second."""
    world = World(START, Ship(), (), sea, current, rate=20.0, seed=9)
    surroundings = surround(sea, current, None, {}, start=START, seed=9)
    return surroundings, world.advance(seconds, {"tap": np.arange(1, 2 * seconds + 1) / 2.0}).taps["tap"]


def test_the_current_that_is_asked_is_the_one_that_carries_the_vessel():
    current = Current(speed=0.6, direction=1.1, variation=0.3, length_scale=400.0, time_scale=300.0)
    surroundings, tap = sailed(None, current)
    assert tap.water_velocity[:, :2].std(axis=0).min() > 0.02
    np.testing.assert_allclose(surroundings["current"].velocity(tap.position, tap.time), tap.water_velocity, atol=5e-3)


def test_the_current_decreases_with_depth():
    surroundings = surround(None, Current(speed=1.0, shear=0.02), None, {}, start=START, seed=1)
    place = np.array([[0.94, 0.138, h] for h in (0.0, -10.0, -80.0)])
    np.testing.assert_allclose(surroundings["current"].velocity(place, np.zeros(3))[:, 0], [1.0, 0.8, 0.0])


def test_a_vessel_that_follows_the_surface_heaves_as_the_waves_are_high():
    # Far below its natural period a hull follows the surface: its height is the elevation at its place.
    sea = Sea(significant_height=2.0, peak_period=9.0, heave_period=0.05, drift_gain=0.0)
    surroundings, tap = sailed(sea, None)
    elevation = surroundings["sea"].elevation(tap.position, tap.time)
    assert 4.0 * elevation.std() == pytest.approx(2.0, rel=0.3)
    heave = tap.position[:, 2] - tap.position[:, 2].mean()
    np.testing.assert_allclose(heave, elevation - elevation.mean(), atol=0.05)


def test_a_part_that_is_not_there_is_named_with_the_table_that_would_make_it():
    surroundings = Surroundings()
    assert "bottom" not in surroundings
    assert surroundings.get("bottom") is None
    with pytest.raises(SpecError, match="no part 'bottom'; the scenario needs water_depth_m"):
        surroundings["bottom"]
    with pytest.raises(SpecError, match=r"no part 'sky'; the scenario needs the table \[surroundings.sky\]"):
        surroundings["sky"]


# --- an instrument of a third party, and the parts that it asks


@pytest.fixture
def shoal(plugins):
    return load(plugins / "shoal.toml")


@pytest.fixture
def text(plugins):
    return (plugins / "shoal.toml").read_text()


def test_the_instrument_asks_bottom_and_sound_speed_at_its_place(shoal):
    data = record(shoal, 1).data
    sounder = data.aids["sounder"]
    north = 5.0 * sounder.time  # due north at 5 m/s, over a bottom that falls by a tenth
    np.testing.assert_allclose(sounder.value[:, 0], (40.0 + 0.1 * north) * 1500.0 / 1480.0, atol=0.05)


def test_a_dvl_has_the_bottom_of_the_third_party(shoal):
    dvl = record(shoal, 1).data.aids["dvl"]
    # The transducer is 5 m down; from 55 m of water on, after 150 m or 30 s, the bottom is out of reach.
    assert 29.0 <= dvl.time[-1] <= 30.5
    assert len(dvl.dropped) >= 29


def test_runs_step_by_step_give_the_same_numbers(shoal):
    block = Simulator(shoal, 1).advance(60.0)
    runs = SteppedRuns(1)
    runs.begin(0, Simulator(shoal, 1))
    values = []
    for _ in range(60):
        runs.advance(np.ones(1, np.bool_))
        values += [m.value[0] for m in runs.packet(0).aids if m.instrument == "sounder"]
    np.testing.assert_array_equal(values, block.aids["sounder"].value[:, 0])


def test_a_drawn_part_has_its_own_stream_of_the_world(plugins, text):
    spread = parse(text.replace("mean_m_s = 1480.0", "spread_m_s = 10.0"), source="shoal.toml", folder=plugins)
    speeds = {Simulator(spread, seed).surroundings["sound_speed"] for seed in (1, 2, 3)}
    assert len(speeds) == 3
    fixed = spread.model_copy(update={"world_seed": 4})
    assert len({Simulator(fixed, seed).surroundings["sound_speed"] for seed in (1, 2, 3)}) == 1


def test_tables_round_trip_and_count_in_the_digest(shoal, plugins, text):
    table = shoal.to_toml()
    assert table["surroundings"]["sound_speed"]["mean_m_s"] == 1480.0
    assert type(shoal).from_toml(table) == shoal
    assert pickle.loads(pickle.dumps(shoal)) == shoal
    other = parse(text.replace("1480.0", "1490.0"), source="shoal.toml", folder=plugins)
    assert other.content_hash() != shoal.content_hash()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("mean_m_s", "mean", "unknown key 'surroundings.sound_speed.mean'.*'mean_m_s'"),
        ("1480.0", "-1.0", "surroundings.sound_speed.mean_m_s = -1.0: should be greater than 0"),
        (
            'kind = "slope"',
            "",
            "surroundings.bottom has no key 'kind'; one of: bathymetry, wind, .*, slope, sound_speed",
        ),
        ('kind = "slope"', 'kind = "slop"', "surroundings.bottom.kind = 'slop' is unknown; did you mean 'slope'"),
        ("[start]", "water_depth_m = 40.0\n[start]", "surroundings.bottom: water_depth_m says the same"),
        ("surroundings.sound_speed", "surroundings.Sound", "Sound"),
    ],
)
def test_mistakes_in_the_tables_are_one_sentence(plugins, text, old, new, message):
    with pytest.raises(SpecError, match=message):
        parse(text.replace(old, new), source="shoal.toml", folder=plugins)


def test_an_instrument_without_the_part_that_it_needs(plugins, text):
    bare = text[: text.index("[surroundings.bottom]")] + text[text.index("[surroundings.sound_speed]") :]
    with pytest.raises(InstrumentError, match=r"'sounder'.*no part 'bottom'; the scenario needs water_depth_m"):
        record(parse(bare, source="shoal.toml", folder=plugins), 1)


def test_a_mistake_in_the_code_of_a_part_names_the_part(shoal):
    slope = type(shoal.surroundings["bottom"])

    class Broken(slope):
        def build(self, name, seed):
            raise ZeroDivisionError("no depth")

    broken = Broken(**shoal.surroundings["bottom"].model_dump())
    Broken.model_fields["kind"].default = "broken"
    register_surrounding(Broken)
    with pytest.raises(SpecError, match=r"surroundings.bottom .*Broken in test_surroundings.py.*no depth"):
        record(shoal.model_copy(update={"surroundings": {"bottom": broken}}), 1)


def test_only_specifications_of_surroundings_are_registered():
    with pytest.raises(PluginError, match=r"not a subclass of simnav.world.SurroundingSpec"):
        register_surrounding(Dvl)
