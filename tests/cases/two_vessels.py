"""A voyage of an AUV that hears another vessel: the range, and where that one believes itself to be."""

from __future__ import annotations

from typing import Any

from simnav.scenario import Scenario

__all__ = ["SHIP", "two_vessels"]

_PLACE = {"latitude_deg": 54.0, "longitude_deg": 7.9}
#: A ship that sails to and fro, whose error lasts.
SHIP: dict[str, Any] = {
    "kind": "vessel_range", **_PLACE, "rate_hz": 0.2, "way": "one_way", "vessel": "ship", "repeats": True,
    "north_m": [250.0, 250.0, -150.0, -150.0], "east_m": [-250.0, 250.0, 250.0, -250.0], "speed_m_s": 4.0,
    "sigma_m": 0.2, "position_noise_m": 0.5, "wander_m": 3.0, "wander_time_s": 1000.0, "velocity_noise_m_s": 0.02,
}  # fmt: skip


def two_vessels(duration: float, **more: Any) -> Scenario:
    """Lines of 60 m with a DVL, a compass, a depth sensor and a modem (`SHIP` with further keys), for a time [s]."""
    return Scenario.from_toml({
        "name": "two-vessels", "version": 1, "title": "An AUV that hears another vessel",
        "duration_s": duration, "water_depth_m": 120.0,
        "start": {**_PLACE, "heading_deg": 40.0, "speed_m_s": 1.5, "depth_m": 40.0},
        "initial_error": {
            "position_m": [10.0, 10.0, 0.3], "velocity_m_s": [0.05, 0.05, 0.05], "attitude_deg": [0.2, 0.2, 1.0],
        },
        "vessel": {"kind": "uuv", "turn_rate_deg_s": 6.0},
        "manoeuvre": [{"kind": "lawn_mower", "leg_m": 60.0, "spacing_m": 20.0, "legs": 20}],
        "instruments": {
            "imu": {"rate_hz": 20.0, "grade": "tactical"},
            "dvl": {"rate_hz": 1.0, "sigma_m_s": 0.02, "scale_percent": 0.3},
            "gyrocompass": {"rate_hz": 1.0, "sigma_deg": 0.3, "bias_deg": 0.5},
            "depth": {"rate_hz": 1.0, "sigma_m": 0.1},
            "modem": SHIP | more,
        },
    })  # fmt: skip
