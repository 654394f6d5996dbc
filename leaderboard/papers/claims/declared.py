"""The headline claims of the five papers, as their files declare them, each with the choices that are not printed.

The conditions under which a claim holds are sufficient ones. They do not say what the authors did.
"""

from __future__ import annotations

from simnav.leaderboard.papers import auv_smoothing_2022, guo_2026, jiang_2026, mao_2025, zhan_2026
from simnav.leaderboard.results.errors import RequestError
from simnav.spec import closest

from .claim import Claim

__all__ = ["CLAIMS", "claim_of", "claims_of"]

CLAIMS: tuple[Claim, ...] = (
    *guo_2026.CLAIMS,
    *mao_2025.CLAIMS,
    *jiang_2026.CLAIMS,
    *auv_smoothing_2022.CLAIMS,
    *zhan_2026.CLAIMS,
)


def claims_of(paper: str) -> list[Claim]:
    """The claims of a paper, by its key."""
    return [claim for claim in CLAIMS if claim.paper == paper]


def claim_of(name: str) -> Claim:
    """The claim of a name.

    Raises
    ------
    RequestError
        If there is none; one sentence.
    """
    for claim in CLAIMS:
        if claim.name == name:
            return claim
    raise RequestError(f"there is no claim {name!r}{closest(name, [c.name for c in CLAIMS])}")
