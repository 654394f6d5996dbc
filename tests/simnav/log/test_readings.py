"""What only a comparison of streams shows is found, with the line to write; a log that is right is left alone."""

from __future__ import annotations

import csv
import json
import os
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from simnav.leaderboard.log_inspection import drafted
from simnav.leaderboard.logs import align, inspect_log
from simnav.leaderboard.results.formats import write
from simnav.log.alignment import align as align_log
from simnav.log.check import check_log
from simnav.log.hypotheses import Reading
from simnav.log.inspection import inspect_log as inspect_files
from simnav.log.likelihood import Residual, effective_samples, fit, log_ratios
from simnav.log.readings import _read, _Tried, probable_readings
from simnav.log.readings import _told as _of_stream
from simnav.scenario import load, parse
from simnav.source import record
from tests.audit.readings import _told, readings_of
from tests.cases.manoeuvring_log import SCENARIO, make_log

DATA = Path(os.environ.get("SIMNAV_DATA") or Path(__file__).parents[4] / "shared" / "data")

#: The attitude of the reference, as it is written.
ANGLES = 'columns = ["roll", "pitch", "yaw"]\nunits = "deg"'
#: What is written wrongly: text, its replacement; then table, key and value that are right.
WRONG = {
    "gyroscope x": ('"gx", "gy", "gz"', '"-gx", "gy", "gz"', "log.imu", "angular_rate", ["gx", "gy", "gz"]),
    "gyroscope y": ('"gx", "gy", "gz"', '"gx", "-gy", "gz"', "log.imu", "angular_rate", ["gx", "gy", "gz"]),
    "gyroscope z": ('"gx", "gy", "gz"', '"gx", "gy", "-gz"', "log.imu", "angular_rate", ["gx", "gy", "gz"]),
    "gyroscope x for y": ('"gx", "gy", "gz"', '"gy", "gx", "gz"', "log.imu", "angular_rate", ["gx", "gy", "gz"]),
    "gyroscope in degrees": (
        '"gx", "gy", "gz"]', '"gx", "gy", "gz"]\nangular_rate_unit = "deg_s"', "log.imu", "angular_rate_unit", "rad_s",
    ),
    "accelerometer y": ('"ax", "ay", "az"', '"ax", "-ay", "az"', "log.imu", "specific_force", ["ax", "ay", "az"]),
    "accelerometer x for y": ('"ax", "ay", "az"', '"ay", "ax", "az"', "log.imu", "specific_force", ["ax", "ay", "az"]),
    "imu late": ('path = "imu.csv"', 'path = "imu.csv"\noffset_s = 1.5', "log.files.imu", "offset_s", 0.0),
    "dvl forward, left, up": (
        '"vx", "vy", "vz"', '"vx", "-vy", "-vz"', "log.instruments.dvl", "columns", ["vx", "vy", "vz"],
    ),
    "dvl left-handed": ('"vx", "vy", "vz"', '"vy", "vx", "vz"', "log.instruments.dvl", "columns", ["vx", "vy", "vz"]),
    "dvl forward, left, up, and late": (
        '"vx", "vy", "vz"]', '"vx", "-vy", "-vz"]\noffset_s = 2', "log.instruments.dvl", "columns", ["vx", "vy", "vz"],
    ),
    "dvl in knots": ('"vz"]\nunits = "m_s"', '"vz"]\nunits = "kn"', "log.instruments.dvl", "units", "m_s"),
    "dvl late": ('"vx", "vy", "vz"]', '"vx", "vy", "vz"]\noffset_s = 2', "log.instruments.dvl", "offset_s", 0.0),
    "compass anticlockwise": ('["hdg"]', '["-hdg"]', "log.instruments.compass", "columns", ["hdg"]),
    "compass from east": (
        '["hdg"]', '["hdg"]\nframe = "enu"', "log.instruments.compass", "frame", "geodetic",
    ),
    "compass across": (
        '["hdg"]', '["hdg"]\nmounting_deg = [0, 0, 90]', "log.instruments.compass", "mounting_deg", [0.0, 0.0, 0.0],
    ),
    "depth up": ('["depth"]', '["-depth"]', "log.instruments.depth", "columns", ["depth"]),
    "magnetometer": ('"mx", "my", "mz"', '"my", "mx", "-mz"', "log.instruments.magnetometer", "columns",
                     ["mx", "my", "mz"]),
    "reference: latitude for longitude": (
        'file = "truth"\ncolumns = ["lat", "lon"', 'file = "truth"\ncolumns = ["lon", "lat"', "log.reference.position",
        "columns", ["lat", "lon", "h"],
    ),
    "fix: latitude for longitude": (
        'file = "aids"\ncolumns = ["lat", "lon"', 'file = "aids"\ncolumns = ["lon", "lat"', "log.instruments.gnss",
        "columns", ["lat", "lon", "h"],
    ),
    "all: latitude for longitude": (
        'columns = ["lat", "lon"', 'columns = ["lon", "lat"', "log.reference.position", "columns", ["lat", "lon", "h"],
    ),
    "velocity east, north, up": (
        '"vn", "ve", "vd"', '"ve", "vn", "-vd"', "log.reference.velocity", "columns", ["vn", "ve", "vd"],
    ),
    "attitude of east, north, up": (
        '"yaw"]', '"yaw"]\nframe = "enu"', "log.reference.attitude", "frame", "geodetic",
    ),
    "attitude: roll": ('"roll", "pitch"', '"-roll", "pitch"', "log.reference.attitude", "columns",
                       ["roll", "pitch", "yaw"]),
    "attitude: roll for pitch": ('"roll", "pitch"', '"pitch", "roll"', "log.reference.attitude", "columns",
                                 ["roll", "pitch", "yaw"]),
    "quaternion, scalar last": (
        ANGLES, 'columns = ["qx", "qy", "qz", "qw"]', "log.reference.attitude", "columns", ["qw", "qx", "qy", "qz"],
    ),
    "quaternion, inverse": (
        ANGLES, 'columns = ["qw", "-qx", "-qy", "-qz"]', "log.reference.attitude", "columns", ["qw", "qx", "qy", "qz"],
    ),
    "quaternion, last and inverse": (
        ANGLES, 'columns = ["-qx", "-qy", "-qz", "qw"]', "log.reference.attitude", "columns", ["qw", "qx", "qy", "qz"],
    ),
    "quaternion of axes forward, left, up": (
        ANGLES, 'columns = ["-qx", "qw", "qz", "-qy"]', "log.reference.attitude", "columns", ["qw", "qx", "qy", "qz"],
    ),
    "quaternion of east, north, up": (
        ANGLES, 'columns = ["qw", "qx", "qy", "qz"]\nframe = "enu"', "log.reference.attitude", "frame", "geodetic",
    ),
    "reference late": ('path = "truth.csv"', 'path = "truth.csv"\noffset_s = 2.0', "log.reference.velocity", "offset_s",
                       -2.0),
}  # fmt: skip


