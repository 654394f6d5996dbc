"""The error processes of instruments: Gauss-Markov of first and second order, random walk, quantization.

Every process is a state machine. It receives the times of successive blocks and gives the same numbers, bit for bit,
for any division into blocks. Times may be irregular. Each process has its own generator (`simnav.streams.stream`) and
draws a fixed number of variates for each sample.

Source: P. D. Groves, *Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems*, 2nd ed., Artech
House 2013, sections 4.4 and 14.2; A. Gelb (ed.), *Applied Optimal Estimation*, MIT Press 1974, section 3.6.
"""

from __future__ import annotations

from math import exp, expm1, floor, isinf, pi, sqrt

import numpy as np

from simnav.compiled import helper, kernel, ready
from simnav.declared_process import oscillation
from simnav.kernel_types import Matrix, Stack, Vector
from simnav.types import Array

__all__ = ["GaussMarkov", "HeldGaussMarkov", "SecondOrder", "quantize_scalar"]


@helper
def quantize_scalar(increment: float, step: float, residual: float) -> tuple[float, float]:
    """The multiple of ``step`` nearest to increment + residual, and the new residual for the next sample."""
    total = increment + residual
    output = step * floor(total / step + 0.5)
    return output, total - output


@kernel
def _gauss_markov(
    variates: Matrix, state: Vector, sigma: Vector, time: Vector, previous: float, correlation_time: float
) -> bool:
    """Convert (n, d) unit variates w into the process x, in place. Return False if the times are not ascending.

    x_k = a x_{k-1} + b sigma w_k with a = exp(-dt/T), b = sqrt(1 - a^2) for the step dt and the correlation time T; for
    an infinite T: a = 1, b = sqrt(dt).
    """
    step = -1.0
    a = 1.0
    b = 0.0
    for i in range(len(time)):
        dt = time[i] - previous
        previous = time[i]
        if not dt >= 0.0:
            return False
        if dt != step:
            step = dt
            if isinf(correlation_time):
                a = 1.0
                b = sqrt(dt)
            else:
                a = exp(-dt / correlation_time)
                b = sqrt(-expm1(-2.0 * dt / correlation_time))
        for j in range(len(state)):
            state[j] = a * state[j] + b * sigma[j] * variates[i, j]
            variates[i, j] = state[j]
    return True


@kernel
def _second_order(
    variates: Stack, state: Matrix, time: Vector, previous: float, frequency: float, damping: float
) -> bool:
    """Convert (n, d, 2) unit variates into value and rate / w of the process x, in place. False as of `_gauss_markov`.

    With the transition matrix Phi of (x, x' / w) the noise of a step has the covariance I - Phi Phi', of which the
    lower Cholesky factor is taken.
    """
    step = -1.0
    a, b, c, d = 1.0, 0.0, 0.0, 1.0
    l11, l21, l22 = 0.0, 0.0, 0.0
    for i in range(len(time)):
        dt = time[i] - previous
        previous = time[i]
        if not dt >= 0.0:
            return False
        if dt != step:
            step = dt
            by = oscillation(dt, frequency, damping)
            a, b, c, d = by.value_by_value, by.value_by_rate * frequency, by.rate_by_value / frequency, by.rate_by_rate
            l11 = sqrt(max(1.0 - a * a - b * b, 0.0))
            l21 = -(a * c + b * d) / l11 if l11 > 0.0 else 0.0
            l22 = sqrt(max(1.0 - c * c - d * d - l21 * l21, 0.0))
        for j in range(len(state)):
            x, v = state[j, 0], state[j, 1]
            first, second = variates[i, j, 0], variates[i, j, 1]
            state[j, 0] = a * x + b * v + l11 * first
            state[j, 1] = c * x + d * v + l21 * first + l22 * second
            variates[i, j, 0], variates[i, j, 1] = state[j, 0], state[j, 1]
    return True


def _vector(value: Array | float, size: int | None = None) -> Array:
    vector = np.array(value, dtype=np.float64, ndmin=1)
    return vector if size is None else np.broadcast_to(vector, (size,)).copy()


