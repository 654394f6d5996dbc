"""Vessels on tracks from files: tables of poses, and AIS archives."""

from __future__ import annotations

import pickle
import re
from pathlib import Path

import numpy as np
import pytest

from simnav.geometry.earth import relative_position
from simnav.geometry.rotation import wrap_angle
from simnav.leaderboard.results.recording_export import write_csv
from simnav.log import LogWarning
from simnav.scenario import load, parse
from simnav.simulation.simulator import ideal
from simnav.source import record
from simnav.spec import SpecError

HEAD = """
name = "own"
version = 1
title = "A recorded track"
duration_s = 60.0

[instruments.imu]
rate_hz = 50.0

[vessel]
"""
SHIP = """
name = "ship"
version = 1
title = "A ship in a seaway"
duration_s = 70.0
step_s = 0.2

[start]
latitude_deg = -33.0
longitude_deg = 151.0
heading_deg = 40.0
speed_m_s = 6.0

[[manoeuvre]]
kind = "turn"
angle_deg = 90.0

[sea]
significant_height_m = 1.5
peak_period_s = 8.0

[instruments.imu]
rate_hz = 50.0
"""
TABLE = """# poses of a survey
when;lat;lon;alt;course
2024-05-01T12:00:00Z;54.0;7.9;1.0;90
2024-05-01T12:00:30Z;54.0;7.902;1.5;90
2024-05-01T12:01:00Z;54.0;7.904;1.0;90
"""


PLACES = "time_s,latitude_deg,longitude_deg\n"


def own(vessel, folder):
    return parse(HEAD + vessel, folder=folder)


def test_the_truth_of_a_simulation_is_a_trajectory(tmp_path):
    """The truth that simnav exports, at 5 Hz, is the truth of another run: at the poses to 1 mm."""
    first = ideal(parse(SHIP), 3)
    write_csv(first, tmp_path)
    truth = first.data.truth
    second = ideal(own('kind = "pose_track"\nfile = "truth.csv"', tmp_path), 1)
    at = np.searchsorted(truth.time - truth.time[0], second.data.truth.time - 1e-6)
    miss = relative_position(second.data.truth.position, truth.position[at])
    np.testing.assert_allclose(miss, 0.0, atol=1e-3)
    np.testing.assert_allclose(wrap_angle(second.data.truth.attitude - truth.attitude[at]), 0.0, atol=1e-9)
    # The waves are slow compared with 5 Hz, so that the samples of the IMU are those of the first run, too.
    shift = round((truth.time[0]) * 50.0)
    n = len(second.data.imu) - 100
    theirs = first.data.imu.specific_force[shift + 50 : shift + 50 + n]
    np.testing.assert_allclose(second.data.imu.specific_force[50 : 50 + n], theirs, atol=0.05)


def test_columns_have_any_names_and_units(tmp_path):
    (tmp_path / "survey.csv").write_text(TABLE)
    vessel = """kind = "pose_track"
file = "survey.csv"
comment = "#"
time = "when"
time_unit = "iso"
position = ["lat", "lon", "alt"]
position_units = ["deg", "deg", "m"]
attitude = ["=0", "=0", "course"]
attitude_units = ["1", "1", "deg"]
"""
    scenario = own(vessel, tmp_path)
    given = scenario.vessel.poses()
    np.testing.assert_allclose(np.degrees(given.position[:, :2]), [[54.0, 7.9], [54.0, 7.902], [54.0, 7.904]])
    np.testing.assert_allclose(given.position[:, 2], [1.0, 1.5, 1.0])
    np.testing.assert_allclose(np.degrees(given.attitude), [[0.0, 0.0, 90.0]] * 3)
    assert list(given.line) == ["line 3", "line 4", "line 5"]
    truth = ideal(scenario, 1).data.truth
    np.testing.assert_allclose(relative_position(truth.position[[29, 59]], given.position[1:]), 0.0, atol=1e-3)
    along = own(vessel.partition("attitude")[0] + "attitude = []", tmp_path)
    assert along.vessel.poses().attitude is None