#: One kind of mistake of each sort; with ``SIMNAV_ALL_READINGS=1`` all are tried: four minutes of one core.
SOME = "gyroscope z", "dvl late", "reference: latitude for longitude", "quaternion, scalar last"
ALL = bool(os.environ.get("SIMNAV_ALL_READINGS"))


@pytest.fixture(scope="module")
def root(tmp_path_factory):
    folder = tmp_path_factory.mktemp("readings")
    make_log(folder, 240.0 if ALL else 120.0)  # a DVL in knots shows only in the longer one
    return folder


@pytest.fixture
def log(root, monkeypatch):
    monkeypatch.setenv("SIMNAV_DATA", str(root))


def test_a_log_that_is_right(log):
    report = check_log(parse(SCENARIO))
    assert report.passed, report


@pytest.mark.parametrize("wrong", WRONG if ALL else SOME)
def test_a_wrong_reading_is_found_with_the_line_to_write(log, wrong):
    old, new, table, key, right = WRONG[wrong]
    assert old in SCENARIO
    found = probable_readings(parse(SCENARIO.replace(old, new)), "")
    assert len(found) == 1
    written = {(t, k): json.loads(v) for t, k, v in found[0].changes}
    assert written[table, key] == (pytest.approx(right) if isinstance(right, float) else right)
    assert found[0].probability > 0.9
    assert found[0].present < 1e-3


