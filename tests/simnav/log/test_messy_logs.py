"""What stopped real logs: each of it is read, or refused with one sentence that says what would be right."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from simnav.geometry.rotation import dcm_from_rpy
from simnav.log import LogError, LogSource, LogWarning
from simnav.log.channel import read_channel
from simnav.log.check import check_log
from simnav.log.delimited import read_csv
from simnav.log.files import FileSpec
from simnav.log.imu_series import read_imu
from simnav.log.reader import READERS
from simnav.log.row_filter import RowFilter
from simnav.log.same_time import settle
from simnav.log.spec import ChannelSpec
from simnav.log.table import Table
from simnav.spec import SpecError
from tests.cases.tiny_log import CLOCK


def table(**columns) -> Table:
    arrays = {
        n: np.array(c, dtype=object if isinstance(c[0], (str, type(None))) else float) for n, c in columns.items()
    }
    return Table("a.csv", arrays, np.arange(2, 2 + len(next(iter(arrays.values())))))


@pytest.mark.parametrize(
    ("condition", "rows"),
    [
        ("Q == 1", [0, 3]),
        ("Q == 1 and sd < 0.5", [0]),
        ("Q != 1 or sd >= 2", [1, 2, 3]),
        ("not (Q == 1 or Q == 2)", [2]),
        ("0.2 < sd <= 0.7", [1]),
        ("mode == 'A'", [0, 1]),
        ('mode != "A"', [3]),  # a missing cell fulfils nothing
        ("`1` == 5", [2]),
    ],
)
def test_a_condition_chooses_rows(condition, rows):
    t = table(Q=[1, 2, 5, 1], sd=[0.1, 0.7, np.nan, 2.0], mode=["A", "A", None, "V"])
    assert np.flatnonzero(RowFilter(condition).rows(t)).tolist() == rows


@pytest.mark.parametrize(
    ("condition", "message"),
    [
        ("Q = 1", r"'= 1' at character 2 is not understood; write it like \"Q == 1"),
        ("Q ==", "is incomplete"),
        ("Q", "is incomplete"),
        ("Q == 1 Q == 2", r"'Q' at character 8"),
        ("(" * 100 + "Q == 1", "more than 50"),
        ("__import__('os')", r"'\(' at character 11"),
    ],
)
def test_what_is_no_condition_is_said(condition, message):
    with pytest.raises(ValueError, match=message):
        RowFilter(condition)


def test_a_condition_in_a_scenario(tiny):
    tiny.replace('columns = ["lat", "lon", "h"]', 'where = "vn > 0"\ncolumns = ["lat", "lon", "h"]')
    spec = tiny.scenario().log
    series = read_channel(spec, spec.reference.position, "position", "1")
    assert len(series.time) == int(np.sum(tiny.truth.velocity[::50, 0] > 0)) < 41
    for condition, message in [
        ("vm > 0", r"no column 'vm'; valid here: .*where = 'vm > 0'; text stands in quotes"),
        ("vn > 1e9", "none of 41 rows"),
    ]:
        channel = spec.reference.position.model_copy(update={"where": condition})
        with pytest.raises(LogError, match=message):
            read_channel(spec, channel, "position", "1")
    with pytest.raises(SpecError, match=r"tiny.toml: log.reference.position: where = 'vn => 0'"):
        tiny.replace("vn > 0", "vn => 0").scenario()


@pytest.mark.parametrize(
    ("how", "time", "rows"),
    [
        ("first", [0, 0, 0, 1, 1, 3], [0, 3, 5]),
        ("last", [0, 0, 0, 1, 1, 3], [2, 4, 5]),
        ("spread", [0, 1 / 3, 2 / 3, 1, 2, 3], [0, 1, 2, 3, 4, 5]),
    ],
)
def test_rows_of_one_time(how, time, rows):
    given = np.array([0.0, 0.0, 0.0, 1.0, 1.0, 3.0])
    t = Table("a.csv", {}, np.arange(1, 7))
    if how == "spread":
        found = settle(given, np.arange(6), t, how)
    else:
        with pytest.warns(LogWarning, match="3 of 6 rows at the time of the one .*'spread'"):
            found = settle(given, np.arange(6), t, how)
    np.testing.assert_allclose(found[0], time)
    assert found[1].tolist() == rows


def test_rows_of_one_time_in_a_table_are_refused_with_the_key(tiny):
    line = (tiny.folder / "truth1.csv").read_text().splitlines()[3]
    tiny.edit("truth1.csv", 3, line)
    spec = tiny.scenario().log
    with pytest.raises(LogError, match=r"truth1\.csv, line 4, column 't': the time is the same .* same_time = 'first'"):
        read_channel(spec, spec.reference.position, "position", "1")


def read(path, **keys):
    return READERS.get("csv").read(path, FileSpec(path=path.name, **keys))


@pytest.mark.parametrize(
    ("text", "keys"),
    [
        ("2024/05/01 10:00:00.500 1.0\n2024/05/01 10:00:01.500 2.0\n", {"time": (1, 2)}),
        ("date,clock,x\n2024-05-01,10:00:00.5,1\n2024-05-01,10:00:01.5,2\n", {"time": ("date", "clock")}),
        ("date;clock;x\n20240501;100000.5;1\n20240501;100001.5;2\n", {"time": ("date", "clock")}),
        ("t,x\n2024/05/01 10:00:00.5,1\n2024/05/01 10:00:01.5,2\n", {"time": "t", "time_unit": "iso"}),
    ],
)
def test_dates_in_one_column_or_in_two(tmp_path, text, keys):
    path = tmp_path / "a.csv"
    path.write_text(text)
    assert read(path, **keys).time.tolist() == [1714557600.5, 1714557601.5]


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("2024-13-01,10:00:00,1", r"line 3, column 'date': '2024-13-01' is not a date like 2024-05-01"),
        ("2024-05-01,25:00:00,1", r"line 3, column 'clock': '25:00:00' is not a time of day"),
    ],
)
def test_a_wrong_date_is_named(tmp_path, row, message):
    path = tmp_path / "a.csv"
    path.write_text(f"date,clock,x\n2024-05-01,10:00:00,1\n{row}\n2024-05-01,10:00:02,x\n")
    with pytest.raises(LogError, match=message):
        read(path, time=("date", "clock"))


def test_an_incomplete_last_row_is_left_out(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("t,x,y\n1,2,3\n2,3,4\n3,4")
    with pytest.warns(LogWarning, match="the last row has 2 cells where the first line has 3; it is incomplete"):
        assert len(read_csv(path)) == 2


@pytest.mark.parametrize(
    ("head", "message"),
    [
        (b"\x89HDF\r\n\x1a\n", "it is an HDF5 file, and no text as format = 'csv' wants"),
        (b"\x1f\x8b\x08", "it is a gzip archive; unpack it"),
        (bytes(range(256)), "it is a binary file.*the formats that are read: .*csv"),
    ],
)
def test_a_binary_file_is_named(tmp_path, head, message):
    path = tmp_path / "a.csv"
    path.write_bytes(head + bytes(1000))
    with pytest.raises(LogError, match=message):
        read_csv(path)


def test_a_unit_may_have_a_factor(tiny):
    spec = tiny.scenario().log
    channel = spec.reference.position.model_copy(update={"units": ("1e-7 deg", "10 deg", "-0.5 m")})
    plain = read_channel(spec, spec.reference.position, "position", "1")
    scaled = read_channel(spec, channel, "position", "1")
    np.testing.assert_allclose(scaled.value[0], plain.value[0] * [1e-7, 10.0, -0.5])
    with pytest.raises(ValueError, match="unit 'x deg': a number other than 0 and a unit"):
        ChannelSpec(file="truth", columns=("lat",), units="x deg")


def test_an_imu_that_is_mounted_at_angles(tiny):
    """The files' axes are starboard, forward, up: as sensor axes they are turned by roll 180 and yaw 90 degrees."""
    spec = tiny.scenario().log
    plain = read_imu(spec, spec.imu, "1")
    mounting = (0.3, -0.2, 0.7)
    turned = spec.imu.model_copy(update={"mounting": mounting})
    found = read_imu(spec, turned, "1")
    np.testing.assert_allclose(found.mean[:, :3], plain.mean[:, :3] @ dcm_from_rpy(np.array(mounting)).T)
    swapped = tiny.replace('"gy", "gx", "-gz"', '"gx", "gy", "gz"').replace('"ay", "ax", "-az"', '"ax", "ay", "az"')
    swapped.replace('samples = "means"', 'samples = "means"\nmounting_deg = [180, 0, 90]')
    np.testing.assert_allclose(read_imu(spec, swapped.scenario().log.imu, "1").mean, plain.mean, atol=1e-9)


