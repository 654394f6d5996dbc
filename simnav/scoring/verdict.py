"""The verdict on the covariance of an estimator: that of the worst of what it states.

An estimator may state its horizontal position well and its heading badly. So horizontal position, height, velocity and
heading are each judged by their NEES, and the worst one is shown.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from simnav.scoring.consistency import GROUPS, JUDGED, Badge, badge
from simnav.types import Array

__all__ = ["Verdict", "verdict"]

#: An optimistic covariance deceives, and a pessimistic one only says too little.
_SEVERITY: Mapping[Badge, int] = {"consistent": 0, "pessimistic": 1, "optimistic": 2}


@dataclass(frozen=True)
class Verdict:
    """The verdict on a covariance.

    Attributes
    ----------
    badge : str
        That of the worst group (`simnav.scoring.badge`); ``unknown`` without a covariance.
    nees : float
        Mean over the runs of its NEES by degree of freedom; NaN where it is not known.
    group : str
        The worst group, one of `simnav.scoring.consistency.JUDGED`; empty where none is known.
    groups : tuple of str
        The groups that are known.
    """

    badge: Badge = "unknown"
    nees: float = math.nan
    group: str = ""
    groups: tuple[str, ...] = ()

    @property
    def words(self) -> str:
        """Which group the verdict is of, and which others are not known; empty without any.

        >>> Verdict("optimistic", 9.0, "heading", ("horizontal", "vertical", "velocity", "heading")).words
        'heading'
        >>> Verdict("optimistic", 9.0, "velocity", ("horizontal", "velocity")).words
        'velocity; vertical and heading unknown'
        >>> Verdict("optimistic", 9.0, "horizontal", ("horizontal",)).words
        'horizontal only'
        """
        if len(self.groups) == 1:
            return f"{self.group} only"
        unknown = [group for group in JUDGED if group not in self.groups]
        return f"{self.group}; {' and '.join(unknown)} unknown" if unknown and self.group else self.group


def verdict(nees_by_group: Mapping[str, Array]) -> Verdict:
    """The worst of the verdicts on several groups.

    Optimistic is worse than pessimistic, and that is worse than consistent. Of equal ones that is worse whose NEES is
    farther from 1, as a ratio.

    Parameters
    ----------
    nees_by_group : mapping of str to (M,) array
        Mean NEES of each run by degree of freedom, by group; NaN is left out. A group without any is not known.

    Examples
    --------
    >>> verdict({"horizontal": np.full(50, 1.1), "heading": np.full(50, 40.0), "vertical": np.array([np.nan])})
    Verdict(badge='optimistic', nees=40.0, group='heading', groups=('horizontal', 'heading'))
    """
    found: list[Verdict] = []
    for group, values in nees_by_group.items():
        known = values[~np.isnan(values)]
        if len(known):
            found.append(Verdict(badge(known, len(GROUPS[group])), float(np.mean(known)), group))
    if not found:
        return Verdict()
    worst = max(found, key=lambda v: (_SEVERITY[v.badge], abs(math.log(max(v.nees, 1e-12)))))
    return Verdict(worst.badge, worst.nees, worst.group, tuple(v.group for v in found))
