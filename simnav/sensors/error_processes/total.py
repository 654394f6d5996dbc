"""The sum of the error processes of an instrument in one run."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from simnav.blocks import StateBlock
from simnav.declared_process import DeclaredProcess
from simnav.kinds import Kind
from simnav.sensors.error_processes.factors import Factors
from simnav.sensors.error_processes.process import ErrorProcessSpec, Sampled
from simnav.streams import stream
from simnav.types import Array, TapStates
from simnav.world.surroundings import Surroundings

__all__ = ["Total", "TotalError", "declared_processes", "in_sea", "labels_of", "white_of"]


def labels_of(specs: Sequence[ErrorProcessSpec]) -> list[str]:
    """The names of the processes of an instrument; those without a name are numbered by kind from the second on.

    Raises
    ------
    ValueError
        If two have the same name.
    """
    seen: Counter[str] = Counter()
    names = []
    for spec in specs:
        seen[spec.kind] += 1
        count = seen[spec.kind]
        names.append(spec.name or (spec.kind if count == 1 else f"{spec.kind}_number_{count}"))
    for name in names:
        if names.count(name) > 1:
            raise ValueError(f"two processes have the name {name!r}; give one of them another name")
    return names


def declared_processes(specs: Sequence[ErrorProcessSpec], kind: Kind) -> tuple[DeclaredProcess, ...]:
    """The coloured processes that a datasheet has."""
    found = (spec.declared(name, kind) for name, spec in zip(labels_of(specs), specs, strict=True) if spec.stated)
    return tuple(process for process in found if process is not None)


def white_of(specs: Sequence[ErrorProcessSpec], kind: Kind) -> Array:
    """The (d,) variance of the white noise that a datasheet adds, with all factors equal to 1."""
    return np.asarray(sum((spec.white(kind) ** 2 for spec in specs if spec.stated), np.zeros(len(kind.errors))))


class Total(NamedTuple):
    """What the processes do to n readings.

    Attributes
    ----------
    error : (n, d) array
        The errors that they add.
    variance : (n, d) array
        Variance of their white part.
    lost : (n,) array of bool
        The readings that are lost.
    """

    error: Array
    variance: Array
    lost: NDArray[np.bool_]


class _Part(NamedTuple):
    spec: ErrorProcessSpec
    process: Sampled | None
    white: Array
    factors: Factors
    rng: np.random.Generator
    state: dict[str, float]


class TotalError:
    """The processes of one instrument, or of one of its channels.

    Parameters
    ----------
    specs : sequence of ErrorProcessSpec
        The processes.
    kind : Kind
        Properties of the instrument.
    seed : int
        Seed of the run.
    *names : str
        Names of the random streams: that of the instrument, and of the channel.
    """

    def __init__(self, specs: Sequence[ErrorProcessSpec], kind: Kind, seed: int, *names: str):
        self._kind = kind
        self._parts = []
        for name, spec in zip(labels_of(specs), specs, strict=True):
            rng = stream(seed, "instrument", *names, "error", name)
            process = spec.sampled(kind, rng)
            self._parts.append(_Part(spec, process, spec.white(kind) ** 2, Factors(spec.factors()), rng, {}))

    def at(self, tap: TapStates, observed: Array, surroundings: Surroundings) -> Total:
        """The processes at the samples of the next block.

        Parameters
        ----------
        tap : TapStates
            True states at the n sample times.
        observed : (n, d) array
            Readings without bias and noise.
        surroundings : Surroundings
            The surroundings of the run.
        """
        error, variance = np.zeros(observed.shape), np.zeros(observed.shape)
        lost = np.zeros(len(tap.time), dtype=np.bool_)
        for part in self._parts:
            factor = part.factors.at(tap, observed, surroundings)
            if part.spec.act == "loses":
                lost |= part.spec.lost(tap.time, np.broadcast_to(factor, observed.shape)[:, 0], part.rng, part.state)
                continue
            if part.process is not None:
                error += part.process.sample(tap.time) * factor
            variance += part.white * factor**2
        return Total(error, variance, lost)

    def rounded(self, value: Array) -> Array:
        """The (n, d) readings as the instrument delivers them."""
        for part in self._parts:
            if part.spec.act == "rounds":
                value = part.spec.rounded(value, self._kind)
        return value


def in_sea(process: DeclaredProcess, height: float) -> DeclaredProcess:
    """A declared process in a sea of a known significant height [m]: without the factor of the wave height."""
    known = [factor for factor in process.factors if factor.name == "wave_height"]
    if not known:
        return process
    times = float(np.prod([height / factor.reference for factor in known]))
    return replace(
        process,
        block=_scaled(process.block, times),
        exact=None if process.exact is None else _scaled(process.exact, times),
        factors=tuple(factor for factor in process.factors if factor not in known),
    )


def _scaled(block: StateBlock, times: float) -> StateBlock:
    sigma, density = (tuple(times * x for x in np.atleast_1d(figures)) for figures in (block.sigma, block.density))
    return replace(block, sigma=sigma, density=density)
