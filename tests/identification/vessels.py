"""Simulated logs whose datasheets are wrong, as those of real logs are: an ROV, an AUV, a car and a ship.

The datasheets of a voyage (`TOLD`) know white noise only. In truth the fixes are coloured, the DVL has a bias, a scale
and a mounting, the compass a slow error, the IMU is noisier and its biases wander. By how much is drawn by the seed,
around what was found on logs of real ROVs: fixes 1.5 m over 60 s, a DVL bias of 0.02 m/s, scale 3 %, mounting 4 deg.
`exact` makes the datasheets that a voyage's errors were drawn from: the best that a filter can be told.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from simnav.recording import Recording
from simnav.scenario import Scenario
from simnav.scenario.reading import parse
from simnav.source import record

__all__ = ["VESSELS", "Vessel", "exact", "voyage"]

_BEGIN = """
version = 1
title = "a voyage whose datasheets are wrong"
duration_s = 480.0

[initial_error]
position_m = [1.0, 1.0, 0.3]
velocity_m_s = [0.1, 0.1, 0.1]
attitude_deg = [1.0, 1.0, 5.0]
"""

_ROV = """
name = "rov"
[start]
latitude_deg = 63.44
longitude_deg = 10.41
heading_deg = 38.0
speed_m_s = 0.5
depth_m = 5.0

[vessel]
kind = "uuv"
turn_rate_deg_s = 10.0

[[manoeuvre]]
kind = "lawn_mower"
leg_m = 12.0
spacing_m = 2.0
legs = 26

[instruments.imu]
rate_hz = 25.0

[instruments.imu.gyroscope]
bias_deg_h = 50.0
random_walk_deg_sqrt_h = 0.3

[instruments.imu.accelerometer]
bias_ug = 2000.0
random_walk_ug_sqrt_hz = 200.0

[instruments.gnss]
kind = "gnss_position"
rate_hz = 1.0
sigma_m = [0.5, 0.5, 1.0]

[instruments.dvl]
rate_hz = 4.0
sigma_m_s = 0.02

[instruments.depth]
rate_hz = 2.0
sigma_m = 0.05

[instruments.compass]
kind = "magnetic_compass"
rate_hz = 2.0
sigma_deg = 2.0
"""

_AUV = """
name = "auv"
[start]
latitude_deg = 32.9
longitude_deg = 34.9
heading_deg = 60.0
speed_m_s = 1.8
depth_m = 15.0

[vessel]
kind = "uuv"
turn_rate_deg_s = 6.0

[[manoeuvre]]
kind = "lawn_mower"
leg_m = 120.0
spacing_m = 15.0
legs = 8

[instruments.imu]
rate_hz = 25.0

[instruments.imu.gyroscope]
bias_deg_h = 1.0
random_walk_deg_sqrt_h = 0.05

[instruments.imu.accelerometer]
bias_ug = 200.0
random_walk_ug_sqrt_hz = 50.0

[instruments.usbl]
kind = "gnss_position"
rate_hz = 0.25
sigma_m = [1.0, 1.0, 1.0]

[instruments.dvl]
rate_hz = 1.0
sigma_m_s = 0.01

[instruments.depth]
rate_hz = 1.0
sigma_m = 0.1

[instruments.gyrocompass]
rate_hz = 1.0
sigma_deg = 0.3
"""

_CAR = """
name = "car"
[start]
latitude_deg = 49.0
longitude_deg = 8.4
heading_deg = 20.0
speed_m_s = 9.0

[vessel]
kind = "ship"
turn_rate_deg_s = 15.0
turn_time_constant_s = 1.0

[[manoeuvre]]
kind = "lawn_mower"
leg_m = 180.0
spacing_m = 70.0
legs = 24

[instruments.imu]
rate_hz = 25.0

[instruments.imu.gyroscope]
bias_deg_h = 30.0
random_walk_deg_sqrt_h = 0.3

[instruments.imu.accelerometer]
bias_ug = 2000.0
random_walk_ug_sqrt_hz = 200.0

[instruments.gnss]
kind = "gnss_position"
rate_hz = 1.0
sigma_m = [1.0, 1.0, 2.0]
"""

_SHIP = """
name = "ship"
[start]
latitude_deg = -54.0
longitude_deg = -66.0
heading_deg = 130.0
speed_m_s = 5.0

[vessel]
kind = "ship"
turn_rate_deg_s = 1.0

[[manoeuvre]]
kind = "zigzag"
angle_deg = 15.0
duration_s = 480.0

[current]
speed_m_s = 0.4
direction_deg = 200.0

[instruments.gnss]
kind = "gnss_position"
rate_hz = 1.0
sigma_m = [1.0, 1.0, 2.0]

[instruments.gyrocompass]
rate_hz = 1.0
sigma_deg = 0.3

