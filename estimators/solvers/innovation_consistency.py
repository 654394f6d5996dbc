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

from simnav.compiled import helper
from simnav.structures import filled, structure
from simnav.types import Array

from .cost_consistency import IMPROBABLE, PATIENCE, chi_square_deviate

__all__ = ["EPOCHS", "LONG", "TEST", "add_square", "begun_test", "end_epoch", "is_inconsistent"]

#: Number of epochs over which innovations are summed: the default length of a window.
EPOCHS = 20
#: Number of epochs of the second sum.
LONG = 100
#: What an epoch counts in it at most, in degrees of freedom.
BOUND = 2.0
#: The test: sum and degrees of freedom of the present epoch; those of the last epochs with measurements, of which
#: there have been so many; of the last ones bounded, with their sums; the last sum over its degrees of freedom; and for
#: how many epochs in a row each sum has been improbable.
TEST = structure(
    total=float, freedom=float, epochs=int, sums=EPOCHS, freedoms=EPOCHS, bounded=LONG, long_freedoms=LONG,
    long_sum=float, long_freedom=float, variance_factor=float, improbable=int, lasting=int,
)  # fmt: skip


def begun_test() -> Array:
    """The test before the first epoch, as an array."""
    return filled(TEST, variance_factor=float("nan"))


@helper
def add_square(memory: Array, nis: float, freedom: float) -> None:
    """Add a normalised innovation squared, and its degrees of freedom, to the present epoch."""
    test = memory.view(TEST)[0]
    test.total += nis
    test.freedom += freedom


@helper
def end_epoch(memory: Array) -> None:
    """Test the sums at the end of an epoch. An epoch without measurements is ignored."""
    test = memory.view(TEST)[0]
    freedom = test.freedom
    if freedom == 0.0:
        return
    newest = test.epochs % EPOCHS
    test.sums[newest], test.freedoms[newest] = test.total, freedom
    squares, freedoms = 0.0, 0.0
    for k in range(EPOCHS):  # the oldest first; before there are so many, the first ones are zero
        at = (newest + 1 + k) % EPOCHS
        squares += test.sums[at]
        freedoms += test.freedoms[at]
    test.variance_factor = squares / freedoms
    test.improbable = test.improbable + 1 if chi_square_deviate(squares, freedoms) > IMPROBABLE else 0
    oldest = test.epochs % LONG
    bounded, its_freedom = test.total if test.total < BOUND * freedom else BOUND * freedom, test.long_freedoms[oldest]
    test.long_sum += bounded - test.bounded[oldest]
    test.long_freedom += freedom - its_freedom
    test.bounded[oldest], test.long_freedoms[oldest] = bounded, freedom
    if its_freedom > 0.0:  # from then on there are so many epochs
        test.lasting = test.lasting + 1 if chi_square_deviate(test.long_sum, test.long_freedom) > IMPROBABLE else 0
    test.epochs += 1
    test.total, test.freedom = 0.0, 0.0


@helper
def is_inconsistent(memory: Array) -> bool:
    """Whether one of the sums has been improbable for `PATIENCE` epochs in a row."""
    test = memory.view(TEST)[0]
    found: bool = test.improbable >= PATIENCE or test.lasting >= PATIENCE
    return found
