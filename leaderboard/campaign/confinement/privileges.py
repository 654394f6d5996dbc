"""What root gives up: where a campaign runs as root, its estimators have another user and no capabilities (Linux).

The other user owns no file of the campaign, so an estimator can neither change their modes nor signal or limit the
processes of the campaign. One capability is left: to read files, for the files of estimators and libraries often belong
to root alone. See capabilities(7).
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import struct
import sys

from simnav.leaderboard.campaign.confinement.limits import prctl

__all__ = ["give_up", "user_for"]

_FIRST_USER = 0x70000000  # beyond all users that systems give numbers to
_READ_SEARCH = 2  # the capability to read any file and to search any folder
_SET_DUMPABLE, _KEEP, _DROP_BOUNDING, _AMBIENT, _RAISE = 4, 8, 24, 47, 2  # of prctl(2)
_VERSION_3 = 0x20080522  # of capset(2)


def user_for(number: int) -> int | None:
    """Number of the user for an estimator; None where this process is not root.

    Parameters
    ----------
    number : int
        That tells estimators apart, from 0; the same number gives the same user.
    """
    if sys.platform != "linux" or os.geteuid() != 0:
        return None
    return _FIRST_USER + number % 0x0FFFFFFF


def give_up(user: int | None) -> bool:
    """Become another user, and give up all capabilities but that to read; a process that is not root stays as it is.

    Parameters
    ----------
    user : int or None
        From `user_for`. Where the system does not know such users, e.g. in some containers, the process stays root,
        without capabilities.

    Returns
    -------
    bool
        Whether this process has no capability that changes anything.
    """
    if sys.platform != "linux" or os.geteuid() != 0:
        return True
    for capability in range(64):
        if capability != _READ_SEARCH and not prctl(_DROP_BOUNDING, capability):
            break
    prctl(_KEEP, 1)
    if user is not None:
        with contextlib.suppress(OSError):
            os.setgroups([])
            os.setresgid(user, user, user)
            os.setresuid(user, user, user)
    done = _only(1 << _READ_SEARCH)
    with contextlib.suppress(OSError, AttributeError):  # programs that it starts read as it does
        ctypes.CDLL(None).prctl(_AMBIENT, _RAISE, _READ_SEARCH, 0, 0)
    prctl(_SET_DUMPABLE, 1)  # or it could not look at itself in /proc
    return done


def _only(capabilities: int) -> bool:
    """Keep these capabilities only, of those that there are."""
    libc = ctypes.CDLL(None, use_errno=True)
    header = struct.pack("=Ii", _VERSION_3, 0)
    held = ctypes.create_string_buffer(24)
    if libc.capget(header, held):
        return False
    permitted = struct.unpack("=6I", held.raw)[1] & capabilities
    low, high = (permitted, permitted, permitted), (0, 0, 0)
    return bool(libc.capset(header, struct.pack("=6I", *low, *high)) == 0)
