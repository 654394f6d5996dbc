"""The standard result that comes with simnav is what the code of today gives, and so is the README."""

from __future__ import annotations

import json
import re
import zlib
from dataclasses import replace
from pathlib import Path

import pytest

import simnav
from simnav.leaderboard import standard
from simnav.leaderboard.profiles import read_profile
from simnav.leaderboard.ranking.board import Ranking
from simnav.leaderboard.ranking.first_view import first_view
from simnav.leaderboard.ranking.reports import StandardReport
from simnav.leaderboard.ranking.runs import group
from simnav.leaderboard.ranking.trouble_profile import profiles
from simnav.leaderboard.results import store
from simnav.leaderboard.results.result import Result
from simnav.leaderboard.site.entries import entries
from simnav.leaderboard.site.headings import headings
from simnav.leaderboard.site.overview import track_data
from simnav.leaderboard.site.scenario_page import RUNS_SHOWN
from simnav.leaderboard.standard import history, readme
from simnav.leaderboard.standard.backgrounds import stored_backgrounds
from simnav.leaderboard.standard.outdated_results import outdated
from simnav.leaderboard.standard.publication import missing

ROOT = Path(__file__).parents[3]
LARGEST_PAGE = 300_000  # bytes of the data of a page, compressed

pytestmark = pytest.mark.skipif(not standard.shipped(), reason="no standard result has been published yet")


@pytest.fixture(scope="module")
def report() -> StandardReport:
    return simnav.standard()


@pytest.fixture(scope="module")
def results(report: StandardReport) -> list[Result]:
    return list(report.results)


@pytest.fixture(scope="module")
def ranking(report: StandardReport) -> Ranking:
    return report.ranking


def test_its_versions_are_those_of_today_or_the_readme_says_which_are_older() -> None:
    """A row may be better than its results until the next edition; a scenario or the simulator may not."""
    found = outdated(standard.RESULTS)
    rest = replace(found, rows=())
    assert not rest, "\n".join([*rest.sentences(), "'simnav standard run' does it, then 'simnav standard publish'"])
    text = readme.marked(ROOT / "README.md")
    said = next((line for line in text.splitlines() if line.startswith("Until the next edition")), "")
    assert [row for row in found.rows if f"`{row}`" not in said] == []


def test_the_answer_in_the_guide_is_that_of_today() -> None:
    """After new results, the first lines of the command's output take the place of those in the page."""
    page = (ROOT / "docs/how-to/choose-an-estimator.md").read_text(encoding="utf-8")
    command, shown = re.findall(r"^```\n(.*?)^```", page, re.DOTALL | re.MULTILINE)[:2]
    assert command == "simnav recommend imu gnss dvl gyrocompass --trouble lying-fixes\n"
    answer = simnav.recommend(["imu", "gnss", "dvl", "gyrocompass"], troubles="lying-fixes")
    assert shown.splitlines() == list(answer.sentences)


def test_the_readme_the_board_and_the_history_are_made_from_it(results: list[Result], ranking: Ranking) -> None:
    lacking = sum(missing(read_profile(standard.PROFILE), results).values())
    text = readme.marked(ROOT / "README.md")
    assert text == readme.first_answer(first_view(ranking, profiles(results)), results, len(results) + lacking)
    assert readme.marked(ROOT / readme.PAGE) == readme.tables(ranking, results, len(results) + lacking)
    assert ("Preliminary" in text) == bool(lacking)
    if lacking:
        return
    last = max(line.edition for line in history.read(standard.HISTORY))
    lines = [line for line in history.read(standard.HISTORY) if line.edition == last]
    assert [(x.track, x.row, x.ranks) for x in lines] == [
        (x.track, x.row, x.ranks) for x in history.lines_of(ranking, results, last)
    ]


def test_nothing_is_simulated_for_its_site(results: list[Result]) -> None:
    found = stored_backgrounds(results)
    assert found.keys() == {s for s in {r.scenario for r in results} if not simnav.load(s).recorded}
    assert {tuple(b.runs) for b in found.values()} == {tuple(map(str, range(RUNS_SHOWN)))}


def test_one_call_has_all_of_it(results: list[Result]) -> None:
    assert len(results) == len(store.keys(standard.RESULTS)) > 50_000


def test_no_page_of_its_board_is_too_large(results: list[Result], ranking: Ranking) -> None:
    runs = group(results)
    estimators, scenarios = entries(runs, ranking)
    shown = headings(ranking.tracks)
    assert len(shown) == 5  # no track is left over
    for heading in shown:
        tracks = [track_data(t, estimators, scenarios, runs) for t in heading.tracks]
        assert len(zlib.compress(json.dumps(tracks).encode())) < LARGEST_PAGE, heading.title
