"""One estimator on one recording, in an estimator process."""

from __future__ import annotations

import atexit
import hashlib
import os
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from simnav.leaderboard.campaign.confinement import bubblewrap
from simnav.leaderboard.campaign.confinement.cores import own_core
from simnav.leaderboard.campaign.confinement.session import EstimatorServer, Limits, StoppedError
from simnav.trial import FailureError, Trial, run_session
from simnav.trial.log import TrialLog
from simnav.trial.wire import InvalidOutputError

if TYPE_CHECKING:
    from collections.abc import Sequence

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
]

#: What can be asked for; ``auto`` is the strongest that works here.
CONFINEMENTS = ("auto", "bubblewrap", "process", "none")

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
    why_not = bubblewrap.available() if asked in ("auto", "bubblewrap") else ""
    if asked == "bubblewrap" and why_not:
        raise ValueError(f"confinement = 'bubblewrap': {why_not}")
    return "bubblewrap" if asked == "bubblewrap" or (asked == "auto" and not why_not) else (
        "process" if asked == "auto" else asked)  # fmt: skip


def prepare(confinement: str, hidden: Sequence[Path], *, loaded: bool = True, sealed: bool = False) -> EstimatorServer:
    """The server of this process: the one that is there, or a new one that begins to load its kernels.

    Parameters
    ----------
    confinement : {"process", "bubblewrap"}
        A process of its own, or that in a sandbox of bubblewrap.
    hidden : sequence of Path
        Paths that estimators must not read.
    loaded : bool
        Whether the kernels are loaded; False is enough to inspect estimators.
    sealed : bool
        Whether the run belongs to a sealed campaign.
    """
    global _server, _owner
    if _server is not None and _owner != os.getpid():
        _server = None  # this is a fork of the worker
    if _server is not None and not _server.fits(confinement, hidden, loaded):
        _server.close()
        _server = None
    if _server is None:
        _server, _owner = EstimatorServer(confinement, hidden, loaded=loaded), os.getpid()
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
    except StoppedError as error:
        status, reason, trial = error.status, error.reason, None
    except FailureError as error:  # of the constructor
        status, reason, trial = error.status, error.reason, None
    except InvalidOutputError as error:
        status, reason, trial = "invalid-output", str(error), None
    seconds = time.monotonic() - started
    if status == "out-of-memory" and trial is None and "memory" not in reason:
        reason = f"more than {limits.memory >> 20} MiB of memory was wanted"
    return Attempt(status, reason, trial, seconds, session.peak_memory if session else 0, server.confinement)


def describe(server: EstimatorServer, entrant: Entrant, limits: Limits) -> dict[str, Any]:
    """Look at an estimator where it can do no harm.

    Returns
    -------
    dict
        ``reference``, ``source`` (a digest), ``failure`` of its constructor (a sentence, or empty), and
        ``learned_from`` as it was told, not checked.

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
    source, failure = facts.get("source"), facts.get("failure")
    if not isinstance(source, str) or not isinstance(failure, str) or len(source) > 200:
        raise ValueError("it says nothing of itself that can be read")
    known = {"reference": facts.get("reference") is True, "source": source, "failure": failure[:1000]}
    return {**known, "learned_from": facts.get("learned_from", [])}