#: Columns of files of a vessel with one turn, by what multiplies them, a delay, and what is said.
IN_FILES = {
    "dvl in knots": ("dvl", dict.fromkeys(("forward_m_s", "starboard_m_s", "down_m_s"), 3600.0 / 1852.0), 0.0,
                     'units = "kn" of [log.instruments.dvl]'),
    "dvl forward, left, up, and late": ("dvl", {"starboard_m_s": -1.0, "down_m_s": -1.0}, 2.0,
                                        'columns = ["forward_m_s", "-starboard_m_s", "-down_m_s"] of '
                                        "[log.instruments.dvl]; offset_s = -2.0 of [log.instruments.dvl]"),
    "gnss with the leap seconds": ("gnss", {}, 18.0, "offset_s = -18.0 of [log.instruments.gnss]"),
    "gyroscope z in one turn": ("imu", {"angular_rate_z_deg_s": -1.0}, 0.0,
                                '"angular_rate_y_deg_s", "-angular_rate_z_deg_s"] of [log.imu]'),
}  # fmt: skip


def export(folder: Path, scenario: str, duration: float, seed: int) -> Path:
    """The files of the beginning of a simulated voyage."""
    voyage = load(scenario).model_copy(update={"duration": duration})
    write("recording", "csv", record(voyage, seed), folder)
    return folder


def changed_file(file: Path, target: Path, factors: dict[str, float], late: float = 0.0) -> None:
    """Write a table with some columns multiplied, and its times later."""
    with file.open() as given, target.open("w") as written:
        rows = csv.DictReader(given)
        assert rows.fieldnames is not None
        changed = csv.DictWriter(written, rows.fieldnames)
        changed.writeheader()
        for row in rows:
            values = {key: float(row[key]) * factor for key, factor in factors.items()}
            changed.writerow(row | values | {"time_s": float(row["time_s"]) + late})


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    folder = export(tmp_path_factory.mktemp("exported") / "run", "open-sea", 400.0, 1)
    return folder, drafted(inspect_files([folder])[0], "exported", "exported.toml").text


@pytest.fixture
def ship(tmp_path):
    """A quarter of an hour of a ship with a speed log, 4 m of noise of its fixes, and a nearly straight course."""
    return export(tmp_path / "run", "ship-field", 900.0, 4004)


@pytest.mark.parametrize("wrong", IN_FILES if ALL else ["dvl in knots", "gnss with the leap seconds"])
def test_files_with_another_unit_other_axes_and_one_turn(exported, wrong, tmp_path):
    folder, draft = exported
    shutil.copytree(folder, tmp_path / "run")
    name, factors, late, right = IN_FILES[wrong]
    changed_file(folder / f"{name}.csv", tmp_path / "run" / f"{name}.csv", factors, late)
    (found,) = probable_readings(parse(draft.replace(str(folder), str(tmp_path / "run"))), "")
    assert right in found.sentence()
    assert found.probability > 0.9


def test_fixes_that_are_held_out_are_not_late_beside_those_of_the_same_receiver(ship):
    """A reference between two fixes has less noise than at a fix; that is no delay."""
    (ship / "truth.csv").unlink()
    assert drafted(inspect_files([ship])[0], "ship", "ship.toml").readings == ()


def test_a_speed_log_in_knots_is_no_current_of_seven_metres_a_second(ship):
    changed_file(ship / "speed_log.csv", ship / "other.csv", {"speed_m_s": 1.0 / 0.514444})
    text = (ship / "other.csv").read_text().replace("speed_m_s", "speed", 1)
    (ship / "speed_log.csv").write_text(text)
    (ship / "other.csv").unlink()
    (found,) = drafted(inspect_files([ship])[0], "ship", "ship.toml").readings
    assert found.changes == (("log.instruments.speed_log", "units", '"kn"'),)


def test_streams_at_other_times_between_the_same_ends_are_not_taken_for_each_other(log):
    """A receiver with an outage has as many readings compared as a compass, over the same time."""
    scenario = parse(SCENARIO)
    streams = _read(scenario, scenario.log, "", ())
    even = np.linspace(2.0, 60.0, 200)
    uneven = 2.0 + 58.0 * np.linspace(0.0, 1.0, 200) ** 2
    asked = streams.attitudes(even), streams.attitudes(uneven)
    fresh = replace(streams)
    assert np.array_equal(fresh.attitudes(uneven), asked[1])
    assert not np.array_equal(asked[0], asked[1])


def test_a_right_log_of_a_fishing_vessel():
    """Without an IMU; readings of roll and pitch tie there."""
    assert _told(record(load("fishing-vessel"), 9100), True) == []


