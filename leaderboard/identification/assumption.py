"""What a fit assumes of a log: datasheets, delays of instruments, heading at the start; and what may vary in it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import exp

import numpy as np

from simnav.types import Array, Datasheet, ImuDatasheet, Instruments, TriadDatasheet

__all__ = ["HEADING", "Assumption", "Parameter", "with_all"]

#: The name that the heading at the start has in place of an instrument.
HEADING = "heading"
#: A step of the derivatives by the logarithm of a size, and by other values as a part of their spread.
_STEP, _PART = 1e-3, 5e-3


@dataclass(frozen=True, eq=False)
class Assumption:
    """What is assumed of a log.

    Attributes
    ----------
    instruments : Instruments
        The datasheets.
    delays : mapping of str to float
        By how much the stamps of an instrument are late [s]; those that are not named are right.
    heading : float
        By how much the heading at the start is more than the log says [rad].
    """

    instruments: Instruments
    delays: Mapping[str, float] = field(default_factory=dict)
    heading: float = 0.0

    def with_sheet(self, name: str, change: Callable[[Datasheet], Datasheet]) -> Assumption:
        """With another datasheet of an aid."""
        known = self.instruments
        sheets = [change(s) if n == name else s for n, s in known.items()]
        return replace(self, instruments=Instruments(sheets, known.imu, known.step))

    def with_imu(self, change: Callable[[ImuDatasheet], ImuDatasheet]) -> Assumption:
        """With another datasheet of the IMU."""
        known = self.instruments
        assert known.imu is not None
        return replace(self, instruments=Instruments(list(known.values()), change(known.imu), known.step))


@dataclass(frozen=True)
class Parameter:
    """A number of an assumption that a fit varies.

    Attributes
    ----------
    instrument : str
        Name of the instrument, of a triad ``gyroscope`` or ``accelerometer``; `HEADING` for the start.
    figure : str
        Field of the datasheet; ``delay``, or ``error`` of the heading at the start.
    components : tuple of int
        The components that the number is for; empty for a figure that is one number.
    first : float
        Value to begin with, SI units.
    spread : float
        Prior standard deviation: of the logarithm of a size, otherwise of the value.
    size : bool
        Whether it is above zero, and fitted as a logarithm.
    part : str
        What the components are called; empty for all.
    step : float
        Step of the derivatives; 0: a usual one. Where it is given, they are central differences: the delay of a reading
        moves it to other samples of the IMU, with other noise, which is in neither side more than in the other.
    """

    instrument: str
    figure: str
    components: tuple[int, ...]
    first: float
    spread: float
    size: bool = True
    part: str = ""
    step: float = 0.0

    @property
    def label(self) -> str:
        """As it is written in a table."""
        return f"{self.instrument}.{self.figure}" + (f" ({self.part})" if self.part else "")

    @property
    def steps(self) -> tuple[float, float]:
        """Where the two runs of a derivative by the number that is fitted are."""
        if self.step:
            return -self.step, self.step
        return 0.0, _STEP if self.size else _PART * self.spread

    def value(self, x: float) -> float:
        """The value in SI units, from what is fitted: for a size, the logarithm of its ratio to the first value."""
        return self.first * exp(x) if self.size else self.first + x

    def put(self, assumed: Assumption, x: float) -> Assumption:
        """The assumption with this number."""
        value = self.value(x)
        if self.instrument == HEADING:
            return replace(assumed, heading=value)
        if self.figure == "delay":
            return replace(assumed, delays={**assumed.delays, self.instrument: value})
        if self.instrument in ("gyroscope", "accelerometer"):
            return assumed.with_imu(lambda imu: self._triad(imu, value))
        return assumed.with_sheet(self.instrument, lambda sheet: self._sheet(sheet, value))

    def _triad(self, imu: ImuDatasheet, value: float) -> ImuDatasheet:
        triad: TriadDatasheet = getattr(imu, self.instrument)
        return replace(imu, **{self.instrument: replace(triad, **{self.figure: value})})  # type: ignore[arg-type]

    def _sheet(self, sheet: Datasheet, value: float) -> Datasheet:
        if not self.components:
            return replace(sheet, **{self.figure: value})  # type: ignore[arg-type]
        new: Array = getattr(sheet, self.figure).copy()
        new[list(self.components)] = value
        return replace(sheet, **{self.figure: new})  # type: ignore[arg-type]


def with_all(assumed: Assumption, parameters: Sequence[Parameter], x: Array) -> Assumption:
    """The assumption with all numbers of a fit."""
    for parameter, number in zip(parameters, np.asarray(x).tolist(), strict=True):
        assumed = parameter.put(assumed, number)
    return assumed
