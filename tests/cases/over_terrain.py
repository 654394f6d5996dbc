"""A clean voyage of an AUV over a bottom that a chart shows."""

from __future__ import annotations

from typing import Any

from simnav.scenario import Scenario

__all__ = ["matched", "over_terrain"]

_PLACE = {"latitude_deg": 54.0, "longitude_deg": 7.9}


def over_terrain(duration: float, *, sounder: Any = None, bottom: Any = None, position: float = 50.0) -> Scenario:
    """A straight course with a turn, with a DVL, a depth sensor and an altimeter or another sounder, for a time [s].

    ``position`` is the standard deviation of the initial position, north and east [m].
    """
    relief = {"extent_m": [3000.0, 3000.0], "depth_m": 90.0, "roughness_m": 6.0, "scale_m": 150.0, "hurst": 0.8}
    return Scenario.from_toml({
        "name": "over-terrain", "version": 1, "title": "An AUV over a bottom that a chart shows",
        "duration_s": duration,
        "start": {**_PLACE, "heading_deg": 40.0, "speed_m_s": 2.0, "depth_m": 40.0},
        "initial_error": {
            "position_m": [position, position, 0.3], "velocity_m_s": [0.05, 0.05, 0.05],
            "attitude_deg": [0.1, 0.1, 0.5],
        },
        "vessel": {"kind": "uuv", "turn_rate_deg_s": 4.0},
        "manoeuvre": [
            {"kind": "hold", "duration_s": 0.5 * duration}, {"kind": "turn", "angle_deg": 70.0},
        ],
        "surroundings": {"bathymetry": _PLACE | relief | (bottom or {})},
        "instruments": {
            "imu": {"rate_hz": 50.0, "grade": "tactical"},
            "dvl": {"rate_hz": 1.0, "sigma_m_s": 0.01, "scale_percent": 0.2},
            "depth": {"rate_hz": 1.0, "sigma_m": 0.1},
            "sounder": {"kind": "altimeter", "rate_hz": 1.0, "sigma_m": 0.2} | (sounder or {}),
        },
    })  # fmt: skip


def matched(duration: float, *, match: Any = None, sounder: Any = None, bottom: Any = None, **more: Any) -> Scenario:
    """The same without an IMU, with a gyrocompass and a terrain-matching computer, and further tables."""
    table = over_terrain(duration, sounder={"sigma_m": 0.1} | (sounder or {}), bottom=bottom).to_toml()
    del table["instruments"]["imu"]
    table["instruments"]["gyrocompass"] = {"rate_hz": 1.0, "sigma_deg": 0.3, "bias_deg": 0.5}
    table["instruments"]["match"] = {"kind": "terrain_match", "sounder": "sounder"} | _PLACE | (match or {})
    return Scenario.from_toml(table | more)
