"""An instrument and a fault of a third party, one file each, wherever the library meets instruments and faults."""

from __future__ import annotations

import pickle
import subprocess
import sys

import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from simnav.environment import NavigationEnv
from simnav.environment.observed_steps import pack
from simnav.geometry.earth import displace, relative_position
from simnav.kinds import Component, Kind
from simnav.plugins import PluginError, load_plugin
from simnav.recording import Recording
from simnav.scenario import load, parse
from simnav.sensors import AidSpec, register_fault, register_instrument
from simnav.sensors.faults import BiasStep, NoiseStep, effect_of
from simnav.simulation.simulator import ideal
from simnav.source import open_source, record
from simnav.spec import SpecError, quantity
from simnav.testing.contract_check import check, contract_recording
from simnav.types import KINDS, Datasheet

PLACE = np.array([np.radians(54.002), np.radians(7.9), -20.0])


@pytest.fixture
def lagoon(plugins):
    return load(plugins / "lagoon.toml")


@pytest.fixture
def text(plugins) -> str:
    return (plugins / "lagoon.toml").read_text()


def changed(plugins, text: str, old: str, new: str):
    assert old in text
    return parse(text.replace(old, new), source="lagoon.toml", folder=plugins)


# --- TOML


def test_a_scenario_names_the_files_and_has_the_units_of_the_keys(lagoon, plugins):
    spec = lagoon.instruments["transponder"]
    assert spec.latitude == PLACE[0]
    assert spec.sigma_bearing == np.radians(1.0)
    assert lagoon.faults[0].detour == 20.0
    assert lagoon.plugins == (str(plugins / "beacon.py"), str(plugins / "echo.py"))
    table = lagoon.to_toml()
    assert table["instruments"]["transponder"]["sigma_bearing_deg"] == 1.0
    assert type(lagoon).from_toml(table) == lagoon


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("sigma_range_m = 0.5", "sigma_range = 0.5", r"'instruments.transponder.sigma_range'.*'sigma_range_m'"),
        (
            "sigma_range_m = 0.5",
            "sigma_range_m = -1",
            r"transponder.sigma_range_m = -1: should be at least 0",
        ),
        ("sigma_range_m = 0.5", "", "required key 'instruments.transponder.sigma_range_m' is missing"),
        (
            'kind = "beacon"',
            'kind = "becon"',
            r"transponder.kind = 'becon' is unknown; did you mean 'beacon'",
        ),
        ('kind = "echo"', 'kind = "eco"', r"fault\[0\].kind = 'eco' is unknown; did you mean 'echo'"),
        ("probability = 0.2", "probability = 2.0", r"fault\[0\].probability = 2.0"),
        (
            'instruments = "transponder"',
            'instruments = "depth"',
            r"fault\[0\] 'echo': 'depth' .* measures no range",
        ),
        ('"beacon.py"', '"bacon.py"', r"plugins = 'bacon.py': there is no plug-in file"),
        ('["beacon.py", "echo.py"]', '"beacon.py"', r"plugins = 'beacon.py' should be a list of Python files"),
    ],
)
def test_mistakes_are_named_as_everywhere(plugins, text, old, new, message):
    with pytest.raises(SpecError, match=message) as caught:
        changed(plugins, text, old, new)
    assert str(caught.value).startswith("lagoon.toml: ")


def test_without_its_file_the_kind_is_unknown(text):
    with pytest.raises(SpecError, match="kind = 'beacon' is unknown; valid here: acoustic_range, altimeter, depth"):
        parse(text.replace('plugins = ["beacon.py", "echo.py"]', ""), source="lagoon.toml")


# --- recordings


def test_readings_labels_and_datasheet(lagoon):
    recording = record(lagoon, 3)
    stream, sheet = recording.data.aids["transponder"], recording.instruments["transponder"]
    assert sheet.sigma == pytest.approx([0.5, np.radians(1.0)])
    assert sheet.details == {"latitude": PLACE[0], "longitude": PLACE[1], "height": -20.0}
    clean = ideal(lagoon, 3)
    truth = clean.data.truth
    offset = relative_position(PLACE, displace(truth.position, np.zeros(3)))
    # The antenna is within two metres of the reference point.
    assert np.abs(clean.data.aids["transponder"].value[:, 0] - np.linalg.norm(offset, axis=1)).max() < 2.0
    error = KINDS["beacon"].difference(stream.value, clean.data.aids["transponder"].value)
    assert np.std((error - stream.fault_error) / sheet.sigma, axis=0) == pytest.approx([1.0, 1.0], abs=0.25)
    touched = stream.faults != 0
    assert 3 < touched.sum() < 25
    assert stream.time[touched].min() >= 60.0
    assert np.all(stream.fault_error[touched, 0] > 0.0)
    assert not stream.fault_error[~touched].any()
    assert not stream.fault_error[:, 1].any()
    label = recording.faults[0]
    assert (label.kind, label.instruments, label.start, label.end) == ("echo", ("transponder",), 60.0, 120.0)
    assert label.parameters == {"probability": 0.2, "detour": 20.0}
    assert effect_of("echo") == "other"


