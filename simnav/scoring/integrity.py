"""Integrity: whether an estimator bounds its position error, and how often the bound is below the alert limit.

The **protection level** of an estimator at an epoch is its diagnostic ``protection_level`` [m], or, without this
diagnostic, a multiple of its standard deviation (`protection_levels`). The **alert limit** is the largest acceptable
error in the waters. If the protection level is above the limit, the navigator is warned, and the position counts as not
available. Every epoch is one of five kinds (the regions of a Stanford diagram):

=========================  ==================================================
normal                     error <= protection level <= alert limit
misleading                 protection level < error <= alert limit
hazardously misleading     protection level <= alert limit < error
unavailable                error <= protection level, above the alert limit
unavailable, misleading    error > protection level, above the alert limit
=========================  ==================================================

Limits of the International Maritime Organization:

- A.915(22), *Revised maritime policy and requirements for a future GNSS*, 2001, appendix 2: horizontal alert limit 25 m
  on the ocean, in coastal waters, port approaches and restricted waters; 2.5 m in ports. Integrity risk 1e-5 in three
  hours, availability 99.8 %.
- A.1046(27), *Worldwide radionavigation system*, 2011: an error of no more than 100 m on the ocean and 10 m in harbour
  entrances, harbour approaches and coastal waters, each with a probability of 95 %. It has no alert limit.

Source: T. Walter, A. Hansen and P. Enge, *Validation of the WAAS MOPS integrity equation*, ION Annual Meeting 1999; R.
Tossaint, J. Samson, F. Toran et al., *The Stanford-ESA integrity diagram*, Navigation 54(2), 2007.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import log, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simnav.recording import Recording
from simnav.scoring.navigation_error import errors, horizontal
from simnav.scoring.registry import ScoringInput, register_score
from simnav.trial import Trial
from simnav.types import Array

__all__ = ["ALERT_LIMITS", "KINDS_OF_EPOCHS", "RISK", "Stanford", "protection_levels", "stanford"]

#: Probability that the error may exceed a protection level that follows from a covariance: A.915(22).
RISK = 1e-5
#: Horizontal alert limits of A.915(22) [m]: ocean, coast and port approaches; ports.
ALERT_LIMITS: tuple[float, ...] = (25.0, 2.5)
#: Radii that 95 % of the errors should keep to, of A.1046(27) [m]: harbours and coast; ocean.
ACCURACIES: tuple[float, ...] = (10.0, 100.0)

KINDS_OF_EPOCHS: tuple[str, ...] = (
    "normal",
    "misleading",
    "hazardously misleading",
    "unavailable",
    "unavailable, misleading",
)


def protection_levels(trial: Trial, risk: float = RISK) -> Array:
    """Horizontal protection level of each epoch [m].

    The diagnostic ``protection_level`` of the estimator, if it has one. Else ``K sigma``, with sigma the semi-major
    axis of the horizontal covariance and ``K = sqrt(-2 ln risk)``: exactly the radius that a circular Gaussian error
    exceeds with the probability ``risk``; an error of any other ellipse exceeds it less often.

    Parameters
    ----------
    trial : Trial
        The estimates, covariances and diagnostics.
    risk : float
        Probability that the error exceeds a level that follows from a covariance.

    Returns
    -------
    (T,) array
        Protection levels; NaN at epochs with neither diagnostic nor covariance.
    """
    reported = trial.diagnostics.get("protection_level")
    if reported is not None:
        if reported.ndim != 1:
            raise ValueError(
                f"{trial.estimator}: the diagnostic 'protection_level' is one number an epoch, "
                f"not an array of shape {reported.shape[1:]}"
            )
        return reported
    if trial.covariance is None:
        return np.full(len(trial), np.nan)
    p = trial.covariance[:, :2, :2]
    middle = 0.5 * (p[:, 0, 0] + p[:, 1, 1])
    largest = middle + np.hypot(0.5 * (p[:, 0, 0] - p[:, 1, 1]), p[:, 0, 1])
    level: Array = sqrt(-2.0 * log(risk)) * np.sqrt(largest)
    return level


@dataclass(frozen=True, eq=False)
class Stanford:
    """The data of a Stanford diagram: the error and the protection level of each epoch.

    Attributes
    ----------
    error, level : (T,) array
        Horizontal error and protection level [m]; infinite where there is no protection level. Epochs without truth
        are left out, and those without an estimate have an infinite error and level.
    limit : float
        Alert limit [m].
    """

    error: Array
    level: Array
    limit: float

    @property
    def kind(self) -> NDArray[np.int64]:
        """(T,) array: index in `KINDS_OF_EPOCHS`."""
        available, bounded = self.level <= self.limit, self.error <= self.level
        hazard = self.error > self.limit
        return np.select(
            [available & bounded, available & hazard, available, bounded], [0, 2, 1, 3], default=4
        ).astype(np.int64)  # fmt: skip

    @property
    def shares(self) -> dict[str, float]:
        """Share of the epochs of each kind; they sum to 1. NaN without an epoch."""
        if not len(self.error):
            return dict.fromkeys(KINDS_OF_EPOCHS, float("nan"))
        counts = np.bincount(self.kind, minlength=len(KINDS_OF_EPOCHS))
        return dict(zip(KINDS_OF_EPOCHS, (counts / counts.sum()).tolist(), strict=True))

    def histogram(self, edges: Array) -> NDArray[np.int64]:
        """Number of epochs by error (rows) and protection level (columns).

        Parameters
        ----------
        edges : (n + 1,) array
            Edges of the bins, the first one 0 [m]. Larger values count in the last bin.
        """
        last = 0.5 * (edges[-2] + edges[-1])
        pair = np.clip(self.error, 0.0, last), np.clip(self.level, 0.0, last)
        return np.histogram2d(*pair, bins=[edges, edges])[0].astype(np.int64)

    def to_dict(self, edges: Iterable[float] | None = None) -> dict[str, Any]:
        """A dictionary for JSON: limit, shares and a histogram, by default with 40 bins up to twice the limit."""
        steps = np.linspace(0.0, 2.0 * self.limit, 41) if edges is None else np.asarray(list(edges), dtype=np.float64)
        return {
            "limit": self.limit,
            "epochs": len(self.error),
            "shares": self.shares,
            "edges": steps.tolist(),
            "histogram": self.histogram(steps).tolist(),
        }


def stanford(runs: Iterable[tuple[Trial, Recording]], limit: float = ALERT_LIMITS[0]) -> Stanford:
    """The epochs of one run or of several, for a Stanford diagram.

    Parameters
    ----------
    runs : iterable of (Trial, Recording)
        Trials, each with the recording that it was run on.
    limit : float
        Alert limit [m].
    """
    pairs = [_epochs(trial, recording, horizontal(errors(trial, recording))) for trial, recording in runs]
    if not pairs:
        return Stanford(np.empty(0), np.empty(0), limit)
    error, level = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
    return Stanford(error, level, limit)


def _epochs(trial: Trial, recording: Recording, error: Array) -> tuple[Array, Array]:
    """Error and protection level at all epochs with truth, those that a failed trial did not reach included."""
    known: NDArray[np.bool_] = np.all(np.isfinite(recording.data.truth.position[:, :2]), axis=1)
    e, level = np.full((2, len(known)), np.inf)
    reached = len(trial)
    e[:reached] = np.where(np.isfinite(error), error, np.inf)
    found = protection_levels(trial)
    level[:reached] = np.where(np.isfinite(found) & np.isfinite(error), found, np.inf)
    return e[known], level[known]


def _of(scored: ScoringInput) -> tuple[Array, Array] | None:
    """Errors and protection levels of a run; None if it has no protection level at all."""
    if not np.isfinite(protection_levels(scored.trial)).any():
        return None
    return _epochs(scored.trial, scored.recording, scored.horizontal)


@register_score(
    "protection_exceeded", title="Share of epochs with an error above the protection level", unit="-", better="lower",
    uses_covariance=True,
)  # fmt: skip
def _exceeded(scored: ScoringInput) -> float:
    found = scored.shared(_of)
    if found is None:
        return float("nan")
    error, level = found
    stated = np.isfinite(level)
    return float(np.mean(error[stated] > level[stated]))


def _register_limit(limit: float) -> None:
    suffix = f"{limit:g}".replace(".", "_")

    @register_score(
        f"integrity_risk_{suffix}", title=f"Share of epochs with an error above {limit:g} m that are not warned of",
        unit="-", better="lower", uses_covariance=True,
    )  # fmt: skip
    def risk(scored: ScoringInput) -> float:
        found = scored.shared(_of)
        if found is None:
            return float("nan")
        return Stanford(*found, limit).shares["hazardously misleading"]

    @register_score(
        f"integrity_availability_{suffix}", title=f"Share of epochs with a protection level of {limit:g} m or less",
        unit="-", better="higher", uses_covariance=True,
    )  # fmt: skip
    def availability(scored: ScoringInput) -> float:
        found = scored.shared(_of)
        return float("nan") if found is None else float(np.mean(found[1] <= limit))


def _register_accuracy(radius: float) -> None:
    @register_score(
        f"within_{radius:g}_m",
        title=f"Share of epochs with an error of {radius:g} m or less",
        unit="-",
        better="higher",
    )
    def within(scored: ScoringInput) -> float:
        known = np.isfinite(scored.recording.data.truth.position[:, :2]).all(axis=1).sum()
        return float((scored.horizontal <= radius).sum() / known) if known and len(scored.error) else float("nan")


for _limit in ALERT_LIMITS:
    _register_limit(_limit)
for _radius in ACCURACIES:
    _register_accuracy(_radius)
