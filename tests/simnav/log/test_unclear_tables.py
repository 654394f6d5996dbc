"""Tables that do not say what they hold: each is read rightly, or refused with one sentence."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.leaderboard.log_inspection import Inspection, drafted
from simnav.leaderboard.results.files import write_whole
from simnav.log import LogError, LogWarning
from simnav.log.channel import check_cells, no_fix, read_channel
from simnav.log.check import check_log
from simnav.log.column_guesses import guesses
from simnav.log.delimited import lines_above, read_csv
from simnav.log.draft import draft
from simnav.log.draft_readings import rewritten
from simnav.log.files import FileSpec
from simnav.log.imu_series import read_imu
from simnav.log.inspection import inspect_log, streams_of
from simnav.log.readings import ProbableReading
from simnav.log.spec import ChannelSpec
from simnav.log.table import Table, check_ascending
from simnav.log.time_units import other_unit, unit_to_write
from simnav.scenario import load, parse
from simnav.spec import SpecError


def errors(tiny) -> dict[str, str]:
    return {f.part: f.sentence for f in check_log(tiny.scenario()).findings if f.level == "error"}


def with_times(path, unit: float, name: str) -> None:
    """Write a table again with its times in a unit [s], from 0 on, under another name."""
    header, *rows = path.read_text().splitlines()
    cells = [row.split(",", 1) for row in rows]
    first = float(cells[0][0])
    scale = 1e-3 if path.stem.startswith("imu") else 1.0
    new = [f"{round((float(t) - first) * scale / unit)},{rest}" for t, rest in cells]
    path.write_text("\n".join([f"{name},{header.split(',', 1)[1]}", *new]) + "\n")


@pytest.mark.parametrize(
    ("file", "column", "says"),
    [
        ("gnss", "latitude_deg", "line 4, column 'latitude_deg': 'bad' is not a number; a draft has no position"),
        (
            "imu",
            "angular_rate_y",
            "line 4, column 'angular_rate_y': 'bad' is not a number; a draft has no angular rate",
        ),
    ],
)
def test_a_cell_that_is_no_number_is_said_and_no_other_column_is_taken(tmp_path, file, column, says):
    tables = {
        "gnss": ("time_s,latitude_deg,longitude_deg,height_m", "50.0,-5.0,10.0"),
        "imu": (
            "time_s," + ",".join(f"{q}_{a}" for q in ("angular_rate", "specific_force") for a in "xyz"),
            "0,0,0,0,0,-9.8",
        ),
    }
    for name, (header, row) in tables.items():
        rows = [f"{k},{row}".split(",") for k in range(20)]
        if name == file:
            rows[2][header.split(",").index(column)] = "bad"
        write_whole(tmp_path / f"{name}.csv", "\n".join([header, *map(",".join, rows)]) + "\n")
    found = Inspection(*map(tuple, inspect_log([tmp_path])))
    assert any(says in sentence for sentence in found.unknown)
    guessed = {g.quantity for s in found.streams for g in guesses(s)}
    assert guessed == ({"angular_rate", "specific_force"} if file == "gnss" else {"position", "specific_force"})
    assert any("a draft has no IMU" in sentence for sentence in found.unknown) == (file == "imu")


@pytest.mark.parametrize("time", ["05/01/2024 10:00:0", "01.05.2024 10:00:0", "10:00:0"])
def test_a_time_of_an_unknown_form_is_quoted(tmp_path, time):
    rows = "\n".join(f"{time}{k},50.0,-5.0,10.0" for k in range(9))
    write_whole(tmp_path / "gnss.csv", f"time,latitude_deg,longitude_deg,height_m\n{rows}\n")
    (said,) = inspect_log([tmp_path])[1]
    assert f"gnss.csv, line 2, column 'time': '{time}0' is no known form of a time; write seconds, or year" in said


def test_longitude_and_height_alone_are_no_position(tmp_path):
    rows = "\n".join(f"{k},-5.0,10.0" for k in range(20))
    write_whole(tmp_path / "gnss.csv", f"time_s,longitude_deg,height_m\n{rows}\n")
    (stream,) = inspect_log([tmp_path])[0]
    assert not list(guesses(stream))


@pytest.mark.parametrize("name", ["time", "time_s"])
@pytest.mark.parametrize(
    ("imu", "truth"), [("ms", "s"), ("us", "s"), ("s", "ms"), ("s", "us"), ("ms", "ms"), ("us", "us")]
)
def test_the_unit_of_times_is_found_by_rates_and_by_the_other_streams(tiny, imu, truth, name):
    units = {"s": 1.0, "ms": 1e-3, "us": 1e-6}
    with_times(tiny.folder / "truth1.csv", units[truth], name)
    if imu == "s":  # with a fraction
        lines = (tiny.folder / "imu1.csv").read_text().splitlines()
        rows = [f"{(k + 1) / 50},{line.split(',', 1)[1]}" for k, line in enumerate(lines[1:])]
        (tiny.folder / "imu1.csv").write_text("\n".join([lines[0].replace("stamp", name), *rows]) + "\n")
    else:
        with_times(tiny.folder / "imu1.csv", units[imu], name)
    streams = {s.path.stem: s for s in inspect_log([tiny.folder / f for f in ("imu1.csv", "truth1.csv")])[0]}
    found = {stem: s.keys["time_unit"] for stem, s in streams.items()}
    assert found == {"imu1": imu, "truth1": truth}
    assert all(s.time[-1] == pytest.approx(40.0, abs=0.1) for s in streams.values())
    assert (imu == "s") == (not streams["imu1"].notes)  # another unit than the header says is told
    assert f'time_unit = "{imu}"' in draft(list(streams.values()))


def test_an_imu_below_one_hertz_is_refused_with_its_unit(tiny):
    tiny.replace('time_unit = "ms"', 'time_unit = "s"')
    spec = tiny.scenario().log
    with pytest.raises(LogError, match=r"imu1\.csv: the IMU would have 0\.05 Hz, where 1 Hz is the least.*'ms'"):
        read_imu(spec, spec.imu, "1")
    assert "write time_unit = 'ms' of its file" in errors(tiny)["imu"]


def test_a_file_in_another_unit_than_the_others_fails_the_check(tiny):
    tiny.replace('path = "truth{recording}.csv"', 'path = "truth{recording}.csv"\nscale = 1000.0')
    tiny.replace('path = "dvl{recording}.txt"', 'path = "dvl{recording}.txt"\noffset_s = -5000.0')
    tiny.replace("offset_s = 0.25\n", "")
    found = errors(tiny)
    assert set(found) == {"reference.position"}
    assert (
        "are not those of the other instruments, but would be with time_unit = 'ms' of its file" in found.popitem()[1]
    )


def test_a_log_in_which_all_is_rare_is_in_milliseconds(tmp_path):
    for name, columns in (("fixes", "lat,lon"), ("compass", "heading_deg,quality")):
        rows = "".join(f"{1000 * k},{50 + 1e-5 * k},{10.0}\n" for k in range(60))
        (tmp_path / f"{name}.csv").write_text(f"time,{columns}\n{rows}")
    streams, _ = inspect_log([tmp_path])
    assert [s.keys["time_unit"] for s in streams] == ["ms", "ms"]
    (alone,), _ = inspect_log([tmp_path / "fixes.csv"])  # nothing tells
    assert alone.keys["time_unit"] == "s"


def test_times_that_fit_have_no_other_unit():
    second, hour = np.arange(0.0, 120.0), np.arange(0.0, 3600.0)
    assert other_unit("s", second, [hour], inertial=False) is None
    assert other_unit("s", 1.7e9 + second, [], inertial=True) is None  # since 1970, once a second
    assert other_unit("s", np.arange(0.0, 1.2e5), [second], inertial=False) is None  # once a second for a day
    assert other_unit("ms", 1e-3 * second / 100.0, [], inertial=True) == "s"  # 100 kHz
    assert other_unit("s", 1e6 * second, [], inertial=False) == "us"  # years
    spec = FileSpec(path="a", format="nmea", scale=2.0)
    assert unit_to_write(spec, 1e3 * second, [second], inertial=False) == "scale = 0.002"


def test_fixes_at_zero_are_none(tiny):
    path = tiny.folder / "truth1.csv"
    header, *rows = path.read_text().splitlines()
    cells = [row.split(",") for row in rows]
    path.write_text("\n".join([header, *(",".join([c[0], *(["0", "0.0"] if k < 3 else c[1:3]), *c[3:]])
                                         for k, c in enumerate(cells))]) + "\n")  # fmt: skip
    spec = tiny.scenario().log
    for drop in (False, True):
        channel = spec.reference.position.model_copy(update={"drop_repeated": drop})
        with pytest.warns(LogWarning, match="3 of 41 rows of position have latitude 0 and longitude 0, .* line 2"):
            series = read_channel(spec, channel, "position", "1")
        assert series.line[0] == 5
    assert any(f.level == "note" and "so they are no fixes" in f.sentence for f in check_log(tiny.scenario()).findings)
    (stream,) = streams_of(path)
    position = next(g for g in guesses(stream) if g.quantity == "position")
    assert position.units[0] == "deg"
    assert "3 with latitude 0 and longitude 0 are no fixes" in position.sentence()
    assert "no fixes, and left out: 3" in draft([stream])
    path.write_text("\n".join([header, *(",".join([c[0], "0", "0", *c[3:]]) for c in cells)]) + "\n")
    with pytest.raises(LogError, match="all 41 rows have latitude 0 and longitude 0: the receiver had no fix"):
        read_channel(spec, spec.reference.position, "position", "1")


def test_a_vessel_may_be_where_latitude_and_longitude_are_zero():
    passing = np.stack([np.arange(-3.0, 4.0), np.arange(-3.0, 4.0)], axis=-1)
    assert not no_fix(passing).any()
    assert no_fix(np.array([[0.0, 0.0], [0.0, 10.0], [0.01, 10.0]])).tolist() == [True, False, False]


PREAMBLE = "Logger 7, version 3.2\nDate: 2024-05-01\n\nVessel, port, bow, stern\n"
ROWS = "".join(f"{k},{54 + 1e-4 * k},10.0,3.0\n" for k in range(20))


@pytest.mark.parametrize(
    ("above", "names", "units", "keys"),
    [
        (PREAMBLE, "time,lat,lon,height", "", {"skip_lines": 4}),
        ("Serial 12345\nRate 10\n", "time,lat,lon,height", "", {"skip_lines": 2}),
        ("one line of text\n", "", "", {"skip_lines": 1}),
        ("", "time,lat,lon,height", "[s],[Deg],deg,cm", {"skip_rows": 1}),
        (PREAMBLE, "time,lat,lon,height", "ms,deg,,hPa", {"skip_lines": 4, "skip_rows": 1}),
        ("", "time,lat,lon,height", "", {}),
    ],
)
def test_lines_above_the_header_and_a_row_of_units(tmp_path, above, names, units, keys):
    path = tmp_path / "fixes.csv"
    path.write_text(above + "".join(f"{line}\n" for line in (names, units) if line) + ROWS)
    (stream,) = streams_of(path)
    assert {k: v for k, v in stream.keys.items() if k.startswith("skip")} == keys
    assert len(stream.table) == 20
    assert stream.table.line[0] == 1 + sum(bool(x) for x in (names, units)) + above.count("\n")
    assert stream.keys["time_unit"] == ("ms" if units.startswith("ms") else "s")
    if names:
        position = next(g for g in guesses(stream) if g.quantity == "position")
        assert position.units == ("deg", "deg", "cm" if "cm" in units else "m")
        assert all(f"{k} = {v}" in draft([stream]) for k, v in keys.items())


def test_lines_above_the_header_are_told(tmp_path):
    path = tmp_path / "fixes.csv"
    path.write_text(PREAMBLE + "time,lat,lon,height\n" + ROWS)
    with pytest.raises(LogError, match=r"fixes\.csv, line 2: .* begin in line 5: write skip_lines = 4"):
        read_csv(path)
    assert len(read_csv(path, skip_lines=4)) == 20
    with pytest.raises(LogError, match="the file is empty below skip_lines = 99"):
        read_csv(path, skip_lines=99)
    path.write_text("t,x\n1,2\n3\n" + "5,6\n" * 9)
    assert lines_above(path) == 0  # a damaged row, and no text above a table
    path.write_text("This is a letter.\nIt has some lines of text, but no table.\nYours\n")
    (failed,) = inspect_log([path])[1]
    assert "no header of a table is found" in failed


def test_one_cell_that_is_impossible_is_named(tiny):
    tiny.edit("truth1.csv", 7, "5005.0,45.8,11.5,1e30,2,0,0,0,0,0")
    assert "line 7, column 'h': 1e+30 is no possible height" in errors(tiny)["reference.position"]
    tiny.replace('columns = ["lat", "lon", "h"]', 'where = \'-20000 < `h` < 20000\'\ncolumns = ["lat", "lon", "h"]')
    assert "reference.position" not in errors(tiny)
    tiny.edit("truth1.csv", 7, "5005.0,9999,11.5,5,2,-1e30,0,0,0,1e30")
    found = errors(tiny)
    assert "line 7, column 'lat': 9999 is no possible latitude" in found["reference.position"]
    assert "line 7, column 'yaw': 1e+30 is no possible yaw" in found["reference.attitude"]
    assert "line 7, column 've': -1e+30 is no possible velocity_east" in found["reference.velocity"]
    tiny.edit("imu1.csv", 7, "5000120.0,0,0,1e30,0,0,0")
    assert "line 7, column 'az': 1e+30 is no possible specific force" in errors(tiny)["imu"]


def test_degrees_and_minutes_are_told(tiny):
    path = tiny.folder / "truth1.csv"
    header, *rows = path.read_text().splitlines()
    path.write_text(
        "\n".join([header, *(",".join([c.split(",")[0], "4547.9", *c.split(",")[2:]]) for c in rows)]) + "\n"
    )
    assert (
        "column 'lat': latitude would be 79.3758 rad; it may be degrees and minutes"
        in errors(tiny)["reference.position"]
    )


def test_one_time_that_is_impossible_is_named():
    table = Table("a.csv", {}, np.arange(2, 6))
    with pytest.raises(LogError, match=r"line 4, column 't': the time 1e\+30 s is after that of all later rows"):
        check_ascending(np.array([1.0, 2.0, 1e30, 3.0]), table, "t")


def test_nul_bytes_are_told(tmp_path):
    path = tmp_path / "a.csv"
    path.write_bytes(b"t,x\n" + b"1,2\n" * 99 + b"\0\0\0" + b"\n3,4\n")
    with pytest.raises(LogError, match=r"a\.csv, line 101: it has the first of 3 NUL bytes"):
        read_csv(path)


def test_a_draft_without_positions_says_which_line_is_to_be_filled_in(tiny, tmp_path):
    streams, _ = inspect_log([tiny.folder / "imu1.csv"])
    made = drafted(streams, "x", "x.toml")
    assert made.scenario is None
    path = tmp_path / "x.toml"
    path.write_text(made.text)
    line = next(k for k, text in enumerate(made.text.splitlines(), 1) if "FILL IN" in text)
    with pytest.raises(
        SpecError, match=rf"x\.toml, line {line}: fill in 'file' of \[log\.reference\.position\]: the name"
    ):
        load(path)
    filled = made.text.replace('"FILL IN"', '"imu1"', 1).replace('["FILL IN"]', '["=0.1", "=0.2", "=0"]')
    assert parse(filled).log.reference.position.file == "imu1"


def test_a_single_fix_is_too_few(tiny):
    path = tiny.folder / "truth1.csv"
    path.write_text("\n".join(path.read_text().splitlines()[:2]) + "\n")
    spec = tiny.scenario().log
    channel = spec.reference.position.model_copy(update={"hold_out": 10})
    with pytest.raises(
        LogError, match="1 row with position every = 1 and hold_out = 10 leave none; more rows are wanted"
    ):
        read_channel(spec, channel, "position", "1")


@pytest.mark.parametrize("names", ["lat,lon", "latitude_deg,longitude_deg", "lat_e7,lon_e7"])
def test_degrees_as_whole_numbers_are_in_the_draft(tmp_path, names):
    path = tmp_path / "fixes.csv"
    path.write_text(f"time,{names},height\n" + "".join(f"{k},{540000000 + k},{100000000 + k},3\n" for k in range(20)))
    assert 'units = ["1e-7 deg", "1e-7 deg", "m"]' in draft(streams_of(path))


def test_a_reading_that_is_not_sure_is_a_comment():
    text = '[log.instruments.gyrocompass]\nfile = "g"\nunits = ["rad"]\n'
    change = (("log.instruments.gyrocompass", "mounting_deg", "[0, 0, 90]"),)
    sure, unsure = (ProbableReading("gyrocompass", change, "mounted at 90 deg", 20.0, p, 0.1) for p in (0.95, 0.6))
    assert "\nmounting_deg = [0, 0, 90]   # check: so with probability 0.95" in rewritten(text, [sure])
    assert "# check: perhaps mounting_deg = [0, 0, 90] (mounted at 90 deg, with probability 0.6)" in rewritten(
        text, [unsure]
    )
    assert "\nmounting_deg" not in rewritten(text, [unsure])


def test_a_file_that_cannot_be_written_is_named_as_its_user_does(tmp_path):
    path = tmp_path / "no" / "a.toml"
    with pytest.raises(OSError, match=r"no/a\.toml'$"):
        write_whole(path, "x")


def test_a_local_position_with_one_impossible_cell(tiny):
    tiny.edit("truth1.csv", 7, "5005.0,45.8,11.5,5,1e30,0,0,0,0,0")
    tiny.add("\n[log.origin]\nlatitude_deg = 45.8\nlongitude_deg = 11.5\nheight_m = 0.0\n")
    channel = ChannelSpec(file="truth", columns=("vn", "ve", "h"), frame="ned")
    with pytest.raises(LogError, match=r"line 7, column 'vn': 1e\+30 is no possible position"):
        read_channel(tiny.scenario().log, channel, "position", "1")


def test_a_column_in_a_smaller_unit_has_no_impossible_cells():
    table = Table("dvl.csv", {}, np.arange(2, 202))
    value = np.random.default_rng(0).normal(0.0, 150.0, 200)  # 0.15 m/s, in mm/s that are read as m/s
    rows = np.arange(200)
    check_cells(value, 200.0, 1.0, "v", table, rows, "velocity")
    value[7] = 1e6
    with pytest.raises(LogError, match="is no possible velocity"):
        check_cells(np.where(np.abs(value) < 200.0, value, 1e6), 200.0, 1.0, "v", table, rows, "velocity")
