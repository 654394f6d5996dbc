"""How a run ended: as its trial did, or lost, or inconsistent.

- **lost**: an error is beyond 100 times its stated sigma for more than a tenth of the epochs. Whatever the estimator
  reports, nobody could navigate by it. It counts as a failure does.
- **inconsistent**: the estimator reports that its measurements contradict its estimate. If it tests itself, it sets the
  diagnostic ``inconsistent`` to 1. This is not a failure: a ranking uses the error of the run as it is, so that an
  estimator does not lose by the report.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from simnav.scoring.consistency import JUDGED, nees_of_groups
from simnav.scoring.registry import ScoringInput, register_score

__all__ = ["FAR", "SHARE", "ending", "outcome", "why_lost"]

#: An error of so many stated sigmas is beyond all that a covariance admits.
FAR = 100.0
#: A run is lost if this is so at a larger share of its epochs.
SHARE = 0.1


@register_score(
    "beyond_sigma", title=f"Share of the epochs with an error beyond {FAR:g} times its stated sigma", unit="-",
    better="lower", uses_covariance=True,
)  # fmt: skip
def _beyond_sigma(scored: ScoringInput) -> float:
    """Of the epochs with a covariance: horizontal position, height, velocity or heading; NaN without any.

    The error of a group of d components, in stated sigmas, is the square root of its NEES divided by d.
    """
    known = np.zeros(len(scored.trial.time), dtype=bool)
    far = known.copy()
    groups = scored.shared(nees_of_groups)
    for group in JUDGED if groups else ():
        values, degrees = groups[group]
        known |= degrees > 0
        far |= (degrees > 0) & (values > FAR**2 * degrees)
    return float(np.mean(far[known])) if known.any() else float("nan")


def _reports(scored: ScoringInput) -> NDArray[np.bool_]:
    """The diagnostic ``inconsistent`` as a mask, at the epochs that have it."""
    reported = scored.trial.diagnostics.get("inconsistent", np.empty(0))
    return reported[np.isfinite(reported)] > 0.5 if reported.ndim == 1 else np.zeros(0, dtype=bool)


@register_score(
    "inconsistent", title="Share of the epochs at which it reports that it is inconsistent", unit="-", better="lower"
)
def _inconsistent(scored: ScoringInput) -> float:
    """NaN for an estimator that does not test itself."""
    reports = _reports(scored)
    return float(np.mean(reports)) if reports.size else float("nan")


@register_score(
    "inconsistent_end",
    title="Share of the last tenth of the epochs at which it reports that it is inconsistent",
    unit="-",
    better="lower",
)
def _inconsistent_end(scored: ScoringInput) -> float:
    """NaN for an estimator that does not test itself."""
    reports = _reports(scored)
    return float(np.mean(reports[-max(1, reports.size // 10) :])) if reports.size else float("nan")


def outcome(status: str, scores: Mapping[str, float]) -> str:
    """The status of a run as it counts: that of its trial, or ``lost`` in place of ``ok``.

    Parameters
    ----------
    status : str
        Status of the trial.
    scores : mapping of str to float
        Scores of the run, by name. Without the score ``beyond_sigma`` no run is lost.

    Examples
    --------
    >>> outcome("ok", {"beyond_sigma": 0.2}), outcome("ok", {}), outcome("timeout", {"beyond_sigma": 0.2})
    ('lost', 'ok', 'timeout')
    """
    return "lost" if status == "ok" and scores.get("beyond_sigma", 0.0) > SHARE else status


def why_lost(scores: Mapping[str, float]) -> str:
    """Why a run with these scores is lost, as a sentence.

    >>> why_lost({"beyond_sigma": 0.873})
    'an error is beyond 100 times its stated sigma at 87 % of the epochs'
    """
    return f"an error is beyond {FAR:g} times its stated sigma at {100.0 * scores['beyond_sigma']:.0f} % of the epochs"


def ending(status: str, scores: Mapping[str, float]) -> str:
    """The final status of a run: that of `outcome`, or ``inconsistent``.

    A run with the outcome ``ok`` becomes ``inconsistent`` if the estimator reported the diagnostic ``inconsistent`` for
    more than a third of the run, or for most of its last tenth, for example after a late fault.

    Parameters
    ----------
    status : str
        Status of the trial.
    scores : mapping of str to float
        Scores of the run, by name.

    Examples
    --------
    >>> ending("ok", {"inconsistent": 0.4}), ending("timeout", {}), ending("ok", {"inconsistent": 0.1})
    ('inconsistent', 'timeout', 'ok')
    >>> ending("ok", {"inconsistent": 0.1, "inconsistent_end": 0.9})
    'inconsistent'
    >>> ending("ok", {"inconsistent": 0.9, "beyond_sigma": 0.5})
    'lost'
    """
    reported = scores.get("inconsistent", 0.0) > 1.0 / 3.0 or scores.get("inconsistent_end", 0.0) > 0.5
    found = outcome(status, scores)
    return "inconsistent" if found == "ok" and reported else found
