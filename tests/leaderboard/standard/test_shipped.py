"""The standard result that comes with simnav is what the code of today gives, and so is the README."""

from __future__ import annotations

from pathlib import Path

import pytest

from simnav.leaderboard import standard
from simnav.leaderboard.profiles import load
from simnav.leaderboard.ranking.ranking import rank
from simnav.leaderboard.results import store
from simnav.leaderboard.standard import history, readme
from simnav.leaderboard.standard.currency import outdated
from simnav.leaderboard.standard.publication import missing

ROOT = Path(__file__).parents[3]

pytestmark = pytest.mark.skipif(not standard.shipped(), reason="no standard result has been published yet")


def test_no_code_that_decides_a_number_has_changed_since() -> None:
    found = outdated(standard.RESULTS)
    assert not found, "\n".join([*found.sentences(), "'simnav standard run' does it, then 'simnav standard publish'"])


def test_the_readme_and_the_history_are_made_from_it() -> None:
    results = store.load(standard.RESULTS, series=False)
    lacking = sum(missing(load(standard.PROFILE), results).values())
    ranking = rank(results)
    text = readme.marked(ROOT / "README.md")
    assert text == readme.tables(ranking, results, len(results) + lacking)
    assert ("Preliminary" in text) == bool(lacking)
    if lacking:
        return
    last = max(line.edition for line in history.read(standard.HISTORY))
    lines = [line for line in history.read(standard.HISTORY) if line.edition == last]
    assert [(x.track, x.row, x.ranks) for x in lines] == [
        (x.track, x.row, x.ranks) for x in history.lines_of(ranking, results, last)
    ]
