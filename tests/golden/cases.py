"""Short scenarios with faults of every kind, on which the golden test runs every row.

Each is a scenario of the catalogue, cut after less than a minute, with faults of its own.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import simnav.scenarios
from simnav.scenario import Scenario

__all__ = ["CASES", "Case", "table_of"]

_CATALOGUE = Path(simnav.scenarios.__file__).parent


@dataclass(frozen=True)
class Case:
    """A short scenario.

    Attributes
    ----------
    base : str
        Name of a scenario of the catalogue.
    duration : float
        [s].
    faults : tuple of dict
        In place of the faults of that scenario, as in a TOML file.
    slow : bool
        Whether slow rows run on it, too.
    instruments : mapping of str to dict
        In place of instruments of that scenario, as in a TOML file.
    initial_error : mapping of str to list
        In place of keys of the table of that scenario. Where a robust window begins far from the truth over rough
        terrain, rounding decides between its solutions.
    """

    base: str
    duration: float
    faults: tuple[dict[str, Any], ...]
    slow: bool = False
    instruments: Mapping[str, dict[str, Any]] = field(default_factory=dict)
    initial_error: Mapping[str, list[float]] = field(default_factory=dict)

    def scenario(self) -> Scenario:
        """The scenario."""
        table = table_of(self.base)
        for name in ("draw", "dial", "fault"):
            table.pop(name, None)
        if self.instruments:
            table["instruments"] = {**table["instruments"], **self.instruments}
        if self.initial_error:
            table["initial_error"] = {**table["initial_error"], **self.initial_error}
        return Scenario.from_toml(table | {"duration_s": self.duration, "fault": list(self.faults)}, source=self.base)


def table_of(name: str) -> dict[str, Any]:
    """The TOML file of a scenario of the catalogue."""
    (path,) = _CATALOGUE.rglob(f"{name}.toml")
    return tomllib.loads(path.read_text(encoding="utf-8"))


def _fault(kind: str, instrument: str, start: float, end: float, **more: Any) -> dict[str, Any]:
    return {"kind": kind, "instruments": [instrument], "start_s": start, "end_s": end, **more}


_RAW = {
    "kind": "gnss_raw", "satellites": ["G12", "G29", "E27", "E30", "E34"], "sigma_pseudorange_m": 0.3,
    "sigma_range_rate_m_s": 0.05, "lever_arm_m": [1.0, 0.0, -3.0],
}  # fmt: skip

CASES = {
    "gnss away, then noisy": Case("coastal-voyage", 32.0, (
        _fault("outage", "gnss", 8.0, 16.0),
        _fault("noise_step", "gnss", 20.0, 30.0, factor=6.0),
    )),
    "gnss reflected, with gross errors": Case("harbour-multipath", 24.0, (
        _fault("multipath", "gnss", 4.0, 24.0, correlation_time_s=8.0, sigma_m=[4.0, 4.0, 6.0]),
        _fault("gross_error", "gnss", 6.0, 20.0, probability=0.4, size_m=[10.0, 40.0]),
    ), slow=True),
    "dvl biased, then zero, while gnss repeats itself": Case("harbour-multipath", 30.0, (
        _fault("bias_step", "dvl", 6.0, 14.0, offset_m_s=[0.4, -0.3, 0.0]),
        _fault("frozen", "gnss", 10.0, 18.0),
        _fault("false_zero", "dvl", 20.0, 27.0),
    )),
    "gnss dragged off, heading off": Case("harbour-multipath", 30.0, (
        _fault("ramp", "gnss", 6.0, 28.0, slope_m_s=[1.0, 0.5, 0.0]),
        _fault("bias_step", "gyrocompass", 8.0, 20.0, offset_deg=6.0),
    )),
    "imu disturbed": Case("mems-only", 24.0, (
        _fault("imu_disturbance", "imu", 8.0, 14.0, specific_force_m_s2=[0.3, -0.2, 0.1], angular_rate_deg_s=0.1,
               specific_force_noise_m_s2=0.2, angular_rate_noise_deg_s=0.2),
    )),
    "imu steps, saturates and loses samples": Case("mems-only", 24.0, (
        _fault("imu_bias_step", "imu", 5.0, 24.0, angular_rate_deg_h=200.0, specific_force_ug=3000.0),
        _fault("imu_clipping", "imu", 8.0, 12.0, angular_rate_limit_deg_s=0.5, specific_force_limit_g=1.0),
        _fault("imu_dropout", "imu", 14.0, 14.2, output="zero"),
        _fault("imu_dropout", "imu", 17.0, 17.25),
    )),
    "imu warms up, is shaken, sticks, and gives no samples": Case("mems-only", 24.0, (
        _fault("imu_warm_up", "imu", 4.0, 24.0, time_s=5.0, angular_rate_deg_h=300.0, specific_force_ug=2000.0),
        _fault("imu_vibration", "imu", 6.0, 11.0, vibration_g=0.5, gyroscope_deg_h_g2=40.0, accelerometer_ug_g2=4000.0),
        _fault("imu_stuck_axis", "imu", 12.0, 13.0, axes=["gyroscope_z", "accelerometer_x"]),
        _fault("imu_dropout", "imu", 16.0, 16.3, output="missing"),
    )),
    "satellites jammed and spoofed": Case("open-sea", 24.0, (
        _fault("jamming", "gnss", 5.0, 15.0, loss=18.0, rise_s=8.0),
        _fault("spoofing", "gnss", 12.0, 22.0, drift_m_s=[2.0, -1.0, 0.0], clock_drift_m_s=0.5),
    ), instruments={"gnss": _RAW}),
    "satellites and the receiver that solves them": Case("open-sea", 12.0, (
        _fault("bias_step", "gnss", 4.0, 9.0, channels=["E30"], offset_m=30.0, offset_m_s=0.0),
    ), instruments={"gnss": _RAW, "fix": {
        "kind": "gnss_receiver", "observations": "gnss", "sigma_m": [0.4, 0.4, 1.0],
    }, "doppler": {
        "kind": "gnss_receiver_velocity", "observations": "gnss", "sigma_m_s": 0.05,
    }}),
    "gnss velocity with gross errors": Case("open-sea", 24.0, (
        _fault("gross_error", "gnss_velocity", 6.0, 20.0, probability=0.4, size_m_s=[1.0, 3.0]),
    )),
    "ship without imu, gnss away": Case("ship-dead-reckoning", 60.0, (
        _fault("outage", "gnss", 15.0, 30.0),
        _fault("frozen", "speed_log", 35.0, 45.0),
        _fault("noise_step", "gyrocompass", 40.0, 55.0, factor=8.0),
    ), slow=True),
    "ship without imu, gross errors": Case("fishing-vessel", 60.0, (
        _fault("gross_error", "gnss", 10.0, 50.0, probability=0.3, size_m=[20.0, 60.0]),
        _fault("bias_step", "magnetic_compass", 20.0, 40.0, offset_deg=8.0),
    )),
    "under water, dvl away, fixes off": Case("auv-survey", 36.0, (
        _fault("outage", "dvl", 8.0, 18.0),
        _fault("bias_step", "terrain_fix", 15.0, 30.0, offset_m=[25.0, -15.0]),
        _fault("noise_step", "depth", 10.0, 25.0, sigma_m=2.0),
    )),
    "dvl late and out of order, its clock steps": Case("auv-survey", 12.0, (
        _fault("clock_step", "dvl", 6.0, 9.0, step_s=0.4),
    ), instruments={"dvl": {
        "rate_hz": 2.0, "sigma_m_s": 0.01, "scale_percent": 0.2,
        "timing": {"latency_s": 0.2, "latency_random_s": 0.3, "offset_s": 0.05, "drift_ppm": 20.0, "jitter_s": 0.002},
    }}),
    "beams of a dvl, two away, one wrong, some false": Case("lawnmower-beams", 14.0, (
        _fault("outage", "beams", 4.0, 8.0, channels=["1", "2"]),
        _fault("bias_step", "beams", 7.0, 11.0, channels=["3"], offset_m_s=0.2),
    ), instruments={"beams": {
        "kind": "dvl_beams", "rate_hz": 2.0, "mounting_deg": 0.1, "false_beams": 0.03, "lever_arm_m": [0.8, 0.0, 0.2],
    }}),
    "fixes of a ship and ranges to beacons, some of them echoes": Case("usbl-inspection", 16.0, (
        _fault("bias_step", "usbl", 5.0, 9.0, offset_m=[8.0, -6.0, 0.0]),
        _fault("outage", "lbl", 7.0, 12.0, channels=["A", "C"]),
    ), instruments={"lbl": {
        "kind": "acoustic_range", "rate_hz": 0.5, "latitude_deg": 54.0, "longitude_deg": 4.0,
        "beacons": ["A", "B", "C"], "north_m": [120.0, -90.0, 20.0], "east_m": [40.0, 150.0, -110.0],
        "depth_m": [40.0, 42.0, 44.0], "way": "one_way", "clock_s": 0.002, "clock_drift_ppm": 1.0, "sigma_m": 0.1,
        "sound_speed_percent": 0.1, "beacon_error_m": 0.3, "reflections": 0.1,
    }}),
    "soundings of an altimeter and a profile, some of them false": Case("terrain-rough", 12.0, (
        _fault("bias_step", "altimeter", 5.0, 8.0, offset_m=3.0),
        _fault("outage", "profile", 4.0, 7.0, channels=["1", "3"]),
    ), slow=True, initial_error={"position_m": [2.0, 2.0, 0.3]}, instruments={"profile": {
        "kind": "multibeam_profile", "rate_hz": 0.25, "beams": 4, "swath_deg": 60.0, "beam_width_deg": 4.0,
        "false_readings": 0.1, "chart_error_m": 0.2, "sound_speed_percent": 0.1, "axis": "vertical",
    }}),
    "fixes of terrain matching, and the velocity through the water": Case("terrain-matching", 16.0, (
        _fault("bias_step", "sounder", 9.0, 12.0, offset_m=2.0),
        _fault("outage", "water_track", 5.0, 9.0, channels=["2"]),
    ), instruments={"sounder": {
        "kind": "multibeam_profile", "rate_hz": 1.0, "beams": 5, "swath_deg": 60.0, "sigma_m": 0.05,
    }, "matching": {
        "kind": "terrain_match", "sounder": "sounder", "rate_hz": 0.25, "window_s": 4.0, "least_soundings": 8,
        "uniqueness": 1.0, "latitude_deg": 54.0, "longitude_deg": 4.0, "first_search_m": 100.0,
    }, "water_track": {
        "kind": "dvl_beams", "frequency_khz": 600, "rate_hz": 1.0, "track": "water", "current_m_s": 0.2,
    }, "water_velocity": {
        "kind": "dvl_water_solution", "beams": "water_track", "rate_hz": 1.0, "sigma_m_s": [0.01, 0.01, 0.005],
        "sound_speed_percent": 0.2, "mounting_deg": 0.1, "current_m_s": 0.2,
    }}),
    "messages of a ship and of a second vehicle, some of them lost": Case("auv-and-ship", 16.0, (
        _fault("bias_step", "modem", 5.0, 9.0, offset_m=6.0),
        _fault("outage", "second", 7.0, 12.0),
    ), instruments={"modem": {
        "kind": "vessel_range", "rate_hz": 0.5, "way": "one_way", "latitude_deg": 54.5, "longitude_deg": 5.0,
        "north_m": [120.0, -90.0], "east_m": [40.0, 150.0], "speed_m_s": 2.0, "repeats": True, "age_s": 1.0,
        "position_noise_m": 0.4, "wander_m": 1.0, "wander_time_s": 100.0, "clock_s": 0.0002, "clock_drift_ppm": 0.2,
        "sigma_m": 0.15, "sound_speed_percent": 0.1, "losses": 0.2, "reflections": 0.1,
    }, "second": {
        "kind": "vessel_range", "vessel": "auv-2", "rate_hz": 0.5, "latitude_deg": 54.5, "longitude_deg": 5.0,
        "north_m": [-60.0, 200.0], "east_m": [80.0, 80.0], "speed_m_s": 1.5, "depth_m": 40.0, "sigma_m": 0.15,
        "navigation": "dead_reckoning", "position_noise_m": 0.5, "drift_percent": [0.3, 0.8], "walk_m_sqrt_s": 0.03,
        "fixes_s": [10.0],
    }}),
    "under water without imu": Case("glider-dive", 60.0, (
        _fault("gross_error", "speed_log", 10.0, 40.0, probability=0.3, size_m_s=[0.5, 1.5]),
        _fault("outage", "gnss", 20.0, 60.0),
    )),
}  # fmt: skip
