"""The features of an error in windows of a minute: by these a real and a simulated error are told apart.

For each component of the error, in each window: the logarithm of its standard deviation, its autocorrelation at 1, 10
and 60 s, the slope of its spectrum, and its excess kurtosis; for the instrument the share of readings that are missing.
Mean values of a recording are taken off first, because a constant bias is another one in each recording.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from simnav.types import Array

from .errors import ErrorSeries

__all__ = ["LAGS", "WINDOW", "Windows", "autocorrelation", "feature_names", "imu_windows", "on_grid", "windows_of"]

Mask: TypeAlias = NDArray[np.bool_]

#: Length of a window, and lags of the autocorrelation [s].
WINDOW, LAGS = 60.0, (1.0, 10.0, 60.0)
#: Windows follow one another at this part of their length.
_STEP = 0.5
#: A window has at least this share of the readings that it should have, and this many.
_SHARE, _LEAST = 0.5, 12
#: Averaging times of the Allan deviation of an IMU within a window [s].
_AVERAGING = (0.1, 1.0, 10.0)


@dataclass(frozen=True, eq=False)
class Windows:
    """The features of the windows of several runs.

    Attributes
    ----------
    values : (w, f) array
        A row for each window.
    run : (w,) int array
        Number of the run that a window is of.
    start : (w,) array
        Beginning of each window [s].
    """

    values: Array
    run: NDArray[np.int64]
    start: Array


def feature_names(components: Sequence[str]) -> list[str]:
    """The names of the features of an instrument with these components of the error."""
    own = ["log sd", *(f"autocorrelation at {lag:g} s" for lag in LAGS), "spectral slope", "kurtosis"]
    return [f"{name} of {component}" for component in components for name in own] + ["missing readings"]


def windows_of(series: Sequence[ErrorSeries]) -> Windows:
    """Cut the errors of several runs into windows, and compute their features."""
    values, run, start = [], [], []
    for number, one in enumerate(series):
        grid, there = on_grid(one)
        n = round(WINDOW * one.rate)
        for first in range(0, len(grid) - n + 1, max(1, round(_STEP * n))):
            inside = there[first : first + n]
            if inside.sum() < max(_LEAST, _SHARE * n):
                continue
            parts = [_features(grid[:, k], there, first, n, one.rate) for k in range(grid.shape[1])]
            values.append([*(x for part in parts for x in part), 1.0 - float(inside.mean())])
            run.append(number)
            start.append(first / one.rate)
    return Windows(np.array(values).reshape(len(values), -1), np.array(run, dtype=np.int64), np.array(start))


def on_grid(series: ErrorSeries) -> tuple[Array, Mask]:
    """The error on the grid of its rate, less its mean, zero where there is no reading; and where there is one."""
    n = max(1, round(series.duration * series.rate))
    place = np.floor(series.time * series.rate + 1e-6).astype(np.int64)
    keep = (place >= 0) & (place < n)
    grid, there = np.zeros((n, series.error.shape[1])), np.zeros(n, dtype=np.bool_)
    grid[place[keep]] = (series.error - series.error.mean(axis=0))[keep]
    there[place[keep]] = True
    return grid, there


def autocorrelation(x: Array, there: Mask, lag: int) -> float:
    """The autocorrelation of a series with zero mean at a lag, over the pairs of which both are there; 0 for none."""
    if lag >= len(x):
        return 0.0
    both = there[:-lag] & there[lag:]
    power = float(np.mean(x[there] ** 2)) if there.any() else 0.0
    if both.sum() < 4 or power == 0.0:
        return 0.0
    return float(np.mean(x[:-lag][both] * x[lag:][both]) / power)


def _features(x: Array, there: Mask, first: int, n: int, rate: float) -> list[float]:
    inside = there[first : first + n]
    window = x[first : first + n][inside]
    window = window - window.mean()
    power = float(np.mean(window**2)) + 1e-300
    found = [0.5 * float(np.log(power))]
    centred = np.where(inside, x[first : first + n] - x[first : first + n][inside].mean(), 0.0)
    for lag in LAGS[:-1]:
        found.append(autocorrelation(centred, inside, max(1, round(lag * rate))))
    # 60 s are the length of a window: each reading with that a window later.
    later = first + max(1, round(LAGS[-1] * rate))
    pair = x[first : first + n], x[later : later + n]
    m = len(pair[1])
    both = inside[:m] & there[later : later + n]
    level = float(np.mean(x[there] ** 2)) + 1e-300
    found.append(float(np.mean(pair[0][:m][both] * pair[1][both]) / level) if both.sum() >= _LEAST else 0.0)
    found.append(_slope(window, rate))
    found.append(float(np.clip(np.mean(window**4) / power**2 - 3.0, -3.0, 30.0)))
    return found


def _slope(window: Array, rate: float) -> float:
    """Slope of the periodogram over the frequency, both logarithmic."""
    spectrum = np.abs(np.fft.rfft(window * np.hanning(len(window))))[1:] ** 2
    frequency = np.fft.rfftfreq(len(window), 1.0 / rate)[1:]
    return float(np.polyfit(np.log(frequency), np.log(spectrum + 1e-12 * spectrum.max() + 1e-300), 1)[0])


def imu_windows(runs: Sequence[tuple[Array, float]]) -> tuple[Windows, list[str]]:
    """Windows of the samples of IMUs: the Allan deviations of the six axes.

    Parameters
    ----------
    runs : sequence of ((n, 6) array, float)
        Angular rates and specific forces, and sample rate [Hz], of each run. They contain the motion.
    """
    values, run, start = [], [], []
    for number, (samples, rate) in enumerate(runs):
        n = round(WINDOW * rate)
        for first in range(0, len(samples) - n + 1, n):
            window = samples[first : first + n]
            row = []
            for averaging in _AVERAGING:
                m = max(1, round(averaging * rate))
                means = window[: len(window) // m * m].reshape(-1, m, 6).mean(axis=1)
                row += (0.5 * np.log(0.5 * np.mean(np.diff(means, axis=0) ** 2, axis=0) + 1e-300)).tolist()
            values.append(row)
            run.append(number)
            start.append(first / rate)
    axes = [f"{triad} {axis}" for triad in ("gyroscope", "accelerometer") for axis in "xyz"]
    names = [f"log Allan deviation at {t:g} s of {axis}" for t in _AVERAGING for axis in axes]
    return Windows(np.array(values).reshape(len(values), -1), np.array(run, dtype=np.int64), np.array(start)), names
