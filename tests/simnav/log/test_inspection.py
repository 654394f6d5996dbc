"""What a log holds is found, and the scenario to begin with can be run."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.leaderboard.logs import export
from simnav.leaderboard.results.formats import write
from simnav.log import LogError, LogSource
from simnav.log.check import check_log, described
from simnav.log.column_guesses import guesses
from simnav.log.delimited import read_csv
from simnav.log.draft import draft
from simnav.log.inspection import inspect_log, streams_of
from simnav.scenario import load
from simnav.source import record
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
    # The axes of the gyroscopes are those that the accelerometers have in the draft; their unit is not seen by size.
    (wrong,) = [f for f in check_log(scenario).findings if f.level == "error"]
    assert wrong.part == "gyroscope"
    assert "gx, -gy, -gz in deg_s" in wrong.sentence
    assert 'angular_rate_unit = "deg_s"' in wrong.sentence
    source = LogSource(scenario, 0)
    assert set(source.instruments) == {"gnss", "gyrocompass"}
    assert source.duration > 30.0


def test_a_draft_of_sentences_can_be_run(tmp_path):
    lines = []
    for k in range(40):
        stamp = f"2024-05-01T10:00:{k:02d}.000Z"
        lines += [f"{stamp} $GPGLL,5427.0000,N,01015.0000,E,1000{k:02d}.00,A", f"{stamp} $PRDID,1.0,2.0,9.0",
                  f"{stamp} $GPGGA,1000{k:02d}.00,54{27.0 + 0.004 * k:07.4f},N,01015.0000,E,1,09,0.9,3.0,M,44.0,M,,",
                  f"{stamp} $HEHDT,0.5,T", f"{stamp} $IIVHW,,T,,M,14.0,N,,K", f"{stamp} $SDDPT,20.5,1.2"]  # fmt: skip
    (tmp_path / "ship.log").write_text("\n".join(lines) + "\n")
    streams, failed = inspect_log([tmp_path / "ship.log"])
    assert {s.sentence for s in streams} == {"GLL", "PRDID", "GGA", "HDT", "VHW", "DPT"}
    assert not failed
    path = tmp_path / "ship.toml"
    path.write_text(draft(streams, "ship"))
    source = LogSource(load(path), 0)
    assert set(source.instruments) == {"gnss", "gyrocompass", "speed_log"}  # the depth of the water is not the vessel's
    speed = source.advance(source.duration).aids["speed_log"].value
    assert speed == pytest.approx(14.0 * 1852.0 / 3600.0)
    assert source.initial_truth.position[0, 2] == pytest.approx(47.0)  # GGA has a height, GLL none
    text = path.read_text()
    assert 'sentence = "HDT"' in text


@pytest.mark.parametrize("form", CASES)
def test_the_format_of_a_file_is_found(tmp_path, form):
    for library in {"hdf5": ["h5py"], "mcap": ["mcap"], "rosbag": ["rosbags"]}.get(form, []):
        pytest.importorskip(library)
    path = tmp_path / f"x{CASES[form].ending}"
    CASES[form].make(path)
    found = streams_of(path)
    tables = {"euroc": "csv"}  # a table of numbers says no more of itself
    assert {s.form for s in found} == {tables.get(form, form)}
    assert all(np.all(np.diff(s.time) >= 0.0) for s in found)
    if form in ("nmea", "rtklib", "pd6", "n2k", "rinex"):
        with pytest.raises(LogError, match=f"it looks like a file of format = '{form}'"):
            read_csv(path)
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
        ("time,gx,gy,gz\n0,0,0,0\n20,0,0,0\n40,0,0,0\n", {"time": "time", "time_unit": "ms"}),
        ("time,gx,gy,gz\n1714557600,0,0,0\n1714557601,0,0,0\n", {"time": "time", "time_unit": "s"}),
    ],
)
def test_the_times_of_a_table_are_found(tmp_path, text, keys):
    path = tmp_path / "a.csv"
    path.write_text(text)
    assert streams_of(path)[0].keys == keys


def test_what_cannot_be_read_is_said(tmp_path):
    (tmp_path / "a.bin").write_bytes(bytes(range(256)) * 8)
    (tmp_path / "b.csv").write_text("t,x\n1,2\n3\n5,6\n")
    (tmp_path / "c.csv").write_text("time,x\n1,2\n3..,4\n5,6\n")
    streams, failed = inspect_log([tmp_path])
    assert not streams
    assert "it is a binary file; say its format" in failed[0]
    assert "b.csv, line 3: 1 cells where the first line has 2" in failed[1]
    assert "c.csv, line 3, column 'time': '3..' is not a number" in failed[2]
    with pytest.raises(LogError, match="there is no such file or folder"):
        inspect_log([tmp_path / "no"])
    assert draft([], "x").startswith("# No columns with latitude")


def test_rows_that_are_not_later_than_the_one_before_have_no_rate():
    assert (
        described(np.array([3.0, 3.0])) == "2 rows from 3.000 to 3.000 s, most rows are not later than the one before"
    )
    assert described(np.array([3.0, 4.0, 9.5])) == "3 rows from 3.000 to 9.500 s, 0.3077 Hz"


def test_a_magnetic_heading_without_variation_is_in_the_draft(tmp_path):
    stamps = [f"2024-05-01T10:00:{k:02d}.000Z" for k in range(40)]
    lines = [f"{t} $GPGGA,1000{k:02d}.00,54{27.0 + 0.004 * k:07.4f},N,01015.0000,E,1,09,0.9,3.0,M,44.0,M,,\n"
             f"{t} $HCHDM,356.5,M" for k, t in enumerate(stamps)]  # fmt: skip
    (tmp_path / "boat.log").write_text("\n".join(lines) + "\n")
    text = draft(streams_of(tmp_path / "boat.log"), "boat", "my boat.toml")
    assert 'columns = ["heading_magnetic"]\nvariation_model = "wmm"' in text
    assert "simnav check my boat.toml" in text
    path = tmp_path / "boat.toml"
    path.write_text(text.replace('variation_model = "wmm"', "variation_deg = 5.0"))
    source = LogSource(load(path), 0)
    heading = source.advance(source.duration).aids["gyrocompass"].value
    assert np.degrees(heading) == pytest.approx(1.5)
    undated = [line.partition(" ")[2] for pair in lines for line in pair.split("\n")]
    (tmp_path / "boat.log").write_text("\n".join(undated) + "\n")
    assert "variation_deg = 0.0 " in draft(streams_of(tmp_path / "boat.log"), "boat")


def test_units_in_the_names_of_columns_count(tmp_path):
    names = ["t_ms", "gyro_x [dps]", "gyro_y (rad/s)", "gyro_z_deg_s", "acc_x [mg]", "acc_y_m_s2", "acc_z",
             "lat_e7", "lon [deg]", "alt_mm", "heading_deg", "speed (kts)"]  # fmt: skip
    rows = [[20 * k, 0.1, 0.1, 0.1, 0.1, 0.1, -9.8, 540000000 + k, 10.0, 2000, 0.5, 2.0] for k in range(9)]
    path = tmp_path / "a.csv"
    path.write_text("\n".join([",".join(names), *(",".join(map(str, row)) for row in rows)]) + "\n")
    found = {g.quantity: g.units for g in guesses(streams_of(path)[0])}
    assert found == {
        "position": ("1e-7 deg", "deg", "mm"),
        "angular_rate": ("deg_s", "rad_s", "deg_s"),
        "specific_force": ("mg", "m_s2", "m_s2"),
        "heading": ("deg",),
        "speed": ("kn",),
    }


def test_a_solution_of_rtklib_gives_its_own_accuracy(tmp_path):
    path = tmp_path / "a.pos"
    CASES["rtklib"].make(path)
    text = path.read_text().splitlines()
    head = next(k for k, line in enumerate(text) if not line.startswith("%"))
    rows = [" ".join([*line.split()[:6], "12", "0.01", "0.01", "0.02"]) for line in text[head:]]
    named = "%  UTC  latitude(deg) longitude(deg) height(m) Q ns sdn(m) sde(m) sdu(m)"
    path.write_text("\n".join([named, *rows]) + "\n")
    text = draft(streams_of(path), "a")
    assert 'sigma = ["sdn", "sde", "sdu"]' in text
    assert '[log.reference]\nquality = "Q"' in text


def test_a_topic_that_cannot_be_read_does_not_hide_the_others(tmp_path):
    writer = pytest.importorskip("mcap.writer")
    path = tmp_path / "a.mcap"
    with open(path, "wb") as stream:
        out = writer.Writer(stream)
        out.start()
        channels = [out.register_channel(t, form, 0) for t, form in (("/image", "own"), ("/fix", "json"))]
        for k in range(3):
            for channel in channels:
                out.add_message(channel, k, b'{"latitude": 54.0}', k)
        out.finish()
    (stream,) = streams_of(path)
    assert (stream.sentence, len(stream.table)) == ("/fix", 3)
    assert "messages of the topic '/image' are encoded as 'own'" in stream.notes[0]


def test_a_folder_of_folders_and_a_damaged_file_are_said(tmp_path):
    (tmp_path / "day1").mkdir()
    with pytest.raises(LogError, match="there is no file in it; name one of its folders: day1"):
        inspect_log([tmp_path])
    path = tmp_path / "a.mat"
    CASES["mat"].make(path)
    path.write_bytes(path.read_bytes()[:-3])
    with pytest.raises(LogError, match=r"a\.mat: .*damaged"):
        streams_of(path)


def test_a_draft_of_a_phone_can_be_run(tmp_path):
    """Gyroscope and accelerometer in files of their own, and a position that is repeated."""
    time = np.arange(0.0, 40.0, 0.02)
    for name, shift, values in (("Gyroscope", 0.0, (0.0, 0.0, 0.01)), ("Accelerometer", 0.007, (0.1, 0.0, 9.81))):
        own = ",".join(map(str, values))
        rows = "".join(f"{1_714_557_600_000 + 1000 * (t + shift):.0f},{own}\n" for t in time)
        (tmp_path / f"{name}.csv").write_text("time_ms,x,y,z\n" + rows)
    fixes = [f"{1714557600 + 0.5 * k},{54.0 + 1e-5 * (k // 2)},10.0,3.0" for k in range(80)]
    (tmp_path / "gps.csv").write_text("\n".join(["time,lat,lon,alt", *fixes]) + "\n")
    text = draft(inspect_log([tmp_path])[0], "phone")
    assert 'file = "gyroscope"\nspecific_force_file = "accelerometer"' in text
    assert text.count("drop_repeated = true") == 2
    path = tmp_path / "phone.toml"
    path.write_text(text)
    source = LogSource(load(path), 0)
    block = source.advance(source.duration)
    assert block.imu.specific_force[:, 2] == pytest.approx(-9.81)
    assert block.imu.angular_rate[:, 2] == pytest.approx(-0.01)
    assert np.diff(block.aids["gnss"].time) == pytest.approx(10.0)


def test_arrays_with_several_times_are_several_streams(tmp_path):
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["imu/t"] = np.arange(2000, dtype=np.uint64) * 20_000_000  # nanoseconds
        file["imu/gyro"], file["imu/accel"] = np.zeros((2000, 3)), np.tile([0.0, 0.0, -9.8], (2000, 1))
        file["gps/t"], file["gps/lat"], file["gps/lon"] = (
            np.arange(40.0),
            54.0 + 1e-5 * np.arange(40),
            np.full(40, 10.0),
        )
    streams = {s.name: s for s in streams_of(path)}
    assert streams["a.h5 imu/t"].keys == {"time": "imu/t", "time_unit": "ns"}
    assert set(streams["a.h5 gps/t"].table.names) == {"gps/t", "gps/lat", "gps/lon"}
    toml = tmp_path / "a.toml"
    toml.write_text(draft(list(streams.values()), "a"))
    source = LogSource(load(toml), 0)
    assert source.duration > 30.0
    assert source.advance(source.duration).imu.specific_force[:, 2] == pytest.approx(-9.8)


@pytest.mark.parametrize("name", ["coastal-voyage", "auv-survey", "ship-straight", "gnss-outage"])
def test_the_draft_of_an_export_runs_without_an_edit(tmp_path, name):
    scenario = load(name)
    scenario = scenario.model_copy(update={"duration": min(scenario.duration, 40.0), "faults": ()})
    export([scenario], tmp_path / "run", truth=True)
    streams, failed = inspect_log([tmp_path / "run"])
    assert not failed
    path = tmp_path / "drafted.toml"
    path.write_text(draft(streams, "drafted", path.name))
    made = load(path)
    assert made.log.reference.position.file == "truth"
    assert made.log.reference.velocity is not None
    assert made.log.reference.attitude is not None
    assert (made.log.imu is not None) == (tmp_path / "run" / "imu.csv").exists()
    quantities = {"gnss", "gnss_velocity", "dvl", "speed_log", "gyrocompass", "depth"}
    exported = {p.stem for p in (tmp_path / "run").glob("*.csv")} & quantities
    assert exported <= set(made.log.instruments)
    assert check_log(made).passed
    assert LogSource(made, 0).duration > 30.0


@pytest.mark.parametrize("rows", [1, 2000])
def test_an_imu_that_says_nothing_is_none_or_is_named(tmp_path, rows):
    """One sample is no IMU; samples that are all the same were not measured."""
    folder = tmp_path / "run"
    voyage = load("open-sea").model_copy(update={"duration": 20.0})
    write("recording", "csv", record(voyage, 1), folder)
    head, *samples = (folder / "imu.csv").read_text().splitlines()
    first = samples[0].partition(",")[2]
    same = [f"{line.partition(',')[0]},{first}" for line in samples[:rows]]
    (folder / "imu.csv").write_text("\n".join([head, *same]) + "\n")
    path = tmp_path / "still.toml"
    path.write_text(draft(inspect_log([folder])[0], "still"))
    assert ("[instruments.imu]" in path.read_text()) == (rows > 1)
    if rows > 1:
        notes = [f.sentence for f in check_log(load(path)).findings if f.part == "imu" and f.level == "note"]
        assert any("100 % of the samples are those of the row before: the IMU did not measure" in n for n in notes)
