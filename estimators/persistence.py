"""Whether the innovations of an instrument persist: the sign of a wrong prediction.

The noise of an instrument is independent from one measurement to the next. If its covariance R is larger than the
filter assumes, the filter follows the noise too closely, and successive innovations have a correlation below zero. If
the covariance of the prediction is too small instead (the IMU is worse than its datasheet, or disturbed), the filter
follows the motion too slowly, and the error of the state is in many innovations in a row: their correlation is above
zero. R. K. Mehra, *On the identification of variances and adaptive Kalman filtering*, IEEE Trans. Automatic Control
15(2), 1970, derives both covariances from this correlation.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from simnav.compiled import helper
from simnav.kernel_types import FlagVector, Matrix, Vector
from simnav.records import Record

__all__ = ["Courses", "add_innovation", "is_correlated", "is_directed", "is_large", "no_innovations"]

#: Memory of a course [innovations].
MEMORY = 20


class Courses(Record):
    """The recent innovations of i instruments, standardised by ``H P H' + R`` with the datasheet's noise R.

    The sums fade with a memory of `MEMORY` innovations. With the product p of a component in two successive
    innovations, ``sum(p) / sqrt(sum(p^2))`` over all components is about standard normal if the innovations are
    independent and symmetrical, whatever their size.

    That needs about six innovations. Where they have no preferred direction either, as a noise larger than R has none,
    fewer are enough: the cosine of the angle between two successive innovations of m components then has the mean 0 and
    the variance 1/m. So ``sum(cosine) sqrt(m / n)`` over the n pairs of a run has unit variance, whatever the sizes. A
    run is a number of successive innovations that all fail their tests.

    Attributes
    ----------
    time : (i,) array
        Time of the last innovation [s].
    before : (i, 3) array
        Its components, with zeros up to three.
    components : (i,) array
        Their number.
    failed : (i,) array of bool
        Whether it failed its chi-square test.
    product, product_squared, squares, freedom : (i,) arrays
        Fading sums: of p, of p^2, of the squared components, and of the numbers of components.
    pairs, cosines : (i,) arrays
        Of the present run: number of pairs, and sum of their cosines.
    """

    time: Vector
    before: Matrix
    components: Vector
    failed: FlagVector
    product: Vector
    product_squared: Vector
    squares: Vector
    freedom: Vector
    pairs: Vector
    cosines: Vector


def no_innovations(count: int) -> Courses:
    """The courses of so many instruments, before their first innovations."""
    sums = {name: np.zeros(count) for name in ("product", "product_squared", "squares", "freedom", "pairs", "cosines")}
    return Courses(
        time=np.full(count, -np.inf), before=np.zeros((count, 3)), components=np.ones(count),
        failed=np.zeros(count, np.bool_), **sums,
    )  # fmt: skip


@helper
def add_innovation(
    courses: Courses, i: int, u0: float, u1: float, u2: float, count: int, time: float, failed: bool
) -> None:
    """Add an innovation of instrument i to its course.

    Parameters
    ----------
    courses : Courses
        Updated.
    i : int
        The instrument.
    u0, u1, u2 : float
        Standardised components, with zeros up to three.
    count : int
        Number of components.
    time : float
        Time [s].
    failed : bool
        Whether the innovation has failed its chi-square test.
    """
    before, fading = courses.before[i], 1.0 - 1.0 / MEMORY
    b0, b1, b2 = before[0], before[1], before[2]
    p0, p1, p2 = u0 * b0, u1 * b1, u2 * b2
    courses.product[i] = fading * courses.product[i] + p0 + p1 + p2
    courses.product_squared[i] = fading * courses.product_squared[i] + p0 * p0 + p1 * p1 + p2 * p2
    courses.squares[i] = fading * courses.squares[i] + u0 * u0 + u1 * u1 + u2 * u2
    courses.freedom[i] = fading * courses.freedom[i] + count
    if failed and courses.failed[i]:
        courses.pairs[i] += 1.0
        courses.cosines[i] += (p0 + p1 + p2) / sqrt((u0 * u0 + u1 * u1 + u2 * u2) * (b0 * b0 + b1 * b1 + b2 * b2))
    else:
        courses.pairs[i], courses.cosines[i] = 0.0, 0.0
    before[0], before[1], before[2] = u0, u1, u2
    courses.time[i], courses.failed[i], courses.components[i] = time, failed, count


@helper
def is_correlated(courses: Courses, i: int, quantile: float) -> bool:
    """Whether successive innovations have a correlation above zero, by a quantile of the normal distribution."""
    total = courses.product[i]
    found: bool = total > 0.0 and total * total > quantile * quantile * courses.product_squared[i]
    return found


@helper
def is_directed(courses: Courses, i: int, quantile: float) -> bool:
    """Whether the innovations of the present run have a common direction, by a normal quantile."""
    pairs = courses.pairs[i]
    found: bool = pairs > 0.0 and courses.cosines[i] * sqrt(courses.components[i] / pairs) > quantile
    return found


@helper
def is_large(courses: Courses, i: int, quantile: float) -> bool:
    """Whether the squares are too large for R and H P H', by a quantile of the normal distribution.

    The limit of chi-square follows from it by the approximation of E. B. Wilson and M. M. Hilferty, *The
    distribution of chi-square*, PNAS 17, 1931.
    """
    freedom = courses.freedom[i]
    spread = 2.0 / (9.0 * freedom)
    root = 1.0 - spread + quantile * sqrt(spread)
    found: bool = courses.squares[i] > freedom * (root * root * root)
    return found
