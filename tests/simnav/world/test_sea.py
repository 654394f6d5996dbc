"""The sea state, against the theory of random waves."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.world import Ship, Start, World
from simnav.world.sea import Sea, components, spectrum

SEA = Sea(significant_height=2.5, peak_period=9.0)


@pytest.mark.parametrize("kind", ["jonswap", "pierson_moskowitz"])
def test_spectrum_holds_the_energy_of_its_significant_height(kind):
    omega = np.linspace(0.05, 30.0, 200_000)
    density = spectrum(Sea(spectrum=kind, significant_height=2.5, peak_period=9.0), omega)
    assert 4.0 * np.sqrt(np.trapezoid(density, omega)) == pytest.approx(2.5, rel=1e-3)
    assert omega[np.argmax(density)] == pytest.approx(2 * np.pi / 9.0, rel=1e-2)


def test_pierson_moskowitz_is_the_closed_form():
    """DNV-RP-C205 eq. 3.5.5.1: 5/16 Hs^2 wp^4 w^-5 exp(-5/4 (w/wp)^-4)."""
    omega, peak = np.linspace(0.3, 3.0, 50), 2 * np.pi / 9.0
    exact = 5 / 16 * 2.5**2 * peak**4 * omega**-5 * np.exp(-1.25 * (omega / peak) ** -4)
    sea = Sea(spectrum="pierson_moskowitz", significant_height=2.5, peak_period=9.0)
    np.testing.assert_allclose(spectrum(sea, omega), exact, rtol=1e-4)


def test_jonswap_is_higher_at_its_peak_by_its_peakedness():
    peak = np.array([2 * np.pi / 9.0])
    ratio = spectrum(SEA, peak) / spectrum(SEA.model_copy(update={"spectrum": "pierson_moskowitz"}), peak)
    # gamma / 1.5, the energy being shared out: A_gamma = 1 - 0.287 ln(gamma) (DNV-RP-C205 eq. 3.5.5.3)
    assert ratio[0] == pytest.approx(3.3 * (1 - 0.287 * np.log(3.3)), rel=0.03)


def test_components_have_the_sea_states_energy_and_travel_away_from_where_it_comes():
    sea = Sea(significant_height=2.5, peak_period=9.0, direction=np.radians(30), components=256)
    phase, table = components(sea, seed=3)
    np.testing.assert_allclose(np.hypot(*phase[:2]), 1.0)
    # Deep-water dispersion
    np.testing.assert_allclose(np.hypot(table[1], table[2]), table[0] ** 2 / 9.81)
    towards = np.degrees(np.arctan2(table[2].mean(), table[1].mean())) % 360
    assert towards == pytest.approx(210.0, abs=5.0)
    # Horizontal displacement of a particle at the surface is the elevation's amplitude times the gain
    displacement = np.hypot(table[3], table[5]) ** 2 + np.hypot(table[4], table[6]) ** 2
    assert np.sqrt(displacement.sum() / 2) * 4 == pytest.approx(2.5 * sea.drift_gain, rel=1e-9)


@pytest.mark.parametrize("kind", ["jonswap", "pierson_moskowitz"])
def test_the_components_reach_to_where_all_but_a_thousandth_of_the_energy_is(kind):
    sea = Sea(spectrum=kind, significant_height=2.5, peak_period=9.0, components=256)
    highest = max(components(sea, seed)[1][0].max() for seed in range(20))
    omega = np.linspace(highest, 30.0, 200_000)
    above = np.trapezoid(spectrum(sea, omega), omega) / (2.5**2 / 16.0)
    assert 0.001 <= above < 0.0015
    if kind == "pierson_moskowitz":  # its energy below a frequency is exp(-1.25 (peak / frequency)^4)
        assert highest / (2 * np.pi / 9.0) == pytest.approx((1.25 / 0.001) ** 0.25, rel=0.03)


def test_the_spectrum_of_the_first_scenarios_ends_at_four_times_its_peak():
    sea = SEA.model_copy(update={"spectrum_end": 4.0, "components": 256})
    assert max(components(sea, seed)[1][0].max() for seed in range(20)) <= 4.0 * 2 * np.pi / 9.0
    assert "spectrum_end" not in sea.model_dump()
    assert "spectrum_end" in SEA.model_dump()


def test_the_phases_of_short_waves_keep_their_size_at_a_fast_vessel():
    """At 10 m/s against waves of 2 s the fastest component advances by more than a radian in 0.02 s."""
    sea = Sea(significant_height=0.5, peak_period=2.0, spreading=0.0)
    start = Start(latitude=0.9, longitude=0.1, heading=0.0, speed=10.0)
    world = World(start, Ship(), [], sea, None, rate=50.0, seed=1)
    world.advance(200.0, {})
    phase = world.share_state()["phase"].reshape(3, -1)
    assert np.max(np.abs(phase[2])) * 0.02 > 1.0
    np.testing.assert_allclose(np.hypot(phase[0], phase[1]), 1.0, rtol=1e-7)


def test_seeds_give_different_seas_and_the_same_one_the_same():
    assert not np.array_equal(components(SEA, 1)[1], components(SEA, 2)[1])
    np.testing.assert_array_equal(components(SEA, 1)[1], components(SEA, 1)[1])


def test_flat_sea_has_no_components():
    assert components(None, 1)[1].shape == (19, 0)