def test_out_of_reach_nothing_is_delivered(plugins, text):
    near = changed(plugins, text, "sigma_range_m = 0.5", "sigma_range_m = 0.5\nreach_m = 190.0")
    stream = record(near, 3).data.aids["transponder"]
    assert len(stream) > 5
    assert len(stream.dropped) > 5
    assert stream.value[stream.faults == 0, 0].max() < 193.0


def test_our_faults_act_on_it_with_a_size_for_each_unit(plugins, text):
    ours = 'kind = "bias_step"\ninstruments = "transponder"\noffset_m = 5.0\noffset_deg = 2.0\n'
    old = text[text.index('kind = "echo"') :]
    stream = record(changed(plugins, text, old, ours), 3).data.aids["transponder"]
    assert np.array_equal(stream.fault_error, np.tile([5.0, np.radians(2.0)], (120, 1)))
    with pytest.raises(SpecError, match=r"'transponder' .*: required key 'offset_deg' is missing"):
        changed(plugins, text, old, ours.replace("offset_deg = 2.0\n", ""))
    uniform = 'kind = "gross_error"\ninstruments = "beacon"\nprobability = 1.0\nsize_m = [5, 9]\nsize_deg = [1, 2]\n'
    error = np.abs(record(changed(plugins, text, old, uniform), 3).data.aids["transponder"].fault_error)
    assert np.all((error >= [5.0, np.radians(1.0) - 1e-12]) & (error <= [9.0, np.radians(2.0) + 1e-12]))


def test_a_file_of_the_recording_keeps_the_datasheet(lagoon, tmp_path):
    recording = record(lagoon.model_copy(update={"duration": 10.0}), 1)
    recording.save(tmp_path / "lagoon.npz")
    again = Recording.load(tmp_path / "lagoon.npz").instruments["transponder"]
    assert again.details == recording.instruments["transponder"].details
    assert again.kind == "beacon"


