"""Replaces the function that checks the estimates: it knows the truth, too."""

import numpy as np
from cheating_last_fix import LastFix

from simnav.trial.log import TrialLog
from simnav.trial.wire import ANSWER


class PatchedLog(LastFix):
    """By patching the trial's log."""

    def reset(self, start, instruments):
        super().reset(start, instruments)
        plain = TrialLog.add

        def add(self, answer, seconds):
            position = (self._truth[self.step] + np.array([1e-13, 1e-13, 0.0])).tobytes()
            plain(self, bytes(answer[: ANSWER.size]) + position + bytes(answer[ANSWER.size + 24 :]), seconds)

        TrialLog.add = add
