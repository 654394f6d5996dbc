"""The chi-square test of a filter's innovations: does the filter explain its measurements?

If model and noise are right, a normalised innovation squared is distributed as chi-square with as many degrees of
freedom as the measurement has components, and innovations are independent of each other. So their sum over the last
`EPOCHS` epochs is chi-square, too. Where it is improbably large for some epochs in a row, the filter is wrong, or its
measurements are: a fault that is believed, a start beyond its sigma, a model that does not fit. The filter cannot know
which. It reports that it is inconsistent, and goes on. Its covariance stays what it is.

The noise is the one that was used: a filter that has adapted its noise to a measurement explains it. Measurements that
were left out count for nothing.

Source: Y. Bar-Shalom, X. R. Li and T. Kirubarajan, *Estimation with Applications to Tracking and Navigation*, Wiley,
2001, section 5.4.2 (the time-average of the normalised innovation squared).
"""

from __future__ import annotations

from collections import deque

from simnav.estimators.solvers.cost_consistency import ConsistencyTest

__all__ = ["InnovationTest"]

#: Epochs over which innovations are summed up: as many as a window has.
EPOCHS = 20


class InnovationTest(ConsistencyTest):
    """The test of the module; its sum is that of the last `EPOCHS` epochs that brought measurements."""

    def __init__(self) -> None:
        super().__init__()
        self._sum, self._freedom = 0.0, 0
        self._epochs: deque[tuple[float, int]] = deque(maxlen=EPOCHS)

    def add(self, nis: float, freedom: int) -> None:
        """Take a normalised innovation squared, and its degrees of freedom."""
        self._sum += nis
        self._freedom += freedom

    def end_epoch(self) -> None:
        """Test; an epoch without measurements says nothing."""
        if not self._freedom:
            return
        self._epochs.append((self._sum, self._freedom))
        self._sum, self._freedom = 0.0, 0
        self.judge(*map(sum, zip(*self._epochs)))
