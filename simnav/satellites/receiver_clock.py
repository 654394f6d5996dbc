"""The clock of a receiver: bias and drift as a `simnav.blocks.StateBlock`, by the grade of its oscillator.

The densities follow from the coefficients h_0 and h_-2 of the power spectrum of the fractional frequency, as lengths:
``q_b^2 = c^2 h_0 / 2`` and ``q_d^2 = 2 pi^2 c^2 h_-2``.

Source: R. G. Brown and P. Y. C. Hwang, *Introduction to Random Signals and Applied Kalman Filtering*, 4th ed., Wiley
2012, section 9.3 (model and coefficients); the stability of the frequency at the start is a typical figure of
datasheets: 0.5 ppm of a temperature-compensated, 10 ppb of an oven-controlled oscillator.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import pi, sqrt
from typing import Literal, NamedTuple

from simnav.blocks import StateBlock
from simnav.satellites.orbit import SPEED_OF_LIGHT

__all__ = ["GRADES", "Grade", "Oscillator", "clock_block"]

Grade = Literal["tcxo", "ocxo"]


class Oscillator(NamedTuple):
    """Figures of a grade of oscillators.

    Attributes
    ----------
    white_frequency : float
        Coefficient h_0 of white frequency noise [s].
    random_walk_frequency : float
        Coefficient h_-2 of random-walk frequency noise [1/s].
    stability : float
        One sigma of the fractional frequency at the start of a run [-].
    """

    white_frequency: float
    random_walk_frequency: float
    stability: float

    @property
    def densities(self) -> tuple[float, float]:
        """Densities of bias [m/sqrt(s)] and drift [m/s/sqrt(s)]."""
        return (
            SPEED_OF_LIGHT * sqrt(self.white_frequency / 2.0),
            SPEED_OF_LIGHT * pi * sqrt(2.0 * self.random_walk_frequency),
        )


GRADES: Mapping[Grade, Oscillator] = {
    "tcxo": Oscillator(2e-19, 2e-20, 5e-7),
    "ocxo": Oscillator(8e-20, 4e-23, 1e-8),
}


def clock_block(grade: Grade, bias: float, factor: float = 1.0) -> StateBlock:
    """The states of a receiver's clock, as lengths: bias [m] and drift [m/s].

    Parameters
    ----------
    grade : str
        A key of `GRADES`.
    bias : float
        One sigma of the bias at the start of a run [m].
    factor : float
        All figures of the oscillator are so many times those of its grade; 0 for a perfect clock.
    """
    oscillator = GRADES[grade]
    sigma = (bias, factor * SPEED_OF_LIGHT * oscillator.stability)
    densities = oscillator.densities
    density = (factor * densities[0], factor * densities[1])
    return StateBlock("clock", 2, ("m", "m_s"), sigma, "clock", density)
