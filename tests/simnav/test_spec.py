"""Specifications: units, the way back to TOML, and the sentence that each class of mistake gets."""

from __future__ import annotations

import math
from typing import Annotated, Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import Field, ValidationError

from simnav.spec import (
    UNITS,
    NonNegative,
    Positive,
    Spec,
    SpecError,
    Vector,
    closest,
    entries,
    quantity,
    register_unit,
    toml_number,
)


class Gyroscope(Spec):
    random_walk: NonNegative = quantity("deg_sqrt_h", 0.0)
    correlation_time: Positive = quantity("s", 100.0)
    range: Positive = quantity("deg_s", math.inf)
    axis: Literal["forward", "starboard"] = "forward"


class Ramp(Spec):
    kind: Literal["ramp"] = "ramp"
    rate: float = quantity("m_s", 0.0)


class Step(Spec):
    kind: Literal["step"] = "step"
    size: float = quantity("m")


class Run(Spec):
    name: str
    rate: Positive = quantity("hz", 1.0)
    count: int = Field(3, ge=1)
    lever_arm: Vector = quantity("m", (0.0, 0.0, 0.0))
    latitude: Annotated[float, Field(ge=-math.pi / 2, le=math.pi / 2)] = quantity("deg", 0.0)
    gyroscope: Gyroscope = Gyroscope()
    faults: tuple[Annotated[Ramp | Step, Field(discriminator="kind")], ...] = entries("fault", ())
    parts: dict[str, Ramp | Step] = Field(default_factory=dict)
    extra: Step | None = None
    tags: tuple[str, ...] = ()
    path: Annotated[tuple[tuple[float, float], ...], Field(min_length=1)] = quantity("m", ((0.0, 0.0),))


def test_values_are_si_in_memory():
    run = Run.from_toml(
        {
            "name": "a",
            "latitude_deg": 45,
            "lever_arm_m": [1, 2.5, -3],
            "gyroscope": {"random_walk_deg_sqrt_h": 0.12, "correlation_time_s": math.inf},
            "fault": [{"kind": "step", "size_m": 4.0}, {"kind": "ramp", "rate_m_s": 0.5}],
            "parts": {"step": {"size_m": 1.0}, "other": {"kind": "ramp"}},
        }
    )
    assert run.latitude == pytest.approx(math.pi / 4)
    assert run.lever_arm == (1.0, 2.5, -3.0)
    # 0.12 deg/sqrt(h) = 0.12 deg / 60 sqrt(s)
    assert run.gyroscope.random_walk == pytest.approx(math.radians(0.12) / 60.0)
    assert run.gyroscope.correlation_time == math.inf
    assert [type(f) for f in run.faults] == [Step, Ramp]
    assert {k: type(v) for k, v in run.parts.items()} == {"step": Step, "other": Ramp}


@pytest.mark.parametrize(
    ("unit", "value", "si"),
    [
        ("kn", 1.0, 0.514444444),
        ("deg_h", 1.0, 4.84813681e-6),
        ("ug", 1.0, 9.80665e-6),
        ("m_s_sqrt_h", 0.6, 0.01),
        ("ug_sqrt_hz", 100.0, 9.80665e-4),
        ("arcsec", 3600.0, 0.0174532925),
        ("percent", 2.55, 0.0255),
        ("ppm", 50.0, 5e-5),
        ("km", 1.0, 1000.0),
    ],
)
def test_units(unit, value, si):
    assert value * UNITS[unit] == pytest.approx(si, rel=1e-8)


@given(st.floats(1e-6, 1e6), st.sampled_from(sorted(UNITS)))
def test_a_number_survives_the_way_to_toml_and_back(value, unit):
    si = value * UNITS[unit]
    assert toml_number(si, unit) * UNITS[unit] == pytest.approx(si, rel=3e-16)


def test_to_toml_is_what_was_typed_and_is_read_back():
    table = {
        "name": "a",
        "latitude_deg": -33.856,
        "gyroscope": {"random_walk_deg_sqrt_h": 0.003},
        "fault": [{"kind": "step", "size_m": 0.1}],
        "parts": {"p": {"kind": "ramp", "rate_m_s": 0.3}},
    }
    run = Run.from_toml(table)
    assert run.to_toml() == table
    assert Run.from_toml(run.to_toml()) == run
    # Kinds are always written, however a specification was made.
    assert Step(size=2.0).to_toml() == {"kind": "step", "size_m": 2.0}


