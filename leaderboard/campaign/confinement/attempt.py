"""One estimator on one recording, where it belongs: in an estimator process, or where it may know the truth."""

from __future__ import annotations

import atexit
import hashlib
import os
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from simnav.leaderboard.results.errors import named
from simnav.trial import FailureError, Trial, run_session, run_trial
from simnav.trial.log import TrialLog
from simnav.trial.wire import InvalidOutputError

from . import bubblewrap
from .cores import own_core
from .estimator_process import seed_generators
from .isolation import isolate
from .limits import interrupted
from .reachable_kernels import ALL
from .session import (
    LOST,
    EstimatorServer,
    Limits,
    NoAnswerError,
    ServerError,
    StoppedError,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from simnav.leaderboard.campaign.entrant import Entrant
    from simnav.recording import Recording

__all__ = [
    "CONFINEMENTS",
    "Attempt",
    "attempt",
    "chosen_confinement",
    "close_server",
    "describe",
    "prepare",
    "seed_words",
    "try_estimator",
]

#: What can be asked for; ``auto`` is the strongest that works here.
CONFINEMENTS = ("auto", "bubblewrap", "process", "none")

_SETTLE = 2.5  # for the end of a worker whose campaign is being killed [s]

_server: EstimatorServer | None = None
_owner = 0  # process of the server's worker


@dataclass(frozen=True, eq=False)
class Attempt:
    """What became of an estimator on a recording.

    Attributes
    ----------
    status, reason : str
        Status and reason as in a trial, or the cause that ended the process.
    trial : Trial or None
        None where the process ended before the trial did.
    seconds : float
        Wall-clock time, with the start of the process [s].
    peak_memory : int
        Beyond what the process started with [bytes].
    confinement : str
        Confinement that was in force.
    """

    status: str
    reason: str
    trial: Trial | None
    seconds: float
    peak_memory: int
    confinement: str


def chosen_confinement(asked: str = "auto") -> str:
    """Which confinement a campaign uses: ``bubblewrap``, ``process`` or ``none``.

    ``$SIMNAV_CONFINEMENT`` stands for ``auto``.

    Raises
    ------
    ValueError
        If it is unknown, or does not work here: one sentence.
    """
    if asked == "auto":
        asked = os.environ.get("SIMNAV_CONFINEMENT", "") or "auto"
    if asked not in CONFINEMENTS:
        raise ValueError(f"confinement = {asked!r} is unknown; there are {', '.join(CONFINEMENTS)}")
    if os.name != "posix":
        if asked in ("bubblewrap", "process"):
            raise ValueError(f"confinement = {asked!r} needs a POSIX system")
        return "none"
    if asked in ("process", "none"):
        return asked
    why_not = bubblewrap.available()
    if not why_not:
        return "bubblewrap"
    if asked == "bubblewrap":
        raise ValueError(f"confinement = 'bubblewrap': {why_not}")
    return "process"


def prepare(
    confinement: str, hidden: Sequence[Path], *, loaded: Iterable[str] = (ALL,), sealed: bool = False
) -> EstimatorServer:
    """The server of this process: the one that is there, or a new one.

    Parameters
    ----------
    confinement, hidden, loaded, sealed
        As of `EstimatorServer`. Kernels are not needed to inspect estimators; a server that lacks some begins to load
        them where they are wanted.
    """
    global _server, _owner
    if _server is not None and _owner != os.getpid():
        _server = None  # this is a fork of the worker
    if _server is not None and not _server.fits(confinement, hidden):
        _server.close()
        _server = None
    if _server is None:
        _server, _owner = EstimatorServer(confinement, hidden, loaded=()), os.getpid()
    _server.load(loaded)
    _server.hidden, _server.sealed = tuple(hidden), sealed
    return _server


def close_server() -> None:
    """End the server of this process, if there is one."""
    global _server
    if _server is not None and _owner == os.getpid():
        _server.close()
    _server = None


atexit.register(close_server)


def seed_words(recording: Recording, entrant: Entrant) -> list[int]:
    """The seed of global generators: a keyed hash of the estimator's name, keyed by the truth of the run.

    The same in every campaign and on every worker. An estimator that knows it learns nothing of the run's seed but by
    simulating all of the run.
    """
    truth = hashlib.blake2b(str(recording.seed).encode(), digest_size=32)
    for array in (recording.data.truth.position, recording.data.truth.attitude):
        truth.update(array.tobytes())
    h = hashlib.blake2b(entrant.label.encode(errors="surrogatepass"), digest_size=32, key=truth.digest())
    return [int(word) for word in np.frombuffer(h.digest(), dtype="<u4")]


def attempt(server: EstimatorServer, entrant: Entrant, recording: Recording, limits: Limits) -> Attempt:
    """Run an estimator over a recording; nothing that it does raises here.

    Raises
    ------
    ServerError
        If the server does not start.
    NoAnswerError
        If the server started no estimator process.
    """
    server.wait_until_ready()
    started, trial = time.monotonic(), None
    session: Any = None
    try:
        with own_core() as core, server.session(entrant, limits, core) as session:
            session.make(entrant, seed_words(recording, entrant))
            log = TrialLog(recording.data.truth, True, limits.memory)
            trial = run_session(session, recording, log)
            session.end()
        status, reason = trial.status, trial.reason
    except (StoppedError, FailureError) as error:  # of the constructor, or the process is no more there
        status, reason, trial = error.status, error.reason, None
    except InvalidOutputError as error:
        status, reason, trial = "invalid-output", str(error), None
    except ServerError:
        raise
    except Exception as error:  # of this process, by what it was sent
        status, reason, trial = "invalid-output", f"its answers cannot be used: {named(error)}", None
    seconds = time.monotonic() - started
    if status == "out-of-memory" and trial is None and "memory" not in reason:
        reason = f"more than {limits.memory >> 20} MiB of memory was wanted"
    return Attempt(status, reason, trial, seconds, session.peak_memory if session else 0, server.confinement)


def try_estimator(
    entrant: Entrant,
    recording: Recording,
    limits: Limits,
    confinement: str,
    hidden: Sequence[Path] = (),
    *,
    sealed: bool = False,
) -> Attempt:
    """Run an estimator over a recording; nothing that it does raises here.

    Parameters
    ----------
    entrant : Entrant
        One of simnav's own references runs in a fork of this process, which has the recording; so does anyone under the
        confinement ``none``.
    recording : Recording
        The run, with its truth and labels.
    limits : Limits
        Time and memory that it may take.
    confinement : {"bubblewrap", "process", "none"}
        What separates it from the recording.
    hidden, sealed
        As of `EstimatorServer`.

    Raises
    ------
    ServerError
        If estimator processes cannot be started.
    """
    for again in (False, True):
        if confinement == "none" or entrant.reference:
            outcome = isolate(_in_a_fork, entrant, recording, timeout=limits.timeout, memory=limits.memory)
            trial: Trial | None = outcome.value if outcome.status == "ok" else None
            status, reason = (outcome.status, outcome.reason) if trial is None else (trial.status, trial.reason)
            found = Attempt(status, reason, trial, outcome.seconds, outcome.peak_memory, "none")
        else:
            try:
                if sealed and _server is not None and _server.used:  # its server has had no other estimator
                    close_server()
                asked: dict[str, Any] = {"loaded": entrant.kernels, "sealed": sealed}
                try:
                    found = attempt(prepare(confinement, hidden, **asked), entrant, recording, limits)
                except NoAnswerError:  # the estimator was not there yet, so this is not a result of it
                    close_server()
                    found = attempt(prepare(confinement, hidden, **asked), entrant, recording, limits)
            finally:
                if sealed:
                    close_server()
        killed = found.status == "error" and found.trial is None and (found.reason == LOST or interrupted(found.reason))
        if again or not killed:
            break
        # Perhaps whoever kills the campaign began with the estimator: then this process is soon gone, too.
        time.sleep(_SETTLE)
    return found


def _in_a_fork(entrant: Entrant, recording: Recording) -> Trial:
    """In the isolated process: make the estimator and run it."""
    seed_generators(seed_words(recording, entrant))
    return run_trial(entrant.make(), recording)


def describe(server: EstimatorServer, entrant: Entrant, limits: Limits) -> dict[str, Any]:
    """Look at an estimator where it can do no harm.

    Returns
    -------
    dict
        ``reference``, ``source`` (a digest), ``version``, modules whose ``kernels`` it may call, and ``learned_from``
        and ``needs`` as it was told, not checked.

    Raises
    ------
    ServerError
        If the server started no estimator process.
    ValueError
        If it cannot be found, imported or asked for like this: one sentence.
    """
    try:
        with server.session(entrant, limits) as session:
            facts = session.describe_estimator(entrant)
            session.end()
    except (StoppedError, FailureError, InvalidOutputError) as error:
        raise ValueError(str(error)) from None
    source, version = facts.get("source"), facts.get("version")
    if not isinstance(source, str) or len(source) > 200 or not isinstance(version, int) or not 0 < version < 2**31:
        raise ValueError("it says nothing of itself that can be read")
    said = facts.get("kernels")
    known = isinstance(said, list) and len(said) < 100 and all(isinstance(m, str) and len(m) < 200 for m in said)
    return {
        "reference": facts.get("reference") is True, "source": source, "learned_from": facts.get("learned_from", []),
        "version": version, "kernels": tuple(said or ()) if known else (ALL,), "needs": facts.get("needs", ()),
    }  # fmt: skip
