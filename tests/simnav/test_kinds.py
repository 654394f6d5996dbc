"""Kinds of instruments: what follows from a declaration, and that every registered kind is declared in full."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.geometry import earth
from simnav.kinds import EQUATIONS, KINDS, Component, Kind, geodetic_components, kinds_with
from simnav.plugins import PluginError
from simnav.sensors import instrument_specs
from simnav.spec import UNITS
from simnav.types import Datasheet, Instruments

RANGE_AND_BEARING = (Component("range", "m", limit=1e5), Component("bearing", "deg", cyclic=True))


def sheet(name: str, kind: str) -> Datasheet:
    return Datasheet(name, kind, 1.0, np.array([1.0]))


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_is_declared_in_full(kind):
    declared = KINDS[kind]
    assert declared.quantity
    assert len(declared.values) == len(declared.errors) == len(declared.components)
    assert {unit for c in declared.components for unit in (c.unit, c.error_unit)} <= set(UNITS)
    assert declared.equation in EQUATIONS or callable(declared.equation)
    cls = next(s for s in instrument_specs() if s.model_fields["kind"].default == kind)
    assert cls.from_toml(cls.example).datasheet("x").sigma.shape == (len(declared.components),)


@pytest.mark.parametrize("kind", KINDS)
def test_errors_are_added_and_found_again(kind):
    d = len(KINDS[kind].errors)
    rng = np.random.default_rng(1)
    value = rng.uniform(-1, 1, (50, d))
    error = rng.normal(size=(50, d))
    found = KINDS[kind].difference(KINDS[kind].add_error(value, error), value)
    assert found == pytest.approx(error, abs=1e-8)
    assert np.array_equal(KINDS[kind].difference(value[3], value[4]), KINDS[kind].difference(value[3:4], value[4:5])[0])


def test_a_metre_of_error_is_a_metre_on_the_ground():
    value = np.array([[np.radians(60.0), 0.0, 0.0]])
    moved = KINDS["gnss_position"].add_error(value, np.array([[0.0, 1000.0, 0.0]]))
    parallel = earth.principal_radii(value[0, 0])[1] * np.cos(value[0, 0])
    assert moved[0, 1] * parallel == pytest.approx(1000.0)


def test_cyclic_components_are_wrapped_and_others_are_not():
    kind = Kind("range and bearing", "range", RANGE_AND_BEARING)
    near_turn = np.array([10.0, 3.0])
    assert kind.add_error(near_turn, np.array([20.0, 1.0])) == pytest.approx([30.0, 4.0 - 2 * np.pi])
    assert kind.difference(np.array([10.0, -3.0]), near_turn) == pytest.approx([0.0, 2 * np.pi - 6.0])


@pytest.mark.parametrize(
    ("kind", "value", "good"),
    [
        ("gnss_position", [0.9, 0.1, 5.0], True),
        ("gnss_position", [50.0, 5.0, 5.0], False),
        ("gnss_position", [0.9, 2 * np.pi, 5.0], True),
        ("gnss_position", [np.pi / 2, 0.0, 5.0], False),
        ("gnss_position", [0.9, 0.1, 1e9], False),
        ("gnss_velocity", [199.0, -199.0, 0.0], True),
        ("gnss_velocity", [200.0, 0.0, 0.0], False),
        ("dvl", [1.0, np.nan, 0.0], False),
        ("dvl", [1.0, 0.0, 0.0], True),
        ("depth", [np.inf], False),
        ("gyrocompass", [6.2], True),
        ("gyrocompass", [300.0], False),
        ("terrain_fix", [0.9, 0.1], True),
    ],
)
def test_plausible(kind, value, good):
    assert KINDS[kind].plausible(np.array(value)) is good


def test_without_a_limit_a_value_is_plausible_as_long_as_it_is_finite():
    field = Kind("flux density", "other", (Component("flux", "m"),))
    assert field.plausible(np.array([1e300]))
    assert not field.plausible(np.array([np.inf]))
    assert not field.plausible(np.array([np.nan]))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("x", "compass", RANGE_AND_BEARING), "role = 'compass' .* should be one of: fix, velocity"),
        (("x", "other", ()), "one to 3 components, not 0"),
        (("x", "other", Component("x", "m")), r"components = Component.* should be a tuple of Component"),
        (("x", "other", ("x",)), r"components = \('x',\) of a kind should be a tuple of Component"),
        (("x", "other", (Component("range, slant", "m"),)), "name of a component, 'range, slant', should be in snake"),
        (("x", "other", (Component("x", "m"), Component("x", "deg"))), "two components of a kind have the name 'x'"),
        (("x", "other", (Component("x", "m", "e"), Component("y", "m", "e"))), "two components .* have the name 'e'"),
        (("x", "other", RANGE_AND_BEARING, None, False, "place"), "datasheet = 'place' .* should be a tuple of str"),
        (("x", "range", RANGE_AND_BEARING, 3), "equation = 3 of a kind should be a function, or one of: position"),
        (("x", "range", RANGE_AND_BEARING, "bearing"), "equation = 'bearing' .* a function, or one of: position"),
        (("x", "heading", RANGE_AND_BEARING, "heading"), "'heading' gives true heading: 1 components, not 2"),
        (("x", "fix", RANGE_AND_BEARING, None, True), "first components of a geodetic kind are latitude and longitude"),
    ],
)
def test_mistakes_in_a_declaration_are_named(arguments, message):
    with pytest.raises(PluginError, match=message):
        Kind(*arguments)


def test_datasheets_are_chosen_by_role_and_by_equation():
    sheets = [sheet("terrain", "terrain_fix"), sheet("log", "speed_log"), sheet("gps", "gnss_position")]
    instruments = Instruments([*sheets, sheet("north", "gyrocompass")])
    assert [s.name for s in instruments.of_role("fix")] == ["terrain", "gps"]
    assert [s.name for s in instruments.of_role("velocity", "heading")] == ["log", "north"]
    assert [s.name for s in instruments.of_equation("position")] == ["gps"]
    assert instruments["log"].equation == "water_speed"
    assert kinds_with("heading", "depth") == ["depth", "gyrocompass", "magnetic_compass"]
    assert geodetic_components(height=False) == KINDS["terrain_fix"].components


def test_an_unknown_kind_is_refused_with_the_list_of_those_that_there_are():
    with pytest.raises(ValueError, match=r"unknown kind of instrument 'radar'; there are: .*gnss_position"):
        sheet("a", "radar")


def test_kinds_are_printed_with_the_units_of_arrays():
    lines = dict(line.split(": ", 1) for line in repr(KINDS).splitlines()[1:])
    assert lines["gyrocompass"] == "heading [rad]"
    assert lines["terrain_fix"] == "latitude [rad] (error: north [m]), longitude [rad] (error: east [m])"
    assert lines["dvl"].startswith("forward [m/s]")
    assert "deg" not in repr(KINDS["gnss_position"])
