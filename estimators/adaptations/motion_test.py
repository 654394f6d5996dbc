"""Whose fault it is, in a window: if fixes and logs agree with each other and not with the motion, the motion's.

A weighting that gives less weight to what does not fit is lost when it is the motion that is wrong (a disturbed IMU):
nothing fits, nothing is believed, and nothing brings the window back. As in a filter
(`estimators.adaptations.prediction`, after paper 003), suspicion falls on the motion where fixes and logs fail their
chi-square tests together, several times running. But a filter cannot tell that from two instruments that are wrong at
once. A window can ask: with the motion of that time all but taken away for one iteration, measurements that are right
agree with each other, and measurements that are wrong still do not.
"""

from __future__ import annotations

import numpy as np

from estimators.adaptations.prediction import FIXES, LOGS, chi_square_limits
from estimators.adaptations.weighting import Factors
from simnav.types import Instruments

__all__ = ["MotionTest"]

#: Weight of motion while the measurements are asked.
LOOSE = 1e-6


class MotionTest:
    """The test of the module.

    Parameters
    ----------
    instruments : Instruments
    together : int
        Failures running, of a fix and of a log, that make the motion suspect.
    recent : float
        A failure older than this [s] is no company.
    probability : float
        Of a good measurement to pass.
    """

    def __init__(self, instruments: Instruments, together: int = 3, recent: float = 5.0, probability: float = 0.999):
        self.together, self.recent, self.probability = together, recent, probability
        self._limits = np.array(chi_square_limits(probability))
        self._is_fix = {n: s.kind in FIXES for n, s in instruments.items() if s.kind in (*FIXES, *LOGS)}
        if len(set(self._is_fix.values())) < 2:
            self._is_fix = {}  # nobody to ask
        self._failures: dict[str, tuple[int, float, float]] = {}  # running; the time of the first and of the latest
        self._blamed: list[tuple[float, float]] = []
        self._tested = -np.inf
        self._asking: tuple[float, float] | None = None
        self._fresh = True

    def begin(self) -> None:
        """An epoch begins."""
        self._fresh, self._asking = True, None

    def judge(self, factors: Factors) -> bool:
        """Let measurements count in full where it is the motion that is at fault, or to find out.

        Returns
        -------
        bool
            False in the iteration in which they are asked: the weights are then not those that are wanted.
        """
        if not self._is_fix:
            return True
        if self._fresh:
            self._fresh = False
            self._suspect(factors)
        elif self._asking is not None:
            self._answer(factors)
        for start, end in self._blamed:
            factors.weight[(factors.time >= start) & (factors.time <= end)] = 1.0
        if self._asking is None:
            return True
        start, end = self._asking
        factors.weight[(factors.time >= start) & (factors.time <= end)] = 1.0
        factors.motion_weight[(factors.motion_time >= start) & (factors.motion_time <= end)] = LOOSE
        return False

    def _suspect(self, factors: Factors) -> None:
        """Test the new measurements, as the window fits them with full weight."""
        new = np.flatnonzero(factors.time > self._tested)
        if not len(new):
            return
        self._tested = now = float(factors.time[new].max())
        failed = factors.norm[new] ** 2 > self._limits[factors.components[new]]
        for i, time, fails in zip(factors.instrument[new].tolist(), factors.time[new].tolist(), failed.tolist()):
            name = factors.names[i]
            if not fails:
                self._failures.pop(name, None)
            elif name in self._is_fix:
                count, since, _ = self._failures.get(name, (0, time, time))
                self._failures[name] = count + 1, since, time
        self._blamed = [span for span in self._blamed if span[1] >= factors.time[0]]
        failing = {n: f for n, f in self._failures.items() if now - f[2] <= self.recent}
        if self._blamed and now - self._blamed[-1][1] <= self.recent and failing:
            self._asking = self._blamed[-1][0], now
        else:
            failing = {n: f for n, f in failing.items() if f[0] >= self.together}
            if len({self._is_fix[name] for name in failing}) == 2:
                self._asking = min(since for _, since, _ in failing.values()), now

    def _answer(self, factors: Factors) -> None:
        """Blame the motion if, without it, fixes and logs agree."""
        from scipy.special import chdtri

        assert self._asking is not None
        (start, end), self._asking = self._asking, None
        asked = (factors.time >= start) & (factors.time <= end)
        agreeing = set()
        for i, name in enumerate(factors.names):
            its = asked & (factors.instrument == i)
            freedom = int(factors.components[its].sum())
            if not freedom or name not in self._is_fix:
                continue
            if float(np.sum(factors.norm[its] ** 2)) <= chdtri(freedom, 1.0 - self.probability):
                agreeing.add(self._is_fix[name])
        if len(agreeing) == 2:
            if self._blamed and start <= self._blamed[-1][1]:
                self._blamed.pop()
            self._blamed.append((start, end))
