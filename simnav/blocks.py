"""Blocks of states that an instrument brings along: what its reading depends on beyond the motion of the vessel.

A datasheet declares its blocks (`simnav.types.Datasheet.blocks`): a receiver's clock, the iron around a magnetometer,
the scale of a DVL, the delay of a time stamp. Estimators append them to their state, and the simulator draws their true
values. With the initial standard deviation sigma, the density q and the correlation time T of a component x, and white
noise w of unit density, the processes are

- ``constant``: x' = 0
- ``random_walk``: x' = q w
- ``gauss_markov``: x' = -x/T + sigma sqrt(2/T) w, with the stationary standard deviation sigma
- ``clock``, of two components, bias b and drift d: b' = d + q_b w_b, d' = q_d w_d

Source: P. D. Groves, *Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems*, 2nd ed., Artech
House 2013, sections 9.4.2 (clock) and 14.2; A. Gelb (ed.), *Applied Optimal Estimation*, MIT Press 1974, section 3.6.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite
from typing import Literal, NamedTuple, get_args

import numpy as np

from simnav.compiled import Array
from simnav.spec import UNITS

__all__ = ["LEVER_ARM", "NAVIGATION", "Process", "Rates", "StateBlock", "blocks_of"]

Process = Literal["constant", "random_walk", "gauss_markov", "clock"]
_PROCESSES: tuple[str, ...] = get_args(Process)
#: In a Jacobian by block, the name of position, velocity and attitude.
NAVIGATION = "navigation"
#: The block of an instrument whose place in the vessel is not known well: what its lever arm is more than the datasheet
#: says, forward, starboard, down.
LEVER_ARM = "lever_arm"

_NAME = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")


class Rates(NamedTuple):
    """How one component x of a block moves: x' = -x times ``decay``, and white noise of the density ``noise``.

    Attributes
    ----------
    variance : float
        Variance at the start of a run [x^2].
    decay : float
        Inverse of the correlation time [1/s].
    noise : float
        Density of the driving noise [x^2/s].
    """

    variance: float
    decay: float
    noise: float


@dataclass(frozen=True)
class StateBlock:
    """States that one instrument needs, or that several share.

    Attributes
    ----------
    name : str
        Name within the instrument, in snake_case: the key in `simnav.kinds.NavigationPoint.blocks` and in a Jacobian by
        block.
    size : int
        Number k of components.
    units : str or sequence of str
        Unit of the components, or of each of them: keys of `simnav.spec.UNITS`, empty for a number without a unit.
        Values are in SI units and radians.
    sigma : float or sequence of float
        Standard deviation of the components at the start of a run, SI units. Their mean is zero.
    process : str
        How the states move: ``constant``, ``random_walk``, ``gauss_markov`` or ``clock`` (see the module).
    density : float or sequence of float
        Of the driving noise of a random walk [unit/sqrt(s)], or of bias and drift of a clock.
    correlation_time : float
        Of a Gauss-Markov process [s].
    shared : str
        Name under which several instruments have this block together, in snake_case. Empty: it is the instrument's own.

    Raises
    ------
    ValueError
        If a field is not valid.
    """

    name: str
    size: int
    units: str | tuple[str, ...]
    sigma: float | tuple[float, ...]
    process: Process = "constant"
    density: float | tuple[float, ...] = 0.0
    correlation_time: float = inf
    shared: str = ""

    def __deepcopy__(self, memo: object) -> StateBlock:
        """Itself: it never changes, and an estimator that takes late readings is copied in each step."""
        return self

    def __post_init__(self) -> None:
        for field in ("name", *(["shared"] if self.shared else [])):
            text = getattr(self, field)
            if not isinstance(text, str) or not _NAME.fullmatch(text) or text == NAVIGATION:
                raise ValueError(f"{field} = {text!r} of a block of states should be in snake_case, like 'iron'")
        if isinstance(self.size, bool) or not isinstance(self.size, int) or self.size < 1:
            raise ValueError(f"block {self.name!r}: size = {self.size!r} should be an integer of 1 or more")
        if self.process not in _PROCESSES:
            valid = ", ".join(_PROCESSES)
            raise ValueError(f"block {self.name!r}: process = {self.process!r} should be one of: {valid}")
        units = (self.units,) * self.size if isinstance(self.units, str) else tuple(self.units)
        if len(units) != self.size or any(unit and unit not in UNITS for unit in units):
            raise ValueError(
                f"block {self.name!r}: units = {self.units!r} should be one unit or {self.size}, each one of: "
                f"{', '.join(UNITS)}"
            )
        object.__setattr__(self, "units", units)
        for field in ("sigma", "density"):
            object.__setattr__(self, field, self._figures(field))
        if self.process == "clock" and self.size != 2:
            raise ValueError(f"block {self.name!r}: a clock has size = 2, bias and drift, not {self.size}")
        if self.process == "gauss_markov" and not 0.0 < self.correlation_time < inf:
            raise ValueError(
                f"block {self.name!r}: correlation_time = {self.correlation_time!r} of a Gauss-Markov process should "
                "be above 0 and finite"
            )

    def _figures(self, field: str) -> tuple[float, ...]:
        given = getattr(self, field)
        if type(given) is float:
            figures = [given] * self.size
        elif type(given) is tuple and len(given) == self.size and all(type(x) is float for x in given):
            figures = [*given]
        else:
            try:
                figures = np.broadcast_to(np.asarray(given, dtype=np.float64), (self.size,)).tolist()
            except (TypeError, ValueError):
                figures = []
        if not figures or not all(isfinite(x) and x >= 0.0 for x in figures):
            raise ValueError(
                f"block {self.name!r}: {field} = {given!r} should be one number or {self.size}, finite and not negative"
            )
        return tuple(figures)

    @classmethod
    def stationary(
        cls,
        name: str,
        size: int,
        units: str | tuple[str, ...],
        sigma: float | tuple[float, ...],
        correlation_time: float,
    ) -> StateBlock:
        """A block of a constant sigma: Gauss-Markov, or constant where the correlation time [s] is infinite."""
        if correlation_time == inf:
            return cls(name, size, units, sigma)
        return cls(name, size, units, sigma, "gauss_markov", correlation_time=correlation_time)

    def label(self, instrument: str) -> str:
        """The name among all blocks of a run: the shared one, or ``INSTRUMENT.NAME``."""
        return self.shared or f"{instrument}.{self.name}"

    @property
    def varies(self) -> bool:
        """Whether a run may draw another value than zero."""
        return any(self.sigma) or (self.process in ("random_walk", "clock") and any(self.density))  # type: ignore[arg-type]

    def rates(self) -> list[Rates]:
        """How each component moves. The noise of a clock is not in it: its components are not independent (`noise`)."""
        assert isinstance(self.sigma, tuple)
        assert isinstance(self.density, tuple)
        if self.process == "gauss_markov":
            return [Rates(s * s, 1.0 / self.correlation_time, 2.0 * s * s / self.correlation_time) for s in self.sigma]
        if self.process == "random_walk":
            return [Rates(s * s, 0.0, q * q) for s, q in zip(self.sigma, self.density, strict=True)]
        return [Rates(s * s, 0.0, 0.0) for s in self.sigma]

    def transition(self, elapsed: float) -> Array:
        """(k, k) transition matrix over a time [s]."""
        _, decay, _ = np.array(self.rates()).T
        matrix = np.diag(np.exp(-decay * elapsed))
        if self.process == "clock":
            matrix[0, 1] = elapsed
        return matrix

    def noise(self, elapsed: float) -> Array:
        """(k, k) covariance of the noise that a time adds [s]."""
        if self.process == "clock":
            b, d = (q * q for q in self.density)  # type: ignore[union-attr]
            t = elapsed
            return np.array([[b * t + d * t**3 / 3.0, d * t**2 / 2.0], [d * t**2 / 2.0, d * t]])
        _, decay, density = np.array(self.rates()).T
        if self.process == "gauss_markov":
            return np.diag(density * -np.expm1(-2.0 * decay * elapsed) / (2.0 * decay))
        return np.diag(density * elapsed)

    def covariance(self, elapsed: float) -> Array:
        """(k, k) covariance of the states at a time after the start [s], before any measurement."""
        matrix = self.transition(elapsed)
        sigma = np.asarray(self.sigma)
        return np.asarray(matrix @ np.diag(sigma**2) @ matrix.T + self.noise(elapsed))


def blocks_of(declared: Iterable[tuple[str, Sequence[StateBlock]]]) -> Mapping[str, StateBlock]:
    """All blocks of a run by label, each once.

    Parameters
    ----------
    declared : iterable of (str, sequence of StateBlock)
        Names of instruments, and their blocks.

    Raises
    ------
    ValueError
        If two instruments declare a shared block differently, or one instrument has two blocks of one name.
    """
    found: dict[str, tuple[str, StateBlock]] = {}
    for instrument, blocks in declared:
        names = [block.name for block in blocks]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"instrument {instrument!r} has two blocks of states of the name {name!r}")
        for block in blocks:
            owner, first = found.setdefault(block.label(instrument), (instrument, block))
            for field in ("size", "units", "sigma", "process", "density", "correlation_time"):
                if getattr(first, field) != getattr(block, field):
                    raise ValueError(
                        f"instruments {owner!r} and {instrument!r} share the block {block.shared!r}, but its {field} "
                        f"is {getattr(first, field)!r} for one and {getattr(block, field)!r} for the other; they "
                        "should agree"
                    )
    return {label: block for label, (_, block) in found.items()}
