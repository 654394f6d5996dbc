"""Raw readings and the instrument that solves them: an estimator with both uses one of them.

A receiver of satellites (`simnav.kinds.Datasheet.sources`) gives a position, or a velocity, that was computed from the
readings of another instrument; so does a DVL with its beams. Its errors are theirs, so an estimator that used both
would count the same readings twice. The rule of all solvers is:

- **tight coupling**: where the model has an equation for the raw observations, and states for what they bring along
  (`ErrorModel.holds`), the receivers that solve them are not used;
- otherwise the receivers are used, and the raw observations are not; also where the model has no use for the raw
  observations alone, as that of a ship without an IMU, which needs a position or a whole velocity.

A row is **loosely coupled** if its class says so (``loose``, `simnav.estimators.composition.Row`): it takes away the
raw observations that a receiver solves.

Source of the terms: P. D. Groves, *Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems*, 2nd
ed., Artech House 2013, section 14.1.
"""

from __future__ import annotations

from simnav.estimator import UnsuitableScenario
from simnav.types import Instruments

from .chain import Chain
from .channels import by_channel, instrument_of
from .suitable import ModelChoice

__all__ = ["by_source"]


def by_source(instruments: Instruments, choice: ModelChoice | Chain, name: str) -> Instruments:
    """The instruments that a solver uses, with each channel as an instrument of its own.

    Parameters
    ----------
    instruments : Instruments
        Datasheets of a run; channels may be apart already.
    choice : ModelChoice or Chain
        The model of the solver, or what chooses it.
    name : str
        Name of the estimator, for messages.

    Raises
    ------
    UnsuitableScenario
        If the model lacks an instrument.
    """
    receivers = {n: set(sheet.sources) for n, sheet in instruments.items() if sheet.sources}
    if receivers:
        model = choice.choose(instruments, name)
        used = {instrument_of(s) for s in instruments.values() if model.observes(s) and model.holds(s)}
        solved = {n for n, sources in receivers.items() if sources <= used}
        if not _suits(instruments.without(solved), choice, name):
            solved = set()
        raw = {source for name in receivers.keys() - solved for source in receivers[name]}
        instruments = instruments.without(solved | {n for n, s in instruments.items() if instrument_of(s) in raw})
    return by_channel(instruments)


def _suits(instruments: Instruments, choice: ModelChoice | Chain, name: str) -> bool:
    """Whether the model finds what it needs."""
    try:
        choice.choose(instruments, name)
    except UnsuitableScenario:
        return False
    return True
