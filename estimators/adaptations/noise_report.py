"""The report of the noise in use: ``sigma_<component>.<instrument>``, and a further number of each instrument."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simnav.structures import length, structure
from simnav.types import KINDS, Array, Instruments

__all__ = ["CHOSEN", "NoiseReport"]

#: What was chosen for an instrument: three sigmas, in the units of ``KINDS[kind].errors``, and a further number.
CHOSEN = structure(sigma=3, number=float)


class NoiseReport:
    """The report of the module. Before the first measurement of an instrument it holds the sigma of its datasheet.

    Parameters
    ----------
    instruments : Instruments
        The j instruments of a run.
    names : sequence of str
        Those of which is reported.
    number : str
        What the further number is reported as, once it is not 0; empty if it is not.
    with_zero : bool
        Whether a number of 0 is reported, too.

    Attributes
    ----------
    values : (j, 4) array
        `CHOSEN` of each instrument; NaN for what there is not.
    sigmas : list of (str, int, int)
        Label, row and component of each reported sigma.
    numbers : list of (str, int)
        Label and row of each reported number.
    """

    def __init__(
        self,
        instruments: Instruments,
        names: Sequence[str],
        number: str = "",
        with_zero: bool = False,
    ):
        self.values, self.with_zero = np.full((len(instruments), length(CHOSEN)), np.nan), with_zero
        self.sigmas: list[tuple[str, int, int]] = []
        self.numbers: list[tuple[str, int]] = []
        rows = self.rows
        for row, (name, sheet) in enumerate(instruments.items()):
            rows[row].sigma[: len(sheet.sigma)] = sheet.sigma
            if name in names:
                self.sigmas += [(f"sigma_{e}.{name}", row, a) for a, e in enumerate(KINDS[sheet.kind].errors)]
                self.numbers += [(f"{number}.{name}", row)] if number else []

    @property
    def rows(self) -> NDArray[Any]:
        """(j,) array of `CHOSEN`: the values by name, a view."""
        return self.values.view(CHOSEN)[:, 0]

    def note(self, row: int, sigma: Sequence[float], number: float) -> None:
        """Report what was chosen for an instrument: nothing if the first sigma is NaN."""
        if sigma[0] == sigma[0]:
            rows = self.rows
            rows["sigma"][row, : len(sigma)] = sigma
            if number:
                rows["number"][row] = number

    def diagnostics(self) -> dict[str, float | Array]:
        """The present values by their labels."""
        rows = self.rows
        sigma = rows["sigma"].tolist()
        found: dict[str, float | Array] = {label: sigma[row][a] for label, row, a in self.sigmas}
        if self.numbers:
            numbers = rows["number"].tolist()
            for label, row in self.numbers:
                if numbers[row] == numbers[row]:
                    found[label] = numbers[row]
        return found

    def table(self, values: Array) -> dict[str, Array]:
        """The values of t steps by their labels, from (t, 4 j) `values`; no number that has not been reported."""
        rows = values.view(CHOSEN)
        found = {label: rows["sigma"][:, row, a] for label, row, a in self.sigmas}
        for label, row in self.numbers:
            numbers = rows["number"][:, row]
            if numbers[-1] == numbers[-1]:
                found[label] = numbers
        return found
