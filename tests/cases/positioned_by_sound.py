"""A clean voyage of an AUV that is positioned by sound: by a ship above, or by beacons on the sea floor."""

from __future__ import annotations

from typing import Any

from simnav.scenario import Scenario

__all__ = ["INSTRUMENTS", "positioned_by_sound"]

_PLACE = {"latitude_deg": 54.0, "longitude_deg": 7.9}
_BEACONS = {
    "kind": "acoustic_range", **_PLACE, "rate_hz": 0.2, "beacons": ["A", "B", "C"], "north_m": [300.0, -250.0, 100.0],
    "east_m": [100.0, 200.0, -400.0], "depth_m": [100.0, 110.0, 115.0], "sigma_m": 0.15,
}  # fmt: skip
INSTRUMENTS: dict[str, dict[str, Any]] = {
    "usbl": {
        "kind": "usbl_fix", **_PLACE, "rate_hz": 0.5,
        "north_m": [-100.0, 200.0], "east_m": [0.0, 50.0], "speed_m_s": 1.0,
        "sigma_m": 0.3, "alignment_deg": [0.2, 0.2, 0.5], "attitude_noise_deg": 0.05, "sound_speed_percent": 0.2,
        "lever_arm_m": [0.5, 0.0, -0.3],
    },
    "lbl": _BEACONS | {"sound_speed_percent": 0.2, "beacon_error_m": 0.5},
    "one-way": _BEACONS | {"way": "one_way", "clock_s": 0.005, "clock_drift_ppm": 0.5},
    "one beacon": _BEACONS | {
        "beacons": ["A"], "north_m": [70.0], "east_m": [10.0], "depth_m": [100.0], "rate_hz": 0.1,
    },
}  # fmt: skip


def positioned_by_sound(instrument: str, duration: float, **more: Any) -> Scenario:
    """Lines of 60 m with a DVL, a depth sensor and one of `INSTRUMENTS` with further keys, for a time [s]."""
    return Scenario.from_toml({
        "name": "positioned-by-sound", "version": 1, "title": "An AUV that is positioned by sound",
        "duration_s": duration, "water_depth_m": 120.0,
        "start": {**_PLACE, "heading_deg": 40.0, "speed_m_s": 1.5, "depth_m": 60.0},
        "initial_error": {
            "position_m": [4.0, 4.0, 0.3], "velocity_m_s": [0.05, 0.05, 0.05], "attitude_deg": [0.2, 0.2, 1.0],
        },
        "vessel": {"kind": "uuv", "turn_rate_deg_s": 6.0},
        "manoeuvre": [{"kind": "lawn_mower", "leg_m": 60.0, "spacing_m": 20.0, "legs": 20}],
        "surroundings": {"sound_speed_profile": {"depth_m": [0, 30, 100], "speed_m_s": [1500, 1485, 1480]}},
        "instruments": {
            "imu": {"rate_hz": 50.0, "grade": "tactical"},
            "dvl": {"rate_hz": 1.0, "sigma_m_s": 0.02, "scale_percent": 0.2},
            "depth": {"rate_hz": 1.0, "sigma_m": 0.1},
            "sound": INSTRUMENTS[instrument] | more,
        },
    })  # fmt: skip
