"""The results of rows in each kind of trouble, and the choice of a row from them, on results that are made up."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from simnav.leaderboard.ranking import reference, trouble_profile
from simnav.leaderboard.ranking.ranking import rank, rank_tracks
from simnav.leaderboard.ranking.recommendation import Recommendation, recommendation
from simnav.leaderboard.ranking.reports import StandardReport
from simnav.leaderboard.ranking.track_runs import TrackRuns, runs_of_tracks
from simnav.leaderboard.ranking.trouble_profile import (
    GroupRow,
    TrackProfile,
    TroubleGroup,
    profile_table,
    profiles,
    profiles_of,
    ranked_group,
)
from simnav.leaderboard.results.result import Result
from simnav.leaderboard.site.report import SiteReport

ROWS = ("oracle", "ekf", "robust", "vb-akf", "even", "poor", "bad")
#: Errors of rows [m] in three scenarios with fixes that lie, and one with an outage. `robust` is good at lies and bad
#: in outages, `vb-akf` one percent worse at lies, `even` a little better than `ekf` throughout.
ERRORS = {
    scenario: dict(zip(ROWS, errors, strict=True))
    for scenario, errors in {
        "gnss-spoofing-v1": (1.0, 8.0, 2.0, 2.02, 6.0, 9.0, 80.0),
        "lasting-bias-v1": (1.0, 6.0, 2.0, 2.02, 4.5, 9.0, 80.0),
        "gnss-multipath-v1": (1.0, 7.0, 2.0, 2.02, 5.0, 9.0, 80.0),
        "gnss-outage-v1": (5.0, 10.0, 20.0, 9.9, 8.0, 30.0, 90.0),
    }.items()
}
#: All rows but the oracle are equally good.
EQUAL = {"open-sea-v1": {**dict.fromkeys(ROWS, 2.0), "oracle": 1.0}}


def made(errors: dict[str, dict[str, float]], seeds: int = 20, failed: Sequence[tuple[str, int]] = ()) -> list[Result]:
    """Results with errors that scatter by 10 %; some runs failed."""
    found = []
    for scenario, by in errors.items():
        rng = np.random.default_rng(sum(map(ord, scenario)))
        for estimator, error in by.items():
            for seed, noise in enumerate(np.exp(rng.normal(0.0, 0.1, seeds)).tolist()):
                lost = (estimator, seed) in failed
                scores = {"horizontal_rmse": error * noise, "update_median": 1e-4, "coverage_95": 0.8}
                found.append(Result(
                    scenario=scenario, seed=seed, estimator=estimator, scores={} if lost else scores, parameters={},
                    reference=estimator == "oracle", status="error" if lost else "ok", reason="", peak_memory=10,
                ))  # fmt: skip
    return found


@pytest.fixture(autouse=True)
def no_stored_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reference, "stored", dict)


def profile(results: list[Result]) -> TrackProfile:
    return next(p for p in profiles(results) if p.track == "aided-ins")


def of(found: TrackProfile, trouble: str, estimator: str) -> GroupRow:
    group = next(g for g in found.groups if g.trouble == trouble)
    row = group.row(estimator)
    assert row is not None
    return row


def test_a_row_has_a_result_in_each_group() -> None:
    found = profile(made(ERRORS))
    assert [(g.trouble, len(g.scenarios)) for g in found.groups] == [("lying-fixes", 3), ("outage", 1)]
    lies, outage = of(found, "lying-fixes", "robust"), of(found, "outage", "robust")
    assert lies.to_plain == pytest.approx(2.0 / (8.0 * 7.0 * 6.0) ** (1 / 3), rel=0.05)
    assert lies.to_reference == pytest.approx(2.0, rel=0.05)
    assert outage.to_plain == pytest.approx(2.0, rel=0.05)
    assert lies.to_plain_low < lies.to_plain < lies.to_plain_high
    assert lies.scenarios_low < lies.to_plain < lies.scenarios_high
    assert lies.coverage == pytest.approx(0.8)
    assert math.isnan(outage.scenarios_low)  # one scenario says nothing of others


def test_rows_are_told_apart_within_a_group() -> None:
    found = profile(made(ERRORS))
    assert of(found, "lying-fixes", "robust").may_be_best
    assert "ekf" in of(found, "lying-fixes", "robust").better_than
    assert "ekf" in of(found, "outage", "robust").worse_than
    assert [r.estimator for r in found.groups[1].ranked if r.may_be_best] == ["even"]


def test_a_run_is_bad_if_it_is_lost_or_far_above_the_plain_row() -> None:
    found = profile(made(ERRORS, failed=[("even", 0), ("even", 1)]))
    assert of(found, "lying-fixes", "even").bad == pytest.approx(6 / 60)
    assert of(found, "lying-fixes", "bad").bad == 1.0  # about ten times the error of the plain row
    assert of(found, "lying-fixes", "poor").bad == 0.0
    assert of(found, "outage", "even").bad_low < 0.1 < of(found, "outage", "even").bad_high


def test_groups_that_separate_nobody_say_so_once() -> None:
    found = profile(made(ERRORS | EQUAL))
    assert found.silence == "No two rows differ significantly in these groups: nothing wrong."
    caption = profile_table(found).caption
    assert caption is not None
    assert caption.count(found.silence) == 1
    assert profile(made(ERRORS)).silence == ""


def test_reports_have_the_profiles() -> None:
    results = made(ERRORS)
    site = SiteReport(Path("index.html"), results, rank(results), profiles=profiles(results))
    (document,) = (p for p in site.to_dict()["profiles"] if p["track"] == "aided-ins")
    assert [g["trouble"] for g in document["groups"]] == ["lying-fixes", "outage"]
    titles = [table.title for table in site.shown()]
    assert titles[-1] == "Aided INS: error beside the plain row's, by kind of trouble"
    assert [p.track for p in StandardReport(results, site.ranking).profiles] == [p.track for p in site.profiles]


# -- the choice ----------------------------------------------------------------------------------------------


def chosen(results: list[Result], *asked: str, limit: float | None = None, without: str = "-") -> Recommendation:
    runs = list(runs_of_tracks(results, "horizontal_rmse"))
    return recommendation(runs, ["gnss_position", "imu"], lambda s: not s.startswith(without), asked, limit)


def named(answer: Recommendation) -> str:
    assert answer.row is not None
    return answer.row.estimator


def test_the_row_is_that_with_the_smallest_error_in_the_trouble() -> None:
    lies = chosen(made(ERRORS), "lying-fixes")
    assert named(lies) == "robust"
    assert lies.confidence == "beyond these scenarios"
    assert [c.estimator for c in lies.as_good] == ["vb-akf"]  # its error is one percent larger
    assert [(w.title, round(w.result.to_plain)) for w in lies.worse] == [("Outage", 2)]
    outage = chosen(made(ERRORS), "outage")
    assert (named(outage), outage.confidence, outage.as_good) == ("even", "in these scenarios", ())
    assert named(chosen(made(ERRORS))) == "vb-akf"  # the geometric mean of both kinds, each counting the same


def test_a_row_that_its_page_advises_against_is_not_taken() -> None:
    errors = {s: {**by, "solution-separation": 1.5} for s, by in ERRORS.items()}
    found = chosen(made(errors), "lying-fixes")
    assert "solution-separation" in [r.estimator for r in found.groups[0].ranked]
    assert named(found) == "robust"
    assert "solution-separation" not in [c.estimator for c in found.as_good]


def test_without_a_difference_the_plain_row_is_taken() -> None:
    found = chosen(made(EQUAL | {"gnss-noise-v1": ERRORS["gnss-outage-v1"] | dict.fromkeys(("even", "vb-akf"), 10.0)}))
    assert (named(found), found.confidence) == ("ekf", "undecided")
    assert "no row is shown to be better" in found.headline()
    alike = chosen(made(EQUAL), "nothing")
    assert (named(alike), alike.confidence) == ("ekf", "undecided")
    assert "says little about the other half" in alike.why


def test_a_limit_of_time_leaves_out_what_is_dearer_or_not_measured() -> None:
    found = chosen(made(ERRORS), "lying-fixes", limit=1.0)
    assert named(found) == "vb-akf"  # the others, which are made up, have no stored cost
    assert found.row is not None
    assert found.row.milliseconds == pytest.approx(0.1 * found.row.cost)
    assert named(chosen(made(ERRORS), "lying-fixes", limit=0.1)) == "ekf"
    none = chosen(made(ERRORS), "lying-fixes", limit=0.01)
    assert (none.row, none.confidence) == (None, "none")
    assert none.headline() == "No evidence: no row with a stored cost takes 0.01 ms or less."


def test_it_says_where_there_is_no_evidence() -> None:
    none = chosen(made(ERRORS), "velocity")
    assert none.row is None
    assert none.headline().startswith("No evidence: no scenario of the results has these troubles and instruments")
    part = chosen(made(ERRORS), "outage", "velocity")
    assert named(part) == "even"
    assert part.sentences[-1] == "No evidence for these instruments with: velocity aid wrong."
    other = chosen(made(ERRORS), "outage", without="gnss-outage")  # the scenario has other instruments
    assert other.row is None


def test_sentences_are_plain_and_short() -> None:
    for answer in (chosen(made(ERRORS), "lying-fixes"), chosen(made(ERRORS)), chosen(made(ERRORS), "imu")):
        for said in answer.sentences:
            numbers = [w for w in said.replace("(95 %)", "").replace("95 % region", "").split() if w[0].isdigit()]
            assert len(numbers) <= 3, said
            assert len(said) < 180, said
            assert said[0].isupper(), said
            assert said.endswith("."), said


def test_the_document_is_plain() -> None:
    document: dict[str, Any] = chosen(made(ERRORS), "lying-fixes").to_dict()
    assert document["row"]["estimator"] == "robust"
    assert document["groups"][0]["trouble"] == "lying-fixes"
    assert document["sentences"]


def test_the_profile_and_the_advice_rank_the_same_scenarios_once(monkeypatch: pytest.MonkeyPatch) -> None:
    ranked = []

    def counted(runs: TrackRuns, *named: str) -> TroubleGroup:
        ranked.append(named[0])
        return ranked_group(runs, *named)

    monkeypatch.setattr(trouble_profile, "ranked_group", counted)
    runs = list(runs_of_tracks(made(ERRORS), "horizontal_rmse"))
    groups = [g for p in profiles_of(runs) for g in p.groups]
    assert sorted(ranked) == sorted(g.trouble for g in groups)
    advice = recommendation(runs, ["gnss_position", "imu"], lambda s: True, ["outage"])
    assert any(advice.groups[0] is g for g in groups)
    part = recommendation(runs, ["gnss_position", "imu"], lambda s: s != "lasting-bias-v1", ["lying-fixes"])
    assert part.groups[0].scenarios == ("gnss-multipath-v1", "gnss-spoofing-v1")  # other scenarios are another group


def test_two_processes_rank_as_one() -> None:
    one, two = (list(runs_of_tracks(made(ERRORS))) for _ in range(2))
    assert rank_tracks(two, workers=2).to_dict() == rank_tracks(one).to_dict()
    groups = [[p.to_dict() for p in profiles_of(runs, workers)] for runs, workers in ((one, 1), (two, 2))]
    assert groups[0] == groups[1]
    assert len(two[0].groups) == len(one[0].groups) == 2  # what other processes ranked is known here
