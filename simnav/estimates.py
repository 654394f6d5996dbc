"""The estimates of some successive steps in arrays, as an estimator may return them by one call."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from simnav.types import Array, Estimate, Flags

__all__ = ["Estimates"]


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
    diagnostics : mapping of str to (t, ...) array
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

    def __iter__(self) -> Iterator[Estimate]:
        """Each of them; further states are among the diagnostics."""
        vectors = (self.position, self.velocity, self.attitude, self.covariance)
        for k, time in enumerate(self.time.tolist()):
            diagnostics = {n: a[k] if a.ndim > 1 else float(a[k]) for n, a in self.diagnostics.items()}
            flags = [(source, when) for step, source, when in self.flagged if step == k]
            yield Estimate(time, *(None if v is None else v[k] for v in vectors), self.estimated, diagnostics, flags)

    @staticmethod
    def of(estimates: Sequence[Estimate]) -> Estimates:
        """Estimates that hold the same vectors, components, diagnostics and states, in arrays.

        Parameters
        ----------
        estimates : sequence of Estimate
            At least one.
        """

        def stacked(name: str) -> Array | None:
            return None if getattr(first, name) is None else np.array([getattr(e, name) for e in estimates])

        first = estimates[0]
        diagnostics = {name: np.array([e.diagnostics[name] for e in estimates]) for name in first.diagnostics}
        for name in first.states:
            for what, part in (("state", 0), ("sigma", 1)):
                diagnostics[f"{what}.{name}"] = np.array([e.states[name][part] for e in estimates])
        return Estimates(
            np.array([e.time for e in estimates]), *map(stacked, ("position", "velocity", "attitude", "covariance")),
            first.estimated, diagnostics, [(k, *flag) for k, e in enumerate(estimates) for flag in e.flagged],
        )  # fmt: skip
