"""The processes that fit a real error best: white noise, and first- and second-order Gauss-Markov processes.

The autocovariance of the error is a sum of those of the processes, so their variances follow by non-negative least
squares over a grid of shapes (C. L. Lawson and R. J. Hanson, *Solving Least Squares Problems*, 1974, chapter 23). The
shapes are the same for all components of an instrument, and are added one by one, as long as each makes the residual
clearly smaller. A shape is compared as it looks after the mean of a recording of its length is taken off.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import pi, sqrt
from typing import Any

import numpy as np
from scipy.optimize import nnls
from scipy.stats import t as student

from simnav.kinds import Kind
from simnav.spec import UNITS
from simnav.types import Array

from .errors import ErrorSeries
from .features import on_grid

__all__ = ["Fit", "autocovariance", "fitted", "fitted_apart"]

#: Largest lag that is fitted [s], and largest number of coloured processes.
_LONGEST, _MOST = 120.0, 3
#: A further process makes the residual smaller by at least this part of the variance squared.
_GAIN = 0.004
#: Correlation times [s]; periods [s] and damping ratios of second-order processes.
_TIMES = (0.5, 0.8, 1.2, 2.0, 3.0, 5.0, 8.0, 12.0, 20.0, 30.0, 50.0, 80.0, 120.0, 200.0, 300.0, 600.0, 1800.0)
_PERIODS = (2.2, 2.6, 3.2, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 12.0, 15.0, 20.0, 30.0)
_DAMPINGS = (0.06, 0.12, 0.25, 0.5)
#: Above this many degrees of freedom white noise is normal.
_NORMAL = 20.0


@dataclass(frozen=True, eq=False)
class Fit:
    """Processes that fit an error.

    Attributes
    ----------
    white : (d,) array
        Standard deviation of the white noise, SI units.
    freedom : (d,) array
        Degrees of freedom of Student's t for the white noise of each component; infinite for normal noise.
    bias : (d,) array
        Root mean square over the recordings of the mean error.
    shapes : list of dict
        Kind and shape of each coloured process, as in TOML.
    sigma : (p, d) array
        Standard deviation of each coloured process.
    """

    white: Array
    freedom: Array
    bias: Array
    shapes: list[dict[str, Any]]
    sigma: Array

    def to_toml(self, name: str, kind: Kind) -> str:
        """The keys and tables of an instrument, in the units of its kind."""
        unit, component = kind.components[0].error_unit, len(kind.components)
        factor = UNITS[unit]

        def written(values: Array) -> str:
            numbers = [f"{v / factor:.3g}" for v in np.atleast_1d(values)]
            return numbers[0] if component == 1 else f"[{', '.join(numbers)}]"

        heavy = self.freedom < _NORMAL
        lines = [f"[instruments.{name}]", f"sigma_{unit} = {written(np.where(heavy, 0.0, self.white))}"]
        lines.append(f"bias_{unit} = {written(self.bias)}")
        for k in np.flatnonzero(heavy & (self.white > 0.0)).tolist():
            lines += [
                "", f"[[instruments.{name}.error]]", 'kind = "heavy_tailed"',
                f"sigma_{unit} = {written(np.where(np.arange(component) == k, self.white, 0.0))}",
                f"degrees_of_freedom = {self.freedom[k]:.3g}",
            ]  # fmt: skip
        for shape, sigma in zip(self.shapes, self.sigma, strict=True):
            lines += [
                "",
                f"[[instruments.{name}.error]]",
                f'kind = "{shape["kind"]}"',
                f"sigma_{unit} = {written(sigma)}",
            ]
            lines += [f"{key} = {value:g}" for key, value in shape.items() if key != "kind"]
        return "\n".join(lines) + "\n"


def autocovariance(series: Sequence[ErrorSeries], longest: float = _LONGEST) -> Array:
    """(m, d) mean autocovariance of several runs at the lags 0, 1 / rate, 2 / rate, ... up to ``longest`` [s].

    The mean of each run is taken off. Runs count by their lengths.
    """
    rate = series[0].rate
    m = max(2, min(round(longest * rate) + 1, round(0.4 * min(s.duration for s in series) * rate)))
    total, pairs = np.zeros((m, series[0].error.shape[1])), np.zeros(m)
    for one in series:
        x, there = on_grid(one)
        for lag in range(m):
            both = there[: len(there) - lag] & there[lag:]
            total[lag] += np.sum(x[: len(x) - lag][both] * x[lag:][both], axis=0)
            pairs[lag] += both.sum()
    return np.asarray(total / np.maximum(pairs, 1.0)[:, None])


def _shapes(lags: Array, step: float, n: int) -> list[tuple[dict[str, Any], Array]]:
    """All shapes with their autocorrelation at some lags (numbers of steps), less the mean of n readings."""
    far = np.arange(n) * step
    found: list[tuple[dict[str, Any], Array]] = []
    for time in _TIMES:
        found.append(({"kind": "gauss_markov", "correlation_time_s": time}, np.exp(-far / time)))
    for period in _PERIODS:
        if period < 2.1 * step:
            continue
        for damping in _DAMPINGS:
            w, s = 2.0 * pi / period, 2.0 * pi / period * sqrt(1.0 - damping**2)
            swing = np.exp(-damping * w * far) * (np.cos(s * far) + damping * w / s * np.sin(s * far))
            found.append(({"kind": "gauss_markov_2", "period_s": period, "damping": damping}, swing))
    weight = np.concatenate([[1.0], 2.0 * (1.0 - np.arange(1, n) / n)]) / n
    return [(shape, rho[lags] - float(weight @ rho)) for shape, rho in found]


def fitted(series: Sequence[ErrorSeries]) -> Fit:
    """Fit the processes to the errors of several runs."""
    rate, found = series[0].rate, autocovariance(series)
    # All near lags, and ever fewer of the far ones, which say the same as their neighbours.
    kept_lags = np.unique(
        np.concatenate([np.arange(min(25, len(found))), np.geomspace(1, len(found) - 1, 40)]).astype(int)
    )
    found, lags = found[kept_lags], kept_lags / rate
    n = round(float(np.median([s.duration for s in series])) * rate)
    shapes = _shapes(kept_lags, 1.0 / rate, n)
    white = np.zeros(len(lags))
    white[0] = 1.0
    near = np.sqrt(1.0 / (1.0 + lags / 10.0))[:, None]  # near lags are known better, and matter more
    # Two descriptions of the same thing: the autocovariance, and the mean square change over a lag, relative to that of
    # the real error. The second has the small and fast parts beside large and slow ones.
    change = np.maximum(found[0] - found, 1e-3 * found[0])[1:]
    wanted = np.concatenate([found / found[0] * near, (found[0] - found[1:]) / change * near[1:]])
    chosen: list[int] = []

    def left(picked: list[int]) -> tuple[float, Array]:
        rho = np.stack([white, *(shapes[k][1] for k in picked)], axis=1)
        solved = []
        for j in range(wanted.shape[1]):
            changes = (rho[0] - rho[1:]) * (found[0, j] / change[:, j : j + 1])
            solved.append(nnls(np.concatenate([rho * near, changes * near[1:]]), wanted[:, j]))
        return sum(residual**2 for _, residual in solved), np.stack([shares for shares, _ in solved], axis=1)

    residual, shares = left([])
    while len(chosen) < _MOST:
        tries = [(left([*chosen, k])[0], k) for k in range(len(shapes)) if k not in chosen]
        best, k = min(tries)
        if residual - best < _GAIN * len(lags) ** 0.5 * wanted.shape[1]:
            break
        chosen.append(k)
        residual, shares = left(chosen)
    kept = [i for i in range(len(chosen)) if shares[1 + i].max() > 1e-3]
    bias = np.sqrt(np.mean([s.error.mean(axis=0) ** 2 for s in series], axis=0))
    return Fit(
        np.sqrt(shares[0] * found[0]),
        _freedom(series, shares),
        bias,
        [shapes[chosen[i]][0] for i in kept],
        np.sqrt(shares[1:][kept] * found[0]),
    )


def fitted_apart(series: Sequence[ErrorSeries]) -> Fit:
    """Fit the processes to the errors of several runs, with shapes of its own for each component."""
    d = series[0].error.shape[1]
    fits = [fitted([replace(s, error=s.error[:, k : k + 1]) for s in series]) for k in range(d)]
    sigma = [np.eye(d)[k] * size for k, fit in enumerate(fits) for size in fit.sigma]
    return Fit(
        np.concatenate([f.white for f in fits]),
        np.concatenate([f.freedom for f in fits]),
        np.concatenate([f.bias for f in fits]),
        [shape for f in fits for shape in f.shapes],
        np.array(sigma).reshape(-1, d),
    )


def _freedom(series: Sequence[ErrorSeries], shares: Array) -> Array:
    """Degrees of freedom of the white part, from the tails of the readings less the mean of their neighbours."""
    parts = []
    for one in series:
        x, there = on_grid(one)
        whole = there[:-2] & there[1:-1] & there[2:]
        rough = (x[1:-1] - 0.5 * (x[:-2] + x[2:]))[whole]
        parts.append(rough / (np.median(np.abs(rough), axis=0) + 1e-300))
    found = np.full(shares.shape[1], np.inf)
    for k, rough in enumerate(np.concatenate(parts).T):
        if rough.size and shares[0, k] > 0.02:
            freedom = float(student.fit(rough[:20000], floc=0.0)[0])
            found[k] = max(freedom, 2.2) if freedom < _NORMAL else np.inf
    return found
