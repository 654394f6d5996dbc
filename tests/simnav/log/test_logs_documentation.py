"""docs/how-to/use-your-own-log.md stays true: its example runs on files like those that it shows."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from simnav.log import LogSource
from simnav.scenario import parse

TEXT = (Path(__file__).resolve().parents[3] / "docs" / "how-to" / "use-your-own-log.md").read_text(encoding="utf-8")


def block(start: str) -> str:
    """The code block that begins with a text."""
    return next(b for b in re.findall(r"^```\w*\n(.*?)^```$", TEXT, re.MULTILINE | re.DOTALL) if b.startswith(start))


@pytest.fixture
def survey(tmp_path, monkeypatch):
    monkeypatch.setenv("SIMNAV_DATA", str(tmp_path))
    folder = tmp_path / "survey"
    folder.mkdir()
    header, row, _ = block("time,gx").splitlines()
    tail = row.split(",", 1)[1]
    imu = [header, *(f"{36000.0 + k / 100.0:.2f},{tail}" for k in range(2600))]
    gga, hdt = block("2024-05-01").splitlines()
    bridge = []
    for k in range(26):
        minutes = 27.0 + 0.002 * k  # 3.7 m/s to the north
        second = f"10:00:{k:02d}"
        bridge.append(gga.replace("10:00:00", second).replace(",100000.00", f",1000{k:02d}.00").replace(
            "5427.0000", f"54{minutes:07.4f}"))  # fmt: skip
        bridge.append(hdt.replace("10:00:00", second))
    for name in ("north", "south"):
        (folder / f"{name}-imu.csv").write_text("\n".join(imu) + "\n")
        (folder / f"{name}.nmea").write_text("\n".join(bridge) + "\n")
    return parse(block("name = "))


def test_the_worked_example(survey):
    sources = [LogSource(survey, seed) for seed in range(2)]
    assert [s.recording for s in sources] == ["north", "south"]
    assert "simulated from the reference: depth" in sources[0].note
    data = sources[0].advance(20.0)
    np.testing.assert_allclose(data.imu.angular_rate[0], [0.0021, 0.0013, -0.0104])
    np.testing.assert_allclose(data.imu.specific_force[0], [0.021, 0.108, -9.812])
    # Fixes 0, 10, 20 of the log are the estimator's; the run begins with fix 1, and the outage takes the one at 9 s.
    np.testing.assert_allclose(data.aids["gnss"].time, [19.0], atol=1e-6)
    np.testing.assert_allclose(data.aids["gnss"].dropped, [9.0], atol=1e-6)
    assert np.degrees(data.aids["gnss"].value[0]) == pytest.approx([54.0 + 27.04 / 60.0, 10.25, np.degrees(47.0)])
    assert np.isnan(data.truth.position[[8, 18]]).all()
    assert np.isfinite(np.delete(data.truth.position, [8, 18], axis=0)).all()
    assert len(data.aids["gyrocompass"]) == len(data.aids["depth"]) == 20
    assert np.degrees(data.aids["gyrocompass"].value) == pytest.approx(32.5)


def test_the_other_example(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    exec(block("from simnav.recording"), {})
    assert "IMU samples were means, resampled" in capsys.readouterr().out
