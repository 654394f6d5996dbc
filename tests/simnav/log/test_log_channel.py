"""Mapping of columns to instruments: axes, units, clocks, thinning, IMU conversions, and every complaint."""

from __future__ import annotations

import json

import numpy as np
import pytest

from simnav.geometry.rotation import dcm_from_rpy, quaternion_from_dcm
from simnav.log.channel import geodetic_from_local, list_recordings, read_channel
from simnav.log.imu_series import read_imu
from simnav.log.spec import ChannelSpec, OriginSpec, RecordedSpec
from simnav.log.table import LogError, LogWarning
from simnav.plugins import load_plugin
from simnav.spec import SpecError, register_unit
from tests.cases.tiny_log import RATE

transform = pytest.importorskip("pyins.transform")


def log(tiny):
    return tiny.scenario().log


def test_axes_and_units_of_the_imu(tiny):
    spec = log(tiny)
    imu = read_imu(spec, spec.imu, "1")
    samples = tiny.truth.samples
    np.testing.assert_allclose(imu.mean, np.hstack([samples.angular_rate, samples.specific_force]), atol=1e-12)
    np.testing.assert_allclose(imu.edge, 5000.0 + tiny.truth.time, atol=1e-9)


@pytest.mark.parametrize("samples", ["increments", "instantaneous"])
def test_increments_and_instantaneous_values_become_means(tiny, samples):
    spec = log(tiny.replace('samples = "means"', f'samples = "{samples}"').replace('specific_force_unit = "g"\n', ""))
    path = tiny.folder / "imu1.csv"
    # Specific force up is 10 + t^2 and the rate about the forward axis 4 t.
    time = np.arange(51) / 50.0
    value, dt = 10.0 + time**2, 0.02
    if samples == "increments":
        # Exact integrals over the interval before.
        force, rate = 10.0 * dt + (time**3 - (time - dt) ** 3) / 3.0, 2.0 * (time**2 - (time - dt) ** 2)
    else:
        force, rate = value, 4.0 * time
    zero = np.zeros_like(time)
    rows = np.stack([5000e3 + time * 1e3, zero, zero, force, zero, np.degrees(rate), zero], axis=-1)
    np.savetxt(path, rows, delimiter=",", header="stamp,ax,ay,az,gx,gy,gz", comments="", fmt="%.17g")
    imu = read_imu(spec, spec.imu, "1")
    after = imu.edge[1:] - 5000.0
    np.testing.assert_allclose(imu.mean[:, 0], 4.0 * after - 2.0 * dt, atol=1e-9)
    exact = 10.0 + (after**3 - (after - dt) ** 3) / (3.0 * dt)
    # The trapezoid overestimates the mean of t^2 by dt^2 / 6.
    excess = dt**2 / 6.0 if samples == "instantaneous" else 0.0
    np.testing.assert_allclose(-imu.mean[:, 5], exact + excess, atol=1e-7)
    assert len(imu.edge) == len(imu.mean) + 1 == (51 if samples == "instantaneous" else 52)


def test_true_spacing_scale_and_offset(tiny):
    channel = ChannelSpec(file="dvl", columns=(2, 3, 4))
    assert read_channel(log(tiny), channel, "dvl", "1").time[1] == pytest.approx(5001.25)
    tiny.replace("offset_s = 0.25", "offset_s = 0.25\nspacing_s = 1.01")
    assert read_channel(log(tiny), channel, "dvl", "1").time[2] == pytest.approx(2.02 + 0.25)
    tiny.replace("spacing_s = 1.01", "scale = 0.5")
    assert read_channel(log(tiny), channel, "dvl", "1").time[2] == pytest.approx(2501.25)


def test_offsets_by_recording(tiny):
    tiny.add_recording("2")
    tiny.replace("offset_s = 0.25", "offset_s = [0.25, -0.5]")
    channel = ChannelSpec(file="dvl", columns=(2, 3, 4))
    assert read_channel(log(tiny), channel, "dvl", "2").time[0] == pytest.approx(4999.5)
    tiny.replace("[0.25, -0.5]", "[0.25, -0.5, 0.1]")
    with pytest.raises(LogError, match=r"3 values for 2 recordings \(1, 2\); give one, or one for each"):
        read_channel(log(tiny), channel, "dvl", "2")