def test_local_coordinates_have_an_origin(tmp_path):
    rows = [f"{t},{3.0 * t},{4.0 * t},{-10.0}" for t in range(0, 70, 10)]
    (tmp_path / "local.csv").write_text("time_s,east_m,north_m,up_m\n" + "\n".join(rows))
    vessel = """kind = "pose_track"
file = "local.csv"
frame = "enu"
position = ["east_m", "north_m", "up_m"]
[vessel.origin]
latitude_deg = 54.0
longitude_deg = 7.9
"""
    truth = ideal(own(vessel, tmp_path), 1).data.truth
    np.testing.assert_allclose(truth.velocity[:, :2], [[4.0, 3.0]] * 60, atol=1e-3)
    np.testing.assert_allclose(np.degrees(truth.attitude[:, 2]), np.degrees(np.arctan2(3.0, 4.0)), atol=0.01)


def test_a_path_is_relative_to_the_scenario_and_the_content_counts(tmp_path):
    (tmp_path / "a").mkdir()
    table = "time_s,latitude_deg,longitude_deg\n0,54.0,7.9\n60,54.002,7.9\n"
    (tmp_path / "a" / "poses.csv").write_text(table)
    (tmp_path / "a" / "own.toml").write_text(HEAD + 'kind = "pose_track"\nfile = "poses.csv"')
    scenario = load(tmp_path / "a" / "own.toml")
    assert len(record(scenario, 1).data.truth) == 60
    assert pickle.loads(pickle.dumps(scenario)).vessel == scenario.vessel
    assert type(scenario).from_toml(scenario.to_toml()) == scenario
    before = scenario.content_hash()
    (tmp_path / "b").mkdir()
    for name in ("poses.csv", "own.toml"):
        (tmp_path / "b" / name).write_text((tmp_path / "a" / name).read_text())
    assert load(tmp_path / "b" / "own.toml").content_hash() == before
    (tmp_path / "b" / "poses.csv").write_text(table.replace("54.002", "54.003"))
    assert load(tmp_path / "b" / "own.toml").content_hash() != before


@pytest.mark.parametrize(
    ("table", "vessel", "message"),
    [
        (None, "", r"vessel.file = .*poses.csv': there is no such file"),
        ("time_s,latitude_deg\n0,54\n", "", "there is no column 'longitude_deg'"),
        (
            "time_s,latitude_deg,longitude_deg\n0,54.0,7.9\n0,54.0,7.9\n",
            "",
            "line 3, column 'time_s': the time is the same",
        ),
        (
            "time_s,latitude_deg,longitude_deg\n0,54.0,x\n9,54.0,7.9\n",
            "",
            "line 2, column 'longitude_deg': 'x' is not a number",
        ),
        (
            "time_s,lat,lon\n0,54.0,7.9\n",
            'position = ["lat", "lon", "=0"]',
            "'lat' ends in no unit, as 'height_m'",
        ),
        (
            "time_s,latitude_deg,longitude_deg\n0,54.0,7.9\n60,54.1,7.9\n",
            "",
            r"poses.csv: the poses jump by 1.113e\+04 m in 60 s from line 2 to line 3.*max_speed_m_s = 40",
        ),
        (
            "time_s,latitude_deg,longitude_deg,heading_deg\n0,54.0,7.9,10\n30,54.001,7.9,\n60,54.002,7.9,10\n",
            "",
            "line 3: a pose is a position and an attitude, and one of them is missing",
        ),
        ("", 'frame = "enu"', r"frame = 'enu' needs a table \[vessel.origin\]"),
        ("", 'position = ["a", "b"]', "three columns are wanted; '=0' is a constant"),
    ],
)
@pytest.mark.filterwarnings("ignore::simnav.log.LogWarning")
def test_mistakes_in_a_table_are_one_sentence(tmp_path, table, vessel, message):
    if table is not None:
        (tmp_path / "poses.csv").write_text(table)
    with pytest.raises(SpecError, match=message):
        record(own('kind = "pose_track"\nfile = "poses.csv"\n' + vessel, tmp_path), 1)


def ais(rows, head="MMSI,BaseDateTime,LAT,LON,SOG,COG,Heading"):
    return head + "\n" + "\n".join(rows)


def reports(mmsi, seconds, errors):
    """Reports of a ship on a gentle curve, with errors of its positions [deg]."""
    lines = []
    for t, (north, east) in zip(seconds, errors, strict=True):
        lat, lon = 54.0 + 4e-5 * t + north, 7.9 + 6e-8 * t * t + east
        lines.append(f"{mmsi},2024-05-01T12:{t // 60:02d}:{t % 60:02d},{lat:.6f},{lon:.6f},9.0,10.0,511.0")
    return lines


