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
import warnings

from .limits import prctl

__all__ = ["PrivilegesWarning", "give_up", "kept_rights", "user_for"]

_FIRST_USER = 0x70000000  # beyond all users that systems give numbers to
_READ_SEARCH = 2  # the capability to read any file and to search any folder
_SET_DUMPABLE, _KEEP, _DROP_BOUNDING, _AMBIENT, _RAISE = 4, 8, 24, 47, 2  # of prctl(2)
_VERSION_3 = 0x20080522  # of capset(2)


class PrivilegesWarning(UserWarning):
    """The estimators of a campaign of root keep capabilities."""


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
        Whether this process has no capability that changes anything; looked up, not concluded.
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
    _only(1 << _READ_SEARCH)
    with contextlib.suppress(OSError, AttributeError):  # programs that it starts read as it does
        ctypes.CDLL(None).prctl(_AMBIENT, _RAISE, _READ_SEARCH, 0, 0)
    prctl(_SET_DUMPABLE, 1)  # or it could not look at itself in /proc
    return _permitted() & ~(1 << _READ_SEARCH) == 0


def kept_rights() -> str:
    """Why an estimator process that root starts here would keep capabilities; empty where it gives them up.

    A child tries it. Some containers forbid the system calls that it takes.
    """
    user = user_for(0)
    if user is None:
        return ""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # fork beside threads: the child uses none of them
        child = os.fork()
    if child == 0:
        code = 2
        try:
            code = 0 if give_up(user) else 1
        finally:
            os._exit(code)
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    if code == 0:
        return ""
    return "the system refuses to take them away" if code == 1 else f"an attempt ended with {code}"


def _permitted() -> int:
    """Capabilities that this process has or can take; all where the system does not say."""
    held = _look()
    return ~0 if held is None else held[1] | held[4] << 32


def _look() -> tuple[int, ...] | None:
    """Effective, permitted and inheritable capabilities, the lower 32 bits, and the upper ones; see capget(2)."""
    held = ctypes.create_string_buffer(24)
    if ctypes.CDLL(None).capget(struct.pack("=Ii", _VERSION_3, 0), held):
        return None
    return struct.unpack("=6I", held.raw)


def _only(capabilities: int) -> bool:
    """Keep these capabilities only, of those that there are."""
    held = _look()
    if held is None:
        return False
    permitted = held[1] & capabilities
    low, high = (permitted, permitted, permitted), (0, 0, 0)
    return bool(ctypes.CDLL(None).capset(struct.pack("=Ii", _VERSION_3, 0), struct.pack("=6I", *low, *high)) == 0)