def test_a_log_with_mounting(tiny):
    tiny.replace('units = ["m_s", "m_s", "mm_s"]', 'units = ["m_s", "m_s", "mm_s"]\nmounting_deg = [0, 0, 90]')
    spec = tiny.scenario().log
    series = read_channel(spec, spec.instruments["dvl"].channel(), "dvl", "1")
    np.testing.assert_allclose(series.value[:, :2], np.stack([-tiny.truth.dvl[:, 1], tiny.truth.dvl[:, 0]], axis=1))
    with pytest.raises(LogError, match="mounting_deg of position: it is for velocities in body axes"):
        read_channel(spec, spec.reference.position.model_copy(update={"mounting": (0.1, 0, 0)}), "position", "1")


def test_an_imu_in_two_files_with_two_clocks(tiny):
    lines = [x.split(",") for x in (tiny.folder / "imu1.csv").read_text().splitlines()]
    (tiny.folder / "gyro1.csv").write_text("\n".join(",".join([x[0], *x[4:]]) for x in lines) + "\n")
    rows = [lines[0][:4]] + [[repr(float(x[0]) / 1e3 - 100.0), *x[1:4]] for x in lines[1:]]
    (tiny.folder / "acc1.csv").write_text("\n".join(",".join(x) for x in rows) + "\n")
    whole = read_imu(tiny.scenario().log, tiny.scenario().log.imu, "1")
    tiny.replace('path = "imu{recording}.csv"', 'path = "gyro{recording}.csv"')
    tiny.replace('file = "imu"', 'file = "imu"\nspecific_force_file = "acc"')
    tiny.add('\n[log.files.acc]\npath = "acc{recording}.csv"\ntime = "stamp"\noffset_s = 100.0\n')
    spec = tiny.scenario().log
    parts = read_imu(spec, spec.imu, "1")
    np.testing.assert_allclose(parts.mean[:-1], whole.mean[: len(parts.mean) - 1], atol=1e-6)
    assert len(parts.mean) >= len(whole.mean) - 1
    tiny.replace("offset_s = 100.0", "offset_s = 0.0")
    with pytest.raises(LogError, match="have no time in common; check time_unit, scale and offset_s of the two files"):
        read_imu(tiny.scenario().log, tiny.scenario().log.imu, "1")


