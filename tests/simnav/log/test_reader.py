"""A reader of a third party, in one file: a format that simnav does not know, in a recorded scenario."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.estimator import make
from simnav.log import LogError
from simnav.log.reader import READERS, register_reader
from simnav.plugins import PluginError
from simnav.scenario import parse
from simnav.source import open_source, record
from simnav.spec import SpecError
from simnav.trial import run_trial

TOML = """
name = "binary"
version = 1
title = "A log in records"
plugins = ["fixed_records.py"]
duration_s = 50.0

[instruments.gnss]
kind = "gnss_position"
sigma_m = 1.0

[log]
recordings = ["a"]

[log.files.fixes]
path = "{recording}.rec"
format = "fixed_records"
options = { columns = ["lat", "lon", "alt"] }
scale = 0.001

[log.instruments.gnss]
file = "fixes"
columns = ["lat", "lon", "alt"]
units = ["deg", "deg", "m"]
hold_out = 2

[log.reference.position]
file = "fixes"
columns = ["lat", "lon", "alt"]
units = ["deg", "deg", "m"]
"""


@pytest.fixture
def log(plugins, tmp_path, monkeypatch):
    """The records of a minute, in milliseconds, and a function that reads a scenario over them."""
    monkeypatch.setenv("SIMNAV_DATA", str(tmp_path))
    t = np.arange(61.0)
    records = np.stack([1000.0 * t, 54.0 + 1e-5 * t, 7.9 + 2e-5 * t, 0.1 * t], axis=1)
    records.astype("<f8").tofile(tmp_path / "a.rec")

    def scenario(old="", new=""):
        assert old in TOML
        return parse(TOML.replace(old, new, 1) if old else TOML, source="binary.toml", folder=plugins)

    scenario.records, scenario.path = records, tmp_path / "a.rec"
    return scenario


def test_the_measurements_are_those_of_the_file(log):
    recording = record(log(), 1)
    gnss = recording.data.aids["gnss"]
    assert len(gnss) == 25
    rows = log.records[np.round(gnss.time).astype(int)]
    np.testing.assert_allclose(np.degrees(gnss.value[:, :2]), rows[:, 1:3], atol=1e-12)
    np.testing.assert_allclose(gnss.value[:, 2], rows[:, 3], atol=1e-12)
    assert run_trial(make("gnss-only"), recording).status == "ok"


def test_options_round_trip_and_count_in_the_digest(log):
    scenario = log()
    assert type(scenario).from_toml(scenario.to_toml()) == scenario
    other = log('columns = ["lat", "lon", "alt"] }', 'columns = ["lat", "lon", "h"] }')
    assert other.content_hash() != scenario.content_hash()
    assert "options" not in type(scenario.log.files["fixes"])(path="a").model_dump()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"fixed_records"', '"fixed_record"', "files.fixes.format = 'fixed_record' is unknown.*'fixed_records'"),
        ('columns = ["lat", "lon", "alt"]\nunits = ["deg", "deg", "m"]\n', "", "'columns' is missing"),
    ],
)
def test_mistakes_in_the_scenario_are_one_sentence(log, old, new, message):
    with pytest.raises(SpecError, match=message):
        log(old, new)


def test_what_the_reader_refuses_and_what_it_raises_names_the_file(log):
    with pytest.raises(LogError, match=r"a.rec: name the columns of a record"):
        open_source(log('options = { columns = ["lat", "lon", "alt"] }\n', ""), 1)
    with pytest.raises(LogError, match=r"reader 'fixed_records' in fixed_records.py: TypeError in read\(\), line"):
        open_source(log('{ columns = ["lat", "lon", "alt"] }', "{ columns = 3 }"), 1)
    log.path.write_bytes(b"")
    with pytest.raises(LogError, match=r"a.rec: there are no rows of data"):
        open_source(log(), 1)
    log.path.unlink()
    with pytest.raises(LogError, match=r"a.rec: there is no such file"):
        open_source(log(), 1)


def test_a_reader_returns_rows(log, tmp_path):
    wrong = register_reader("wrong_rows")(lambda path, file, sentence, talker: [1.0])
    with pytest.raises(LogError, match=r"'wrong_rows' in test_reader.py: it returned list, where Rows are wanted"):
        wrong.read(log.path, log().log.files["fixes"])


def test_a_format_of_simnav_is_not_replaced():
    assert {"csv", "nmea"} <= set(READERS.items())
    with pytest.raises(PluginError, match=r"format 'csv' of log reader .* the name is taken by _read"):
        register_reader("csv")(lambda path, file, sentence, talker: None)
