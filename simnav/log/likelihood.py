"""How likely a residual is, when neither its variance nor its correlation in time is known.

Each component of a residual is taken as n_eff independent normal samples with an unknown variance, whose prior is an
inverse-gamma distribution with few degrees of freedom about a usual size s. Integrated over the variance, the density
is Student's t::

    log p = -(n_eff + nu) / 2  log(nu s^2 + n_eff m)  + constants,        m the mean square

(A. Gelman et al., "Bayesian Data Analysis", 3rd edition, section 3.2). Residuals of instruments are correlated, so n
samples say as much as n_eff = n / (1 + 2 sum rho_k) independent ones; the sum ends where a pair of autocorrelations is
no longer positive (C. J. Geyer, "Practical Markov chain Monte Carlo", Statistical Science 7, 1992). Parameters of small
effect (bias, small turn, lever arm, scale) are those of the largest posterior density, with a normal prior.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from simnav.types import Array

__all__ = ["Fit", "Residual", "effective_samples", "fit", "log_ratios"]

#: Degrees of freedom of the prior of a variance.
_NU = 4.0
#: Residuals beyond this multiple of their robust standard deviation count as one of this size.
_FAR = 4.0
_NORMAL = 1.4826


@dataclass(frozen=True, eq=False)
class Residual:
    """Differences between two streams, in the order of time.

    Attributes
    ----------
    value : (n, d) array
        The differences; not a number where one of the streams says nothing.
    size : (d,) array
        Usual size of what is left where both are read rightly.
    design : (n, d, p) array
        Derivatives of the differences by parameters of small effect.
    spread : (p,) array
        Prior standard deviations of these.
    """

    value: Array
    size: Array
    design: Array
    spread: Array


@dataclass(frozen=True, eq=False)
class Fit:
    """A residual with its parameters fitted.

    Attributes
    ----------
    samples, mean_square, size : (d,) array
        Effective number of samples, mean square and usual size of each component; 0 samples where there are none.
    penalty : float
        Half the sum of squares of the parameters, over their prior variances.
    """

    samples: Array
    mean_square: Array
    size: Array
    penalty: float


def effective_samples(value: Array, white: float = 0.0) -> float:
    """Number of independent samples that say as much about the mean square as n correlated ones.

    Parameters
    ----------
    value : (n,) array
        In the order of time. Its mean is not taken out: a residual that is constant is one sample.
    white : float
        Variance of white noise that is taken to be added: of a residual that is far below it, it does not matter
        whether it is slow.
    """
    n = len(value)
    total = float(value @ value) + n * white
    if n < 4 or total <= 0.0:
        return float(n)
    spectrum = np.fft.rfft(value, 2 * n)
    correlation = np.fft.irfft(np.abs(spectrum) ** 2)[:n] / total
    pairs = correlation[1 : n - (n - 1) % 2].reshape(-1, 2).sum(axis=1)
    ends = np.flatnonzero(pairs <= 0.0)
    last = int(ends[0]) if ends.size else len(pairs)
    return float(np.clip(n / (1.0 + 2.0 * pairs[:last].sum()), 1.0, n))


def fit(residual: Residual) -> Fit:
    """Fit the parameters of small effect, and give mean squares and effective numbers of samples."""
    n, d = residual.value.shape
    p = residual.design.shape[2]
    known = np.isfinite(residual.value) & np.isfinite(residual.design).all(axis=2)
    value = np.where(known, residual.value, 0.0)
    design = np.where(known[:, :, None], residual.design, 0.0)
    count = known.sum(axis=0)
    parameters, left = np.zeros(p), value
    samples, mean_square = np.zeros(d), np.zeros(d)
    for turn in range(3):
        left = value - design @ parameters if p else value
        weight = np.zeros((n, d))
        for i in range(d):
            here = left[known[:, i], i]
            if not len(here):
                continue
            limit = _FAR * max(_NORMAL * float(np.median(np.abs(here))), residual.size[i])
            clipped = np.clip(here, -limit, limit)
            if turn != 1:
                samples[i] = effective_samples(clipped, float(residual.size[i]) ** 2)
            mean_square[i] = float(np.mean(clipped**2))
            scale = _NU * residual.size[i] ** 2 + samples[i] * mean_square[i]
            weight[known[:, i], i] = (samples[i] + _NU) * samples[i] / (scale * count[i])
            weight[known[:, i], i] *= np.minimum(1.0, limit / np.maximum(np.abs(here), 1e-300))
        if not p:
            break
        weighted = design * weight[:, :, None]
        normal = np.einsum("nip,niq->pq", weighted, design) + np.diag(residual.spread**-2.0)
        parameters = np.linalg.solve(normal, np.einsum("nip,ni->p", weighted, value))
    return Fit(samples, mean_square, residual.size, 0.5 * float(np.sum((parameters / residual.spread) ** 2)))


def log_ratios(other: Fit, present: Fit) -> Array:
    """Logarithms of the likelihood of one reading over that of another, by component; without the penalties.

    The number of samples is the smaller one: a residual that changes slowly says little. But if the other reading makes
    it larger, the number is that of the other reading: what it adds is not slow, and speaks against it.
    """
    worse = other.mean_square > present.mean_square
    samples = np.where(worse, other.samples, np.minimum(other.samples, present.samples))
    prior = _NU * present.size**2

    def density(one: Fit) -> Array:
        return -0.5 * (samples + _NU) * np.log(prior + samples * one.mean_square)

    return np.asarray(np.where(samples > 0.0, density(other) - density(present), 0.0))