def test_repeated_values(tiny):
    lines = (tiny.folder / "dvl1.txt").read_text().splitlines()
    stale = []
    for k, line in enumerate(lines):
        time, rest = line.split(" ", 1)
        stale += [line, f"{float(time) + 0.5} {rest}"]
        assert k < 100
    (tiny.folder / "dvl1.txt").write_text("\n".join(stale) + "\n")
    found = check_log(tiny.scenario())
    assert found.passed
    assert any(f.level == "note" and "drop_repeated = true" in f.sentence and f.part == "dvl" for f in found.findings)
    spec = tiny.scenario().log
    channel = spec.instruments["dvl"].channel().model_copy(update={"drop_repeated": True})
    fresh = read_channel(spec, channel, "dvl", "1")
    assert len(fresh.time) == 39
    # A row that is held out is not in the other part once more.
    taken, left = (channel.model_copy(update=u) for u in ({"every": 3}, {"hold_out": 3}))
    split = [read_channel(spec, c, "dvl", "1").time for c in (taken, left)]
    assert [len(time) for time in split] == [13, 26]
    assert sorted(np.concatenate(split)) == fresh.time.tolist()


def test_skip_for_each_recording(tiny):
    tiny.add_recording("22")
    tiny.replace('folder = "tiny"', 'folder = "tiny"\nskip_s = [2.0, 5.0]')
    sources = [LogSource(tiny.scenario(), seed) for seed in (0, 1)]
    assert [s.initial_truth.velocity[0, 0] for s in sources] == pytest.approx(
        [2.0 * np.cos(0.1), 2.0 * np.cos(0.25)], abs=1e-3
    )
    with pytest.raises(LogError, match=r"skip_s of \[log\] has 3 values for 2 recordings"):
        LogSource(tiny.replace("[2.0, 5.0]", "[2.0, 5.0, 1.0]").scenario(), 0)


