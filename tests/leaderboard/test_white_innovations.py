"""Noise figures from innovations: what was put in is found, whatever the datasheet says."""

from __future__ import annotations

import numpy as np
import pytest

import simnav
from simnav.geometry.earth import displace

SHIP = """
name = "drifter"
version = 1
title = "fixes, a compass and a log on a straight track"
duration_s = 300.0

[initial_error]
position_m = [1.0, 1.0, 1.0]
velocity_m_s = [0.1, 0.1, 0.1]
attitude_deg = [1.0, 1.0, 1.0]

[log]
folder = "."

[log.files.all]
path = "all.csv"
time = "t"

[log.instruments.gnss]
file = "all"
columns = ["lat", "lon", "=0"]
units = ["deg", "deg", "m"]

[log.instruments.gyrocompass]
file = "all"
columns = ["hdg"]
units = "deg"

[log.instruments.speed_log]
file = "all"
columns = ["speed"]

[log.reference.position]
file = "all"
columns = ["rlat", "rlon", "=0"]
units = ["deg", "deg", "m"]

[instruments.gnss]
kind = "gnss_position"
rate_hz = 1.0
sigma_m = 2.0

[instruments.gyrocompass]
rate_hz = 1.0
sigma_deg = 0.1

[instruments.speed_log]
rate_hz = 1.0
sigma_m_s = 1.0
"""


def test_the_noise_that_was_put_in_is_found(tmp_path, monkeypatch):
    monkeypatch.setenv("SIMNAV_DATA", str(tmp_path))
    chance, t = np.random.default_rng(3), np.arange(301.0)
    course, speed = np.radians(40.0), 4.0
    way = np.stack([speed * t * np.cos(course), speed * t * np.sin(course), 0.0 * t], axis=-1)
    place = displace(np.array([0.9, 0.1, 0.0]), way)
    fixes = displace(place, np.stack([*0.5 * chance.standard_normal((2, 301)), 0.0 * t], axis=-1))
    columns = [t, *np.degrees(fixes[:, :2].T), *np.degrees(place[:, :2].T)]
    columns += [np.degrees(course) + 0.8 * chance.standard_normal(301), speed + 0.05 * chance.standard_normal(301)]
    rows = "\n".join(",".join(repr(float(x)) for x in row) for row in zip(*columns, strict=True))
    (tmp_path / "all.csv").write_text("t,lat,lon,rlat,rlon,hdg,speed\n" + rows + "\n")
    (tmp_path / "drifter.toml").write_text(SHIP)
    found = {f.key: f for f in simnav.tune_noise(tmp_path / "drifter.toml", innovations=True) if "NIS" in f.basis}
    gnss = found["instruments.gnss.sigma_m"]
    assert gnss.now == (2.0, 2.0, 2.0)
    assert gnss.value[0] == pytest.approx(0.5, rel=0.3)
    assert found["instruments.gyrocompass.sigma_deg"].value[0] == pytest.approx(0.8, rel=0.4)
    assert "coloured" not in gnss.basis
