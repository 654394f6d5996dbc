"""Consistency: does the covariance that an estimator states agree with the errors that it makes?

The normalised estimation error squared (NEES) of d components, e^T P^-1 e, is chi-square with d degrees of freedom for
a consistent Gaussian estimator (Bar-Shalom, Li and Kirubarajan, *Estimation with Applications to Tracking and
Navigation*, Wiley 2001, section 5.4). Scores here are divided by d: 1 is ideal, above it the estimator is optimistic
(its covariance too small), below it pessimistic.

Errors are correlated over the epochs of a run, so that the epochs are no independent samples; runs are. Bands are
therefore those of the mean over M runs, chi-square with M d degrees of freedom: exact at one epoch, and wider than
needed for a mean over time.

The horizontal NEES and the coverage are also scored by parts: before the first measurement that a fault touched, and
from then on. An estimator may be consistent while nothing is wrong, and not know when something is.

An estimator can test itself, too: one whose measurements contradict it sets the diagnostic ``inconsistent`` to 1. A run
in which it does so for most of the time, or at its end, ends as ``inconsistent``, not as ``ok``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from simnav.recording import Recording
from simnav.scoring.registry import ScoringInput, register_score
from simnav.types import Array

__all__ = [
    "GROUPS",
    "LARGEST",
    "MARGIN",
    "Badge",
    "badge",
    "coverage",
    "ending",
    "first_fault",
    "nees",
    "nees_band",
]

#: The components of each group that gets a NEES.
GROUPS: dict[str, tuple[int, ...]] = {
    "horizontal": (0, 1),
    "position": (0, 1, 2),
    "velocity": (3, 4, 5),
    "attitude": (6, 7, 8),
}

#: Mean NEES [-] that stands for a covariance without an inverse, so that scores stay finite.
LARGEST = 1e12

#: A mean NEES within this factor of 1 is consistent whatever the number of runs (sigmas right within 22 %).
MARGIN = 1.5

Badge = Literal["optimistic", "consistent", "pessimistic", "unknown"]


def nees(error: Array, covariance: Array, components: tuple[int, ...]) -> tuple[Array, NDArray[np.int64]]:
    """Normalised estimation error squared of a group of components, epoch by epoch.

    Parameters
    ----------
    error : (T, 9) array
        NaN components are left out of the epoch's NEES.
    covariance : (T, 9, 9) array
        Of the error, as the estimator reports it.
    components : tuple of int
        For example one of `GROUPS`.

    Returns
    -------
    nees : (T,) array
        e^T P^-1 e; infinite where P is singular, NaN where no component is known.
    degrees : (T,) int array
        Number of components in it.
    """
    index = np.asarray(components)
    e = error[:, index]
    p = covariance[:, index[:, None], index]
    known = np.isfinite(e) & np.isfinite(np.diagonal(p, axis1=1, axis2=2))
    e = np.where(known, e, 0.0)
    p = np.where(known[:, :, None] & known[:, None, :], p, np.eye(len(index)))
    # In units of its own sigmas, so that a small variance is not taken for a singular matrix.
    sigma = np.sqrt(np.diagonal(p, axis1=1, axis2=2))
    flat = (sigma <= 0.0).any(axis=1)
    sigma = np.where(sigma > 0.0, sigma, 1.0)
    correlation = p / sigma[:, :, None] / sigma[:, None, :]
    values, vectors = np.linalg.eigh(0.5 * (correlation + correlation.swapaxes(1, 2)))
    flat |= values[:, 0] <= 1e-12
    principal = np.einsum("tij,ti->tj", vectors, e / sigma)
    with np.errstate(divide="ignore", invalid="ignore"):
        result = np.sum(principal**2 / values, axis=1)
    result = np.where(flat, np.inf, result)
    degrees = known.sum(axis=1)
    return np.where(degrees > 0, result, np.nan), degrees.astype(np.int64)


def nees_band(degrees: int, runs: int, level: float = 0.95) -> tuple[float, float]:
    """Two-sided chi-square band of the mean of ``runs`` independent NEES, divided by the degrees of freedom.

    Parameters
    ----------
    degrees : int
        Of one NEES.
    runs : int
        Number of independent runs.
    level : float
        Probability that a consistent estimator falls inside.

    Returns
    -------
    low, high : float
        Around 1.

    Examples
    --------
    The example of Bar-Shalom et al. 2001, section 5.4.2: 50 runs, 2 components.

    >>> low, high = nees_band(2, 50)
    >>> round(2 * low, 2), round(2 * high, 2)
    (1.48, 2.59)
    """
    from scipy.stats import chi2

    n = degrees * runs
    low, high = chi2.ppf([0.5 * (1.0 - level), 0.5 * (1.0 + level)], n) / n
    return float(low), float(high)


def coverage(nees_horizontal: Array, level: float) -> float:
    """Fraction of epochs at which the truth lies in the horizontal error ellipse of a probability.

    Parameters
    ----------
    nees_horizontal : (T,) array
        With two degrees of freedom; NaN is left out.
    level : float
        Probability content of the ellipse: its NEES is below -2 ln(1 - level).
    """
    x = nees_horizontal[~np.isnan(nees_horizontal)]
    return float(np.mean(x <= -2.0 * math.log1p(-level))) if len(x) else float("nan")


def _nees_of(given: ScoringInput) -> dict[str, tuple[Array, NDArray[np.int64]]]:
    """`nees` of each group; empty without a covariance."""
    covariance = given.trial.covariance
    if covariance is None:
        return {}
    return {group: nees(given.error, covariance, components) for group, components in GROUPS.items()}


def first_fault(recording: Recording) -> float:
    """Time of the first measurement or IMU sample that a fault touched [s]; infinite without any.

    Missing measurements are no faults here: a consistent estimator knows that it hears nothing.
    """
    data = recording.data
    times = [s.time[s.faults != 0] for s in data.aids.values()]
    if data.imu is not None and data.imu_labels is not None:
        times.append(data.imu.time[data.imu_labels.faults != 0])
    return min((float(t[0]) for t in times if len(t)), default=math.inf)


def _before_faults(given: ScoringInput) -> NDArray[np.bool_]:
    """Which epochs lie before the first fault."""
    return given.trial.time < first_fault(given.recording) - 1e-9


#: Parts of a run that are judged: all of it, before the first fault, and from then on.
_PARTS = {"": "", "_clean": ", before the first fault", "_faulty": ", from the first fault on"}


def _part(given: ScoringInput, part: str) -> NDArray[np.bool_]:
    if not part:
        return np.ones(len(given.trial.time), dtype=bool)
    before = given.shared(_before_faults)
    return before if part == "_clean" else ~before


def _register_nees(group: str, title: str, part: str = "") -> None:
    """The mean over the epochs, divided by the degrees of freedom: 1 is ideal, at most `LARGEST`."""

    @register_score(
        f"nees_{group}{part}", title=f"Mean NEES by degree of freedom, {title}{_PARTS[part]}", unit="-", better="one",
        uses_covariance=True,
    )  # fmt: skip
    def mean(given: ScoringInput) -> float:
        found = given.shared(_nees_of).get(group)
        if found is None:
            return float("nan")
        values, degrees = found
        known = (degrees > 0) & _part(given, part)
        return min(float(values[known].sum() / degrees[known].sum()), LARGEST) if known.any() else float("nan")


def _register_coverage(percent: int, part: str = "") -> None:
    @register_score(
        f"coverage_{percent}{part}", title=f"Coverage of the {percent} % horizontal ellipse{_PARTS[part]}", unit="-",
        better="nominal", uses_covariance=True,
    )  # fmt: skip
    def share(given: ScoringInput) -> float:
        found = given.shared(_nees_of).get("horizontal")
        if found is None:
            return float("nan")
        values, degrees = found
        return coverage(np.where((degrees == 2) & _part(given, part), values, np.nan), percent / 100.0)


for _group in GROUPS:
    _register_nees(_group, "horizontal position" if _group == "horizontal" else _group)
for _percent in (50, 95):
    _register_coverage(_percent)
for _of in ("_clean", "_faulty"):
    _register_nees("horizontal", "horizontal position", _of)
    _register_coverage(95, _of)


def _reports(given: ScoringInput) -> NDArray[np.bool_]:
    """Whether it reports that it is inconsistent, at the epochs at which it says anything of it."""
    reported = given.trial.diagnostics.get("inconsistent", np.empty(0))
    return reported[np.isfinite(reported)] > 0.5 if reported.ndim == 1 else np.zeros(0, dtype=bool)


@register_score(
    "inconsistent", title="Share of the epochs at which it reports that it is inconsistent", unit="-", better="lower"
)
def _inconsistent(given: ScoringInput) -> float:
    """NaN for an estimator that does not test itself."""
    reports = _reports(given)
    return float(np.mean(reports)) if reports.size else float("nan")


@register_score(
    "inconsistent_end",
    title="Share of the last tenth of the epochs at which it reports that it is inconsistent",
    unit="-",
    better="lower",
)
def _inconsistent_end(given: ScoringInput) -> float:
    """NaN for an estimator that does not test itself."""
    reports = _reports(given)
    return float(np.mean(reports[-max(1, reports.size // 10) :])) if reports.size else float("nan")


def ending(status: str, scores: Mapping[str, float]) -> str:
    """How a run ended: its status, or ``inconsistent``.

    A run that is ``ok`` ended as inconsistent where the estimator reported that its measurements contradict it, for
    most of the time, or for most of the last tenth: one that a late fault leaves wrong has ended so, too. It is no
    failure: a ranking takes its error as it is, so that nobody loses by being honest.

    Parameters
    ----------
    status : str
        Of the trial.
    scores : mapping of str to float
        Of the run.

    Examples
    --------
    >>> ending("ok", {"inconsistent": 0.98}), ending("timeout", {}), ending("ok", {"inconsistent": 0.1})
    ('inconsistent', 'timeout', 'ok')
    >>> ending("ok", {"inconsistent": 0.1, "inconsistent_end": 0.9})
    'inconsistent'
    """
    reported = max(scores.get("inconsistent", 0.0), scores.get("inconsistent_end", 0.0))
    return "inconsistent" if status == "ok" and reported > 0.5 else status


def badge(nees_by_run: Array, degrees: int = 2) -> Badge:
    """Verdict on an estimator's covariance over several runs.

    Parameters
    ----------
    nees_by_run : (M,) array
        Mean NEES of each run divided by its degrees of freedom (the scores ``nees_<group>``); NaN is left out.
    degrees : int
        Of the group: 2 for the horizontal position.

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