@pytest.mark.parametrize(
    ("name", "seed", "length", "with_truth"),
    [
        ("survey-without-bottom-lock", 9242, 700.0, True),  # lever arms of 20 m
        ("gnss-outage", 9251, 60.0, False),  # a delay of half a minute would leave little to compare
        ("training-clean", 9254, 75.0, False),  # the height of the fixes is a constant in its place
    ],
)
def test_a_right_log_is_read_as_it_is(name, seed, length, with_truth):
    scenario = load(name)
    scenario = scenario.model_copy(update={"duration": min(length, scenario.duration)})
    assert _told(record(scenario, seed), with_truth) == []


def test_two_mistakes_are_named_only_if_both_are_likely():
    """A delay that fits slightly better beside another reading is none."""
    one = Reading("dvl", ("dvl",), lambda s: s, 1, "other axes", (("t", "k", 1),))
    late = [replace(one, what=f"other axes, late by {d}", delay=float(d), mistakes=2, number=2) for d in range(1, 21)]
    tried = [_Tried(one, ratio=40.0, worst=0.0, left=-3.0, least=-1.0, unit=0.0)]
    tried += [_Tried(r, ratio=42.0, worst=0.0, left=-3.1, least=-1.0, unit=0.0) for r in late]
    reading, told = _of_stream("dvl", tried)
    assert reading is one
    assert told.probability > 0.5


def test_readings_that_the_motion_does_not_tell_apart_are_named_together():
    def read(number, ratio):
        reading = Reading("dvl", ("dvl",), lambda s: s, number, f"reading {number}", (("t", "k", number),))
        return _Tried(reading, ratio=ratio, worst=0.0, left=-3.0, least=-1.0, unit=0.0)

    tried = [read(number, ratio) for number, ratio in ((1, 40.0), (2, 40.2), (3, 20.0))]
    _, told = _of_stream("dvl", tried)
    assert told.alike == ("reading 2",)
    assert told.probability > 0.99
    assert "reading 1, or reading 2: the motion does not tell them apart" in told.sentence()


def test_on_a_straight_course_a_delay_is_not_told_from_a_lever_arm(ship):
    found = {a.instrument: a for a in align_log(parse(drafted(inspect_files([ship])[0], "ship", "ship.toml").text))}
    assert found["gnss"].remark == "the motion is too steady to tell a delay"
    assert abs(found["gnss"].parameters["lever_arm_x"][0]) < 1.0


def test_the_velocity_of_a_receiver_is_aligned_with_its_lever_arm(exported):
    found = {a.instrument: a for a in align_log(parse(exported[1]))}["gnss_velocity"]
    assert found.delay == pytest.approx(0.0, abs=0.05)
    for axis, arm in zip("xyz", (-4.0, 0.5, -12.0), strict=True):
        assert found.parameters[f"lever_arm_{axis}"][0] == pytest.approx(arm, abs=4.0)


def test_a_height_that_is_counted_downwards_is_not_the_fault_of_the_depth(tmp_path):
    folder = export(tmp_path / "run", "auv-survey", 200.0, 4001)
    changed_file(folder / "truth.csv", folder / "other.csv", {"height_m": -1.0})
    (folder / "other.csv").replace(folder / "truth.csv")
    (found,) = drafted(inspect_files([folder])[0], "auv", "auv.toml").readings
    assert found.changes[0][:2] == ("log.reference.position", "columns")
    assert "-height_m" in found.changes[0][2]


def test_a_course_is_no_heading(log):
    (found,) = probable_readings(parse(SCENARIO.replace('["hdg"]', '["cog"]')), "")
    assert (found.stream, found.changes) == ("compass", ())
    assert "take [log.instruments.compass] out, or name another column" in found.sentence()


@pytest.mark.skipif(not ALL, reason="SIMNAV_ALL_READINGS=1")
def test_a_quaternion_that_is_right(log):
    assert not probable_readings(parse(SCENARIO.replace(ANGLES, 'columns = ["qw", "qx", "qy", "qz"]')), "")


def test_a_delay_that_only_one_component_likes_is_none():
    """Its forward part has the swing of a lever arm, and fits late; its vertical part, which was slow, is then fast."""
    assert readings_of(133) == []


