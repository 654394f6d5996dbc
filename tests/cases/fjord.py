"""Scenarios of a third party whose instruments bring states along, one for each of its files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from simnav.scenario import Scenario, parse

__all__ = ["CASES", "CHANNEL_CASES", "WITH_CHANNELS", "fjord", "true_blocks"]

_FIX = '[instruments.fix]\nkind = "gnss_position"\nsigma_m = 2.0\n'
_IRON = (
    _FIX
    + """[instruments.magnetometer]
rate_hz = 2.0
sigma_ut = 0.3
hard_iron_ut = 4.0
soft_iron = 0.05
"""
)
_BEAM = """[instruments.beam_{0}]
kind = "beam"
sigma_m_s = 0.02
azimuth_deg = {1}
sound_speed = 0.02
"""
_RANGE = """[instruments.transponder_{0}]
kind = "one_way_range"
latitude_deg = {1}
longitude_deg = {2}
height_m = -20.0
sigma_m = 0.5
clock_m = 30.0
drift_m_s = 0.1
clock_noise = 0.02
drift_noise = 0.002
"""
_BEACONS = """[instruments.beacons]
kind = "moving_beacons"
latitude_deg = 54.0
longitude_deg = 7.9
beacons = ["A", "B", "C", "D", "E"]
north_m = [400.0, -200.0, -150.0, 100.0, 700.0]
east_m = [50.0, 500.0, -400.0, -100.0, 100.0]
depth_m = [5.0, 40.0, 20.0, 60.0, 10.0]
course_deg = [90.0, 0.0, 45.0, 200.0, 0.0]
speed_m_s = [1.0, 1.5, 1.0, 0.5, 4.0]
uncertainty_m = [0.0, 0.3, 1.0, 0.0, 0.0]
reach_m = 720.0
sigma_m = 0.5
clock_m = 30.0
drift_m_s = 0.1
clock_noise = 0.02
drift_noise = 0.002
"""
_JANUS = """[instruments.beams]
kind = "janus"
sigma_m_s = 0.02
sound_speed = 0.02
reach_m = 60.0
"""
_PLACES = [(54.004, 7.9), (53.998, 7.907), (53.998, 7.893)]
#: By name: the file of the instrument, and the tables of a scenario with it.
CASES = {
    "iron": ("magnetometer.py", _IRON),
    "delay": ("late_fix.py", '[instruments.fix]\nkind = "late_fix"\nsigma_m = 1.0\ndelay_s = 0.5\n'),
    "beams": ("beam.py", _FIX + "".join(_BEAM.format(k, 45 + 90 * k) for k in range(4))),
    "clock": ("one_way_range.py", "".join(_RANGE.format(k, *place) for k, place in enumerate(_PLACES))),
}
#: The same for instruments with channels.
CHANNEL_CASES = {
    "beacons": ("moving_beacons.py", _BEACONS),
    "janus": ("janus.py", _FIX + _JANUS),
}
#: The cases whose instrument has channels, and its name.
WITH_CHANNELS = {"beacons": "beacons", "janus": "beams"}


def fjord(plugins: Path, case: str, *, duration: float = 60.0, tables: str = "") -> Scenario:
    """The scenario of a case, with more tables."""
    file, instruments = {**CASES, **CHANNEL_CASES}[case]
    text = (plugins / "fjord.toml").read_text().partition("[instruments.fix]")[0]
    text = text.replace('plugins = ["magnetometer.py"]', f'plugins = ["{file}"]')
    scenario = parse(text + instruments + tables, folder=plugins)
    return scenario.model_copy(update={"duration": duration})


def true_blocks(scenario: Scenario, seed: int, time: np.ndarray) -> dict[str, np.ndarray]:
    """By label, the true values of all blocks of a run at n times, (n, k)."""
    values = {}
    for name, spec in scenario.aids.items():
        instrument = spec.actual().build(name, seed)
        values |= {block.label(name): instrument.block(block.name, time) for block in spec.blocks()}
    return values