def test_recordings_are_sorted_by_number(tiny):
    for name in ("10", "2", "b"):
        tiny.add_recording(name)
    assert list_recordings(log(tiny)) == ("1", "2", "10", "b")
    tiny.replace('folder = "tiny"', 'folder = "tiny"\nrecordings = "1*"')
    assert list_recordings(log(tiny)) == ("1", "10")


def test_a_folder_for_each_recording(tiny):
    for name in ("a", "b"):
        (tiny.folder / name).mkdir()
        (tiny.folder / name / "imu.csv").write_text("")
    tiny.replace("imu{recording}.csv", "{recording}/imu.csv")
    assert list_recordings(log(tiny)) == ("a", "b")


def test_thinning_and_holding_out_share_no_row(tiny):
    spec = log(tiny)
    taken = read_channel(spec, ChannelSpec(file="dvl", columns=(2, 3, 4), every=10), "dvl", "1")
    left = read_channel(spec, ChannelSpec(file="dvl", columns=(2, 3, 4), hold_out=10), "dvl", "1")
    np.testing.assert_allclose(taken.time, 5000.25 + np.arange(0, 39, 10))
    assert sorted([*taken.time, *left.time]) == pytest.approx(5000.25 + np.arange(39))


@pytest.mark.parametrize("frame", ["enu", "ned"])
def test_local_cartesian_positions_against_pyins(frame):
    origin = OriginSpec.from_toml({"latitude_deg": 49.0, "longitude_deg": 8.4, "height_m": 115.0})
    rng = np.random.default_rng(1)
    local = rng.uniform(-5000.0, 5000.0, (50, 3))
    ned = local if frame == "ned" else np.stack([local[:, 1], local[:, 0], -local[:, 2]], axis=-1)
    lla = geodetic_from_local(local, origin, frame)
    lla0 = np.array([49.0, 8.4, 115.0])
    ecef = transform.lla_to_ecef(lla0) + ned @ transform.mat_en_from_ll(*lla0[:2]).T
    degrees = np.column_stack([np.degrees(lla[:, :2]), lla[:, 2]])
    np.testing.assert_allclose(transform.lla_to_ecef(degrees), ecef, atol=1e-6)


def test_rows_without_a_value_are_left_out_and_counted(tiny):
    tiny.edit("truth1.csv", 5, "5003.0,,0,0,0,0,0,0,0,0")
    spec = log(tiny)
    with pytest.warns(LogWarning, match="1 rows without position are left out, the first is line 5"):
        series = read_channel(spec, spec.reference.position, "position", "1")
    assert len(series.time) == 40
    assert 5003.0 not in series.time


@pytest.mark.parametrize(
    ("line", "new", "message"),
    [
        (4, "5000.0,45,11,0,0,0,0,0,0,0", r"truth1\.csv, line 4, column 't': the time is before that of line 3"),
        (4, "5001.0,45,11,0,0,0,0,0,0,0", r"truth1\.csv, line 4, column 't': the time is the same as that of line 3"),
        (4, ",45,11,0,0,0,0,0,0,0", r"truth1\.csv, line 4, column 't': the time is missing"),
        (4, "5002.0,4x,11,0,0,0,0,0,0,0", r"truth1\.csv, line 4, column 'lat': '4x' is not a number"),
        (4, "5002.0,95,11,0,0,0,0,0,0,0", r"truth1\.csv, line 4, column 'lat': latitude would be 1\.65806 rad"),
        (1, "t,lat,lng,h,vn,ve,vu,roll,pitch,yaw", r"truth1\.csv: there is no column 'lon'; did you mean 'lng'"),
    ],
)
def test_bad_references(tiny, line, new, message):
    tiny.edit("truth1.csv", line, new)
    spec = log(tiny)
    with pytest.raises(LogError, match=message):
        read_channel(spec, spec.reference.position, "position", "1")


