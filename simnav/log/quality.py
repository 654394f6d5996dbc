"""How good the fixes of a reference are: fixed, float or none of both, and their standard deviations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from simnav.log.channel import Series, open_file
from simnav.log.spec import RecordedSpec
from simnav.log.table import LogError
from simnav.types import Array

__all__ = ["FIXED", "FLOATING", "Quality", "graded"]

FIXED, FLOATING = 1.0, 2.0


@dataclass(frozen=True, eq=False)
class Quality:
    """Of each fix of a reference.

    Attributes
    ----------
    time : (n,) array
        Times of the fixes [s].
    sigma : (n, 3) array
        Standard deviation of the position, north-east-down [m]; NaN: not known.
    solution : (n,) array
        1 fixed, 2 float; NaN: not said.
    left_out : int
        Number of fixes that are neither, which are left out.
    """

    time: Array
    sigma: Array
    solution: Array
    left_out: int = 0

    @property
    def sentence(self) -> str:
        """What is known, for the note of a recording; empty if nothing is."""
        told, total = [], len(self.time) + self.left_out
        if np.isfinite(self.solution).any():
            for name, value in (("fixed", FIXED), ("float", FLOATING)):
                told.append(f"{np.sum(self.solution == value) / total:.1%} {name}")
            told.append(f"{self.left_out / total:.1%} neither and not scored")
        known = np.isfinite(self.sigma).all(axis=1)
        if known.any():
            horizontal = float(np.median(np.hypot(self.sigma[known, 0], self.sigma[known, 1])))
            told.append(f"its own horizontal sigma of {horizontal:.3g} m is subtracted in the scores beyond it")
        return f"reference: {', '.join(told)}" if told else ""

    def at(self, time: Array) -> tuple[Array, Array]:
        """(n, 3) sigmas, interpolated, and (n,) solutions, those of the nearest fix, at n times."""
        sigma = np.stack([np.interp(time, self.time, column) for column in self.sigma.T], axis=-1)
        after = np.clip(np.searchsorted(self.time, time), 1, max(len(self.time) - 1, 1))
        if len(self.time) == 1:
            return sigma, np.full(len(time), self.solution[0])
        nearer = after - (time - self.time[after - 1] < self.time[after] - time)
        return sigma, self.solution[nearer]


def graded(log: RecordedSpec, recording: str, position: Series) -> tuple[Series, Quality | None]:
    """The fixes of a reference that count, and how good they are; None if the log says nothing of it.

    Raises
    ------
    LogError
        If there is no such column, or no fix is of a good solution.
    """
    spec, channel = log.reference, log.reference.position
    if spec.quality is None and position.sigma is None:
        return position, None
    sigma = np.full((len(position.time), 3), np.nan) if position.sigma is None else position.sigma
    solution = np.full(len(position.time), np.nan)
    if spec.quality is not None:
        table = open_file(log, channel.file, recording, channel.sentence, channel.talker, channel.where)[0]
        values = table.column(spec.quality)[1][np.searchsorted(table.line, position.line)]
        for number, names, own in (
            (FIXED, spec.fixed, spec.fixed_sigma),
            (FLOATING, spec.floating, spec.floating_sigma),
        ):
            here = np.isin(values, names)
            solution[here] = number
            if own is not None:
                unknown = here & ~np.isfinite(sigma).all(axis=1)
                sigma[unknown] = own
        good = np.isfinite(solution)
        if not good.any():
            raise LogError(
                f"{position.source}: no row has a value of fixed = {list(spec.fixed)} or floating = "
                f"{list(spec.floating)} in the column {spec.quality!r}; the first is {values[0]:g}"
            )
        rest = Series(position.source, position.time[good], position.value[good], position.line[good])
        return rest, Quality(rest.time, sigma[good], solution[good], int(np.sum(~good)))
    return position, Quality(position.time, sigma, solution)