def test_what_another_reading_makes_larger_has_the_samples_that_it_has_there():
    slow = Residual(np.full((200, 1), 0.1), np.array([0.15]), np.zeros((200, 1, 0)), np.zeros(0))
    noise = np.random.default_rng(1).normal(0.0, 0.3, (200, 1))
    fast = replace(slow, value=noise)
    assert fit(slow).samples < 4.0
    assert log_ratios(fit(fast), fit(slow))[0] < -50.0
    assert 0.0 < log_ratios(fit(slow), fit(fast))[0] < 5.0


def test_two_wrong_readings_are_found_one_after_the_other(log):
    text = SCENARIO.replace('"gy", "gz"', '"gy", "-gz"').replace('"vx", "vy", "vz"', '"vx", "-vy", "-vz"')
    report = check_log(parse(text))
    assert not report.passed
    said = [f.sentence for f in report.findings if f.level == "error"]
    assert len(said) == 2
    assert any('angular_rate = ["gx", "gy", "gz"] of [log.imu]' in s for s in said)
    assert any('columns = ["vx", "vy", "vz"] of [log.instruments.dvl]' in s for s in said)


@pytest.mark.parametrize("wrong", ["dvl forward, left, up"])
def test_a_steady_vessel_tells_nothing(tmp_path, monkeypatch, wrong):
    monkeypatch.setenv("SIMNAV_DATA", str(tmp_path))
    make_log(tmp_path, steady=True)
    assert not probable_readings(parse(SCENARIO.replace(*WRONG[wrong][:2])), "")


def test_align_warns_of_figures_of_a_wrong_reading(log):
    text = SCENARIO.replace('"gy", "gz"', '"gy", "-gz"').replace('"vx", "vy", "vz"', '"vx", "-vy", "-vz"')
    remarks = {a.instrument: a.remark for a in align(parse(text))}
    assert "do not use these figures" in remarks["imu"]
    assert "do not use these figures" in remarks["dvl"]
    assert "do not use" not in remarks["compass"]


def test_the_draft_has_the_probable_reading(root, tmp_path):
    folder = tmp_path / "log"
    folder.mkdir()
    header, *rows = (root / "manoeuvring" / "imu.csv").read_text().splitlines()
    cells = [row.split(",") for row in rows]
    for row in cells:
        row[3] = repr(-float(row[3]))  # the gyroscope's third axis points up, those of the accelerometers down
    (folder / "imu.csv").write_text("\n".join([header, *map(",".join, cells)]) + "\n")
    (folder / "truth.csv").write_text((root / "manoeuvring" / "truth.csv").read_text())
    target = tmp_path / "draft.toml"
    inspect_log([folder], output=target)
    line = next(x for x in target.read_text().splitlines() if x.startswith("angular_rate ="))
    assert '"-gz"' in line
    assert "with probability 0.9999" in line
    assert check_log(load(target)).passed


def test_correlated_samples_say_less():
    chance = np.random.default_rng(3)
    white = chance.standard_normal(4000)
    assert effective_samples(white) == pytest.approx(4000.0, rel=0.1)
    walk, rho = np.zeros(4000), 0.9
    for k in range(1, 4000):
        walk[k] = rho * walk[k - 1] + white[k]
    assert effective_samples(walk) == pytest.approx(4000.0 * (1.0 - rho) / (1.0 + rho), rel=0.3)
    assert effective_samples(np.ones(4000)) < 5.0


@pytest.mark.parametrize("name", ["car-kitti", "ship-nbp1406", *(["auv-akit"] if ALL else [])])
def test_the_recordings_of_the_catalogue_are_right(monkeypatch, name):
    monkeypatch.setenv("SIMNAV_DATA", str(DATA))
    if name != "car-kitti" and not (DATA / name.partition("-")[2]).is_dir():
        pytest.skip(f"no folder {name.partition('-')[2]} in {DATA} (SIMNAV_DATA)")
    assert check_log(load(name)).passed


def test_the_recorded_car_with_a_gyroscope_of_the_wrong_sign():
    import simnav.scenarios

    text = (Path(simnav.scenarios.__file__).parent / "car-kitti.toml").read_text()
    (found,) = probable_readings(parse(text.replace('"-omegaZ"', '"omegaZ"')), "")
    assert found.changes == (("log.imu", "angular_rate", '["omegaX", "-omegaY", "-omegaZ"]'),)