def test_degrees_taken_for_radians(tiny):
    spec = log(tiny.replace('units = ["deg", "deg", "m"]', 'units = ["rad", "rad", "m"]'))
    with pytest.raises(LogError, match=r"line 2, column 'lat': latitude would be 45\.8\d* rad; is its unit 'deg'"):
        read_channel(spec, spec.reference.position, "position", "1")


def test_latitude_for_longitude_is_named_where_it_is_no_latitude(tiny):
    """The longitude of the log is made 121 deg: as a latitude it cannot be read at all."""
    path = tiny.folder / "truth1.csv"
    header, *rows = path.read_text().splitlines()
    cells = [row.split(",") for row in rows]
    path.write_text("\n".join([header, *(",".join([r[0], r[1], repr(121.0 + float(r[2])), *r[3:]]) for r in cells)]))
    spec = log(tiny.replace('columns = ["lat", "lon", "h"]', 'columns = ["lon", "lat", "h"]'))
    with pytest.raises(LogError, match=r"they are exchanged; write columns = \[\"lat\", \"lon\", \"h\"\]"):
        read_channel(spec, spec.reference.position, "position", "1")


@pytest.mark.parametrize(
    ("order", "message"),
    [
        (["qw", "qx", "qy", "qz"], ""),
        (["qw", "qx", "qy", "t"], r"line 2: the quaternion in the columns qw, qx, qy, t has the length 5000, not 1"),
        (
            ["qw", "qx"],
            r"needs 3 columns \(roll, pitch, yaw\), or the 4 of a quaternion \(w, x, y, z\), but 2 are given",
        ),
    ],
)
def test_an_attitude_may_be_a_quaternion(tiny, order, message):
    path, angles = tiny.folder / "truth1.csv", tiny.truth.attitude[:: round(RATE)]
    quaternion = quaternion_from_dcm(dcm_from_rpy(angles))
    header, *rows = path.read_text().splitlines()
    new = [",".join([row, *map(repr, map(float, q))]) for row, q in zip(rows, quaternion, strict=True)]
    path.write_text("\n".join([f"{header},qw,qx,qy,qz", *new]))
    columns = f"columns = {json.dumps(order)}"
    spec = log(tiny.replace('columns = ["roll", "pitch", "yaw"]\nunits = "deg"', columns))
    if message == "":
        found = read_channel(spec, spec.reference.attitude, "attitude", "1")
        np.testing.assert_allclose(found.value, angles, atol=1e-12)
    else:
        with pytest.raises(LogError, match=message):
            read_channel(spec, spec.reference.attitude, "attitude", "1")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            'specific_force_unit = "g"',
            'specific_force_unit = "m_s2"',
            r"mean specific force is 0\.9995 m/s\^2 where gravity is 9\.8; it is with specific_force_unit = 'g' of",
        ),
        (
            'specific_force_unit = "g"',
            'specific_force_unit = "mg"',
            r"it is with specific_force_unit = 'g' of \[log\.imu\]: write that",
        ),
        (
            'samples = "means"\nangular_rate = ["gy", "gx", "-gz"]\nangular_rate_unit = "deg_s"',
            'samples = "increments"\nangular_rate = ["gy", "gx", "-gz"]\nangular_rate_unit = "deg"',
            r"it is with samples = 'instantaneous', specific_force_unit = 'g', angular_rate_unit = 'deg_s' of \[log",
        ),
        ('"-az"', '"az"', r"points down \(9\.8\d* m/s\^2\).*put a minus before 'az'"),
        ('"-gz"', '"-gw"', "there is no column 'gw'"),
        ("{recording}.csv", "{recording}.tsv", r"imu1\.tsv: there is no such file"),
    ],
)
def test_bad_imu_mappings(tiny, old, new, message):
    spec = log(tiny.replace(old, new))
    with pytest.raises(LogError, match=message):
        read_imu(spec, spec.imu, "1")