[instruments.speed_log]
rate_hz = 1.0
sigma_m_s = 0.1
"""


class Draw:
    """What is drawn for a voyage; with ``sigmas`` the constants are their sigmas."""

    def __init__(self, seed: int, sigmas: bool = False):
        self._rng, self._sigmas = np.random.default_rng([5802, seed]), sigmas

    def about(self, size: float, factor: float = 1.6) -> float:
        """A size, up to a factor more or less."""
        return size * float(factor ** self._rng.uniform(-1.0, 1.0))

    def normal(self, sigma: float, number: int = 1) -> Any:
        """Constants of a sigma."""
        found = self._rng.normal(0.0, sigma, number).tolist()
        if self._sigmas:
            found = [sigma] * number
        return found if number > 1 else found[0]


def _fixes(draw: Draw, white: float, slow: float, time: float) -> dict[str, Any]:
    a, b = draw.about(white), draw.about(slow)
    return {"sigma_m": [a, a, 2 * a], "bias_instability_m": [b, b, b], "correlation_time_s": draw.about(time)}


def _imu(draw: Draw, gyro: float, walk: float, accelerometer: float, noise: float) -> dict[str, Any]:
    """In-run biases (deg/h, micro-g) and white noise."""
    return {
        "gyroscope": {
            "bias_deg_h": 3.0 * gyro, "bias_instability_deg_h": draw.about(gyro), "correlation_time_s": 300.0,
            "random_walk_deg_sqrt_h": draw.about(walk),
        },
        "accelerometer": {
            "bias_ug": 3.0 * accelerometer, "bias_instability_ug": draw.about(accelerometer),
            "correlation_time_s": 300.0, "random_walk_ug_sqrt_hz": draw.about(noise),
        },
    }  # fmt: skip


def _dvl(draw: Draw, bias: float, scale: float, mounting: float, wander: float) -> dict[str, Any]:
    return {
        "bias_instability_m_s": draw.about(wander), "correlation_time_s": draw.about(60.0, 3.0),
        "fixed_bias_m_s": draw.normal(bias, 3), "fixed_scale_percent": draw.normal(scale),
        "fixed_misalignment_deg": draw.normal(mounting, 3),
    }  # fmt: skip


def _rov(draw: Draw) -> dict[str, Any]:
    return {
        "imu": _imu(draw, 30.0, 1.0, 500.0, 500.0),
        "gnss": _fixes(draw, 0.3, 1.5, 60.0),
        "dvl": {"sigma_m_s": draw.about(0.02), **_dvl(draw, 0.02, 3.0, 4.0, 0.01)},
        "depth": {"sigma_m": draw.about(0.05), "fixed_bias_m": draw.normal(0.2)},
        "compass": {
            "sigma_deg": draw.about(1.5), "fixed_bias_deg": draw.normal(3.0), "bias_instability_deg": draw.about(2.0),
            "correlation_time_s": draw.about(60.0),
        },
    }  # fmt: skip


def _auv(draw: Draw) -> dict[str, Any]:
    return {
        "imu": _imu(draw, 0.5, 0.1, 50.0, 100.0),
        "usbl": _fixes(draw, 1.0, 2.0, 120.0),
        "dvl": {"sigma_m_s": draw.about(0.01), **_dvl(draw, 0.005, 0.5, 0.5, 0.005)},
        "depth": {"sigma_m": draw.about(0.1)},
        "gyrocompass": {"sigma_deg": draw.about(0.2), "fixed_bias_deg": draw.normal(0.5)},
    }


def _car(draw: Draw) -> dict[str, Any]:
    return {"imu": _imu(draw, 20.0, 0.6, 300.0, 400.0), "gnss": _fixes(draw, 0.5, 1.5, 60.0)}


def _ship(draw: Draw) -> dict[str, Any]:
    return {
        "gnss": _fixes(draw, 0.5, 1.5, 120.0),
        "gyrocompass": {
            "sigma_deg": draw.about(0.2), "fixed_bias_deg": draw.normal(0.5), "bias_instability_deg": draw.about(0.3),
            "correlation_time_s": draw.about(60.0),
        },
        "speed_log": {
            "sigma_m_s": draw.about(0.1), "fixed_scale_percent": draw.normal(3.0),
            "bias_instability_m_s": draw.about(0.15), "correlation_time_s": draw.about(30.0),
        },
    }  # fmt: skip


@dataclass(frozen=True)
class Vessel:
    """A vessel: its scenario with the datasheets, and what its instruments really are."""

    told: str
    true: Callable[[Draw], dict[str, Any]]


VESSELS = {
    "rov": Vessel(_ROV, _rov), "auv": Vessel(_AUV, _auv), "car": Vessel(_CAR, _car), "ship": Vessel(_SHIP, _ship),
}  # fmt: skip


def _told(name: str) -> Scenario:
    first, _, tables = VESSELS[name].told.lstrip().partition("\n")
    return parse(f"{first}{_BEGIN}{tables}", source=name)


def _other(name: str, draw: Draw, constant: str) -> Scenario:
    """The scenario of a vessel with the figures that are drawn; ``constant`` begins the keys of constant errors."""
    table: dict[str, Any] = _told(name).to_toml()
    for instrument, figures in VESSELS[name].true(draw).items():
        sheet = table["instruments"][instrument]
        for key, figure in figures.items():
            if isinstance(figure, dict):
                sheet[key] |= figure
            else:
                sheet[key.replace("fixed_", constant)] = figure
    return Scenario.from_toml(table, source="true")


def exact(name: str, seed: int) -> Scenario:
    """The scenario of a voyage with datasheets that are right: sizes as they are, constant errors by their sigma."""
    return _other(name, Draw(seed, sigmas=True), "")


def voyage(name: str, seed: int) -> tuple[Scenario, Recording]:
    """The scenario of a vessel with its datasheets, and a recording of other errors with these datasheets."""
    told, recording = _told(name), record(_other(name, Draw(seed), "fixed_"), seed)
    return told, replace(recording, instruments=told.instruments_sheet(), actual=None)
