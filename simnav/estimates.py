"""The estimates of some successive steps in arrays, as an estimator may return them by one call."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from simnav.types import Array, Estimate, Flags

__all__ = ["Estimates"]

_VECTORS = ("position", "velocity", "attitude", "covariance")


@dataclass(eq=False, slots=True)
class Estimates:
    """The estimates at the ends of t successive steps. All of them hold the same vectors, components and diagnostics.

    Attributes
    ----------
    time : (t,) array
        Times of validity [s]: the ends of the steps.
    position, velocity, attitude : (t, 3) array or None
        The vectors of `Estimate`; None for one that is not estimated.
    covariance : (t, 9, 9) array or None
        Covariances of the errors.
    estimated : (9,) bool array or None
        As of `Estimate`.
    diagnostics : dict of str to (t, ...) array
        Diagnostics and further states by name, as a trial keeps them.
    flagged : list of (int, str, float)
        Number of the step, source and time of each measurement that is considered faulty, in order of the steps.
    """

    time: Array
    position: Array | None = None
    velocity: Array | None = None
    attitude: Array | None = None
    covariance: Array | None = None
    estimated: Flags | None = None
    diagnostics: dict[str, Array] = field(default_factory=dict)
    flagged: list[tuple[int, str, float]] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self.time)

    @staticmethod
    def of(estimates: Iterable[Estimate]) -> Estimates:
        """The vectors and the further states of estimates that all hold the same; diagnostics and flags are left out.

        Parameters
        ----------
        estimates : iterable of Estimate
            At least one. Each is copied before the next one is asked for.
        """
        times: list[float] = []
        vectors: dict[str, list[Array]] = {}
        states: dict[str, list[Array]] = {}
        estimated = None
        for estimate in estimates:
            times.append(estimate.time)
            estimated = estimate.estimated
            for name in _VECTORS:
                if (vector := getattr(estimate, name)) is not None:
                    vectors.setdefault(name, []).append(np.array(vector))
            for name, (value, sigma) in estimate.states.items():
                states.setdefault(f"state.{name}", []).append(np.array(value))
                states.setdefault(f"sigma.{name}", []).append(np.array(sigma))
        arrays = (np.array(vectors[name]) if name in vectors else None for name in _VECTORS)
        position, velocity, attitude, covariance = arrays
        diagnostics = {name: np.array(parts) for name, parts in states.items()}
        return Estimates(np.array(times), position, velocity, attitude, covariance, estimated, diagnostics)
