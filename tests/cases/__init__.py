"""Scenario files, recordings, trials and logs that several tests use."""

from pathlib import Path

__all__ = ["POND", "ROV", "SHORT", "TWENTY_SATELLITES", "ship"]

#: A short voyage with fixes only: the text of its file.
POND = Path(__file__).with_name("pond.toml").read_text(encoding="utf-8")
#: Twelve steps with an IMU at 20 Hz and a GNSS receiver at 0.5 Hz: the text of its file.
SHORT = Path(__file__).with_name("short.toml").read_text(encoding="utf-8")
#: A slow ROV with a DVL at 23 Hz and a MEMS IMU: its file.
ROV = Path(__file__).with_name("rov.toml")
#: A minute with raw observations of 20 satellites and an IMU at 20 Hz: its file.
TWENTY_SATELLITES = Path(__file__).with_name("twenty_satellites.toml")


def ship(name: str, seconds: float, speed: float = 5.0, sigma: str = "[3.0, 3.0, 5.0]") -> str:
    """A scenario as TOML: a ship that holds its course, with GNSS once a second and nothing else."""
    return f"""
name = "{name}"
version = 1
title = "A ship that holds its course"
duration_s = {seconds}

[start]
latitude_deg = 50.0
longitude_deg = -5.0
heading_deg = 45.0
speed_m_s = {speed}

[[manoeuvre]]
kind = "hold"
duration_s = {seconds}

[instruments.gnss]
kind = "gnss_position"
rate_hz = 1.0
sigma_m = {sigma}
"""
