"""Two ways to take an error that is a sum of processes: merged into one state a component, or apart.

Filters and windows merge. With the turn-on bias and the in-run bias in one state they have half the states, and give
away little. Oracles and the bound take each process as a state of its own, which is exact. Both read one declaration
(`simnav.estimators.models.declared_errors`), and a fast process is white noise in both.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import inf

import numpy as np

from simnav.blocks import Rates, StateBlock
from simnav.types import Array, Datasheet

from .declared_errors import DeclaredError, errors_of
from .equations import equation_of

__all__ = ["merged", "merged_states", "separate_states", "with_variance"]


def merged(error: DeclaredError) -> list[Rates]:
    """One Gauss-Markov state for each component of an error, in place of all its slow processes.

    With the sigma b of the turn-on bias and the sigma s and correlation time tau of the in-run bias, their sum has the
    autocovariance ``b^2 + s^2 exp(-t/tau)``. One state with the variance ``b^2 + s^2`` and the correlation time
    ``tau (b^2 + s^2) / s^2`` has the same value and the same slope at lag 0, and a smaller autocovariance at all other
    lags, so its variance after averaging is not too small. It is exact if b or s is zero. A random walk adds its
    density. Several Gauss-Markov processes count as one with the same value and slope at lag 0.

    Parameters
    ----------
    error : DeclaredError
        An error whose processes are constants, random walks and Gauss-Markov processes.

    Returns
    -------
    list of Rates
        One for each component; all zero for an error without processes.
    """
    slow = [(p.process, p.correlation_time, p.rates()) for p in error.slow]
    return [_merged([(process, time, rates[k]) for process, time, rates in slow]) for k in range(error.size)]


def _merged(processes: list[tuple[str, float, Rates]]) -> Rates:
    """One component."""
    constant = walk = moving = 0.0
    time = inf
    for process, of_process, (variance, _, noise) in processes:
        if process != "gauss_markov":
            constant, walk = constant + variance, walk + noise
        elif variance:
            time = of_process if not moving else (moving + variance) / (moving / time + variance / of_process)
            moving += variance
    if not moving:
        return Rates(constant, 0.0, walk)
    total = constant + moving
    return Rates(total, moving / (total * time), 2.0 * moving / time + walk)


def merged_states(sheet: Datasheet) -> dict[str, list[Rates]]:
    """The states that a filter or window has for an aid, by name of the error, in the order of the compiled loops.

    These are ``bias``, with ``current`` behind it for a log, and ``scale``, with ``misalignment`` behind it for a
    velocity in body axes. Errors that are zero have no states, unless another one has its place behind them. The scale
    factor of a depth sensor and the deviation of a compass have no states.
    """
    errors = errors_of(sheet)
    groups = [("bias", "current"), *([("scale", "misalignment")] if equation_of(sheet).calibrates else [])]
    found: dict[str, list[Rates]] = {}
    for group in groups:
        known = [errors[name] for name in group if name in errors]
        if any(error.slow for error in known):
            found |= {error.name: merged(error) for error in known}
    return found


def separate_states(error: DeclaredError) -> list[tuple[StateBlock, int, Rates]]:
    """A state for each component of each slow process that is not zero: process, component and rates."""
    return [
        (process, k, rates)
        for process in error.slow
        for k, rates in enumerate(process.rates())
        if rates.variance or rates.noise
    ]


def with_variance(noise: Array, processes: Iterable[StateBlock]) -> Array:
    """(k,) variances and those of processes without states; a random walk counts with that of its first second."""
    for process in processes:
        walks = process.process == "random_walk"
        noise = noise + [rates.variance + (rates.noise if walks else 0.0) for rates in process.rates()]
    return np.asarray(noise)
