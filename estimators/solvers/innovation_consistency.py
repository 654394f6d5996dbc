"""The chi-square test of a filter's innovations: whether the innovations agree with their covariance.

If model and noise are right, a normalised innovation squared has a chi-square distribution with as many degrees of
freedom as the measurement has components, and innovations are independent of each other. So their sum over the last
`EPOCHS` epochs is chi-square, too. If it is improbably large for some epochs in a row, the filter or its measurements
are wrong: an undetected fault, an initial error much larger than its sigma, or a wrong model. The test cannot
distinguish these. The filter reports that it is inconsistent, and continues; its covariance is not changed.

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


class InnovationTest(ConsistencyTest):
    """The test of the module: the sum is that of the normalised innovations squared, over the last `EPOCHS` epochs with
    measurements.
    """

    def __init__(self) -> None:
        super().__init__()
        self._sum, self._freedom = 0.0, 0
        self._sums: deque[float] = deque(maxlen=EPOCHS)
        self._freedoms: deque[int] = deque(maxlen=EPOCHS)

    def add(self, nis: float, freedom: int) -> None:
        """Add a normalised innovation squared, and its degrees of freedom."""
        self._sum += nis
        self._freedom += freedom

    def end_epoch(self) -> None:
        """Test the sum at the end of an epoch. An epoch without measurements is ignored."""
        if not self._freedom:
            return
        self._sums.append(self._sum)
        self._freedoms.append(self._freedom)
        self._sum, self._freedom = 0.0, 0
        self.judge(sum(self._sums), sum(self._freedoms))
