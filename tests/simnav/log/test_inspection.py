"""What a log holds is found, and the scenario to begin with can be run."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.log import LogError, LogSource
from simnav.log.check import check_log, described
from simnav.log.draft import draft, guesses
from simnav.log.inspection import inspect_log, streams_of
from simnav.scenario import load
from tests.cases.log_files import CASES


def test_a_draft_of_tables_can_be_run(tiny, tmp_path):
    streams, failed = inspect_log([tiny.folder])
    assert not failed
    found = {g.quantity: g for s in streams for g in guesses(s)}
    assert found["position"].columns == ("lat", "lon", "h")
    assert found["position"].units == ("deg", "deg", "m")
    assert found["specific_force"].units == ("g",) * 3
    assert found["specific_force"].columns == ("ax", "-ay", "-az")  # gravity was on the wrong side
    assert found["angular_rate"].units == ("deg_s",) * 3 or found["angular_rate"].units == ("rad_s",) * 3
    path = tmp_path / "my-log.toml"
    path.write_text(draft(streams, "my-log"))
    scenario = load(path)
    report = check_log(scenario)
    assert report.passed, report
    source = LogSource(scenario, 0)
    assert set(source.instruments) == {"gnss", "gyrocompass"}
    assert source.duration > 30.0


def test_a_draft_of_sentences_can_be_run(tmp_path):
    lines = []
    for k in range(40):
        stamp = f"2024-05-01T10:00:{k:02d}.000Z"
        lines += [f"{stamp} $GPGGA,1000{k:02d}.00,54{27.0 + 0.004 * k:07.4f},N,01015.0000,E,1,09,0.9,3.0,M,44.0,M,,",
                  f"{stamp} $HEHDT,0.5,T", f"{stamp} $IIVHW,,T,,M,14.0,N,,K", f"{stamp} $SDDPT,20.5,1.2"]  # fmt: skip
    (tmp_path / "ship.log").write_text("\n".join(lines) + "\n")
    streams, failed = inspect_log([tmp_path / "ship.log"])
    assert {s.sentence for s in streams} == {"GGA", "HDT", "VHW", "DPT"}
    assert not failed
    path = tmp_path / "ship.toml"
    path.write_text(draft(streams, "ship"))
    source = LogSource(load(path), 0)
    assert set(source.instruments) == {"gnss", "gyrocompass", "speed_log"}  # the depth of the water is not the vessel's
    speed = source.advance(source.duration).aids["speed_log"].value
    assert speed == pytest.approx(14.0 * 1852.0 / 3600.0)


@pytest.mark.parametrize("form", CASES)
def test_the_format_of_a_file_is_found(tmp_path, form):
    for library in {"hdf5": ["h5py"], "mcap": ["mcap"], "rosbag": ["rosbags"]}.get(form, []):
        pytest.importorskip(library)
    path = tmp_path / f"x{CASES[form].ending}"
    CASES[form].make(path)
    found = streams_of(path)
    tables = {"euroc": "csv", "kf_gins": "csv"}  # a table of numbers says no more of itself
    assert {s.form for s in found} == {tables.get(form, form)}
    assert all(np.all(np.diff(s.time) >= 0.0) for s in found)
    if form == "rtklib":
        assert any(g.quantity == "position" and g.units[0] == "deg" for s in found for g in guesses(s))


@pytest.mark.parametrize(
    ("text", "keys"),
    [
        ("Date,Time,lat,lon\n2024-05-01,10:00:00,1,2\n2024-05-01,10:00:01,1,2\n", {"time": ("Date", "Time")}),
        ("timestamp_ms,lat,lon\n1,1,2\n2,1,2\n", {"time": "timestamp_ms", "time_unit": "ms"}),
        ("#timestamp [ns],lat,lon\n1,1,2\n2,1,2\n", {"time": "#timestamp [ns]", "time_unit": "ns"}),
        ("x,utc\n1,2024-05-01T10:00:00Z\n2,2024-05-01T10:00:01Z\n", {"time": "utc", "time_unit": "iso"}),
        ("1714557600000,5\n1714557600100,6\n", {"time": "1", "time_unit": "ms"}),
    ],
)
def test_the_times_of_a_table_are_found(tmp_path, text, keys):
    path = tmp_path / "a.csv"
    path.write_text(text)
    assert streams_of(path)[0].keys == keys


def test_what_cannot_be_read_is_said(tmp_path):
    (tmp_path / "a.bin").write_bytes(bytes(range(256)) * 8)
    (tmp_path / "b.csv").write_text("t,x\n1,2\n3\n5,6\n")
    streams, failed = inspect_log([tmp_path])
    assert not streams
    assert "it is a binary file; say its format" in failed[0]
    assert "b.csv, line 3: 1 cells where the first line has 2" in failed[1]
    with pytest.raises(LogError, match="there is no such file or folder"):
        inspect_log([tmp_path / "no"])
    assert draft([], "x").startswith("# No columns with latitude")


def test_rows_that_are_not_later_than_the_one_before_have_no_rate():
    assert (
        described(np.array([3.0, 3.0])) == "2 rows from 3.000 to 3.000 s, most rows are not later than the one before"
    )
    assert described(np.array([3.0, 4.0, 9.5])) == "3 rows from 3.000 to 9.500 s, 0.3077 Hz"
