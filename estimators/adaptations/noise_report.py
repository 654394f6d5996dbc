"""The report of the noise in use: ``sigma_<component>.<instrument>``, and a further number of each instrument."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from simnav.types import KINDS, Array, Instruments

__all__ = ["NoiseReport"]


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
    said : callable, optional
        The numbers as they are reported.
    with_zero : bool
        Whether a number of 0 is reported, too.

    Attributes
    ----------
    values : (j, 4) array
        Three sigmas and the number of each instrument; NaN for what there is not.
    columns : list of (str, int)
        Label and place in ``values`` of each sigma.
    numbers : list of (str, int)
        The same of each number.
    """

    def __init__(
        self, instruments: Instruments, names: Sequence[str], number: str = "",
        said: Callable[[Array], Array] | None = None, with_zero: bool = False,
    ):  # fmt: skip
        self.values, self._said, self.with_zero = np.full((len(instruments), 4), np.nan), said, with_zero
        self.columns: list[tuple[str, int]] = []
        self.numbers: list[tuple[str, int]] = []
        for row, (name, sheet) in enumerate(instruments.items()):
            self.values[row, : len(sheet.sigma)] = sheet.sigma
            if name in names:
                self.columns += [(f"sigma_{e}.{name}", 4 * row + a) for a, e in enumerate(KINDS[sheet.kind].errors)]
                self.numbers += [(f"{number}.{name}", 4 * row + 3)] if number else []

    def note(self, row: int, sigma: Sequence[float], number: float) -> None:
        """Report what was chosen for an instrument: nothing if the first sigma is NaN."""
        if sigma[0] == sigma[0]:
            self.values[row, : len(sigma)] = sigma
            if number:
                self.values[row, 3] = number

    def diagnostics(self) -> dict[str, float | Array]:
        """The present values by their labels."""
        values = self.values.ravel().tolist()
        found: dict[str, float | Array] = {label: values[at] for label, at in self.columns}
        if self.numbers:
            numbers = self.said(self.values[:, 3]).tolist()
            found |= {label: numbers[at // 4] for label, at in self.numbers if numbers[at // 4] == numbers[at // 4]}
        return found

    def table(self, values: Array) -> dict[str, Array]:
        """The values of t steps by their labels, from a (t, 4 j) array; no number that has not been reported."""
        found = {label: values[:, at] for label, at in self.columns}
        for label, at in self.numbers:
            if values[-1, at] == values[-1, at]:
                found[label] = self.said(values[:, at])
        return found

    def said(self, numbers: Array) -> Array:
        """Numbers as they are reported."""
        return numbers if self._said is None else self._said(numbers)
