"""A trial: one estimator run over one recording, step by step, with every failure caught and named.

The estimator sees copies, packet by packet: it can neither look ahead nor spoil the recording for the next one.
Its output is checked at every step; the first step that fails ends the trial, and all that came before is kept.

`simnav.trial.session` runs an estimator, here or in another process. `simnav.trial.wire` is the plain form in which
packets and answers pass between the two. `simnav.trial.log` checks the answers and collects them, and
`simnav.trial.trial` is what comes out, with the list of statuses.
"""

from simnav.trial.log import DIVERGENCE_LIMIT
from simnav.trial.session import (
    FailureError,
    LostError,
    Session,
    describe_failure,
    run_session,
    run_trial,
)
from simnav.trial.trial import Trial

__all__ = [
    "DIVERGENCE_LIMIT",
    "FailureError",
    "LostError",
    "Session",
    "Trial",
    "describe_failure",
    "run_session",
    "run_trial",
]
