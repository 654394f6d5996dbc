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
from simnav.types import Array

__all__ = ["COURSE", "TIME", "Course", "add_innovation", "begun", "is_correlated", "is_directed", "is_large"]

#: Memory of a course [innovations].
MEMORY = 20
#: Places in the array of a course: time of the last innovation [s], its three components, their number, and whether it
#: failed its test; the fading sums of products, of their squares, of squares, and of components; of the present run,
#: number of pairs and sum of their cosines. And the length of the array.
TIME, BEFORE, COUNT, FAILED, PRODUCT, SQUARE, SQUARES, FREEDOM, PAIRS, COSINES, COURSE = 0, 1, *range(4, 13)


def begun(count: int, more: int = 0) -> Array:
    """(count, COURSE + more) array: courses without innovations, each with so many further zeros."""
    courses = np.zeros((count, COURSE + more))
    courses[:, TIME], courses[:, COUNT] = -np.inf, 1.0
    return courses


@helper
def add_innovation(course: Array, u0: float, u1: float, u2: float, count: int, time: float, failed: bool) -> None:
    """Do `Course.add` on the array of a course."""
    b0, b1, b2 = course[BEFORE], course[BEFORE + 1], course[BEFORE + 2]
    fading = 1.0 - 1.0 / MEMORY
    p0, p1, p2 = u0 * b0, u1 * b1, u2 * b2
    course[PRODUCT] = fading * course[PRODUCT] + p0 + p1 + p2
    course[SQUARE] = fading * course[SQUARE] + p0 * p0 + p1 * p1 + p2 * p2
    course[SQUARES] = fading * course[SQUARES] + u0 * u0 + u1 * u1 + u2 * u2
    course[FREEDOM] = fading * course[FREEDOM] + count
    if failed and course[FAILED] > 0.0:
        course[PAIRS] += 1.0
        course[COSINES] += (p0 + p1 + p2) / sqrt((u0 * u0 + u1 * u1 + u2 * u2) * (b0 * b0 + b1 * b1 + b2 * b2))
    else:
        course[PAIRS], course[COSINES] = 0.0, 0.0
    course[BEFORE], course[BEFORE + 1], course[BEFORE + 2], course[TIME] = u0, u1, u2, time
    course[FAILED], course[COUNT] = 1.0 if failed else 0.0, count


@helper
def is_correlated(course: Array, quantile: float) -> bool:
    """Do `Course.correlated` on the array of a course."""
    found: bool = course[PRODUCT] > 0.0 and course[PRODUCT] * course[PRODUCT] > quantile * quantile * course[SQUARE]
    return found


@helper
def is_directed(course: Array, quantile: float) -> bool:
    """Do `Course.directed` on the array of a course."""
    found: bool = course[PAIRS] > 0.0 and course[COSINES] * sqrt(course[COUNT] / course[PAIRS]) > quantile
    return found


@helper
def is_large(course: Array, quantile: float) -> bool:
    """Do `Course.large` on the array of a course."""
    spread = 2.0 / (9.0 * course[FREEDOM])
    root = 1.0 - spread + quantile * sqrt(spread)
    found: bool = course[SQUARES] > course[FREEDOM] * (root * root * root)
    return found


class Course:
    """The recent innovations of one instrument, standardised by ``H P H' + R`` with the datasheet's noise R.

    The sums fade with a memory of `MEMORY` innovations. With the product p of a component in two successive
    innovations, ``sum(p) / sqrt(sum(p^2))`` over all components is about standard normal if the innovations are
    independent and symmetrical, whatever their size.

    That needs about six innovations. Where they have no preferred direction either, as a noise larger than R has none,
    fewer are enough: the cosine of the angle between two successive innovations of m components then has the mean 0 and
    the variance 1/m. So ``sum(cosine) sqrt(m / n)`` over the n pairs of a run has unit variance, whatever the sizes. A
    run is a number of successive innovations that all fail their tests.

    Attributes
    ----------
    array : (COURSE,) array
        Its numbers, in the order of the constants of this module.
    """

    __slots__ = ("array",)

    def __init__(self) -> None:
        self.array = begun(1)[0]

    def add(self, components: tuple[float, float, float], count: int, time: float, failed: bool = False) -> None:
        """Add an innovation.

        Parameters
        ----------
        components : (float, float, float)
            Standardised components, with zeros up to three.
        count : int
            Number of components.
        time : float
            Time [s].
        failed : bool
            Whether the innovation has failed its chi-square test.
        """
        add_innovation(self.array, *components, count, time, failed)

    def correlated(self, quantile: float) -> bool:
        """Whether successive innovations have a correlation above zero, by a quantile of the normal distribution."""
        return bool(is_correlated(self.array, quantile))

    def directed(self, quantile: float) -> bool:
        """Whether the innovations of the present run have a common direction, by a normal quantile."""
        return bool(is_directed(self.array, quantile))

    def large(self, quantile: float) -> bool:
        """Whether the squares are too large for R and H P H', by a quantile of the normal distribution.

        The limit of chi-square follows from it by the approximation of E. B. Wilson and M. M. Hilferty, *The
        distribution of chi-square*, PNAS 17, 1931.
        """
        return bool(is_large(self.array, quantile))
