"""A ship with raw observations of satellites beside its inertial unit."""

from __future__ import annotations

from simnav.scenario import Scenario, parse

__all__ = ["raw_gnss"]

_TEXT = """
name = "raw-gnss"
version = 1
title = "A coaster with raw observations of satellites"
duration_s = 600.0
[start]
latitude_deg = 54.0
longitude_deg = 7.9
heading_deg = 40.0
speed_m_s = 6.0
[initial_error]
position_m = [3.0, 3.0, 5.0]
velocity_m_s = [0.1, 0.1, 0.1]
attitude_deg = [0.1, 0.1, 1.0]
[vessel]
kind = "ship"
[[manoeuvre]]
kind = "hold"
duration_s = 30.0
[[manoeuvre]]
kind = "turn"
angle_deg = 80.0
rate_deg_s = 1.0
[[manoeuvre]]
kind = "hold"
duration_s = 100.0
[[manoeuvre]]
kind = "turn"
angle_deg = -120.0
rate_deg_s = 1.0
[sea]
significant_height_m = 1.0
peak_period_s = 7.0
[instruments.imu]
rate_hz = 20.0
[instruments.imu.gyroscope]
bias_deg_h = 10.0
bias_instability_deg_h = 3.0
correlation_time_s = 500.0
random_walk_deg_sqrt_h = 0.15
[instruments.imu.accelerometer]
bias_ug = 500.0
bias_instability_ug = 50.0
correlation_time_s = 500.0
random_walk_ug_sqrt_hz = 60.0
[instruments.gnss]
kind = "gnss_raw"
satellites = ["G11", "G12", "G25", "G28", "G29", "E27", "E30", "E36"]
sigma_pseudorange_m = 0.3
sigma_range_rate_m_s = 0.05
lever_arm_m = [-3.0, 0.0, -12.0]
"""


def raw_gnss(duration: float = 60.0, tables: str = "") -> Scenario:
    """The scenario, with more tables."""
    return parse(_TEXT + tables).model_copy(update={"duration": duration})
