"""Consistency: the agreement between the covariance of an estimator and its errors.

The normalised estimation error squared (NEES) of d components, e^T P^-1 e, is chi-square with d degrees of freedom for
a consistent Gaussian estimator (Bar-Shalom, Li and Kirubarajan, *Estimation with Applications to Tracking and
Navigation*, Wiley 2001, section 5.4). Scores here are divided by d: 1 is ideal, above it the estimator is optimistic
(its covariance too small), below it pessimistic.

Errors are correlated over the epochs of a run, so epochs are not independent samples, but runs are. The bands are
therefore those of the mean over M runs, chi-square with M d degrees of freedom. They are exact at one epoch, and wider
than necessary for a mean over time.

The NEES of what a verdict looks at (`JUDGED`), and the coverage, are also computed for two parts of a run: before the
first measurement that a fault affected, and from then on. An estimator may be consistent without faults and
inconsistent with them.

The verdict itself is that of the worst of them (`simnav.scoring.verdict`). How a run ended is in
`simnav.scoring.ending`.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from simnav.recording import Recording
from simnav.scoring.registry import ScoringInput, register_score
from simnav.types import Array

__all__ = [
    "GROUPS",
    "JUDGED",
    "LARGEST",
    "MARGIN",
    "Badge",
    "badge",
    "coverage",
    "first_fault",
    "nees",
    "nees_band",
    "nees_of_groups",
]

#: The components of each group that gets a NEES.
GROUPS: dict[str, tuple[int, ...]] = {
    "horizontal": (0, 1),
    "vertical": (2,),
    "position": (0, 1, 2),
    "velocity": (3, 4, 5),
    "attitude": (6, 7, 8),
    "heading": (8,),
}

#: The groups that a verdict on a covariance looks at.
JUDGED = ("horizontal", "vertical", "velocity", "heading")

#: Largest mean NEES [-]. It replaces the infinite NEES of a singular covariance, so that scores are finite.
LARGEST = 1e12

#: A mean NEES within this factor of 1 is consistent whatever the number of runs (sigmas right within 22 %).
MARGIN = 1.5

Badge = Literal["optimistic", "consistent", "pessimistic", "unknown"]


def nees(error: Array, covariance: Array, components: tuple[int, ...]) -> tuple[Array, NDArray[np.int64]]:
    """Normalised estimation error squared of a group of components, epoch by epoch.

    Parameters
    ----------
    error : (T, 9) array
        Errors e at T epochs. NaN components are left out of the NEES of the epoch.
    covariance : (T, 9, 9) array
        Covariances P of the error, as the estimator reports them.
    components : tuple of int
        Indices of the components of the group, for example one of `GROUPS`.

    Returns
    -------
    nees : (T,) array
        e^T P^-1 e; infinite where P is singular, NaN where no component is known.
    degrees : (T,) int array
        Number of components in the NEES of each epoch.
    """
    index = np.asarray(components)
    e = error[:, index]
    p = covariance[:, index[:, None], index]
    known = np.isfinite(e) & np.isfinite(np.diagonal(p, axis1=1, axis2=2))
    e = np.where(known, e, 0.0)
    p = np.where(known[:, :, None] & known[:, None, :], p, np.eye(len(index)))
    # The covariance is scaled by its own sigmas, so that small variances do not look like a singular matrix.
    sigma = np.sqrt(np.diagonal(p, axis1=1, axis2=2))
    flat = (sigma <= 0.0).any(axis=1)
    sigma = np.where(sigma > 0.0, sigma, 1.0)
    correlation = p / sigma[:, :, None] / sigma[:, None, :]
    values, vectors = np.linalg.eigh(0.5 * (correlation + correlation.swapaxes(1, 2)))
    flat |= values[:, 0] <= 1e-12
    principal = np.einsum("tij,ti->tj", vectors, e / sigma)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        result = np.sum(principal**2 / values, axis=1)
    result = np.where(flat, np.inf, result)
    degrees = known.sum(axis=1)
    return np.where(degrees > 0, result, np.nan), degrees.astype(np.int64)


def nees_band(degrees: int, runs: int, level: float = 0.95) -> tuple[float, float]:
    """Two-sided chi-square band of the mean of ``runs`` independent NEES, divided by the degrees of freedom.

    Parameters
    ----------
    degrees : int
        Degrees of freedom of one NEES.
    runs : int
        Number of independent runs.
    level : float
        Probability that the mean NEES of a consistent estimator is inside the band.

    Returns
    -------
    low, high : float
        Limits of the band; 1 is between them.

    Examples
    --------
    The example of Bar-Shalom et al. 2001, section 5.4.2: 50 runs, 2 components.

    >>> low, high = nees_band(2, 50)
    >>> round(2 * low, 2), round(2 * high, 2)
    (1.48, 2.59)
    """
    from scipy.special import gammaincinv  # to import scipy.stats takes 0.8 s

    n = degrees * runs
    low, high = 2.0 * gammaincinv(0.5 * n, [0.5 * (1.0 - level), 0.5 * (1.0 + level)]) / n
    return float(low), float(high)


def coverage(nees_horizontal: Array, level: float) -> float:
    """Fraction of epochs at which the truth lies in the horizontal error ellipse of a probability.

    Parameters
    ----------
    nees_horizontal : (T,) array
        NEES of the horizontal position (two degrees of freedom); NaN is left out.
    level : float
        Probability content of the ellipse: its NEES is below -2 ln(1 - level).
    """
    x = nees_horizontal[~np.isnan(nees_horizontal)]
    return float(np.mean(x <= -2.0 * math.log1p(-level))) if len(x) else float("nan")


def nees_of_groups(scored: ScoringInput) -> dict[str, tuple[Array, NDArray[np.int64]]]:
    """The result of `nees` for each group; empty without a covariance. For `ScoringInput.shared`."""
    covariance = scored.trial.covariance
    if covariance is None:
        return {}
    return {group: nees(scored.error, covariance, components) for group, components in GROUPS.items()}


def first_fault(recording: Recording) -> float:
    """Time of the first measurement or IMU sample that a fault affected [s]; infinite without any.

    Missing measurements do not count, because an estimator can see that they are missing.
    """
    data = recording.data
    times = [s.time[s.faults != 0] for s in data.aids.values()]
    if data.imu is not None and data.imu_labels is not None:
        times.append(data.imu.time[data.imu_labels.faults != 0])
    return min((float(t[0]) for t in times if len(t)), default=math.inf)


def _before_faults(scored: ScoringInput) -> NDArray[np.bool_]:
    """A mask of the epochs before the first fault."""
    return scored.trial.time < first_fault(scored.recording) - 1e-9


#: Parts of a run with scores of their own: the whole run, before the first fault, and from then on.
_PARTS = {"": "", "_clean": ", before the first fault", "_faulty": ", from the first fault on"}


def _part(scored: ScoringInput, part: str) -> NDArray[np.bool_]:
    if not part:
        return np.ones(len(scored.trial.time), dtype=bool)
    before = scored.shared(_before_faults)
    return before if part == "_clean" else ~before


def _register_nees(group: str, title: str, part: str = "") -> None:
    """Register a score: the mean NEES over the epochs, divided by the degrees of freedom, at most `LARGEST`."""

    @register_score(
        f"nees_{group}{part}", title=f"Mean NEES by degree of freedom, {title}{_PARTS[part]}", unit="-", better="one",
        uses_covariance=True,
    )  # fmt: skip
    def mean(scored: ScoringInput) -> float:
        found = scored.shared(nees_of_groups).get(group)
        if found is None:
            return float("nan")
        values, degrees = found
        known = (degrees > 0) & _part(scored, part)
        return min(float(values[known].sum() / degrees[known].sum()), LARGEST) if known.any() else float("nan")


def _register_coverage(percent: int, part: str = "") -> None:
    @register_score(
        f"coverage_{percent}{part}",
        title=f"Coverage of the {percent} % horizontal ellipse{_PARTS[part]}",
        unit="-",
        better="nominal",
        uses_covariance=True,
    )
    def share(scored: ScoringInput) -> float:
        found = scored.shared(nees_of_groups).get("horizontal")
        if found is None:
            return float("nan")
        values, degrees = found
        return coverage(np.where((degrees == 2) & _part(scored, part), values, np.nan), percent / 100.0)


_TITLES = {"horizontal": "horizontal position", "vertical": "height"}
for _group in GROUPS:
    _register_nees(_group, _TITLES.get(_group, _group))
for _percent in (50, 95):
    _register_coverage(_percent)
for _of in ("_clean", "_faulty"):
    for _group in JUDGED:
        _register_nees(_group, _TITLES.get(_group, _group), _of)
    _register_coverage(95, _of)


def badge(nees_by_run: Array, degrees: int = 2) -> Badge:
    """Verdict on an estimator's covariance over several runs.

    Parameters
    ----------
    nees_by_run : (M,) array
        Mean NEES of each run divided by its degrees of freedom (the scores ``nees_<group>``); NaN is left out.
    degrees : int
        Degrees of freedom of the group: 2 for the horizontal position.

    Returns
    -------
    str
        ``consistent`` if the mean over the runs lies within the 95 % chi-square band of M independent samples or within
        a factor of `MARGIN` of 1; otherwise ``optimistic`` (above) or ``pessimistic`` (below). ``unknown`` without a
        covariance.
    """
    x = np.asarray(nees_by_run, dtype=np.float64)
    x = x[~np.isnan(x)]
    if len(x) == 0:
        return "unknown"
    low, high = nees_band(degrees, len(x))
    mean = float(np.mean(x))
    if mean > max(high, MARGIN):
        return "optimistic"
    return "pessimistic" if mean < min(low, 1.0 / MARGIN) else "consistent"
