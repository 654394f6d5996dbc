"""IMUs by name and by grade, figures in the units of datasheets; their drift without aids."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.scenario import parse
from simnav.sensors.imu import ImuSpec
from simnav.sensors.imu_models import GRADES, IMU_MODELS, MARKOV_PEAK
from simnav.spec import UNITS, SpecError
from tests.audit.grades import CLASSES, LOST, TIMES, misplaced, predicted, simulated

SCENARIO = """
name = "named"
version = 1
title = "An IMU by name"
duration_s = 10.0
[start]
latitude_deg = 54.0
longitude_deg = 7.9
[instruments.imu]
rate_hz = 50.0
"""


def imu(**table):
    return ImuSpec.from_toml({"kind": "imu", "rate_hz": 100, **table}, source="my.toml", path="instruments.imu")


@pytest.mark.parametrize("name", IMU_MODELS)
def test_every_model_is_complete(name):
    model, spec = IMU_MODELS[name], imu(model=name)
    assert model.datasheet
    assert model.read_in
    assert model.grade in GRADES
    assert spec.gyroscope.random_walk > 0.0
    for triad, stated in ((spec.gyroscope, model.gyroscope), (spec.accelerometer, model.accelerometer)):
        for figure, unlike in (("bias", "bias_instability"), ("scale", "scale_none")):
            assert getattr(triad, figure) > 0.0
            is_stated = any(key.startswith(figure) and not key.startswith(unlike) for key in stated)
            assert (figure in triad.datasheet().assumed) is not is_stated
    assert spec == imu(**{key: value for key, value in spec.to_toml().items() if key not in ("kind", "rate_hz")})
    assert spec.model_dump() == ImuSpec(rate=100, model=name).model_dump()


def test_there_are_ten_from_mems_to_navigation_grade():
    assert len(IMU_MODELS) >= 10
    assert {m.grade for m in IMU_MODELS.values()} == set(GRADES)
    drift = [imu(grade=grade).gyroscope.random_walk for grade in ("mems", "tactical", "intermediate", "navigation")]
    assert drift == sorted(drift, reverse=True)


def test_figures_are_those_of_the_datasheet():
    spec = imu(model="stim300")
    assert spec.gyroscope.random_walk == pytest.approx(np.radians(0.15) / 60.0)
    assert spec.gyroscope.bias_instability == pytest.approx(np.radians(0.5 / 3600.0) / MARKOV_PEAK)
    assert spec.accelerometer.random_walk == pytest.approx(0.06 / 60.0)
    assert spec.accelerometer.range == pytest.approx(98.0665)
    assert spec.gyroscope.misalignment == pytest.approx(1e-3)
    assert spec.effects.gyroscope_g_sensitivity == pytest.approx(np.radians(1.0 / 3600.0) / 9.80665)
    assert imu(grade="tactical").model_dump() == spec.model_dump()


def test_a_figure_beside_the_name_replaces_one_in_whatever_unit():
    spec = imu(model="STIM300", accelerometer={"random_walk_ug_sqrt_hz": 100.0}, effects={"delay_s": 0.01})
    assert spec.accelerometer.random_walk == pytest.approx(100.0 * UNITS["ug_sqrt_hz"])
    assert spec.accelerometer.bias_instability == imu(model="STIM300").accelerometer.bias_instability
    assert spec.effects.delay == 0.01
    assert spec.effects.gyroscope_g_sensitivity > 0.0


def test_a_figure_beside_the_name_is_not_assumed():
    spec = imu(model="MTi-1", gyroscope={"bias_deg_s": 0.1}, accelerometer={"scale_ppm": 500.0})
    assert spec.datasheet().gyroscope.assumed == ("scale",)
    assert spec.datasheet().accelerometer.assumed == ("bias",)
    again = imu(**{key: value for key, value in spec.to_toml().items() if key not in ("kind", "rate_hz")})
    assert again.datasheet().gyroscope.assumed == ("scale",)
    assert spec.ideal().datasheet().gyroscope.assumed == ()
    assert "assumed" not in imu(gyroscope={"bias_deg_h": 1.0}).gyroscope.model_dump()


def test_units_of_datasheets_say_the_same():
    ours = imu(gyroscope={"random_walk_deg_sqrt_h": 0.42, "bias_deg_h": 36.0, "scale_ppm": 1000.0},
               accelerometer={"random_walk_ug_sqrt_hz": 140.0, "bias_ug": 750.0})  # fmt: skip
    theirs = imu(gyroscope={"random_walk_deg_s_sqrt_hz": 0.007, "bias_deg_s": 0.01, "scale_percent": 0.1},
                 accelerometer={"random_walk_mg_sqrt_hz": 0.14, "bias_mg": 0.75})  # fmt: skip
    for triad in ("gyroscope", "accelerometer"):
        for name in ("random_walk", "bias", "scale"):
            assert getattr(getattr(theirs, triad), name) == pytest.approx(getattr(getattr(ours, triad), name))


def test_the_name_decides_nothing_beside_the_figures():
    """Two scenarios with the same figures are the same scenario, and one without effects is as it was before."""
    named, plain = parse(SCENARIO + 'model = "HG1700"'), parse(SCENARIO)
    tables = imu(model="HG1700").to_toml()
    spelt = plain.model_copy(
        update={"instruments": {"imu": ImuSpec.from_toml({**tables, "rate_hz": 50.0}, source="t")}}
    )
    assert named.content_hash() == spelt.content_hash() != plain.content_hash()
    assert set(plain.imu.model_dump()) == {"kind", "rate", "gyroscope", "accelerometer"}
    assert type(named).from_toml(named.to_toml()) == named


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"model": "STIM30"}, "my.toml: instruments.imu: there is no IMU of the name 'STIM30'; did you mean 'STIM300'"),
        ({"model": "abc"}, "there is no IMU of the name 'abc'; there are: MTi-1, VN-100"),
        ({"grade": "tactic"}, "grade = 'tactic' is unknown; did you mean 'tactical'"),
        ({"model": "tactical"}, "model = 'tactical' is a grade; say grade = 'tactical'"),
        ({"model": "HG1700", "grade": "tactical"}, "give a model or a grade, not both"),
        ({"model": 300}, "model = 300 should be a name in quotes"),
        ({"gyroscope": {"bias_deg_h": 1.0, "bias_deg_s": 1.0}}, "gyroscope.bias_deg_s' says the same as another key"),
        (
            {"gyroscope": {"assumed": ["bais"]}},
            "gyroscope: assumed: bais: there is no such figure; did you mean 'bias'",
        ),
        ({"effects": {"delay": 1.0}}, "unknown key 'instruments.imu.effects.delay'.*'delay_s'"),
    ],
)
def test_mistakes_are_one_sentence(table, message):
    with pytest.raises(SpecError, match=message):
        imu(**table)


def test_the_predicted_drift_is_in_the_order_of_grades_and_within_the_published_class():
    drifts = {name: [predicted(imu(model=name), time) for time in TIMES] for name in IMU_MODELS}
    for k in range(len(TIMES)):
        assert misplaced({name: drift[k] for name, drift in drifts.items()}) == []
    for name, drift in drifts.items():
        published = CLASSES[IMU_MODELS[name].grade]
        assert published.lowest <= drift[TIMES.index(published.time)] <= published.highest, name


def test_the_simulated_drift_is_that_and_has_the_same_order():
    early, late = {}, {}
    for name, model in IMU_MODELS.items():
        spec = imu(model=name)
        lost = model.grade in LOST
        drift = np.median(simulated(spec, range(8), TIMES[:1] if lost else TIMES), axis=0)
        early[name] = drift[0]
        assert drift[0] == pytest.approx(predicted(spec, TIMES[0]), rel=0.6)
        if not lost:
            late[name] = drift[1]
            assert drift[1] == pytest.approx(predicted(spec, TIMES[1]), rel=0.6)
    assert misplaced(early) == []
    assert misplaced(late) == []


def test_a_misplaced_pair_is_found():
    assert len(misplaced({"STIM300": 1.0, "HG9900": 2.0, "HG1700": 3.0})) == 1