def moored(tiny, moves=True):
    """The vessel lies still for 20 s; the reference has positions only."""
    lines = (tiny.folder / "truth1.csv").read_text().splitlines()
    first = lines[1].split(",")
    for k in range(2, 22 if moves else len(lines)):
        cells = lines[k].split(",")
        lines[k] = ",".join([cells[0], *first[1:4], *cells[4:]])
    (tiny.folder / "truth1.csv").write_text("\n".join(lines) + "\n")
    for part in ("velocity", "attitude"):
        begin = tiny.text.index(f"[log.reference.{part}]")
        tiny.text = tiny.text[:begin] + tiny.text[tiny.text.index("\n\n", begin) + 2 :]
    tiny.replace("duration_s = 30.0", "duration_s = 10.0")
    return tiny


def test_a_vessel_that_starts_moored(tiny):
    moored(tiny)
    with pytest.raises(LogError, match=r"too slow at the start.*begin = 'moving' or skip_s of \[log\].*attitude_deg"):
        LogSource(tiny.scenario(), 0)
    source = LogSource(tiny.replace('folder = "tiny"', 'folder = "tiny"\nbegin = "moving"').scenario(), 0)
    assert 15.0 < source._begin - 5000.0 < 21.0
    assert "heading (course over ground)" in source.note


def test_a_heading_that_nobody_knows(tiny):
    moored(tiny).replace("attitude_deg = [0.1, 0.1, 1.0]", "attitude_deg = [0.1, 0.1, 120.0]")
    with pytest.warns(LogWarning, match="the heading at the start is unknown; only estimators that search it can use"):
        source = LogSource(tiny.scenario(), 0)
    assert "heading (unknown)" in source.note
    assert source.start.unknown == ""
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # rows with an IMU align themselves
        source = LogSource(tiny.replace("[0.1, 0.1, 120.0]", "[0.1, 0.1, 180.0]").scenario(), 0)
    assert source.start.unknown == "heading"


def test_a_compass_gives_the_heading_of_a_moored_vessel(tiny):
    moored(tiny)
    (tiny.folder / "compass1.txt").write_text("".join(f"{5000 + k} 40.0\n" for k in range(40)))
    tiny.add('\n[log.files.compass]\npath = "compass{recording}.txt"\n')
    tiny.add('\n[log.instruments.compass]\nfile = "compass"\ncolumns = [2]\nunits = "deg"\nmounting_deg = [0, 0, 10]\n')
    tiny.add('\n[instruments.compass]\nkind = "magnetic_compass"\nrate_hz = 1.0\nsigma_deg = 1.0\n')
    source = LogSource(tiny.scenario(), 0)
    assert "heading (compass)" in source.note
    assert np.degrees(source.start.attitude[2]) == pytest.approx(30.0, abs=5.0)


def test_a_vessel_that_never_moves_says_so(tiny):
    moored(tiny, moves=False).replace('folder = "tiny"', 'folder = "tiny"\nbegin = "moving"')
    with pytest.raises(LogError, match="the reference never moves by 1 m/s"):
        LogSource(tiny.scenario(), 0)


def nmea(tiny, *lines):
    (tiny.folder / "h.nmea").write_text("\n".join(lines) + "\n")
    tiny.add('\n[log.files.bridge]\npath = "h.nmea"\nformat = "nmea"\n')
    return tiny.scenario().log


def test_a_magnetic_heading_and_its_variation(tiny):
    spec = nmea(tiny, *(f"2024-05-01T10:00:0{k}Z $HCHDM,100.0,M" for k in range(5)))
    channel = ChannelSpec(file="bridge", sentence="HDM")
    with pytest.raises(LogError, match=r"its heading is magnetic.*give variation_deg, or variation_model = 'wmm'"):
        read_channel(spec, channel, "magnetic_compass", "1")
    given = channel.model_copy(update={"variation": np.radians(-12.5)})
    assert np.degrees(read_channel(spec, given, "magnetic_compass", "1").value) == pytest.approx(87.5)
    with pytest.raises(LogError, match="needs the date, but the clock of the reference starts at 5000 s"):
        read_channel(spec, channel.model_copy(update={"variation_model": "wmm"}), "magnetic_compass", "1")


