"""An instrument of a third party that raises or returns something else: the error is its own and names it."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.scenario import parse
from simnav.sensors import AidSpec, Depth, Instrument, register_instrument
from simnav.sensors.instrument import InstrumentError
from simnav.source import open_source, record
from simnav.spec import SpecError
from simnav.testing.contract_check import contract_recording

WHO = r"instrument 'transponder' of kind 'beacon' \(_Beacon in beacon\.py\): "


@pytest.fixture
def broken(plugins, tmp_path):
    """The scenario of the lagoon, with something else in the instrument's file."""

    def scenario(old: str, new: str):
        source = (plugins / "beacon.py").read_text()
        assert old in source
        (tmp_path / "beacon.py").write_text(source.replace(old, new))
        (tmp_path / "echo.py").write_text((plugins / "echo.py").read_text())
        return parse((plugins / "lagoon.toml").read_text(), source="lagoon.toml", folder=tmp_path)

    return scenario


READING = "return np.stack([np.sqrt(north**2 + east**2 + down**2), bearing], axis=1)"
AVAILABLE = "return np.linalg.norm(self.to_beacon(tap), axis=1) <= self.reach"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            READING,
            "return bearing",
            r"observe\(\) returned an array of shape \(120,\), where \(120, 2\) is wanted: a row for each of 120 "
            r"times, a column for each component \(range, bearing\)",
        ),
        (READING, READING.replace("axis=1", "axis=0"), r"observe\(\) returned .* shape \(2, 120\), where \(120, 2\)"),
        (READING, READING + "[3:]", r"observe\(\) returned .* shape \(117, 2\), where \(120, 2\)"),
        (READING, "return 5.0", r"observe\(\) returned .* shape \(\), where \(120, 2\)"),
        (READING, "return None", r"observe\(\) returned .* shape \(\), where"),
        (READING, "return ['x']", r"ValueError: could not convert"),
        (
            AVAILABLE,
            AVAILABLE + "\n\n    def noise_sigma(self, observed):\n        return self.sigma",
            r"noise_sigma\(\) returned an array of shape \(2,\), where \(120, 2\) is wanted",
        ),
        (
            AVAILABLE,
            "return np.ones(3, bool)",
            r"available\(\) returned an array of bool of shape \(3,\), where one of bool of shape \(120,\) is wanted",
        ),
        (AVAILABLE, "return np.ones(120, int)", r"available\(\) returned an array of int64 of shape \(120,\), where"),
        (
            READING,
            READING.replace("bearing]", "bearing * np.where(tap.time > 7.0, np.nan, 1.0)]"),
            r"observe\(\) returned \[.*, nan\] at 8 s; it should be finite; where nothing is delivered, available\(\) "
            r"says so",
        ),
        (
            AVAILABLE,
            AVAILABLE + "\n\n    def noise_sigma(self, observed):\n        return observed - 1e3",
            r"noise_sigma\(\) returned \[-.*\] at 1 s; it should be finite and not negative",
        ),
        (READING, "raise RuntimeError('boom')", r"RuntimeError in observe\(\), line \d+: boom"),
        ("north, east, down = self", "north, east, up = self", r"NameError in observe\(\), line \d+: name 'down'"),
    ],
)
def test_a_reading_that_is_none(broken, old, new, message):
    scenario = broken(old, new)
    with pytest.raises(InstrumentError, match=WHO + message) as raised:
        record(scenario, 1)
    assert "\n" not in str(raised.value)
    assert isinstance(raised.value, SpecError)


def test_what_is_not_delivered_may_be_anything(broken):
    """Where there is nothing to deliver, a formula may have no value."""
    more = "\n\n    def noise_sigma(self, observed):\n        late = np.arange(len(observed))[:, None] >= 100\n"
    more += "        return np.where(late, np.nan, self.sigma)"
    with pytest.raises(InstrumentError, match="at 101 s"):
        record(broken(AVAILABLE, AVAILABLE + more), 1)
    assert len(record(broken(AVAILABLE, "return tap.time <= 100.0" + more), 1).data.aids["transponder"]) == 100


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "return _Beacon(self, name, seed)",
            "return None",
            r"build\(\) returned NoneType, where an Instrument is wanted",
        ),
        ("self.reach = spec.reach", "self.reach = spec.rich", r"AttributeError in __init__\(\), line \d+: .*'rich'"),
        ("    def build(", "    def make(", "NotImplementedError: Beacon has no build"),
    ],
)
def test_an_instrument_that_is_not_built(broken, old, new, message):
    scenario = broken(old, new)
    with pytest.raises(InstrumentError, match=r"instrument 'transponder' of kind 'beacon' \(Beacon in .*" + message):
        open_source(scenario, 1)


def test_lists_do_as_well_as_arrays(broken):
    expected = record(broken(READING, READING), 1).data.aids["transponder"]
    lists = READING.replace("return ", "return list(") + ")"
    stream = record(broken(READING, lists), 1).data.aids["transponder"]
    np.testing.assert_array_equal(stream.value, expected.value)


def test_no_time_no_row(broken):
    """A block without a sample: an empty array has the right shape."""
    listed = "return np.array([[r, b] for r, b in zip(np.sqrt(north**2 + east**2 + down**2), bearing)])"
    source = open_source(broken(READING, listed).model_copy(update={"step": 0.5}), 1)
    lengths = [len(source.advance(t).aids["transponder"]) for t in (0.5, 1.0, 1.5, 2.0)]
    assert lengths == [0, 1, 0, 1]


def test_the_contract_test_names_it_and_leaves_it_out(broken):
    broken(READING, "return bearing")
    with pytest.warns(
        UserWarning, match=r"'beacon' are left out of the contract test: .*observe\(\) returned an array"
    ):
        recording = contract_recording(0)
    assert "beacon" not in recording.instruments


def test_a_kind_may_inherit_from_a_registered_one(plugins):
    class Plain(Instrument):
        def observe(self, tap):
            return tap.position

    def build(self, name, seed):
        return Plain(self, name, seed)

    first = type("First", (AidSpec,), {"__annotations__": {"kind": str, "sigma": float}, "kind": "first_depth",
                                       "sigma": Depth.model_fields["sigma"], "build": build})  # fmt: skip
    second = type("Second", (first,), {"__annotations__": {"kind": str}, "kind": "second_depth"})
    for cls in (first, second):
        register_instrument(Depth.definition, example={"sigma_m": 1.0})(cls)
    made = second.from_toml({"sigma_m": 1.0}).build("d", 0)
    assert isinstance(made, Plain)
    assert made.kind == "second_depth"