class GaussMarkov:
    """First-order Gauss-Markov process; with an infinite correlation time, a random walk.

    It exists from time 0, where it is drawn from its stationary distribution (a random walk starts at zero).
    Its autocovariance is sigma^2 exp(-|dt| / T).

    Parameters
    ----------
    sigma : (d,) array
        Stationary standard deviation of each component [x]; for a random walk, its density [x/sqrt(s)].
    correlation_time : float
        Correlation time T [s]; infinite for a random walk.
    rng : numpy.random.Generator
        Random stream that only this process uses.
    """

    def __init__(self, sigma: Array | float, correlation_time: float, rng: np.random.Generator):
        if not correlation_time > 0.0:
            raise ValueError(f"a correlation time is positive, not {correlation_time} s")
        self.sigma = _vector(sigma)
        self.correlation_time = float(correlation_time)
        self._rng = rng
        self._time = 0.0
        start = 0.0 if np.isinf(correlation_time) else rng.standard_normal(len(self.sigma))
        self.state = self.sigma * start
        self._started = False

    def sample(self, time: Array) -> Array:
        """The process at the times of the next block.

        Parameters
        ----------
        time : (n,) array
            Ascending times, not before the last time of the previous block [s]. If the first time of a run is negative,
            the process has its initial value there.

        Returns
        -------
        (n, d) array
            Values of the process, in the unit of ``sigma``.

        Raises
        ------
        ValueError
            If the times are not ascending.
        """
        n = len(time)
        x = self._rng.standard_normal((n, len(self.sigma)))
        if n:
            t = ready(time)
            if not self._started:
                self._time = min(0.0, float(t[0]))
                self._started = True
            if not _gauss_markov(x, self.state, self.sigma, t, self._time, self.correlation_time):
                raise ValueError("the times of an error process run backwards; sort the measurements by time")
            self._time = float(t[-1])
        return x


class SecondOrder:
    """Stationary second-order Gauss-Markov process (`simnav.declared_process`).

    Parameters
    ----------
    sigma : (d,) array
        Standard deviation of each component.
    period : float
        Natural period [s].
    damping : float
        Damping ratio.
    rng : numpy.random.Generator
        Random stream that only this process uses.
    """

    def __init__(self, sigma: Array | float, period: float, damping: float, rng: np.random.Generator):
        self.sigma = _vector(sigma)
        self._frequency, self._damping, self._rng = 2.0 * pi / period, float(damping), rng
        self._state = rng.standard_normal((len(self.sigma), 2))
        self._time: float | None = None

    def sample(self, time: Array) -> Array:
        """The process at the times of the next block. See `GaussMarkov.sample`."""
        x = self._rng.standard_normal((len(time), len(self.sigma), 2))
        if len(time):
            t = ready(time)
            first = min(0.0, float(t[0])) if self._time is None else self._time
            if not _second_order(x, self._state, t, first, self._frequency, self._damping):
                raise ValueError("the times of an error process run backwards; sort the measurements by time")
            self._time = float(t[-1])
        return np.asarray(self.sigma * x[:, :, 0])


class HeldGaussMarkov:
    """Gauss-Markov process that changes on the grid 0, h, 2h, ... and is constant between the grid points.

    It is used for a bias that changes slowly compared with the sample rate. Each value has the stationary variance. The
    autocovariance at multiples of h is exact. The power density at low frequencies, which decides the error of inertial
    navigation, is that of the continuous process times 1 + (h/T)^2 / 12; for h = T/100 the factor is 1 + 1e-5.

    Parameters
    ----------
    sigma : (d,) array
        Stationary standard deviation of each component, as in `GaussMarkov`.
    correlation_time : float
        Correlation time T [s], as in `GaussMarkov`.
    hold : float
        Spacing h of the grid [s].
    rng : numpy.random.Generator
        Random stream that only this process uses.
    """

    def __init__(self, sigma: Array | float, correlation_time: float, hold: float, rng: np.random.Generator):
        self._process = GaussMarkov(sigma, correlation_time, rng)
        self.per_second = 1.0 / hold
        self._hold = hold
        self._next = 1
        self._last = self._process.state[None].copy()

    def table(self, until: float) -> tuple[Array, int]:
        """The values at the grid points up to a time, from the last grid point of the previous call on.

        Parameters
        ----------
        until : float
            Last time of the block [s].

        Returns
        -------
        values : (m, d) array
            Values of the d components, in the unit of the process.
        first : int
            Number of the first grid point. The value at time t is that of grid point floor(t / h + 1e-6); the term 1e-6
            is for times that are multiples of h up to rounding.
        """
        first = self._next - 1
        end = int(until * self.per_second + 1e-6) + 1
        if end <= self._next:
            return self._last, first
        grid = np.arange(self._next, end, dtype=np.float64) * self._hold
        values = np.concatenate([self._last, self._process.sample(grid)])
        self._next, self._last = end, values[-1:].copy()
        return values, first
