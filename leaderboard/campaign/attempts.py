"""One estimator on one recording, where it belongs: confined, or with the recording where it may know the truth."""

from __future__ import annotations

import random
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from simnav.leaderboard.campaign.confinement.attempt import Attempt, attempt, close_server, prepare, seed_words
from simnav.leaderboard.campaign.confinement.session import NoAnswerError
from simnav.leaderboard.campaign.isolation import isolate

if TYPE_CHECKING:
    from simnav.leaderboard.campaign.confinement.session import Limits
    from simnav.leaderboard.campaign.entrant import Entrant
    from simnav.recording import Recording
    from simnav.trial import Trial

__all__ = ["try_estimator"]


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
        What separates it from the recording (`simnav.leaderboard.campaign.confinement`).
    hidden : sequence of Path
        Paths that the estimator must not read.
    sealed : bool
        Whether the run belongs to a sealed campaign.

    Raises
    ------
    simnav.leaderboard.campaign.confinement.session.ServerError
        If estimator processes cannot be started.
    """
    if confinement == "none" or entrant.reference:
        outcome = isolate(_in_a_fork, entrant, recording, timeout=limits.timeout, memory=limits.memory)
        trial: Trial | None = outcome.value if outcome.status == "ok" else None
        status, reason = (outcome.status, outcome.reason) if trial is None else (trial.status, trial.reason)
        return Attempt(status, reason, trial, outcome.seconds, outcome.peak_memory, "none")
    try:
        return attempt(prepare(confinement, hidden, sealed=sealed), entrant, recording, limits)
    except NoAnswerError:  # the estimator was not there yet, so this is not a result of it
        close_server()
        return attempt(prepare(confinement, hidden, sealed=sealed), entrant, recording, limits)


def _in_a_fork(entrant: Entrant, recording: Recording) -> Trial:
    """In the isolated process: make the estimator and run it."""
    import numpy as np

    from simnav.trial import run_trial

    words = seed_words(recording, entrant)
    random.seed(sum(word << 32 * k for k, word in enumerate(words)))
    np.random.seed(words)  # noqa: NPY002
    return run_trial(entrant.make(), recording)
