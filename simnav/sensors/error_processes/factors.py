"""The factors of error processes: quantities of the motion and of the surroundings that an error is proportional to.

A scenario names them in the table ``proportional_to`` of a process, each with the value at which the factor is 1:
``proportional_to = { speed_m_s = 5.0 }``. `register_factor` registers one more.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from math import pi

import numpy as np

from simnav.declared_process import Factor, Oscillation, oscillation
from simnav.plugins import PluginError
from simnav.spec import UNITS
from simnav.types import Array, TapStates
from simnav.world.surroundings import Surroundings

__all__ = ["FACTORS", "FactorKind", "Factors", "named_factors", "register_factor"]

#: The (n,) or (n, d) values of a factor, SI units, from the n true states at the samples of an instrument, its (n, d)
#: readings without error, and the surroundings.
Value = Callable[[TapStates, Array, Surroundings], Array]


@dataclass(frozen=True)
class FactorKind:
    """A registered factor.

    Attributes
    ----------
    name : str
        Name in snake_case.
    units : tuple of str
        Units in which a scenario may give its reference, keys of `simnav.spec.UNITS`; empty for a pure number.
    meaning : str
        What it is, in a few words.
    make : callable
        Makes the function of one run from a `Factor`.
    remembers : bool
        True: a value depends on earlier samples.
    parameters : tuple of str
        Names of the parameters that it needs. A factor with parameters belongs to a process of its own, and is not
        named in ``proportional_to``.
    """

    name: str
    units: tuple[str, ...]
    meaning: str
    make: Callable[[Factor], Value]
    remembers: bool = False
    parameters: tuple[str, ...] = ()


#: All factors by name.
FACTORS: dict[str, FactorKind] = {}


def register_factor(name: str, *units: str, meaning: str) -> Callable[[Value], Value]:
    """Register a function as a factor (decorator).

    Parameters
    ----------
    name : str
        Name in snake_case.
    *units : str
        Units of its reference in TOML; none for a pure number.
    meaning : str
        What it is, in a few words.

    Raises
    ------
    PluginError
        If the name is taken, or a unit is not known.
    """

    def wrap(value: Value) -> Value:
        _add(FactorKind(name, units, meaning, lambda factor: value))
        return value

    return wrap


def _add(kind: FactorKind) -> None:
    if kind.name in FACTORS:
        raise PluginError(f"there is a factor {kind.name!r} already: {FACTORS[kind.name].meaning}")
    for unit in kind.units:
        if unit not in UNITS:
            raise PluginError(f"factor {kind.name!r}: the unit {unit!r} is unknown; there are: {', '.join(UNITS)}")
    FACTORS[kind.name] = kind


def named_factors() -> dict[str, tuple[str, str]]:
    """The TOML keys of ``proportional_to``: name of the factor, and its unit (empty for a pure number)."""
    found: dict[str, tuple[str, str]] = {}
    for kind in FACTORS.values():
        if not kind.parameters:
            found |= {f"{kind.name}_{unit}" if unit else kind.name: (kind.name, unit) for unit in kind.units or ("",)}
    return found


class Factors:
    """The product of factors in one run.

    Parameters
    ----------
    factors : iterable of Factor
        The factors.
    """

    def __init__(self, factors: Iterable[Factor]):
        self._parts = [(factor.reference, FACTORS[factor.name].make(factor)) for factor in factors]

    def __bool__(self) -> bool:
        return bool(self._parts)

    def at(self, tap: TapStates, observed: Array, surroundings: Surroundings) -> Array:
        """The (n, 1) or (n, d) product at n samples; they follow those of the call before."""
        product = np.ones((len(tap.time), 1))
        for reference, value in self._parts:
            found = np.asarray(value(tap, observed, surroundings), dtype=np.float64)
            product = product * (found if found.ndim == 2 else found[:, None]) / reference
        return product


@register_factor("speed", "m_s", "kn", meaning="speed over the ground")
def _speed(tap: TapStates, observed: Array, surroundings: Surroundings) -> Array:
    return np.asarray(np.sqrt(np.sum(tap.velocity**2, axis=1)))


@register_factor("reading", "m", "m_s", "km", "kn", meaning="the size of each component of the reading, like a range")
def _reading(tap: TapStates, observed: Array, surroundings: Surroundings) -> Array:
    return np.abs(observed)


@register_factor("secant_latitude", meaning="1 / cos(latitude)")
def _secant_latitude(tap: TapStates, observed: Array, surroundings: Surroundings) -> Array:
    return np.asarray(1.0 / np.cos(tap.position[:, 0]))


@register_factor("sin_heading", meaning="sine of the heading")
def _sin_heading(tap: TapStates, observed: Array, surroundings: Surroundings) -> Array:
    return np.sin(tap.attitude[:, 2])


@register_factor("cos_heading", meaning="cosine of the heading")
def _cos_heading(tap: TapStates, observed: Array, surroundings: Surroundings) -> Array:
    return np.cos(tap.attitude[:, 2])


@register_factor("sin_2heading", meaning="sine of twice the heading")
def _sin_2heading(tap: TapStates, observed: Array, surroundings: Surroundings) -> Array:
    return np.sin(2.0 * tap.attitude[:, 2])


@register_factor("cos_2heading", meaning="cosine of twice the heading")
def _cos_2heading(tap: TapStates, observed: Array, surroundings: Surroundings) -> Array:
    return np.cos(2.0 * tap.attitude[:, 2])


@register_factor("roll", "deg", meaning="roll angle")
def _roll(tap: TapStates, observed: Array, surroundings: Surroundings) -> Array:
    return np.asarray(tap.attitude[:, 0])


@register_factor("pitch", "deg", meaning="pitch angle")
def _pitch(tap: TapStates, observed: Array, surroundings: Surroundings) -> Array:
    return np.asarray(tap.attitude[:, 1])


@register_factor("turn_rate", "deg_s", "deg_min", meaning="size of the rate of turn")
def _turn_rate(tap: TapStates, observed: Array, surroundings: Surroundings) -> Array:
    return np.abs(tap.angular_rate[:, 2])


@register_factor("vertical_speed", "m_s", meaning="size of the vertical velocity of the vessel")
def _vertical_speed(tap: TapStates, observed: Array, surroundings: Surroundings) -> Array:
    return np.abs(tap.velocity[:, 2])


@register_factor("wave_height", "m", meaning="significant wave height; 0 without a sea")
def _wave_height(tap: TapStates, observed: Array, surroundings: Surroundings) -> Array:
    waves = surroundings.get("sea")
    return np.full(len(tap.time), 0.0 if waves is None else float(waves.sea.significant_height))


class _Squared:
    """The square of the roll angle over the square of its reference: the product divides by the reference once."""

    def __init__(self, factor: Factor):
        self._reference = factor.reference

    def __call__(self, tap: TapStates, observed: Array, surroundings: Surroundings) -> Array:
        return np.asarray(tap.attitude[:, 0] ** 2 / self._reference)


class _Ballistic:
    """Sum of the changes of the north velocity over cos(latitude), each dying away as a damped oscillation."""

    def __init__(self, factor: Factor):
        period, self._damping = factor.parameters["period"], factor.parameters["damping"]
        self._frequency = 2.0 * pi / period
        self._state = (0.0, 0.0)
        self._last: tuple[float, float] | None = None

    def __call__(self, tap: TapStates, observed: Array, surroundings: Surroundings) -> Array:
        north = tap.velocity[:, 0] / np.cos(tap.position[:, 0])
        out = np.empty(len(north))
        x, rate = self._state
        steps: Mapping[float, Oscillation] = {}
        for k, (t, v) in enumerate(zip(tap.time.tolist(), north.tolist(), strict=True)):
            if self._last is not None:
                elapsed = t - self._last[0]
                if elapsed not in steps:
                    steps = {elapsed: oscillation(elapsed, self._frequency, self._damping)}
                by = steps[elapsed]
                x, rate = by.value_by_value * x + by.value_by_rate * rate, by.rate_by_value * x + by.rate_by_rate * rate
                x += v - self._last[1]
            self._last = t, v
            out[k] = x
        self._state = x, rate
        return out


_add(FactorKind("roll_squared", ("deg",), "square of the roll angle over that of the reference", _Squared))
_add(
    FactorKind(
        "ballistic", ("m_s",), "changes of the north velocity that die away", _Ballistic, True, ("period", "damping")
    )
)
