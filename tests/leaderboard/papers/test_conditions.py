"""``simnav paper reproduce PAPER --holds-if``: all claims of a paper are searched, and its page has the answers."""

from __future__ import annotations

import pytest

import simnav
from simnav.leaderboard.papers.claims import stored as claims_stored


def test_conditions_of_claims_do_not_go_with_a_part_of_the_comparison():
    for other in ({"methods": ["EKF"]}, {"stored": True}, {"until_decided": True}):
        with pytest.raises(simnav.RequestError, match="'holds_if' is about all claims"):
            simnav.reproduce("guo-2026", holds_if=True, **other)


def test_answers_that_were_searched_are_on_the_page(monkeypatch, tmp_path):
    """All claims of the paper are searched; the tables are those that come with simnav."""
    asked = []

    def search(claim, dials, folder, *, runs, judged, **_):
        asked.append((claim.name, [d.name for d in dials] == [d.name for d in claim.dials], runs, judged))
        return claims_stored.read(claim.name)

    monkeypatch.setattr("simnav.leaderboard.papers.claims.search.search", search)
    found = simnav.reproduce("zhan-2026", holds_if=True, runs=4, output=tmp_path)
    assert asked == [("zhan-east", True, 4, 8), ("zhan-north", True, 4, 8)]
    assert [a.claim for a in found.answers] == ["zhan-east", "zhan-north"]
    assert [c["claim"] for c in found.to_dict()["claims"]] == ["zhan-east", "zhan-north"]
