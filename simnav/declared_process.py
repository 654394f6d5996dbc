"""The coloured processes of an instrument's error, as its datasheet declares them.

A declared process is a random process times factors that depend on the motion, such as the speed or the sine of the
heading. Filters take its first-order form with all factors equal to 1 (`DeclaredProcess.block`). Oracles take the
process itself.

A second-order process x has the natural angular frequency w and the damping ratio z::

    x'' + 2 z w x' + w^2 x = white noise

With the stationary standard deviation sigma, the values (x, x') have the stationary covariance diag(sigma^2, w^2
sigma^2), and the autocovariance of x is sigma^2 exp(-z w t) (cos(s t) + z w sin(s t) / s) with s = w sqrt(1 - z^2)
(A. Gelb (ed.), *Applied Optimal Estimation*, MIT Press 1974, section 3.6 and table 3.8-1).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import cos, cosh, exp, inf, pi, sin, sinh, sqrt
from typing import NamedTuple

import numpy as np

from simnav.blocks import StateBlock
from simnav.compiled import Array, helper

__all__ = ["DeclaredProcess", "Factor", "Oscillation", "oscillation"]


class Oscillation(NamedTuple):
    """The transition matrix of value and rate of a second-order process, by rows.

    Attributes
    ----------
    value_by_value, value_by_rate, rate_by_value, rate_by_rate : float
        What each becomes by each: [-], [s], [1/s], [-].
    """

    value_by_value: float
    value_by_rate: float
    rate_by_value: float
    rate_by_rate: float


@helper
def oscillation(elapsed: float, frequency: float, damping: float) -> Oscillation:
    """Transition matrix of value and rate of a second-order process.

    Parameters
    ----------
    elapsed : float
        Time [s].
    frequency : float
        Natural angular frequency w [rad/s].
    damping : float
        Damping ratio z [-].
    """
    decay = exp(-damping * frequency * elapsed)
    if damping < 1.0:
        s = frequency * sqrt(1.0 - damping * damping)
        c, h = cos(s * elapsed), sin(s * elapsed) / s
    elif damping > 1.0:
        s = frequency * sqrt(damping * damping - 1.0)
        c, h = cosh(s * elapsed), sinh(s * elapsed) / s
    else:
        c, h = 1.0, elapsed
    along = damping * frequency * h
    return Oscillation(decay * (c + along), decay * h, -decay * frequency * frequency * h, decay * (c - along))


@dataclass(frozen=True)
class Factor:
    """A factor of a process, which depends on the motion.

    Attributes
    ----------
    name : str
        A name of `simnav.sensors.error_processes.FACTORS`.
    reference : float
        The value, in SI units, at which the factor is 1.
    parameters : mapping of str to float
        What else the factor depends on, SI units.
    """

    name: str
    reference: float = 1.0
    parameters: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class DeclaredProcess:
    """A coloured process of the error of an instrument.

    Attributes
    ----------
    block : StateBlock
        Its first-order form: one state for each of the d components of the error, SI units. A component without this
        error has sigma 0.
    period, damping : float
        Of a second-order process: natural period [s] and damping ratio. An infinite period: the process is ``block``.
    driven : bool
        False: the second-order process has no driving noise. It starts with the sigma of ``block`` and dies away.
    factors : tuple of Factor
        What the process is multiplied with.
    exact : StateBlock or None
        The process that is multiplied with the factors, where ``block`` describes the product.
    """

    block: StateBlock
    period: float = inf
    damping: float = 1.0
    driven: bool = True
    factors: tuple[Factor, ...] = ()
    exact: StateBlock | None = None

    @property
    def name(self) -> str:
        """Name within the instrument."""
        return self.block.name

    @property
    def second_order(self) -> bool:
        """Whether each component has two states, value and rate."""
        return self.period < inf

    def transition(self, elapsed: float) -> Array:
        """(2, 2) transition matrix of value and rate of a second-order process over a time [s]."""
        return np.array(oscillation(elapsed, 2.0 * pi / self.period, self.damping)).reshape(2, 2)

    def covariance(self, component: int) -> Array:
        """(2, 2) covariance of value and rate of a second-order process at the start."""
        sigma = self.block.sigma[component]  # type: ignore[index]
        rate = 2.0 * pi / self.period if self.driven else 0.0
        return np.diag([sigma**2, (rate * sigma) ** 2])

    def noise(self, component: int, elapsed: float) -> Array:
        """(2, 2) covariance of the noise that a time adds to value and rate of a second-order process [s]."""
        if not self.driven:
            return np.zeros((2, 2))
        stationary, matrix = self.covariance(component), self.transition(elapsed)
        return np.asarray(stationary - matrix @ stationary @ matrix.T)
