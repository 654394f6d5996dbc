"""Labels of a recording: what was wrong, with what, and when. Estimators do not receive them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

__all__ = ["CLOCK_JUMP", "REFLECTION", "FaultLabel"]

#: Kinds of labels that no fault of a scenario makes: of errors by reflections, which the surroundings make, and of the
#: first readings after a step of a receiver's clock.
REFLECTION, CLOCK_JUMP = "reflection", "clock_jump"


@dataclass(frozen=True, eq=False)
class FaultLabel:
    """One fault of a run. Estimators do not receive it.

    Attributes
    ----------
    kind : str
        Kind of the fault in the scenario (``outage``, ``gross_error``, ...).
    instruments : tuple of str
        Names of the instruments that it affects.
    start, end : float
        Beginning and end of the fault [s].
    parameters : mapping
        The parameters of the fault in the scenario (sizes, probability, correlation time), as fields of its
        specification, SI units.
    channels : tuple of str
        The channels of the instruments that it affects; empty: all.
    """

    kind: str
    instruments: tuple[str, ...]
    start: float
    end: float
    parameters: Mapping[str, Any] = field(default_factory=dict)
    channels: tuple[str, ...] = ()

    @property
    def where(self) -> str:
        """The affected instruments, with their channels in brackets, for a listing; empty without instruments."""
        names = ", ".join(self.instruments)
        return f"{names} [{', '.join(self.channels)}]" if self.channels else names