def test_another_process_gets_the_scenario_with_its_plug_ins(lagoon, tmp_path):
    (tmp_path / "scenario").write_bytes(pickle.dumps(lagoon))
    code = (
        "import pickle, sys\nfrom simnav.source import record\n"
        f"s = pickle.loads(open({str(tmp_path / 'scenario')!r}, 'rb').read())\n"
        "print(s.content_hash(), record(s, 1).data.aids['transponder'].value.tobytes().hex()[:64])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    here = record(lagoon, 1).data.aids["transponder"].value
    assert done.stdout.split() == [lagoon.content_hash(), here.tobytes().hex()[:64]]


def test_what_the_file_says_is_part_of_the_scenario_s_hash(lagoon, plugins, text, tmp_path):
    for name in ("beacon.py", "echo.py"):  # a copy is no other instrument
        (tmp_path / name).write_text((plugins / name).read_text())
    assert parse(text, folder=tmp_path).content_hash() == lagoon.content_hash()


def test_an_edited_file_takes_the_place_of_its_older_self(plugins, text, tmp_path):
    for name in ("beacon.py", "echo.py"):
        (tmp_path / name).write_text((plugins / name).read_text())
    before = parse(text, folder=tmp_path)
    (tmp_path / "echo.py").write_text((plugins / "echo.py").read_text().replace("exponential(", "rayleigh("))
    after = parse(text, folder=tmp_path)
    assert after.content_hash() != before.content_hash()
    errors = [record(s, 1).data.aids["transponder"].fault_error for s in (before, after)]
    assert np.array_equal(errors[0] != 0.0, errors[1] != 0.0)
    assert not np.array_equal(*errors)
    with pytest.raises(SpecError, match=r"plugins = 'echo.py': kind 'echo' .* the name is taken by Echo"):
        parse(text, folder=plugins)


# --- the rest of the library


def test_the_contract_test_has_every_kind(plugins):
    before = {sheet.kind for sheet in contract_recording(0).instruments.values()}
    load_plugin(plugins / "beacon.py")
    recording = contract_recording(0)
    assert {sheet.kind for sheet in recording.instruments.values()} == {*before, "beacon"} == set(KINDS)
    assert len(recording.data.aids["beacon"]) == 40
    assert check("ekf").passed


def test_a_kind_whose_instrument_fails_is_left_out_of_the_contract_test(plugins, tmp_path):
    broken = (plugins / "beacon.py").read_text().replace("bearing = wrap_angle", "bearing = unwrap_angle")
    (tmp_path / "broken.py").write_text(broken)
    load_plugin(tmp_path / "broken.py")
    with pytest.warns(UserWarning, match="kind 'beacon' are left out of the contract test: .* NameError"):
        recording = contract_recording(0)
    assert {sheet.kind for sheet in recording.instruments.values()} == set(KINDS) - {"beacon"}


def test_the_environment_has_its_space(lagoon):
    env = NavigationEnv(lagoon)
    space = env.observation_space["transponder"]
    assert space["value"].shape == (1, 2)
    observation, info = env.reset(seed=4)
    assert space.contains(observation["transponder"])
    assert isinstance(info["instruments"]["transponder"], Datasheet)
    assert np.array_equal(observation["transponder"]["value"], record(lagoon, 4).data.aids["transponder"].value[:1])
    check_env(env, skip_render_check=True)


def test_a_chart_shows_fixes_by_latitude_and_longitude_only(plugins, tmp_path):
    for name in ("beacon.py", "echo.py", "lagoon.toml"):
        (tmp_path / name).write_text((plugins / name).read_text().replace('role="range"', 'role="fix"'))
    env = NavigationEnv(load(tmp_path / "lagoon.toml"), render_mode="rgb_array")
    env.reset(seed=1)
    env.step(env.action_space.sample())
    block = open_source(load(tmp_path / "lagoon.toml"), 1).advance(5.0)
    observed = pack(block, 0.0, {"imu": 50, "depth": 1, "transponder": 1})
    assert not any(list(observed.fixes(i)) for i in range(5))
    assert env.render().ndim == 3


# --- registration


def instrument(name: str = "thing", sigma: tuple = (1.0,), **fields) -> type:
    """An unregistered specification of a kind of one component."""
    annotations = {"kind": str, "sigma": tuple[float, ...], **dict.fromkeys(fields, float)}
    values = {"kind": name, "sigma": quantity("m", sigma), **fields}
    return type("Thing", (AidSpec,), {"__annotations__": annotations, **values})


THING = Kind("a thing", "other", (Component("thing", "m"),))


@pytest.mark.parametrize(
    ("make", "kind", "message"),
    [
        (lambda: int, THING, "is not a subclass of simnav.sensors.AidSpec"),
        (lambda: instrument("imu"), THING, "kind 'imu' .* means something else"),
        (lambda: instrument("velocity"), THING, "kind 'velocity' .* means something else"),
        (lambda: instrument("dvl"), THING, r"kind 'dvl' of instrument Thing: the name is taken by Dvl \(.*dvl.py"),
        (
            lambda: instrument(),
            Kind("x", "other", (Component("x", "metre"),)),
            "the unit 'metre' is unknown; simnav.spec.register_unit adds one; there are: s",
        ),
        (
            lambda: instrument(),
            Kind("x", "other", THING.components, datasheet=("y",)),
            "names 'y', but Thing has no",
        ),
        (
            lambda: instrument(sigma=(1.0, 2.0)),
            THING,
            r"the example of kind 'thing'.* do not fit its components \(thing\)",
        ),
        (
            lambda: instrument(extra=quantity("m")),
            THING,
            "the example of kind 'thing': required key 'extra_m' is missing",
        ),
    ],
)
def test_an_instrument_that_cannot_be_registered(plugins, make, kind, message):
    with pytest.raises(PluginError, match=message):
        register_instrument(kind, example={})(make())
    assert "thing" not in KINDS


def test_a_fault_that_cannot_be_registered():
    with pytest.raises(PluginError, match=r"is not a subclass of simnav.sensors.faults.FaultSpec"):
        register_fault(int)


def test_errors_in_another_unit_take_the_faults_that_need_no_size(plugins):
    register_instrument(Kind("a delay", "other", (Component("delay", "s"),)), example={})(instrument())
    with pytest.raises(SpecError, match=r"fault 'bias_step' on 'clock' \(thing\): there is no offset in s"):
        BiasStep(instruments=("clock",), offset_position=1.0).check({"clock": "thing"})
    NoiseStep(instruments=("clock",), factor=2.0).check({"clock": "thing"})
