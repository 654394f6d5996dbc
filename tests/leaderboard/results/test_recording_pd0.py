"""PD0 files of recordings: a reader of others and that of simnav find the beams and the velocity of the DVL."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from simnav.leaderboard.results.formats import write
from simnav.log.files import FileSpec
from simnav.log.formats import pd0
from simnav.recording import Recording
from simnav.scenario import Scenario
from simnav.simulation.simulator import simulate
from simnav.types import Array
from tests.golden.cases import CASES, table_of

PD0_OF = [3, 1, 0, 2]  # channels of simnav that are beams 1 to 4
START = 946684800.0  # 2000-01-01


def survey(**beams: Any) -> Recording:
    """Fourteen seconds in which two beams are away for a while."""
    table = table_of("lawnmower-beams")
    for name in ("draw", "dial"):
        table.pop(name)
    table["instruments"]["beams"] |= {"false_beams": 0.0} | beams
    if beams.get("track") == "water":
        table["instruments"].pop("solution")
    case = CASES["beams of a dvl, two away, one wrong, some false"]
    return simulate(Scenario.from_toml(table | {"duration_s": case.duration, "fault": [case.faults[0]]}), 3)


def by_ping(recording: Recording, column: Array) -> Array:
    """(n, 4) values of the beams in the order of PD0; NaN where one is lost."""
    stream = recording.data.aids["beams"]
    times, row = np.unique(stream.time, return_inverse=True)
    found = np.full((len(times), 4), np.nan)
    found[row, stream.channel] = column
    return found[:, PD0_OF]


@pytest.fixture(scope="module")
def recording() -> Recording:
    return survey()


@pytest.fixture(scope="module")
def files(recording: Recording, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    written = write("recording", "pd0", recording, tmp_path_factory.mktemp("pd0") / "run.pd0")
    return {path.stem: path for path in written}


def test_there_is_a_file_for_the_beams_and_one_for_the_velocity(files: dict[str, Path]) -> None:
    assert set(files) == {"run-beams", "run-solution"}


def test_an_independent_reader_finds_the_beams(recording: Recording, files: dict[str, Path]) -> None:
    reader = pytest.importorskip("adcpreader.rdi_reader")
    found = list(reader.PD0().ensemble_generator(str(files["run-beams"])))
    stream = recording.data.aids["beams"]
    velocity, ranges = by_ping(recording, stream.value[:, 0]), by_ping(recording, stream.side[:, 2])
    assert len(found) == len(velocity) == 28
    track = [e["bottom_track"] for e in found]
    read = np.array([[t[f"BTVel{i}"] for i in range(1, 5)] for t in track])
    np.testing.assert_array_equal(read == -32.768, np.isnan(velocity))
    assert np.isnan(velocity).sum() == 2 * 8
    there = ~np.isnan(velocity)
    np.testing.assert_allclose(read[there], velocity[there], atol=0.5e-3 + 1e-9)
    far = np.array([[t[f"Range{i}"] for i in range(1, 5)] for t in track])
    np.testing.assert_allclose(far[there], np.cos(np.radians(30.0)) * ranges[there], atol=0.5e-2 + 1e-9)
    assert [e["variable_leader"]["Ensnum"] for e in found] == list(range(1, 29))
    clock = np.array([e["variable_leader"]["RTC"] for e in found])  # year, month, day, hour, minute, second, hundredth
    assert (clock[:, :5] == [0, 1, 1, 0, 0]).all()
    np.testing.assert_allclose(clock[:, 5] + 0.01 * clock[:, 6], np.unique(stream.time), atol=0.0051)
    head = found[0]["fixed_leader"]
    assert (head["Sys_Freq"], head["Beam_Angle"], head["CoordXfrm"], head["EA"]) == (
        "600 kHz",
        "30 Degree",
        "Beam",
        45.0,
    )
    assert (head["Xdcr_Facing"], head["N_Beams"]) == ("Down", 4)
    compass = recording.data.aids["gyrocompass"]
    course = [e["variable_leader"]["Heading"] for e in found[1:]]
    at = np.searchsorted(compass.time, np.unique(stream.time)[1:], side="right") - 1
    np.testing.assert_allclose(course, np.degrees(compass.value[at, 0]) % 360.0, atol=0.0051)


def test_the_velocity_of_the_beams_is_that_of_the_ship(recording: Recording, files: dict[str, Path]) -> None:
    """By the transformation that Teledyne gives: X = a (B1 - B2), Y = a (B4 - B3), Z = b (B1 + B2 + B3 + B4)."""
    beams, ship = (
        pd0.read.read(files[f"run-{n}"], FileSpec(path="x", format="pd0"), None, None) for n in ("beams", "solution")
    )
    b = np.stack([beams.table.column(f"v{i}")[1] for i in range(1, 5)], axis=1)
    whole = np.isfinite(b).all(axis=1)
    b = b[whole]
    x, y = (
        (b[:, 0] - b[:, 1]) / (2.0 * np.sin(np.radians(30.0))),
        (b[:, 3] - b[:, 2]) / (2.0 * np.sin(np.radians(30.0))),
    )
    z = b.sum(axis=1) / (4.0 * np.cos(np.radians(30.0)))
    turn = np.radians(45.0)  # beam 3 looks to 45 degrees from forward to starboard: Y is forward, X starboard
    forward, starboard = y * np.cos(turn) - x * np.sin(turn), y * np.sin(turn) + x * np.cos(turn)
    for name, value in (("forward", -forward), ("starboard", -starboard), ("down", z)):
        np.testing.assert_allclose(ship.table.column(f"ground_{name}")[1], value, atol=2.5e-3)
    solution = recording.data.aids["solution"]
    np.testing.assert_allclose(ship.table.column("ground_forward")[1], solution.value[:, 0], atol=0.5e-3 + 1e-9)
    np.testing.assert_allclose(ship.time - START, solution.time, atol=0.0051)
    assert ship.table.column("depth")[1] == pytest.approx(40.0, abs=1.0)
    assert np.isnan(ship.table.column("range_1")[1]).all()


def test_water_track_is_in_the_fields_of_the_layer(tmp_path: Path) -> None:
    reader = pytest.importorskip("adcpreader.rdi_reader")
    recording = survey(track="water")
    [path] = write("recording", "pd0", recording, tmp_path / "run.pd0")
    found = [e["bottom_track"] for e in reader.PD0().ensemble_generator(str(path))]
    velocity = by_ping(recording, recording.data.aids["beams"].value[:, 0])
    read = np.array([[t[f"ReflVel{i}"] for i in range(1, 5)] for t in found])
    there = ~np.isnan(velocity)
    np.testing.assert_allclose(read[there], velocity[there], atol=0.5e-3 + 1e-9)
    assert all(t["BTVel1"] == -32.768 for t in found)


def test_a_recording_without_a_dvl_is_refused(tmp_path: Path) -> None:
    table = table_of("open-sea") | {"duration_s": 2.0}
    table["instruments"].pop("dvl", None)
    with pytest.raises(ValueError, match="no Doppler velocity log"):
        write("recording", "pd0", simulate(Scenario.from_toml(table), 1), tmp_path / "run.pd0")
