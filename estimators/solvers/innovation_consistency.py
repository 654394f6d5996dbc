"""The chi-square test of a filter's innovations: whether the innovations agree with their covariance.

If model and noise are right, a normalised innovation squared has a chi-square distribution with as many degrees of
freedom as the measurement has components, and innovations are independent of each other. So their sum over the last
`EPOCHS` epochs is chi-square, too. If it is improbably large for some epochs in a row, the filter or its measurements
are wrong: an undetected fault, an initial error much larger than its sigma, or a wrong model. The test cannot
distinguish these. The filter reports that it is inconsistent, and continues; its covariance is not changed.

A filter that follows wrong measurements bends its states until they agree. Then the last `EPOCHS` epochs are as they
should be, while the estimate is lost. So there is a second sum, over the last `LONG` epochs. In it no epoch counts for
more than `BOUND` times its degrees of freedom. So it is improbable only if about a third of the epochs contradict the
filter: one that recovers soon is not reported for it afterwards. Such a sum is never larger than chi-square, so its
limit is one of chi-square, too.

The noise is the one in use, so an adapted noise explains a large innovation. Rejected measurements are not counted.

Source: Y. Bar-Shalom, X. R. Li and T. Kirubarajan, *Estimation with Applications to Tracking and Navigation*, Wiley,
2001, section 5.4.2 (the time-average of the normalised innovation squared).
"""

from __future__ import annotations

from collections import deque

from .cost_consistency import ConsistencyTest

__all__ = ["InnovationTest"]

#: Number of epochs over which innovations are summed: the default length of a window.
EPOCHS = 20
#: Number of epochs of the second sum.
LONG = 100
#: What an epoch counts in it at most, in degrees of freedom.
BOUND = 2.0


class InnovationTest:
    """The test of the module: sums of the normalised innovations squared over the last epochs with measurements."""

    def __init__(self) -> None:
        self._sum, self._freedom = 0.0, 0
        self._latest, self._lasting = ConsistencyTest(), ConsistencyTest()
        self._sums: deque[float] = deque(maxlen=EPOCHS)
        self._freedoms: deque[int] = deque(maxlen=EPOCHS)
        self._bounded: deque[tuple[float, int]] = deque([(0.0, 0)] * LONG)
        self._long_sum, self._long_freedom = 0.0, 0

    @property
    def variance_factor(self) -> float:
        """The sum over the last `EPOCHS` epochs over its degrees of freedom; NaN before the first."""
        return self._latest.variance_factor

    @property
    def inconsistent(self) -> bool:
        """Whether one of the sums is improbable (`ConsistencyTest.inconsistent`)."""
        return self._latest.inconsistent or self._lasting.inconsistent

    def add(self, nis: float, freedom: int) -> None:
        """Add a normalised innovation squared, and its degrees of freedom."""
        self._sum += nis
        self._freedom += freedom

    def end_epoch(self) -> None:
        """Test the sums at the end of an epoch. An epoch without measurements is ignored."""
        freedom = self._freedom
        if not freedom:
            return
        self._sums.append(self._sum)
        self._freedoms.append(freedom)
        self._latest.judge(sum(self._sums), sum(self._freedoms))
        bounded = self._sum if self._sum < BOUND * freedom else BOUND * freedom
        oldest, its_freedom = self._bounded.popleft()
        self._bounded.append((bounded, freedom))
        self._long_sum += bounded - oldest
        self._long_freedom += freedom - its_freedom
        if its_freedom:  # from then on there are so many epochs
            self._lasting.judge(self._long_sum, self._long_freedom)
        self._sum, self._freedom = 0.0, 0