def test_a_hole_in_the_imu(tiny):
    """A short one is bridged and counted; the message on a long one names the key."""
    for _ in range(8):
        tiny.edit("imu1.csv", 101, None)
    spec = log(tiny)
    with pytest.warns(LogWarning, match=r"1 holes, together 0\.18 s, .* before line 101.*max_gap_s of \[log.imu\]"):
        assert len(read_imu(spec, spec.imu, "1").mean) == 2000 - 8
    spec = log(tiny.replace('samples = "means"', 'samples = "means"\nmax_gap_s = 0.15'))
    with pytest.raises(LogError, match=r"line 101: 0\.180 s without the IMU, where 0\.15 s .*\(max_gap_s of \[log"):
        read_imu(spec, spec.imu, "1")


def test_an_imu_with_samples_every_second(tiny):
    for name in ("imu1.csv",):
        lines = (tiny.folder / name).read_text().splitlines()
        (tiny.folder / name).write_text("\n".join([lines[0], *lines[1:1000:50], *lines[1101::50]]) + "\n")
    with pytest.warns(LogWarning, match=r"the IMU has 1 holes, together 3 s"):
        assert len(read_imu(log(tiny), log(tiny).imu, "1").mean) == 38


def test_a_missing_imu_value(tiny):
    tiny.edit("imu1.csv", 7, "5000120.0,0,0,,0,0,0")
    spec = log(tiny)
    with pytest.warns(LogWarning, match=r"1 of 2000 rows without a value of the IMU are left out, the first is line 7"):
        assert len(read_imu(spec, spec.imu, "1").mean) == 1999
    spec = log(tiny.replace('samples = "means"', 'samples = "increments"'))
    with pytest.raises(LogError, match=r"imu1\.csv, line 7, column '-az': the value is missing; an increment"):
        read_imu(spec, spec.imu, "1")


def test_the_data_folder(tiny, monkeypatch, tmp_path):
    spec = log(tiny)
    monkeypatch.setenv("SIMNAV_DATA", str(tmp_path / "elsewhere"))
    with pytest.raises(LogError, match=r"elsewhere/tiny: there is no such folder \(SIMNAV_DATA = "):
        list_recordings(spec)
    monkeypatch.delenv("SIMNAV_DATA")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(LogError, match="set the environment variable SIMNAV_DATA"):
        list_recordings(spec)
    (tmp_path / "data").symlink_to(tmp_path)
    assert list_recordings(spec) == ("1",)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            'file = "dvl"',
            'file = "dlv"',
            r"instruments\.dvl\.file = 'dlv' is not in \[log\.files\]; did you mean 'dvl'",
        ),
        ('units = "deg"', 'units = "degs"', r"log\.reference\.attitude.*unknown unit 'degs'; did you mean 'deg"),
        ('units = ["m_s", "m_s", "mm_s"]', 'units = ["m_s"]', "1 units for 3 columns"),
        ('specific_force_unit = "g"', 'specific_force_unit = "deg"', "'deg' is no unit of acceleration .m_s2, g, mg"),
        ('time_unit = "ms"', 'time_unit = "m"', r"time_unit = 'm' is no unit of time \(s, ms"),
        ('columns = [2, -3, 4]\nunits = ["m_s", "m_s", "mm_s"]\n', "", "instruments.dvl: 'columns' is missing"),
        ('file = "dvl"', 'source = "reference"', "reads no file"),
        (
            '[log.reference.position]\nfile = "truth"',
            '[log.reference.position]\nframe = "enu"\nfile = "truth"',
            "needs",
        ),
        ("offset_s = 0.25", "offset_s = 0.25\nspacing_s = -1.0", "spacing_s"),
        ("offset_s = 0.25", 'offset_s = 0.25\nformat = "nmea"', "say which 'sentence'"),
        ('folder = "tiny"', 'folder = "tiny"\nrecordings = []', "recordings"),
    ],
)
def test_bad_tables(tiny, old, new, message):
    tiny.replace(old, new)
    with pytest.raises(SpecError, match=message) as raised:
        tiny.scenario()
    assert str(raised.value).startswith("tiny.toml: ")
    assert "\n" not in str(raised.value)


