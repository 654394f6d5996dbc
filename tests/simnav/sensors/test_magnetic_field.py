"""A magnetometer in a vessel with iron: its field, its equation, and a circle that finds the heading."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from simnav.blocks import NAVIGATION
from simnav.estimator import make
from simnav.geometry.rotation import dcm_from_rotation_vector, dcm_from_rpy
from simnav.kinds import NavigationPoint
from simnav.scenario import Scenario
from simnav.scoring.navigation_error import errors
from simnav.sensors import MagneticField
from simnav.sensors.magnetic_field import model_field, observe
from simnav.source import record
from simnav.spec import SpecError
from simnav.trial import run_trial
from simnav.types import Array, TapStates
from simnav.world.surroundings import Surroundings

FIELD = [18000.0, 1100.0, 46700.0]  # [nT], German Bight
IRON = {"hard_iron_nt": 4000.0, "soft_iron": 0.05}


def test_the_field_is_that_of_a_published_example() -> None:
    # Aerospace Toolbox, example of wrldmagm: Natick, Massachusetts, 4 July 2028, 1000 m: 20139, -4905 and 46532 nT. At
    # sea level the field is stronger by 3 h / R, 0.05 %.
    field, doubt = model_field(np.radians(42.283), np.radians(-71.35), 2028.507)
    np.testing.assert_allclose(field, 1e-9 * np.array([20139.0, -4905.0, 46532.0]), rtol=1e-3)
    assert field[2] > 46532e-9
    # The report says 137, 89 and 141 nT; of the declination sqrt(0.26^2 + (5417 / H)^2) degrees.
    np.testing.assert_allclose(doubt, [137e-9, 89e-9, 141e-9])


def test_the_anomaly_is_as_large_as_the_model_is_uncertain() -> None:
    table = {"sigma_nt": 50.0, "latitude_deg": 54.0, "longitude_deg": 7.9, "date": 2026.9}
    spec = MagneticField.from_toml(table)
    assert spec.anomaly == pytest.approx((137e-9, 89e-9, 141e-9))
    assert MagneticField.from_toml(table | {"anomaly_nt": 0.0}).blocks() == ()
    assert MagneticField.from_toml(spec.to_toml()) == spec
    drawn = [spec.build("m", seed).block("anomaly", np.zeros(1))[0] for seed in range(400)]
    np.testing.assert_allclose(np.std(drawn, axis=0), spec.anomaly, rtol=0.12)


def test_the_equation_predicts_the_reading_and_its_derivatives() -> None:
    spec = MagneticField.from_toml({"sigma_nt": 0.0, "field_nt": FIELD, "anomaly_nt": 300.0} | IRON)
    made = spec.install("m", 3, Surroundings({}))
    row = np.zeros((1, 3))
    tap = TapStates(np.ones(1), row, row, np.array([[0.2, -0.3, 2.0]]), row, row)
    blocks = {block.name: made.block(block.name, np.zeros(1))[0] for block in spec.blocks()}
    sheet, dcm = spec.datasheet("m"), dcm_from_rpy(tap.attitude)[0]

    def at(turn: Any = (0.0, 0.0, 0.0), **more: Any) -> tuple[Array, dict[str, Array]]:
        changed = {name: value + more.get(name, 0.0) for name, value in blocks.items()}
        turned = dcm_from_rotation_vector(np.array(turn)) @ dcm
        return observe(NavigationPoint(1.0, row[0], row[0], turned, row[0], changed), sheet)

    reading, jacobian = at()
    np.testing.assert_allclose(reading, made.sense(tap).value[0], rtol=1e-12)
    for k, e in enumerate(1e-6 * np.eye(3)):
        assert (at(turn=e)[0] - reading) / 1e-6 == pytest.approx(jacobian[NAVIGATION][:, 6 + k], abs=1e-10)
    for name, value in blocks.items():
        step = 1e-9 if name != "soft_iron" else 1e-6
        for k, e in enumerate(step * np.eye(len(value))):
            assert (at(**{name: e})[0] - reading) / step == pytest.approx(jacobian[name][:, k], rel=1e-4, abs=1e-9)
    # Level and without iron the reading points to magnetic north.
    plain = MagneticField.from_toml({"sigma_nt": 0.0, "field_nt": FIELD}).install("m", 1, Surroundings({}))
    level = TapStates(np.ones(1), row, row, np.array([[0.0, 0.0, 1.0]]), row, row)
    x, y, _ = plain.sense(level).value[0]
    assert 1.0 - np.arctan2(FIELD[1], FIELD[0]) == pytest.approx(np.arctan2(-y, x))


def circle() -> Scenario:
    """An AUV whose heading is known to five degrees goes straight for 20 s, and round a circle."""
    return Scenario.from_toml({
        "name": "circle", "version": 1, "title": "A circle", "duration_s": 110.0,
        "start": {"latitude_deg": 54.0, "longitude_deg": 7.9, "heading_deg": 40.0, "speed_m_s": 1.5, "depth_m": 10.0},
        "initial_error": {
            "position_m": [1.0, 1.0, 0.3], "velocity_m_s": [0.05, 0.05, 0.05], "attitude_deg": [0.2, 0.2, 5.0],
        },
        "vessel": {"kind": "uuv", "turn_rate_deg_s": 5.0},
        "manoeuvre": [{"kind": "hold", "duration_s": 20.0}, {"kind": "turn", "angle_deg": 360.0}],
        "instruments": {
            "imu": {"rate_hz": 50.0, "grade": "tactical"},
            "dvl": {"rate_hz": 1.0, "sigma_m_s": 0.01},
            "depth": {"rate_hz": 1.0, "sigma_m": 0.1},
            "magnetic_field": {"rate_hz": 2.0, "sigma_nt": 100.0, "field_nt": FIELD} | IRON,
        },
    })  # fmt: skip


def test_one_circle_recovers_the_heading_to_a_fifth_of_a_degree() -> None:
    begin, end = [], []
    for seed in range(31, 41):
        recording = record(circle(), seed)
        trial = run_trial(make("ekf"), recording)
        assert trial.status == "ok", trial.reason
        heading = np.degrees(errors(trial, recording)[:, 8])
        begin.append(heading[np.searchsorted(trial.time, 15.0)])
        end.append(heading[-1])
    assert np.sqrt(np.mean(np.square(begin))) > 1.0
    assert np.sqrt(np.mean(np.square(end))) < 0.2


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"latitude_deg": 54.0}, "give field_nt"),
        ({"latitude_deg": 54.0, "longitude_deg": 8.0, "date": 1990.0}, "date = 1990: pygeomag has no World Magnetic"),
        ({"field_nt": [0.0, 0.0, 50000.0]}, "field_nt: a field without a horizontal part"),
        ({"field_nt": FIELD, "soft_iron": -1.0}, "soft_iron"),
    ],
)
def test_bad_input_gets_a_sentence(table: dict[str, Any], message: str) -> None:
    with pytest.raises(SpecError, match=message):
        MagneticField.from_toml({"sigma_nt": 50.0} | table)
