"""A trial: one estimator run over one recording, step by step, with every failure caught and named.

The estimator receives copies, packet by packet. So it cannot use later measurements, and cannot change the recording
for the next estimator. An estimator that takes several steps by one call receives them together; one that a campaign
confines does so only if it comes with simnav. Its output is checked at every step. The first step that fails ends the
trial, and all earlier steps are kept.

`simnav.trial.session` runs an estimator, in this or in another process. `simnav.trial.wire` is the form of packets and
answers as plain arrays. `simnav.trial.log` checks and collects the answers, and `simnav.trial.trial` is the result,
with the list of statuses.
"""

from simnav.trial.log import DIVERGENCE_LIMIT
from simnav.trial.session import (
    TOGETHER,
    FailureError,
    LostError,
    Session,
    answers_to,
    describe_failure,
    run_session,
    run_trial,
)
from simnav.trial.trial import Trial

__all__ = [
    "DIVERGENCE_LIMIT",
    "TOGETHER",
    "FailureError",
    "LostError",
    "Session",
    "Trial",
    "answers_to",
    "describe_failure",
    "run_session",
    "run_trial",
]
