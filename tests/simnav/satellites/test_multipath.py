"""The error of a reflected signal: its envelope, and its sign by the phase."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.satellites.multipath import CHIP, WAVELENGTH, multipath_error, strength_change


def at_phase(excess: float, phase: float) -> np.ndarray:
    """The excess next to one whose phase at the correlator, with the half turn of the mirror, is as given."""
    turns = round(excess / WAVELENGTH)
    return np.array([(turns + (phase - np.pi) / (2.0 * np.pi)) * WAVELENGTH])


@pytest.mark.parametrize("spacing", [0.1, 1.0])
def test_the_envelope_by_the_spacing_of_the_correlators(spacing):
    amplitude, middle = 0.4, 0.5 * CHIP
    highest = multipath_error(at_phase(middle, 0.0), amplitude, spacing)[0]
    lowest = multipath_error(at_phase(middle, np.pi), amplitude, spacing)[0]
    plateau = 0.5 * amplitude * spacing * CHIP
    steep = amplitude * middle / (1.0 + amplitude)
    assert highest == pytest.approx(min(plateau, steep), rel=1e-3)
    assert lowest == pytest.approx(-min(plateau, amplitude * middle / (1.0 - amplitude)), rel=1e-3)


def test_short_ways_far_ways_and_none():
    near = at_phase(2.0, 0.0)
    assert multipath_error(near, 0.5, 0.1)[0] == pytest.approx(near[0] / 3.0, rel=1e-6)
    assert multipath_error(np.array([1.1 * CHIP, np.inf]), 0.5, 0.1).tolist() == [0.0, 0.0]
    quadrature = at_phase(100.0, 0.5 * np.pi)
    assert multipath_error(quadrature, 0.5, 0.1)[0] == pytest.approx(0.0, abs=1e-6)


def test_the_strength_goes_with_the_phase():
    strong, weak = (strength_change(at_phase(50.0, phase), 0.5)[0] for phase in (0.0, np.pi))
    assert (strong, weak) == pytest.approx((20.0 * np.log10(1.5), 20.0 * np.log10(0.5)), abs=1e-6)
    assert strength_change(np.array([np.inf]), 0.5)[0] == 0.0