def test_variation_by_the_model(tiny):
    pytest.importorskip("pygeomag")
    tiny.replace("[log.files.truth]", "[log.files.truth]\noffset_s = 1.7e9")
    spec = nmea(tiny, *(f"2023-11-14T23:36:4{k}Z $HCHDM,100.0,M" for k in range(5)))
    channel = ChannelSpec(file="bridge", sentence="HDM", variation_model="wmm")
    found = read_channel(spec, channel, "magnetic_compass", "1")
    # 45.8 N, 11.5 E: the NOAA calculator (WMM2020) gives 3.9 degrees east at the end of 2023.
    assert np.degrees(found.value[0, 0]) - 100.0 == pytest.approx(3.9, abs=0.3)


def test_the_check_finds_all_errors_at_once(tiny):
    tiny.edit("dvl1.txt", 3, "5002.0 1.0 x 5")
    tiny.replace('units = "deg"', 'units = "rad"')
    found = check_log(tiny.scenario())
    assert not found.passed
    errors = {f.part: f.sentence for f in found.findings if f.level == "error"}
    assert set(errors) == {"dvl", "reference.attitude"}
    assert "line 3, column '3': 'x' is not a number" in errors["dvl"]
    assert "is its unit 'deg'?" in errors["reference.attitude"]
    good = {f.part for f in found.findings if f.level == "ok"}
    assert good == {"imu", "reference.position", "reference.velocity"}


STATED = """
[log.instruments.gnss]
file = "truth"
columns = ["lat", "lon", "h"]
units = ["deg", "deg", "m"]
sigma = ["sdn", "sde", "sdu"]
sigma_units = "cm"

[instruments.gnss]
kind = "gnss_position"
rate_hz = 1.0
sigma_m = [9.0, 9.0, 9.0]
"""


def test_sigmas_from_columns(tiny):
    path = tiny.folder / "truth1.csv"
    lines = path.read_text().splitlines()
    more = ["sdn,sde,sdu", *(f"{100 + k},200,{'' if k == 3 else 300}" for k in range(len(lines) - 1))]
    path.write_text("\n".join(f"{a},{b}" for a, b in zip(lines, more, strict=True)) + "\n")
    tiny.add(STATED)
    with pytest.warns(LogWarning, match=r"1 of 41 rows of gnss_position state no standard deviation .* line 5"):
        source = LogSource(tiny.scenario(), 0)
    gnss = source.advance(10.0).aids["gnss"]
    assert source.instruments["gnss"].stated
    k = np.round(source._begin + gnss.time - CLOCK)
    expected = np.stack([1.0 + 0.01 * k, np.full(len(k), 2.0), np.full(len(k), 3.0)], axis=1)
    expected[k == 3] = 9.0  # that of the datasheet
    np.testing.assert_allclose(gnss.side, expected)
    np.testing.assert_allclose(gnss.sigma, expected)
    assert next(gnss.measurements()).side.tolist() == pytest.approx(expected[0].tolist())
    tiny.replace('sigma = ["sdn", "sde", "sdu"]\nsigma_units = "cm"', 'sigma = ["sde"]\nsigma_times = 0.015')
    assert LogSource(tiny.scenario(), 0).advance(10.0).aids["gnss"].side == pytest.approx(3.0)
    for old, new, says in (
        ('sigma = ["sde"]', 'sigma = ["sde", "sdn"]', "sigma of gnss_position has 2 columns; give one, or 3"),
        ('"sde", "sdn"]', '"sde"]\nsigma_units = "deg"', "sigma of north in 'deg'; a unit of length is wanted"),
        ('sigma = ["sde"]\nsigma_units = "deg"\n', "", "sigma_times needs 'sigma'"),
    ):
        tiny.replace(old, new)
        with pytest.raises(ValueError, match=says):
            LogSource(tiny.scenario(), 0)
