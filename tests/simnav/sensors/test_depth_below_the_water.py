"""The depth sensor below a surface that is not the ellipsoid: geoid, tide, air pressure, waves above it."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from simnav.scenario import Scenario, parse
from simnav.simulation.simulator import simulate
from simnav.spec import SpecError
from simnav.world.water_column import Column, WaterColumn
from tests.cases.depth_sensor import HEAD


def read(text: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, readings and true depths below the ellipsoid."""
    recording = simulate(parse(HEAD + text), 1)
    stream = recording.data.aids["depth"]
    truth = recording.data.truth
    return stream.time, stream.value[:, 0], -np.interp(stream.time, truth.time, truth.position[:, 2])


def test_geoid_tide_and_air_pressure_add_up():
    time, value, depth = read(
        "[surroundings.water_level]\ngeoid_m = 40.0\ngeoid_slope_mm_km = [20.0, 0.0]\ntide_amplitude_m = [1.5, 0.4]\n"
        "tide_period_h = [12.42, 12.0]\ntide_phase_deg = [0.0, 90.0]\n"
        "pressure_change_hpa = -20.0\npressure_time_h = 0.5\n"
    )
    tide = 1.5 * np.cos(2.0 * np.pi * time / 12.42 / 3600.0) - 0.4 * np.sin(2.0 * np.pi * time / 12.0 / 3600.0)
    air = -2000.0 / (1025.0 * 9.81) * np.minimum(time / 1800.0, 1.0)
    north = 2.0 * (time - time[0])
    np.testing.assert_allclose(value - depth, 40.0 + 2e-5 * north + tide + air, atol=2e-3)


def test_the_tide_begins_anywhere_where_no_phase_is_given():
    text = "[surroundings.water_level]\ntide_amplitude_m = 2.0\ntide_period_h = 12.42\n"
    scenario = parse(HEAD + text)
    first = [simulate(scenario, seed).data.aids["depth"].value[0, 0] for seed in range(4)]
    assert np.std(first) > 0.3
    assert Scenario.from_toml(scenario.to_toml()) == scenario


def test_waves_above_the_sensor_are_less_at_depth():
    sea = "[sea]\nsignificant_height_m = 2.0\npeak_period_s = 8.0\ndrift_gain = 0.0\n"
    text = HEAD.replace("rate_hz = 0.1", "rate_hz = 1.0").replace("3600.0", "600.0")

    def spread(depth: float) -> float:
        given = text.replace("depth_m = 12.0", f"depth_m = {depth}")
        with_waves, without = (
            simulate(parse(f"{given}waves = {waves}\n{sea}"), 1).data.aids["depth"].value[:, 0]
            for waves in ("true", "false")
        )
        return float(np.std(with_waves - without))

    near, far = spread(1.0), spread(20.0)
    assert 0.3 < near < 0.5  # a quarter of the significant height, and less
    k = (2.0 * np.pi / 8.0) ** 2 / 9.81
    assert far / near == pytest.approx(np.exp(-19.0 * k), rel=0.5)


def test_bad_tides_are_refused():
    with pytest.raises(SpecError, match="have 2, 1 and 1 numbers; each constituent has one of each"):
        parse(HEAD + "[surroundings.water_level]\ntide_amplitude_m = [1.0, 2.0]\ntide_period_h = [12.0]\n")


def test_pressure_of_the_water_column_is_that_of_teos_10():
    gsw = pytest.importorskip("gsw")
    latitude = np.radians(np.full(3, 54.0))
    depth = np.array([10.0, 300.0, 4000.0])
    # The standard ocean, of which gsw has a formula of its own (the dynamic height of McDougall and Barker).
    np.testing.assert_allclose(Column(WaterColumn()).pressure(depth, latitude), gsw.p_from_z(-depth, 54.0), rtol=1.2e-5)
    fresh = Column(WaterColumn(salinity=0.0, temperature=10.0)).pressure(depth[:1], latitude[:1])
    assert fresh[0] == pytest.approx(gsw.rho(0.0, 10.0, 5.0) * gsw.grav(54.0, 5.0) * 10.0 / 1e4, rel=1e-6)
    # In layers: the weights of both add up.
    layers = WaterColumn(depth=(0.0, 20.0, 20.001), salinity=(7.0, 7.0, 35.0), temperature=(15.0, 15.0, 5.0))
    both = Column(layers).pressure(np.array([100.0]), latitude[:1])
    weight = 20.0 * gsw.rho(7.0, 15.0, 10.0) + 80.0 * gsw.rho(35.0, 5.0, 60.0)
    assert both[0] == pytest.approx(weight * gsw.grav(54.0, 50.0) / 1e4, rel=1e-4)
    many = Column(layers)
    np.testing.assert_array_equal(
        [float(many.pressure(np.array([d]), latitude[:1])[0]) for d in (30.0, 800.0)],
        Column(layers).pressure(np.array([30.0, 800.0]), latitude[:2]),
    )


def test_a_sensor_in_brackish_water_reads_too_little():
    pytest.importorskip("gsw")
    column = "[surroundings.water_column]\nsalinity_g_kg = 7.0\ntemperature_celsius = 10.0\n"
    _, standard, depth = read(column)
    np.testing.assert_allclose(standard / depth, 1005.0 / 1028.0, rtol=1e-3)
    _, told, _ = read("assumed_density_kg_m3 = 1005.25\n" + column)
    np.testing.assert_allclose(told, depth, atol=0.02)


def test_columns_that_make_no_sense_are_refused(monkeypatch):
    with pytest.raises(SpecError, match="have 2, 1 and 1 numbers; each depth has one of each"):
        parse(HEAD + "[surroundings.water_column]\ndepth_m = [0.0, 10.0]\n")
    with pytest.raises(SpecError, match="sea water has 0 to 42"):
        parse(HEAD + "[surroundings.water_column]\nsalinity_g_kg = 300.0\n")
    scenario = parse(HEAD + "[surroundings.water_column]\n")
    monkeypatch.setitem(sys.modules, "gsw", None)
    with pytest.raises(SpecError, match="needs the library gsw: pip install 'simnav\\[ocean\\]'"):
        simulate(scenario, 1)