def test_an_ais_archive_is_a_trajectory(tmp_path):
    rng = np.random.default_rng(2)
    seconds = [*range(0, 601, 10)]
    ours = reports(211000001, seconds, rng.normal(size=(len(seconds), 2)) * [4e-5, 6e-5])
    other = reports(211000002, seconds, np.ones((len(seconds), 2)))
    lost = ["211000001,2024-05-01T12:00:05,91.0,181.0,102.3,360.0,511.0"]
    rows = [*ours[::2], *other, *lost, *ours[::-1]]  # out of order, and repeated
    (tmp_path / "ais.csv").write_text(ais(rows))
    scenario = own('kind = "ais_track"\nfile = "ais.csv"\nmmsi = 211000001', tmp_path)
    with pytest.warns(LogWarning, match="32 of 93 AIS reports have no position or a time that another one has"):
        given = scenario.vessel.poses()
    np.testing.assert_array_equal(given.time, seconds)
    with pytest.warns(LogWarning):
        truth = ideal(scenario.model_copy(update={"duration": 600.0}), 1).data.truth
    clean = np.radians(np.stack([54.0 + 4e-5 * truth.time, 7.9 + 6e-8 * truth.time**2], axis=1))
    error = relative_position(truth.position, np.column_stack([clean, np.zeros(600)]))
    assert np.sqrt(np.mean(error[:, :2] ** 2)) < 3.0  # the errors of the reports are 4.4 m
    np.testing.assert_array_equal(truth.position[:, 2], 0.0)
    with pytest.raises(SpecError, match=r"there are 2 ships in it; name one by its mmsi \(211000001, 211000002"):
        own('kind = "ais_track"\nfile = "ais.csv"', tmp_path).vessel.poses()
    with pytest.raises(SpecError, match="there is no report of mmsi = 5"):
        own('kind = "ais_track"\nfile = "ais.csv"\nmmsi = 5', tmp_path).vessel.poses()


def test_the_archive_of_the_danish_maritime_authority(tmp_path):
    head = "# Timestamp,Type of mobile,MMSI,Latitude,Longitude,SOG"
    rows = [f"01/05/2024 12:{m:02d}:00,Class A,219000001,{54.0 + 0.004 * m:.4f},7.9,13.0" for m in range(6)]
    (tmp_path / "dma.csv").write_text(ais(rows, head))
    given = own('kind = "ais_track"\nfile = "dma.csv"\ndeparture_m = 0.0', tmp_path).vessel.poses()
    np.testing.assert_allclose(given.time, 60.0 * np.arange(6))
    (tmp_path / "dma.csv").write_text(ais([rows[0].replace("01/05", "2024.05")], head))
    with pytest.raises(SpecError, match=r"line 2, column '# Timestamp': '2024.05/2024 12:00:00' is not a date like"):
        own('kind = "ais_track"\nfile = "dma.csv"', tmp_path).vessel.poses()
    (tmp_path / "dma.csv").write_text("a,b\n1,2\n")
    with pytest.raises(SpecError, match="no column holds the time of AIS reports; one of these names is wanted"):
        own('kind = "ais_track"\nfile = "dma.csv"', tmp_path).vessel.poses()


def test_the_page_of_the_documentation_works_as_written(tmp_path):
    page = (Path(__file__).parents[3] / "docs" / "how-to" / "use-your-own-trajectory.md").read_text(encoding="utf-8")
    table = re.search(r"^```\n(time_s.*?)^```", page, re.DOTALL | re.MULTILINE)
    whole, waypoints, *_ = re.findall(r"^```toml\n(.*?)^```", page, re.DOTALL | re.MULTILINE)
    (tmp_path / "survey.csv").write_text(table[1])
    scenario = parse(whole, folder=tmp_path)
    run = record(scenario, 1)
    given = scenario.vessel.poses()
    at = np.searchsorted(run.data.truth.time, given.time[1:] - 1e-6)
    np.testing.assert_allclose(relative_position(run.data.truth.position[at], given.position[1:]), 0.0, atol=1e-3)
    other = parse(whole.partition("[vessel]")[0] + waypoints + "[instruments.imu]\nrate_hz = 50.0", folder=tmp_path)
    assert len(record(other, 1).data.truth) == 80
