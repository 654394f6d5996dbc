"""Allan deviation of the output of an IMU, and the noise coefficients that follow from it.

The overlapping estimate (IEEE Std 952-1997, annex C; W. J. Riley, *Handbook of Frequency Stability Analysis*, NIST
Special Publication 1065, 2008, section 5.2.4): with the integral theta of the output at the spacing t0,

    sigma^2(m t0) = sum_k (theta_{k+2m} - 2 theta_{k+m} + theta_k)^2 / (2 (m t0)^2 (n - 2m + 1))

over all k for which the terms exist, n samples.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from simnav.types import Array, ImuSamples

__all__ = ["AXES", "AllanCurve", "NoiseCoefficients", "allan_deviation", "imu_allan"]

#: The columns of the Allan deviation of an IMU.
AXES = (
    *(f"angular_rate_{axis}" for axis in "xyz"),
    *(f"specific_force_{axis}" for axis in "xyz"),
)
#: Averaging times in a factor of ten, and the fewest independent averages of an estimate.
_PER_DECADE, _LEAST = 10, 9
#: Lowest Allan deviation of flicker noise over its coefficient: sqrt(2 ln 2 / pi).
_FLICKER = 0.664


def averaging_numbers(n: int) -> NDArray[np.int64]:
    """Numbers of samples over which n samples are averaged, ten for each factor of ten."""
    most = max(1, n // _LEAST)
    return np.unique(np.rint(10.0 ** np.arange(0.0, np.log10(most) + 1e-9, 1.0 / _PER_DECADE)).astype(np.int64))


def allan_deviation(values: Array, rate: float, numbers: NDArray[np.int64] | None = None) -> tuple[Array, Array]:
    """The overlapping Allan deviation.

    Parameters
    ----------
    values : (n, d) array
        Means over successive sample intervals.
    rate : float
        Number of samples in a second [Hz].
    numbers : (m,) int array, optional
        Numbers of samples that are averaged, each at most n // 2. Default: ten for each factor of ten, up to n / 9.

    Returns
    -------
    time : (m,) array
        Averaging times [s].
    deviation : (m, d) array
        In the unit of the values.

    Raises
    ------
    ValueError
        If there are fewer than two samples, or a number is too large.
    """
    n = len(values)
    if n < 2:
        raise ValueError(f"an Allan deviation needs at least 2 samples, not {n}")
    chosen = averaging_numbers(n) if numbers is None else np.asarray(numbers)
    if chosen.max() > n // 2 or chosen.min() < 1:
        raise ValueError(f"averages are over 1 to {n // 2} of {n} samples, not over {chosen.min()} to {chosen.max()}")
    # Less the mean, which the second difference does not see, so that the sum keeps its digits.
    integral = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values - values.mean(axis=0), axis=0)])
    deviation = np.empty((len(chosen), values.shape[1]))
    for row, m in enumerate(chosen):
        second = integral[2 * m :] - 2.0 * integral[m : n + 1 - m] + integral[: n + 1 - 2 * m]
        deviation[row] = np.sqrt(0.5 * np.mean(second * second, axis=0)) / m
    return chosen / rate, deviation


@dataclass(frozen=True)
class NoiseCoefficients:
    """Coefficients of the noise of an axis, in SI units; zero where it is not seen.

    Attributes
    ----------
    random_walk : float
        White noise N: sigma^2 = N^2 / tau (angle or velocity random walk).
    bias_instability : float
        Flicker noise B: sigma = 0.664 B at all times.
    rate_random_walk : float
        Random walk K of the output: sigma^2 = K^2 tau / 3.
    quantization : float
        Quantization Q of the increments: sigma^2 = 3 Q^2 / tau^2.
    lowest : float
        Lowest Allan deviation.
    at : float
        Its averaging time [s].
    """

    random_walk: float
    bias_instability: float
    rate_random_walk: float
    quantization: float
    lowest: float
    at: float


@dataclass(frozen=True, eq=False)
class AllanCurve:
    """The Allan deviation of an IMU.

    Attributes
    ----------
    time : (m,) array
        Averaging times [s].
    deviation : (m, 6) array
        Of angular rate [rad/s] and specific force [m/s^2], in the order of `AXES`.
    """

    time: Array
    deviation: Array

    def coefficients(self) -> tuple[NoiseCoefficients, ...]:
        """Coefficients of each axis: the least relative error of the Allan variance, none of them negative.

        The variance of an estimate is in proportion to tau (Riley 2008, section 5.3), and so are the weights.
        """
        from scipy.optimize import nnls

        t = self.time
        terms = np.stack([1.0 / t, np.full(len(t), _FLICKER**2), t / 3.0, 3.0 / t**2], axis=1)
        found = []
        for column in self.deviation.T:
            least = int(np.argmin(column))
            if not column.all():
                found.append(NoiseCoefficients(0.0, 0.0, 0.0, 0.0, float(column[least]), float(t[least])))
                continue
            weight = np.sqrt(t[0] / t) / column**2
            scale = 1.0 / np.linalg.norm(terms * weight[:, None], axis=0)
            squares, _ = nnls(terms * weight[:, None] * scale, column**2 * weight)
            n, b, k, q = np.sqrt(squares * scale)
            found.append(NoiseCoefficients(n, b, k, q, float(column[least]), float(t[least])))
        return tuple(found)


def imu_allan(samples: ImuSamples, rate: float) -> AllanCurve:
    """The Allan deviation of the samples of an IMU at a constant rate [Hz].

    Raises
    ------
    ValueError
        If there are fewer than two samples.
    """
    values = np.hstack([samples.angular_rate, samples.specific_force])
    return AllanCurve(*allan_deviation(values, rate))
