"""Recordings for other programs: what simnav also reads makes the round trip, and independent readers open it."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
import pytest

from simnav.leaderboard.results.formats import formats, write
from simnav.leaderboard.results.hidden import without_truth
from simnav.leaderboard.results.recording_tracks import track_of
from simnav.log.delimited import read_csv
from simnav.log.files import FileSpec
from simnav.log.nmea import read_nmea
from simnav.log.reader import READERS
from simnav.scenario import parse
from simnav.scoring import score
from simnav.source import record
from simnav.trial.estimate_file import trial_of_file
from tests.cases.positioned_by_sound import positioned_by_sound

TOML = """
name = "writers"
version = 1
title = "for writers"
duration_s = 20.0

[start]
latitude_deg = -54.0
longitude_deg = -0.5
heading_deg = 200.0
speed_m_s = 5.0

[instruments.gnss]
kind = "gnss_position"
sigma_m = 1.0

[instruments.second]
kind = "gnss_position"
sigma_m = 2.0

[instruments.gyrocompass]
sigma_deg = 0.5

[instruments.speed_log]
sigma_m_s = 0.1

[instruments.dvl]
sigma_m_s = 0.02

[instruments.imu]
rate_hz = 10.0
grade = "mems"
"""


@pytest.fixture(scope="module")
def recording():
    return record(parse(TOML), 1)


def test_tum_is_the_truth_for_the_scores(tmp_path, recording):
    write("recording", "tum", recording, tmp_path / "truth.tum")
    trial = trial_of_file(tmp_path / "truth.tum", recording)
    assert trial.status == "ok"
    np.testing.assert_allclose(trial.position[:, :2], recording.data.truth.position[:, :2], atol=1e-13)
    np.testing.assert_allclose(trial.position[:, 2], recording.data.truth.position[:, 2], atol=1e-7)
    np.testing.assert_allclose(np.cos(trial.attitude), np.cos(recording.data.truth.attitude), atol=1e-9)
    np.testing.assert_allclose(np.sin(trial.attitude), np.sin(recording.data.truth.attitude), atol=1e-9)
    with pytest.raises(ValueError, match="write it with --truth"):
        write("recording", "tum", without_truth(recording), tmp_path / "x.tum")


def test_parquet_makes_the_round_trip_and_names_units(tmp_path, recording):
    from pyarrow import parquet

    files = {p.name: p for p in write("recording", "parquet", recording, tmp_path / "run")}
    assert {"truth.parquet", "imu.parquet", "gnss.parquet", "README.md", "start.json"} <= set(files)
    schema = parquet.read_schema(files["gnss.parquet"])
    assert schema.field("latitude_deg").metadata == {b"unit": b"deg"}
    reader = READERS.get("parquet")
    rows = reader.read(files["gnss.parquet"], FileSpec(path="x", format="parquet", time="time_s"))
    gnss = recording.data.aids["gnss"]
    np.testing.assert_array_equal(rows.time, gnss.time)
    np.testing.assert_array_equal(rows.table.column("latitude_deg")[1], np.degrees(gnss.value[:, 0]))
    csv = {p.name: p for p in write("recording", "csv", recording, tmp_path / "csv")}
    assert read_csv(csv["gnss.csv"]).names == rows.table.names


def test_absolute_pose_error_of_evo_is_our_rmse(tmp_path, recording):
    """Positional APE without alignment (M. Grupp, evo: Python package for the evaluation of odometry and SLAM)."""
    file_interface = pytest.importorskip("evo.tools.file_interface")
    from evo.core import metrics, sync

    truth, estimate = tmp_path / "truth.tum", tmp_path / "estimate.tum"
    write("recording", "tum", recording, truth)
    rows = np.loadtxt(truth)
    rng = np.random.default_rng(5)
    rows[:, 1:4] += np.array([3.0, -2.0, 1.0]) + rng.normal(0.0, 2.0, (len(rows), 3))
    np.savetxt(estimate, rows, fmt="%.17g")
    trial = trial_of_file(estimate, recording)
    ours = score(trial, recording)
    pair = sync.associate_trajectories(*(file_interface.read_tum_trajectory_file(str(p)) for p in (truth, estimate)))
    ape = metrics.APE(metrics.PoseRelation.translation_part)
    ape.process_data(pair)
    theirs = ape.get_statistic(metrics.StatisticsType.rmse)
    assert theirs == pytest.approx(np.hypot(ours["horizontal_rmse"], ours["vertical_rmse"]), rel=1e-5)
    assert theirs > 3.0


def test_nmea_makes_the_round_trip(tmp_path, recording):
    [path] = write("recording", "nmea", recording, tmp_path / "a.nmea")
    file = read_nmea(path)
    aids = recording.data.aids
    for talker, name in (("GP", "gnss"), ("G1", "second")):
        table = file.table("GGA", talker)
        found = np.stack([table.column(n)[1] for n in ("latitude", "longitude", "height")], axis=-1)
        np.testing.assert_allclose(found[:, :2], aids[name].value[:, :2], atol=1e-11)
        np.testing.assert_allclose(found[:, 2], aids[name].value[:, 2], atol=1e-6)
        for clock in ("logger", "sentence"):
            np.testing.assert_allclose(table.column(clock)[1], aids[name].time, atol=1e-5)
    heading = file.table("HDT").column("heading")[1]
    np.testing.assert_allclose(np.cos(heading - aids["gyrocompass"].value[:, 0]), 1.0, atol=1e-12)
    np.testing.assert_allclose(file.table("VHW").column("speed")[1], aids["speed_log"].value[:, 0], atol=1e-8)
    np.testing.assert_allclose(file.table("VBW").column("ground_starboard")[1], aids["dvl"].value[:, 1], atol=1e-8)


def test_another_reader_opens_our_nmea(tmp_path, recording):
    pynmea2 = pytest.importorskip("pynmea2")
    [path] = write("recording", "nmea", recording, tmp_path / "a.nmea")
    sentences = [pynmea2.parse(line.partition(" ")[2], check=True) for line in path.read_text().splitlines()]
    fix = next(s for s in sentences if s.sentence_type == "GGA")
    assert np.radians(fix.latitude) == pytest.approx(recording.data.aids["gnss"].value[0, 0], abs=1e-11)
    assert np.radians(fix.longitude) == pytest.approx(recording.data.aids["gnss"].value[0, 1], abs=1e-11)
    assert float(next(s for s in sentences if s.sentence_type == "HDT").heading) > 0.0


def test_mcap_makes_the_round_trip(tmp_path, recording):
    mcap = pytest.importorskip("mcap.reader")
    [path] = write("recording", "mcap", recording, tmp_path / "a.mcap")
    reader = READERS.get("mcap")
    rows = reader.read(path, FileSpec(path="a.mcap", format="mcap", clock="sentence"), "/imu")
    np.testing.assert_allclose(rows.time, recording.data.imu.time, atol=1e-9)
    found = np.stack([rows.table.column(f"linear_acceleration.{a}")[1] for a in "xyz"], axis=-1)
    np.testing.assert_array_equal(found, recording.data.imu.specific_force)
    fixes = reader.read(path, FileSpec(path="a.mcap", format="mcap"), "/gnss").table
    np.testing.assert_allclose(fixes.column("latitude")[1], np.degrees(recording.data.aids["gnss"].value[:, 0]))
    with open(path, "rb") as stream:
        summary = mcap.make_reader(stream).get_summary()
    assert {c.topic for c in summary.channels.values()} == {"/imu", "/truth", *(f"/{n}" for n in recording.data.aids)}
    write("recording", "mcap", without_truth(recording), tmp_path / "b.mcap")
    assert b"/truth" not in (tmp_path / "b.mcap").read_bytes()


@pytest.mark.parametrize("told", [True, False])
def test_tracks_for_maps(tmp_path, recording, told):
    given = recording if told else without_truth(recording)
    wanted = recording.data.truth.position if told else recording.data.aids["gnss"].value
    [gpx] = write("recording", "gpx", given, tmp_path / "a.gpx")
    points = ET.parse(gpx).getroot().findall(".//{*}trkpt")
    found = [[float(p.get("lat")), float(p.get("lon")), float(p.find("{*}ele").text)] for p in points]
    np.testing.assert_allclose(found, np.column_stack([np.degrees(wanted[:, :2]), wanted[:, 2]]), atol=1e-6)
    [kml] = write("recording", "kml", given, tmp_path / "a.kml")
    first = ET.parse(kml).getroot().find(".//{*}coordinates").text.split()[0].split(",")
    assert [float(x) for x in first] == pytest.approx([found[0][1], found[0][0], found[0][2]], abs=1e-6)


def test_the_fixes_of_a_ship_are_a_track() -> None:
    ship = without_truth(record(positioned_by_sound("usbl", 10.0), 1))
    name, time, position = track_of(ship)
    assert (name, len(time), position.shape) == ("sound", 5, (5, 3))


def test_csv_has_a_page_beside_it(tmp_path, recording):
    names = {p.name for p in write("recording", "csv", recording, tmp_path)}
    assert {"README.md", "start.json", "truth.csv", "imu.csv", "gnss.csv"} <= names
    table = read_csv(tmp_path / "gnss.csv")
    np.testing.assert_allclose(np.radians(table.column("latitude_deg")[1]), recording.data.aids["gnss"].value[:, 0])
    assert "gnss (gnss_position): 1 Hz; sigma north 1 m" in (tmp_path / "README.md").read_text()


def test_the_formats():
    assert {"csv", "npz", "gpx", "kml", "tum", "nmea", "mcap"} <= set(formats("recording"))
