"""``simnav recommend``: which estimator to take."""

from __future__ import annotations

from simnav.leaderboard.recommend_requests import RecommendRequest
from simnav.leaderboard.recommending import recommend

from .console import Output

__all__ = ["show"]


def show(out: Output, request: RecommendRequest) -> None:
    """Say which row to take for some instruments and troubles, why, what it costs, and how sure that is."""
    answer = recommend.of(request)
    out.document(answer.to_dict())
    out.print(answer.headline(), *answer.shown())
