"""A speed log within the boundary layer of the hull, and below a current that decreases with depth."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.scenario import Scenario, parse
from simnav.sensors.speed_log import layer_share
from simnav.simulation.simulator import simulate
from simnav.spec import SpecError

HEAD = (
    'name = "log"\nversion = 1\ntitle = "log"\nduration_s = 20.0\n[start]\nlatitude_deg = 54.0\nlongitude_deg = 8.0\n'
    "speed_m_s = {speed}\n[current]\nspeed_m_s = 1.0\ndirection_deg = 0.0\nshear_per_s = 0.02\n"
    "[instruments.speed_log]\nsigma_m_s = 0.0\nlever_arm_m = [0.0, 0.0, 5.0]\n"
)
LAYER = "protrusion_m = 0.05\ndistance_from_bow_m = 30.0\ncalibrated_at_m_s = 6.0\n"


def read(speed: float, more: str) -> float:
    return float(simulate(parse(HEAD.format(speed=speed) + more), 1).data.aids["speed_log"].value[-1, 0])


def test_the_layer_of_a_flat_plate():
    """Schlichting and Gersten: at a Reynolds number of 1e8 the thickness is 0.37 x / 39.8."""
    speed = 1e8 * 1.19e-6 / 30.0
    thickness = 0.37 * 30.0 / 1e8**0.2
    assert layer_share(np.array([speed]), thickness, 30.0)[0] == pytest.approx(1.0)
    assert layer_share(np.array([speed]), thickness / 128.0, 30.0)[0] == pytest.approx(0.5)
    assert layer_share(np.array([speed]), 2.0 * thickness, 30.0)[0] == 1.0


def test_a_log_in_the_layer_is_right_at_the_speed_of_its_calibration_only():
    assert read(6.0, LAYER) == pytest.approx(6.0, rel=1e-5)
    # The layer grows with speed^(-1/5), and the profile is a power of 1/7 of it.
    assert read(2.0, LAYER) == pytest.approx(2.0 * (2.0 / 6.0) ** (1.0 / 35.0), rel=1e-5)
    assert read(9.0, LAYER) > 9.0


def test_a_log_below_the_surface_feels_the_current_there():
    """On a course with the current: 0.02 per second of shear at 5 m is 0.1 m/s less of following water."""
    assert read(4.0, "") == pytest.approx(4.0, abs=1e-5)
    assert read(4.0, "shear = true\n") == pytest.approx(4.1, abs=1e-5)


def test_scenarios_without_it_are_unchanged_and_half_of_it_is_refused():
    plain = parse(HEAD.format(speed=3.0))
    assert not {"protrusion", "shear"} & set(plain.model_dump()["instruments"]["speed_log"])
    full = parse(HEAD.format(speed=3.0) + LAYER + "shear = true\n")
    assert Scenario.from_toml(full.to_toml()) == full
    with pytest.raises(SpecError, match="distance_from_bow_m and calibrated_at_m_s is missing"):
        parse(HEAD.format(speed=3.0) + "protrusion_m = 0.05\n")
