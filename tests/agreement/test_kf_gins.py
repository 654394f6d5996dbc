"""What is written for KF-GINS, and what is read of it; the program itself is not needed here."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import simnav
from simnav.geometry import earth
from simnav.scenario import load
from tests.agreement.kf_gins import compared, imu_and_fixes, write_input

#: A program in place of KF-GINS: its position is that of the fixes.
PROGRAM = """#!/usr/bin/env python3
import json, sys
c = json.load(open(sys.argv[1]))
with open(c["outputpath"] + "/KF_GINS_Navresult.nav", "w") as file:
    for line in open(c["gnsspath"]):
        time, latitude, longitude, height = line.split()[:4]
        print(0, time, latitude, longitude, height, *[0.0] * 6, file=file)
"""


@pytest.fixture(scope="module")
def recording():
    scenario = imu_and_fixes(load("open-sea").with_values({"duration_s": 20.0}))
    return simnav.record(scenario, 1000)


def test_the_files_hold_increments_fixes_and_the_datasheet(recording, tmp_path: Path):
    c = json.loads(write_input(recording, tmp_path).read_text())
    imu, fixes = np.loadtxt(tmp_path / "imu.txt"), np.loadtxt(tmp_path / "gnss.txt")
    data, sheet = recording.data, recording.instruments.imu
    np.testing.assert_allclose(imu[1:-1, 1:4] * 100.0, data.imu.angular_rate, rtol=1e-9)
    np.testing.assert_allclose(imu[1:-1, 4:] * 100.0, data.imu.specific_force, rtol=1e-9)
    assert imu[0, 0] == recording.start.time
    np.testing.assert_allclose(np.radians(fixes[:, 1:3]), data.aids["gnss"].value[:, :2], rtol=0.0, atol=1e-14)
    assert fixes[0, 4:].tolist() == [1.5, 1.5, 3.0]
    assert c["antlever"] == [-4.0, 0.5, -12.0]
    # The random walk of the bias is what its process is driven by: 2 sigma^2 / correlation time.
    sigma = np.radians(c["imunoise"]["gbstd"][0]) / 3600.0
    assert np.sqrt(2.0 * sigma**2 / (c["imunoise"]["corrtime"] * 3600.0)) == pytest.approx(
        sheet.gyroscope.rate_random_walk
    )
    assert np.radians(c["imunoise"]["arw"][0]) / 60.0 == pytest.approx(sheet.gyroscope.random_walk)
    assert c["initbastd"][0] * 1e-5 == pytest.approx(sheet.accelerometer.bias)


def test_its_positions_are_compared_with_the_truth(recording, tmp_path: Path):
    program = tmp_path / "program"
    program.write_text(PROGRAM)
    program.chmod(0o755)
    ours, theirs, apart = compared(program, recording)
    data = recording.data
    off = earth.relative_position(data.aids["gnss"].value, data.truth.position)[:, :2]
    lever = np.hypot(4.0, 0.5)  # the fixes are those of the antenna
    assert theirs == pytest.approx(np.sqrt(np.mean(np.sum(off**2, axis=1))), rel=1e-6)
    assert 0.5 * lever < apart < lever + 5.0
    assert ours < theirs


def test_a_program_that_fails_is_reported(recording, tmp_path: Path):
    with pytest.raises(RuntimeError, match="exit code 1"):
        compared(Path("/bin/false"), recording)


def test_a_scenario_without_a_receiver_is_refused():
    with pytest.raises(ValueError, match="ship-turn"):
        imu_and_fixes(load("ship-turn"))
