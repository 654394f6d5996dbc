"""A fault of a third party that raises or returns something else: the error is its own and names it."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest

from simnav.plugins import PluginError
from simnav.scenario import parse
from simnav.sensors import AidSpec, register_fault, register_instrument
from simnav.sensors.faults import FAULTS, AdditiveLayer, FaultSpec
from simnav.sensors.faults.fault import FaultError
from simnav.source import record
from simnav.spec import SpecError, quantity
from simnav.types import KINDS

ERROR = "        return error\n"
WHO = r"fault 'echo' on 'transponder' \(_Echo in echo\.py\): "


@pytest.fixture
def broken(plugins, tmp_path):
    """The scenario of the lagoon, with something else in the fault's file."""

    def scenario(old: str, new: str, more: str = ""):
        source = (plugins / "echo.py").read_text()
        assert old in source
        (tmp_path / "echo.py").write_text(source.replace(old, new))
        (tmp_path / "beacon.py").write_text((plugins / "beacon.py").read_text())
        return parse((plugins / "lagoon.toml").read_text() + more, source="lagoon.toml", folder=tmp_path)

    return scenario


@pytest.mark.parametrize(
    ("new", "message"),
    [
        ("        raise RuntimeError('boom')\n", r"RuntimeError in error\(\), line \d+: boom"),
        (
            "        return error[:, 0]\n",
            r"ValueError: error\(\) returned an array of shape \(61,\), where \(61, 2\) is wanted: a row for each of "
            r"61 times, a column for each component \(range, bearing\)",
        ),
        ("        return None\n", r"ValueError: error\(\) returned an array of shape \(\), where"),
        ("        return error + np.nan\n", r"ValueError: at 60 s the value is not finite"),
        (
            ERROR + "\n    def apply(self, stream):\n        return stream.value\n",
            r"ValueError: apply\(\) returned ndarray, where an AidStream is wanted",
        ),
        (
            ERROR + "\n    def apply(self, stream):\n        from dataclasses import replace\n"
            "        return replace(stream, value=stream.value[:5])\n",
            r"ValueError: apply\(\) returned a stream whose value is of shape \(5, 2\), where \(120, 2\) is wanted",
        ),
    ],
)
def test_a_layer_that_fails(broken, new, message):
    scenario = broken(ERROR, new)
    with pytest.raises(FaultError, match=WHO + message):
        record(scenario, 1)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "return _Echo(self, index, seed, self.key_of_streams(index, occurrence))",
            "return None",
            r"fault 'echo': build\(\) returned NoneType, where a FaultLayer is wanted",
        ),
        (
            "    def build(",
            "    def make(",
            r"fault 'echo' \(Echo in echo\.py\): NotImplementedError: Echo has no build",
        ),
        (
            "    def error(",
            "    def mistake(",
            r"fault 'echo' \(Echo in echo\.py\): TypeError in build\(\), line \d+: ",
        ),
    ],
)
def test_a_fault_that_is_not_built(broken, old, new, message):
    scenario = broken(old, new)
    with pytest.raises(FaultError, match=message):
        record(scenario, 1)


def test_a_check_that_fails_is_named_with_its_place_in_the_scenario(broken):
    with pytest.raises(SpecError, match=r"lagoon\.toml: fault\[0\] 'echo' \(Echo in echo\.py\): KeyError in check\(\)"):
        broken("super().check(instruments, imu=imu)", "instruments['nothing']")


def test_an_error_may_depend_on_the_readings_whatever_else_took_some_away(broken):
    body = (
        "        return 0.1 * self.readings(stream, time) * np.array([1.0, 0.0])\n"
        "\n    def unused(self):\n        error = None\n"
    )
    outage = '\n[[fault]]\nkind = "outage"\ninstruments = "transponder"\nstart_s = 100.0\nend_s = 105.0\n'
    scenario = broken("        hit =", body + "        hit =")
    faults = broken("        hit =", body + "        hit =", outage).faults
    clean = record(scenario.model_copy(update={"faults": ()}), 1).data.aids["transponder"]
    stream = record(scenario.model_copy(update={"faults": faults[::-1]}), 1).data.aids["transponder"]
    assert len(stream) == 115
    there = np.isin(clean.time, stream.time)
    expected = np.where(stream.time >= 60.0, 0.1 * clean.value[there, 0], 0.0)
    np.testing.assert_allclose(stream.fault_error[:, 0], expected, rtol=1e-12)


def test_a_layer_gets_the_streams_of_its_instruments_only(broken):
    """Whatever `apply` does, it is asked for no other instrument."""
    lost = "\n    def apply(self, stream):\n        from dataclasses import replace\n"
    lost += "        return replace(stream, value=stream.value + 1.0)\n"
    scenario = broken(ERROR, ERROR + lost)
    clean, hit = (record(scenario.model_copy(update=u), 1).data.aids for u in ({"faults": ()}, {}))
    assert np.array_equal(hit["depth"].value, clean["depth"].value)
    assert np.array_equal(hit["transponder"].value, clean["transponder"].value + 1.0)


def test_readings_where_nothing_was_delivered_are_zero(plugins, broken):
    stream = record(broken(ERROR, ERROR), 1).data.aids["transponder"]
    times = np.array([0.5, stream.time[3], stream.time[-1] + 1.0])
    values = AdditiveLayer.readings(stream, times)
    assert np.array_equal(values[1], stream.value[3])
    assert not values[[0, 2]].any()


# --- registration


def fault(**fields):
    annotations = {"kind": Literal["swell"], **dict.fromkeys(fields, float)}
    return {"__annotations__": annotations, "kind": "swell", **fields}


def test_an_effect_that_oracles_do_not_know(plugins):
    cls = type("Swell", (FaultSpec,), {**fault(), "effect": "weird", "__module__": __name__})
    with pytest.raises(PluginError, match="fault 'swell': effect = 'weird' should be one of: missing, noise"):
        register_fault(cls)
    assert "swell" not in FAULTS.items()


@pytest.mark.filterwarnings("ignore:Field name")
def test_a_field_that_hides_a_method(plugins):
    with pytest.raises(PluginError, match=r"fault 'swell': the field 'size' of Swell hides FaultSpec\.size"):
        register_fault(type("Swell", (FaultSpec,), {**fault(size=quantity("m", 1.0)), "__module__": __name__}))
    fields = {"__annotations__": {"kind": str, "sigma": float, "figure": float}, "kind": "thing",
              "sigma": quantity("m", 1.0), "figure": 1.0, "__module__": __name__}  # fmt: skip
    with pytest.raises(PluginError, match=r"instrument 'thing': the field 'figure' of Thing hides AidSpec\.figure"):
        register_instrument(KINDS["depth"], example={})(type("Thing", (AidSpec,), fields))


def test_a_field_of_every_instrument_keeps_its_unit(plugins):
    fields = {"__annotations__": {"kind": str, "sigma": float, "rate": float}, "kind": "thing",
              "sigma": quantity("m", 1.0), "rate": quantity("m", 0.0), "__module__": __name__}  # fmt: skip
    with pytest.raises(PluginError, match="kind 'thing': every instrument has the field 'rate', in hz; Thing should"):
        register_instrument(KINDS["depth"], example={})(type("Thing", (AidSpec,), fields))
