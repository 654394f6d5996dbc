"""Whether the instruments of a run suit an estimator: it has what it needs, and uses a position if there is one.

An estimator declares what it cannot do without (`simnav.estimator.needs`). It may also say which instruments it uses
(`simnav.estimator.Estimator.observes`). Where instruments give a position and it uses none of them, its error is that
of another task. It is then not run, as if something that it needs were missing.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

from simnav.estimator.needs import NeedsError, lacking

if TYPE_CHECKING:
    from simnav.estimator.contract import Estimator
    from simnav.types import Instruments

__all__ = ["unsuitable", "unused_positions"]

_FORM = "observes() should return None or a collection of names of instruments, like {'gnss'}"


def unsuitable(estimator: Estimator, instruments: Instruments) -> str:
    """Why instruments do not suit an estimator, as a sentence; empty where they do.

    Parameters
    ----------
    estimator : Estimator
        The estimator.
    instruments : Instruments
        Those of a run.

    Raises
    ------
    NeedsError
        If what it says of itself is not in the form of `Estimator.needs` or `Estimator.observes`.
    """
    return lacking(estimator.needs, instruments) or unused_positions(estimator.observes(instruments), instruments)


def unused_positions(observed: object, instruments: Instruments) -> str:
    """Which instruments give a position, if an estimator uses none of them, as a sentence; empty where it uses one.

    Parameters
    ----------
    observed : collection of str or None
        Names of the instruments that it uses; None if it does not say.
    instruments : Instruments
        Those that are there.

    Raises
    ------
    NeedsError
        If ``observed`` is no collection of names of these instruments.

    Examples
    --------
    >>> from simnav.types import Datasheet, Instruments
    >>> aids = Instruments([Datasheet("ship", "usbl_fix", 1.0, 1.0), Datasheet("keel", "depth", 1.0, 0.1)])
    >>> unused_positions({"keel"}, aids)
    'it uses no instrument that gives a position; here that is ship (usbl_fix)'
    >>> unused_positions({"keel", "ship"}, aids), unused_positions(None, aids)
    ('', '')
    """
    if observed is None:
        return ""
    if isinstance(observed, str) or not isinstance(observed, Collection):
        raise NeedsError(f"{_FORM}, not {observed!r:.80}")
    for name in observed:
        if not isinstance(name, str) or name not in instruments:
            raise NeedsError(f"{_FORM}; there is no {name!r:.80}")
    positions = [name for name, sheet in instruments.items() if sheet.gives_position]
    if not positions or not set(positions).isdisjoint(observed):
        return ""
    found = ", ".join(f"{name} ({instruments[name].kind})" for name in positions)
    return f"it uses no instrument that gives a position; here that is {found}"
