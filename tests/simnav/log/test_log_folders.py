"""Folders as other systems write them: from the folder to a rank in one line, by the voyage whose truth is known."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from simnav.geometry.earth import relative_position
from simnav.geometry.rotation import wrap_angle
from simnav.leaderboard.log_inspection import drafted, innovation_table
from simnav.leaderboard.logs import inspect_log
from simnav.log import LogSource
from simnav.log.inspection import inspect_log as look
from tests.cases.log_folders import FOLDERS, voyage

_NEEDS = {"ros-bag": "rosbags", "mcap": "mcap"}
#: What the estimators get in each folder, and whether the reference has an attitude.
_HELD = {
    "ardusub": ({"gnss"}, True), "px4": ({"gnss"}, True), "ros-bag": ({"gnss"}, True), "mcap": ({"gnss"}, True),
    "kf-gins": ({"gnss"}, True), "phone": ({"gnss"}, False), "nmea": ({"gnss", "gyrocompass", "speed_log"}, False),
    "export": ({"gnss", "gnss_velocity", "dvl", "gyrocompass", "speed_log"}, True),
}  # fmt: skip


@pytest.fixture(params=FOLDERS)
def folder(request, tmp_path):
    if request.param in _NEEDS:
        pytest.importorskip(_NEEDS[request.param])
        pytest.importorskip("rosbags")
    target = tmp_path / request.param
    target.mkdir()
    FOLDERS[request.param](target)
    return target


def test_the_draft_runs_without_an_edit_and_is_right(folder):
    streams, failed = look([folder])
    assert not failed
    made = drafted(streams, "drafted", "drafted.toml")
    assert not made.missing
    assert not made.readings  # by names and sizes it is read rightly
    instruments, oriented = _HELD[folder.name]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        source = LogSource(made.scenario, 0)
    assert set(source.instruments) == instruments
    assert (made.scenario.log.imu is not None) == (folder.name != "nmea")
    block, true = source.advance(source.duration), voyage().data
    # The run begins at the first fix, a second after that of the voyage, or when the vessel moves.
    delay = _delay(block.truth, true.truth)
    shared = np.flatnonzero(block.truth.time + delay <= true.truth.time[-1])
    time = block.truth.time[shared] + delay
    place = np.stack([np.interp(time, true.truth.time, c) for c in true.truth.position.T], axis=-1)
    away = relative_position(block.truth.position[shared], place[0]) - relative_position(place, place[0])
    assert np.sqrt(np.nanmean(away[:, :2] ** 2)) < 2.0
    if oriented:
        yaw = np.interp(time, true.truth.time, np.unwrap(true.truth.attitude[:, 2]))
        assert np.nanmax(np.abs(wrap_angle(block.truth.attitude[shared, 2] - yaw))) < np.radians(2.0)
    if block.imu is not None:
        later = block.imu.time + delay
        for name, size in (("angular_rate", 0.02), ("specific_force", 0.3)):
            values = getattr(true.imu, name)
            own = np.stack([np.interp(later, true.imu.time, c) for c in values.T], axis=-1)
            assert np.sqrt(np.mean((getattr(block.imu, name) - own) ** 2)) < size


def _delay(own, true):
    """When in the voyage the run begins, to a second: where the positions agree best."""
    known = np.flatnonzero(np.isfinite(own.position[:, 0]))[:: max(1, len(own) // 40)]

    def apart(delay):
        time = own.time[known] + delay
        place = np.stack([np.interp(time, true.time, c) for c in true.position.T], axis=-1)
        return np.mean(
            (relative_position(own.position[known], place[0]) - relative_position(place, place[0]))[:, :2] ** 2
        )

    return min(np.arange(0.0, 8.0, 0.5), key=apart)


def test_a_folder_to_a_rank(tmp_path):
    FOLDERS["ardusub"](tmp_path)
    found = inspect_log([tmp_path], run=True, output=tmp_path / "mine.toml")
    assert not found.missing
    assert [e.status for e in found.run.estimators] == ["ok"] * 3
    assert {e.estimator for e in found.run.estimators} == {"ekf", "gnss-only", "inertial"}
    assert all(np.isfinite(e.scores["horizontal_rmse"]) for e in found.run.estimators)
    table = innovation_table(found.run)
    assert table.columns == ["estimator", "gnss"]
    assert (tmp_path / "mine.toml").read_text() == found.draft


def test_what_a_person_must_add_is_one_sentence(tmp_path):
    (tmp_path / "imu.csv").write_text("t,gx,gy,gz,ax,ay,az\n" + "".join(f"{k},0,0,0,0,0,-9.8\n" for k in range(30)))
    found = inspect_log([tmp_path], run=True)
    assert found.run is None
    assert found.missing.startswith("no columns hold latitude and longitude")
    assert "\n" not in found.missing


def test_a_table_that_is_not_known_is_told(tmp_path):
    """Increments in g are none of KF-GINS, and no name says what they are."""
    FOLDERS["kf-gins"](tmp_path)
    path = tmp_path / "imu.txt"
    table = np.array([[float(c) for c in row.split()] for row in path.read_text().splitlines()])
    table[:, 4:] /= 9.80665
    path.write_text("".join(" ".join(map(repr, map(float, row))) + "\n" for row in table))
    found = inspect_log([tmp_path], output=tmp_path / "mine.toml")
    (told,) = found.unknown
    assert told.startswith("imu.txt: what its columns are (1, 2, 3, 4, 5, 6, 7) is not known")


def test_an_imu_that_is_not_level_is_turned(tmp_path):
    """A phone in its holder: roll and pitch of the mounting are those of its mean specific force."""
    FOLDERS["phone"](tmp_path)
    tilt = np.radians(35.0)
    turn = np.array([[1.0, 0.0, 0.0], [0.0, np.cos(tilt), np.sin(tilt)], [0.0, -np.sin(tilt), np.cos(tilt)]])
    for name in ("Accelerometer", "Gyroscope"):
        header, *rows = (tmp_path / f"{name}.csv").read_text().splitlines()
        table = np.array([[float(c) for c in row.split(",")] for row in rows])
        table[:, 1:] = table[:, 1:] @ turn.T
        (tmp_path / f"{name}.csv").write_text("\n".join([header, *(",".join(map(repr, map(float, r))) for r in table)]))
    made = drafted(look([tmp_path])[0], "tilted", "tilted.toml")
    assert not made.missing
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        source = LogSource(made.scenario, 0)
    mean = source.advance(source.duration).imu.specific_force.mean(axis=0)
    assert mean == pytest.approx([0.0, 0.0, -9.81], abs=0.15)