def test_specs_are_immutable():
    with pytest.raises(ValidationError):
        Run(name="a").rate = 2.0  # type: ignore[misc]


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"rat_hz": 2}, "f.toml: unknown key 'rat_hz' (value 2); did you mean 'rate_hz'?"),
        ({"rate": 2}, "f.toml: unknown key 'rate' (value 2); it is given in hz: 'rate_hz'"),
        ({"latitude_arcsec": 2}, "f.toml: unknown key 'latitude_arcsec' (value 2); it is given in deg: 'latitude_deg'"),
        ({"faults": []}, "f.toml: unknown key 'faults' (value []); did you mean 'fault'?"),
        ({"rate_hz": -1}, "f.toml: rate_hz = -1: should be greater than 0"),
        ({"latitude_deg": 91}, "f.toml: latitude_deg = 91: should be at most 90"),
        ({"count": 0}, "f.toml: count = 0: should be at least 1"),
        ({"count": "3"}, "f.toml: count = '3' should be a number"),
        ({"count": True}, "f.toml: count = True should be a number"),
        ({"rate_hz": "fast"}, "f.toml: rate_hz = 'fast' should be a number"),
        ({"rate_hz": math.nan}, "f.toml: rate_hz = nan should be a finite number"),
        ({"lever_arm_m": [0, math.inf, 0]}, "f.toml: lever_arm_m = inf should be a finite number"),
        ({"lever_arm_m": [0, 1]}, "f.toml: lever_arm_m = [0, 1]: should have 3 numbers"),
        ({"lever_arm_m": [0, 1, 2, 3]}, "f.toml: lever_arm_m = [0, 1, 2, 3]: should have 3 numbers"),
        ({"lever_arm_m": 1}, "f.toml: lever_arm_m = 1: should be an array of 3 numbers"),
        ({"path_m": []}, "f.toml: path_m = []: should have at least 1, not 0"),
        ({"path_m": [[1, 2, 3]]}, "f.toml: path_m = [[1, 2, 3]]: should have 2 numbers"),
        ({"tags": "x"}, "f.toml: tags = 'x': should be an array"),
        ({"rate_hz": 1e300}, "f.toml: rate_hz = 1e+300 is beyond all measure"),
        ({"gyroscope": {"axis": 3}}, "f.toml: gyroscope.axis = 3: should be 'forward' or 'starboard'"),
        ({"fault": [{"kind": []}]}, "f.toml: fault[0].kind = [] should be one of: ramp, step"),
        ({"gyroscope": 3}, "f.toml: gyroscope = 3 should be a table"),
        (
            {"gyroscope": {"random_walk_deg_sqrt_h": -0.1}},
            "f.toml: gyroscope.random_walk_deg_sqrt_h = -0.1: should be at least 0",
        ),
        (
            {"gyroscope": {"axis": "forwards"}},
            "f.toml: gyroscope.axis = 'forwards': should be 'forward' or 'starboard'; did you mean 'forward'?",
        ),
        ({"fault": {"kind": "ramp"}}, "f.toml: fault = {'kind': 'ramp'} should be an array of tables ([[fault]])"),
        ({"fault": [{"kind": "rampp"}]}, "f.toml: fault[0].kind = 'rampp' is unknown; did you mean 'ramp'?"),
        ({"fault": [{"rate_m_s": 1}]}, "f.toml: fault[0] has no key 'kind'; one of: ramp, step"),
        ({"fault": [{"kind": "ramp"}, {"kind": "step"}]}, "f.toml: required key 'fault[1].size_m' is missing"),
        ({"parts": {"x": {"rate_m_s": 1}}}, "f.toml: parts.x has no key 'kind'; one of: ramp, step"),
        ({"parts": [1]}, "f.toml: parts = [1] should be a table of tables ([parts.name])"),
    ],
)
def test_bad_input_names_file_key_value_and_what_is_right(change, sentence):
    with pytest.raises(SpecError) as caught:
        Run.from_toml({"name": "a", **change}, source="f.toml")
    assert str(caught.value) == sentence


def test_a_missing_key_is_named():
    with pytest.raises(SpecError, match=r"^f.toml: required key 'name' is missing$"):
        Run.from_toml({}, source="f.toml")


def test_an_unknown_unit_is_refused_when_the_class_is_written():
    with pytest.raises(SpecError, match="unknown unit 'furlong'"):
        quantity("furlong")


def test_a_unit_of_others(plugins):
    register_unit("fathom", 1.8288)
    register_unit("fathom", 1.8288)  # a file may be loaded twice
    sounding = type("Sounding", (Spec,), {"__annotations__": {"depth": float}, "depth": quantity("fathom")})
    assert sounding.from_toml({"depth_fathom": 10}).depth == 18.288
    with pytest.raises(SpecError, match=r"unknown key 'depth_m' .* it is given in fathom: 'depth_fathom'"):
        sounding.from_toml({"depth_m": 10})


@pytest.mark.parametrize(
    ("name", "factor", "message"),
    [
        ("m", 0.3048, "the unit 'm' is known: it is 1 in SI, not 0.3048"),
        ("kPa", 1000.0, "'kPa', should be in lower case"),
        ("k_", 1.0, "'k_', should be in lower case"),
        ("kpa", 0.0, "the factor of the unit 'kpa', 0.0, should be a number greater than 0"),
        ("kpa", float("nan"), "the factor of the unit 'kpa', nan, should be"),
        ("kpa", "1000", "the factor of the unit 'kpa', '1000', should be"),
    ],
)
def test_a_unit_that_cannot_be_registered(plugins, name, factor, message):
    with pytest.raises(SpecError, match=message):
        register_unit(name, factor)
    assert "kpa" not in UNITS


def test_closest_lists_what_is_valid_where_nothing_is_near():
    assert closest("gps", ["gnss", "dvl"]) == "; valid here: dvl, gnss"
    assert closest("gns", ["gnss", "dvl"]) == "; did you mean 'gnss'?"
