"""The first view of a board, of made-up errors of real rows on scenarios of the catalogue."""

from __future__ import annotations

import math
import re

import pytest

from simnav.leaderboard.ranking.first_view import FirstView, first_view, view_figure
from simnav.leaderboard.ranking.ranking import rank
from simnav.leaderboard.ranking.trouble_profile import profiles
from simnav.leaderboard.results.result import Result
from simnav.leaderboard.standard.readme import FIRST, first_answer

#: One scenario with nothing wrong, two with fixes that lie, one with noisy fixes; errors beside the plain row's.
SCENARIOS = ("open-sea-v1", "gnss-spoofing-v1", "lasting-bias-v1", "gnss-noise-v1")
RATIOS = {
    "ekf": (1.0, 1.0, 1.0, 1.0),
    "iae": (1.0, 0.4, 0.4, 0.7),
    "vb-akf": (1.0, 0.6, 0.6, 0.6),
    "adkf-paper": (2.0, 0.2, 0.2, 1.0),
    "ukf": (1.1, 1.1, 1.1, 1.1),
    "ckf": (1.2, 1.2, 1.2, 1.2),
}
COVERAGE = {"vb-akf": 0.94, "adkf-paper": 0.95}


@pytest.fixture(scope="module")
def results() -> list[Result]:
    def error(ratio: float, k: int) -> float:
        return 30.0 * ratio * (1.0 + 0.02 * (k % 7))  # m: none is below an oracle

    return [
        Result(scenario, seed, name, {}, False, "ok", "",
               {"horizontal_rmse": error(ratio, 3 * seed + len(name)), "coverage_95": COVERAGE.get(name, 0.7)})
        for name, ratios in RATIOS.items() for scenario, ratio in zip(SCENARIOS, ratios, strict=True)
        for seed in range(20)
    ]  # fmt: skip


@pytest.fixture(scope="module")
def view(results: list[Result]) -> FirstView:
    found = first_view(rank(results), profiles(results))
    assert found is not None
    return found


def test_in_a_rank_each_kind_of_trouble_counts_the_same(results: list[Result]) -> None:
    (track,) = rank(results).tracks
    gain = next(r.gain for r in track.rows if r.estimator == "iae")
    assert gain is not None
    assert gain.value == pytest.approx((1.0 * 0.4 * 0.7) ** (1.0 / 3.0), rel=0.02)  # and not 0.4 twice
    assert gain.scenarios == 4
    assert gain.scenarios_low < gain.value < gain.scenarios_high


def test_the_picture_has_the_plain_row_first_and_the_others_by_error(view: FirstView) -> None:
    assert (view.track, view.plain) == ("aided-ins", "ekf")
    assert [g.trouble for g in view.groups] == ["nothing", "noisy-fixes", "lying-fixes"]
    assert [r.estimator for r in view.rows] == ["ekf", "iae", "vb-akf", "adkf-paper", "ukf", "ckf"]
    paper = view.rows[3]
    assert [g.to_plain for g in paper.groups] == pytest.approx([2.0, 1.0, 0.2], rel=0.03)
    assert paper.to_plain == pytest.approx(0.4 ** (1.0 / 3.0), rel=0.03)
    assert (view.rows[0].cost, math.isnan(view.rows[1].cost)) == (1.0, False)
    drawn = {text.get_text() for text in view_figure(view).axes[0].texts}
    assert {"1.00", f"{paper.to_plain:.2f}"} <= drawn


def test_what_to_take_has_reasons_and_the_sentence_few_numbers(view: FirstView) -> None:
    advice = {a.what: a for a in view.advice}
    assert (advice["plain"].estimator, advice["robust"].estimator) == ("ekf", "iae")
    assert advice["most honest"].estimator == "adkf-paper"  # it has no more error than the plain row over all kinds
    assert "95 %" in advice["most honest"].reason
    better = [r for r in view.rows if r.to_plain < 0.9 and math.isfinite(r.cost)]
    cheap = min(better, key=lambda r: r.cost)
    assert advice["cheapest"].estimator == cheap.estimator
    assert advice["cheapest"].reason.startswith(f"{100.0 * (1.0 - cheap.to_plain):.0f} % less error over all kinds")
    assert advice["robust"].reason.startswith("35 % less error than `ekf` over all kinds of trouble, and no run")
    assert view.sentence.startswith("Where nothing is wrong, no filter is shown to be better than the plain filter")
    assert view.sentence.endswith("% less with fixes that lie slowly.")
    assert len(re.findall(r"\d+", view.sentence)) <= 3


def test_the_readme_has_it(view: FirstView, results: list[Result]) -> None:
    text = first_answer(view, results)
    assert f"**{view.sentence}**" in text
    assert f"]({FIRST})" in text
    assert "| robust | `iae` | " in text


def test_where_no_row_is_better_the_plain_one_is_taken_and_without_one_there_is_no_view(results: list[Result]) -> None:
    few = [r for r in results if r.estimator in ("ekf", "ukf", "ckf")]
    found = first_view(rank(few), profiles(few))
    assert found is not None
    assert found.sentence.startswith("No filter is shown to be better than the plain filter `ekf` over all kinds")
    assert [a.what for a in found.advice] == ["plain", "most honest"]
    other = [r for r in results if r.estimator in ("ukf", "ckf")]
    assert first_view(rank(other), profiles(other)) is None