def test_wrong_number_of_columns(tiny):
    with pytest.raises(LogError, match=r"dvl needs 3 columns \(forward, starboard, down\), but 2 are given"):
        read_channel(log(tiny), ChannelSpec(file="dvl", columns=(2, 3)), "dvl", "1")


def test_dates_in_the_time_column(tmp_path, monkeypatch):
    monkeypatch.setenv("SIMNAV_DATA", str(tmp_path))
    path = tmp_path / "depth.csv"
    path.write_text("when,depth\n2020-01-01T00:00:00.5Z,3\n2020-01-01T00:00:01Z,4\n")
    spec = RecordedSpec.from_toml(
        {
            "files": {"d": {"path": "depth.csv", "time": "when", "time_unit": "iso"}},
            "reference": {"position": {"file": "d", "columns": [1, 1, 1]}},
        }
    )
    channel = ChannelSpec(file="d", columns=("depth",))
    np.testing.assert_allclose(read_channel(spec, channel, "depth", "").time, 1577836800.0 + np.array([0.5, 1.0]))
    path.write_text("when,depth\n2020-01-01T00:00:00.5Z,3\nyesterday,4\n")
    with pytest.raises(LogError, match=r"depth\.csv, line 3, column 'when': 'yesterday' is not a date"):
        read_channel(spec, channel, "depth", "")


def test_a_unit_of_another_dimension_is_refused(tiny):
    spec = log(tiny)
    for units, message in (
        (("m_s", "m_s", "deg"), r"dvl1\.txt, column 4: down of dvl in 'deg'; a unit of speed is wanted \(m_s, mm_s"),
        ("m", "column 2: forward of dvl in 'm'; a unit of speed"),
    ):
        with pytest.raises(LogError, match=message):
            read_channel(spec, ChannelSpec(file="dvl", columns=(2, 3, 4), units=units), "dvl", "1")
    known = read_channel(spec, ChannelSpec(file="dvl", columns=(2, 3, 4), units="1"), "dvl", "1")
    assert len(known.time) > 0


def test_a_row_of_units_after_the_header_is_skipped(tiny):
    channel = ChannelSpec(file="truth", columns=("lat", "lon", "h"), units=("deg", "deg", "m"))
    before = read_channel(log(tiny), channel, "position", "1")
    path = tiny.folder / "truth1.csv"
    header, *rows = path.read_text().splitlines()
    units = ",".join("[unit]" for _ in header.split(","))
    path.write_text("\n".join([header, units, "% a remark", *rows]) + "\n")
    tiny.replace('path = "truth{recording}.csv"', 'path = "truth{recording}.csv"\nskip_rows = 1\ncomment = "%"')
    after = read_channel(log(tiny), channel, "position", "1")
    np.testing.assert_array_equal(after.value, before.value)
    np.testing.assert_array_equal(after.time, before.time)
    np.testing.assert_array_equal(after.line, before.line + 2)


def test_a_log_faster_than_its_datasheet_says_so(tiny):
    from simnav.source import record

    tiny.replace("rate_hz = 1.0", "rate_hz = 0.2")
    with pytest.warns(LogWarning, match=r"'dvl' is measured every \S+ s, but rate_hz = 0\.2, and the environment"):
        record(tiny.scenario(), 0)


def test_a_unit_of_others_is_read_and_another_one_refused(tiny, plugins):
    load_plugin(plugins / "pressure.py")
    register_unit("hpa", 100.0)
    spec = log(tiny)
    for unit, factor in (("kpa", 1000.0), ("hpa", 100.0), ("1", 1.0)):
        pressures = read_channel(spec, ChannelSpec(file="dvl", columns=(2,), units=(unit,)), "pressure", "1").value
        expected = read_channel(spec, ChannelSpec(file="dvl", columns=(2,)), "pressure", "1").value
        np.testing.assert_array_equal(pressures, factor * expected)
    with pytest.raises(LogError, match=r"column 2: pressure of pressure in 'm'; it is in 'kpa'"):
        read_channel(spec, ChannelSpec(file="dvl", columns=(2,), units=("m",)), "pressure", "1")
