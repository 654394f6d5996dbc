"""What an estimator needs: kinds of instruments that it declares, and the harness checks.

``Estimator.needs`` lists what must be there. Each entry is one name, or a tuple of names of which one is enough::

    needs = ("imu", ("gnss_position", "terrain_fix"))      # an IMU, and GNSS or terrain fixes

A name is a kind of `simnav.types.KINDS`, ``"imu"``, or ``"aid"`` for any instrument beside the IMU.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

from simnav.kinds import KINDS
from simnav.spec import closest

if TYPE_CHECKING:
    from simnav.types import Instruments

__all__ = ["AID", "IMU", "Needs", "NeedsError", "checked_needs", "lacking"]

Needs: TypeAlias = tuple[str | tuple[str, ...], ...]

IMU, AID = "imu", "aid"


class NeedsError(ValueError):
    """Needs that are not declared as they should be; the message is one sentence."""


def checked_needs(needs: object) -> Needs:
    """Needs as tuples of known names.

    Parameters
    ----------
    needs : object
        What an estimator declares.

    Raises
    ------
    NeedsError
        If it is no tuple or list of names and tuples of names, or a name is unknown.

    Examples
    --------
    >>> checked_needs(["imu", ["gyrocompass", "magnetic_compass"]])
    ('imu', ('gyrocompass', 'magnetic_compass'))
    """
    form = "needs should be a tuple of names and tuples of names, like ('imu', ('gnss_position', 'terrain'))"
    if not isinstance(needs, (tuple, list)):
        raise NeedsError(f"{form}, not {needs!r:.80}")
    found: list[str | tuple[str, ...]] = []
    for entry in needs:
        group = (entry,) if isinstance(entry, str) else tuple(entry) if isinstance(entry, (tuple, list)) else ()
        if not group or not all(isinstance(name, str) for name in group):
            raise NeedsError(f"{form}; one entry is {entry!r:.80}")
        for name in group:
            if name not in (IMU, AID) and name not in KINDS:
                raise NeedsError(f"needs names {name!r:.80}, no kind of instrument{closest(name, list(KINDS))}")
        found.append(entry if isinstance(entry, str) else group)
    return tuple(found)


def lacking(needs: object, instruments: Instruments) -> str:
    """What is needed and not there, as a sentence; empty where all is there.

    Parameters
    ----------
    needs : object
        As `checked_needs` takes it.
    instruments : Instruments
        Those that are there.

    Raises
    ------
    NeedsError
        As `checked_needs`.

    Examples
    --------
    >>> from simnav.types import Instruments
    >>> lacking(("imu", ("gnss_position", "terrain_fix")), Instruments())
    'it needs an IMU; there is none'
    """
    kinds = {sheet.kind for sheet in instruments.values()}
    there = kinds | ({IMU} if instruments.imu is not None else set()) | ({AID} if kinds else set())
    for entry in checked_needs(needs):
        group = (entry,) if isinstance(entry, str) else entry
        if not there.intersection(group):
            return f"it needs {' or '.join(_WORDS.get(name, name) for name in group)}; there is none"
    return ""


_WORDS = {IMU: "an IMU", AID: "an instrument beside the IMU"}
