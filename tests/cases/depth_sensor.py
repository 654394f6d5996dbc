"""A vehicle below the water, straight ahead, with a depth sensor without noise; a test adds the surroundings."""

__all__ = ["HEAD"]

HEAD = """
name = "level"
version = 1
title = "Depth"
duration_s = 3600.0
step_s = 10.0
[start]
latitude_deg = 54.0
longitude_deg = 8.0
depth_m = 12.0
heading_deg = 0.0
speed_m_s = 2.0
[vessel]
kind = "uuv"
[instruments.depth]
rate_hz = 0.1
sigma_m = 0.0
"""
