"""Claims: the verdict on chosen ratios, the dials of all declared claims, the search with made results, the command."""

from __future__ import annotations

import json
import math
from collections import Counter

import numpy as np
import pytest
from typer.testing import CliRunner

import simnav
from simnav.leaderboard.claim_requests import ClaimRequest
from simnav.leaderboard.cli import app
from simnav.leaderboard.papers import FOLDER, PAPERS, reading, reproduction
from simnav.leaderboard.papers.claims import search as searching
from simnav.leaderboard.papers.claims import stored
from simnav.leaderboard.papers.claims.answer import Answer
from simnav.leaderboard.papers.claims.claim import Claim, compared
from simnav.leaderboard.papers.claims.declared import claim_of, claims
from simnav.leaderboard.papers.claims.dials import choice_dial, lag_dial, lags_given, parameter_dial, scenario_dial
from simnav.leaderboard.papers.claims.looks import LEVEL, deciding_interval, looks
from simnav.leaderboard.papers.claims.points import DialAnswer, Judgement, Point
from simnav.leaderboard.papers.claims.section import claim_count, claim_figures, claim_sheets
from simnav.leaderboard.papers.measures import measure
from simnav.leaderboard.papers.reproduction import Reproduction
from simnav.leaderboard.results.result import Result
from simnav.scenario import load

RUNNER = CliRunner()
HALF = [math.exp(e) for e in (-0.02, -0.01, 0.0, 0.01, 0.02)]  # scatter of five seeds


MINE = {"claim": "ship-fgo", "than": "ship-ekf", "gain": 9.0, "scenario": "ship-turn"}


def point(value, ratio: float, failed: int = 0) -> Point:
    return Point(value, list(range(5)), [ratio * x for x in HALF], failed)


def judged(value, ratio: float) -> Judgement:
    """At the first look, of ten runs."""
    return Judgement(value, list(range(10)), [ratio * x for x in (*HALF, *HALF)], first=10)


def answer(ours: float, found: float, value: float = 10.0) -> Answer:
    points = [point(0.0, ours), point(5.0, 0.5 * (ours + found)), point(value, found)]
    dial = DialAnswer("lag", "the delay of the output", "s", 0.0, "not printed", points, [judged(value, found)])
    return Answer("c", "guo-2026", "a is 20 % better than b", 0.2, False, "s-v1", "a", "b", "horizontal_rmse",
                  "horizontal_rmse", judged("", ours), [dial])  # fmt: skip


def test_a_claim_holds_where_the_whole_interval_reaches_it():
    limit = 0.8 ** (1.0 / 1.5)  # a ratio of 0.862: the tolerance of all gains
    assert answer(1.0, 1.0).limit == pytest.approx(limit)
    assert point(0.0, 0.83).standing(limit) == "holds"
    assert point(0.0, 0.5).standing(limit) == "holds"  # a larger gain holds, too
    assert point(0.0, limit).standing(limit) == "undecided"
    assert point(0.0, 0.9).standing(limit) == "does not hold"
    assert point(0.0, 0.5, failed=1).standing(limit) == "does not hold"
    assert Point(0.0, [1, 2], [0.5, 0.5]).standing(limit) == "undecided"  # two seeds decide nothing


@pytest.mark.parametrize(
    ("ours", "found", "verdict", "words"),
    [
        (0.8, 1.0, "holds", "holds with our settings"),
        (1.0, 0.8, "holds if", "holds if the delay of the output is 10 s or more (20.0 % [18.5, 21.5], 10 runs)"),
        (1.0, 0.95, "does not hold", "does not hold; tried: the delay of the output"),
        (1.0, 0.862, "undecided", "undecided: an interval lies across the limit, and more seeds may decide it"),
    ],
)
def test_verdicts(ours, found, verdict, words):
    made = answer(ours, found)
    assert (made.verdict, made.sentence_of_verdict) == (verdict, words)


def test_the_range_of_a_condition_is_in_words():
    values = (1.0, 2.0, 3.0, 5.0)

    def words(ratios, judged, ours=None) -> str:
        points = [point(v, r) for v, r in zip(values, ratios, strict=True)]
        tried = Judgement(values[judged], list(range(10)), [ratios[judged]] * 10, first=10)
        return DialAnswer("x", "the factor", "", ours, "", points, [tried]).condition(0.86)

    assert words((1.0, 1.0, 0.8, 0.7), 2) == "the factor is 3 or more"
    assert words((0.7, 0.8, 1.0, 1.0), 1, 5.0) == "the factor is 2 or less"
    assert words((1.0, 0.8, 0.8, 0.7), 2) == "the factor is 3 or more"  # 2 was not judged
    assert words((1.0, 0.8, 0.8, 1.0), 1) == "the factor is from 2 to 3"
    assert words((1.0, 0.8, 1.0, 0.8), 1) == "the factor is 2"
    assert words((0.8, 0.8, 0.8, 0.8), 0) == "the factor is from 1 to 5, all that was tried"


@pytest.mark.parametrize("claim", claims(), ids=lambda c: c.name)
def test_every_value_of_every_dial_is_a_comparison_that_can_be_run(claim):
    base = claim.base()
    assert claim.paper in PAPERS
    for dial in claim.dials:
        assert dial.ours is None or dial.ours in dial.values
        for value in dial.values:
            setting = dial.set(base, value)
            measure(setting.score)
            measure(setting.than_score)
            setting.row.make()
            setting.than.make()


def test_names_are_unique():
    assert max(Counter(c.name for c in claims()).values()) == 1
    assert claim_of("guo-sw-fgo").gain == 0.1373


def test_one_run_gives_all_lags():
    base = compared(lambda: load("ship-turn"), "ship-fgo", "ship-ekf", "horizontal_rmse")()
    dial = lag_dial((0.0, 5.0, 10.0))
    made = lags_given([base, *(dial.set(base, v) for v in dial.values)])
    assert [s.row.parameters.get("lags") for s in made] == [None, None, "5/10", "5/10"]
    assert [s.score for s in made] == ["horizontal_rmse"] * 2 + ["horizontal_rmse_lag_5", "horizontal_rmse_lag_10"]
    assert {s.than.label for s in made} == {"ship-ekf"}


def test_dials_set_what_they_say():
    base = compared(lambda: load("ship-turn"), "ship-fgo", "ship-ekf", "horizontal_rmse")()
    assert parameter_dial("window", "w", "row", "window", (5, 10)).set(base, 5.0).row.label == "ship-fgo(window=5)"
    wrong = scenario_dial("told", "t", "", (2.0,), lambda x: {"instruments.gnss.times_datasheet": {"sigma": x}},
                          whose="than").set(base, 2.0)  # fmt: skip
    assert wrong.scenario is base.scenario
    assert wrong.than_scenario.instruments["gnss"].times_datasheet == {"sigma": 2.0}
    both = choice_dial("c", "c", {"late": lambda s: s.with_parameters("both", lags="5")}).set(base, "late")
    assert both.than.label == "ship-ekf(lags=5)"


@pytest.fixture
def made_results(monkeypatch):
    """Results of a row whose error falls with its window, in place of runs; gives the seeds that were run."""
    ran: dict[str, set[int]] = {}
    kept: dict[tuple[str, str, int], Result] = {}

    def run(scenarios, requests, seeds, folder, **_):
        for scenario in scenarios:
            for r in requests:
                for seed in seeds:
                    ran.setdefault(r.label, set()).add(seed)
                    window = float(r.parameters.get("window", 1.0))
                    value = math.exp(0.01 * np.random.default_rng([seed, len(r.label)]).standard_normal())
                    if r.name == "ship-fgo":
                        value *= 1.0 - 0.05 * window
                    kept[scenario.id, r.label, seed] = Result(
                        scenario.id, seed, r.label, {}, False, "ok", "", {"horizontal_rmse": value}
                    )

    def load_made(*_, **__):
        if not kept:
            raise simnav.RequestError("there are no results")
        return list(kept.values())

    monkeypatch.setattr(searching, "run_campaign", run)
    monkeypatch.setattr(searching, "load", load_made)
    return ran


def test_the_search_finds_the_nearest_value_and_judges_it_on_other_seeds(made_results, tmp_path):
    dial = parameter_dial("window", "the window", "row", "window", (1, 2, 4, 6, 8), ours=1.0)
    base = compared(lambda: load("ship-turn"), "ship-fgo", "ship-ekf", "horizontal_rmse")
    claim = Claim("c", "", "a is 25 % better than b", 0.25, base, (dial,))
    found = searching.search(claim, claim.dials, tmp_path, runs=3, judged=12)
    assert found.verdict == "holds if"  # 1 - 0.05 * 4 = 0.8 is below the limit of 0.825; 0.9 is not
    (along,) = found.dials
    assert along.judged is not None
    assert along.judged.value == 4.0
    assert along.condition(claim.limit) == "the window is 4 or more"
    assert set(along.points[0].seeds).isdisjoint(along.judged.seeds)
    assert set(found.ours.seeds) == set(along.judged.seeds) == set(range(10000, 10012))
    assert made_results["ship-fgo(window=2)"] == set(range(1000, 1003))  # it was not judged


def test_where_a_judgement_fails_the_next_value_is_judged_on_other_seeds(made_results, monkeypatch, tmp_path):
    """The first value looks good in the search only: what is judged next has seeds that nothing was judged on."""
    dial = parameter_dial("window", "the window", "row", "window", (1, 4, 6), ours=1.0)
    base = compared(lambda: load("ship-turn"), "ship-fgo", "ship-ekf", "horizontal_rmse")
    claim = Claim("c", "", "a is 25 % better than b", 0.25, base, (dial,))
    inner = searching._point

    def lucky(value, setting, results):
        found = inner(value, setting, results)
        if value == 4.0 and min(found.seeds) >= searching.JUDGED_FROM:
            return Point(value, found.seeds, [1.0, 1.01] * (len(found.seeds) // 2), found.failed)
        return found

    monkeypatch.setattr(searching, "_point", lucky)
    found = searching.search(claim, claim.dials, tmp_path, runs=3, judged=12)
    (along,) = found.dials
    assert [(p.value, p.standing(claim.limit)) for p in along.tried] == [(4.0, "does not hold"), (6.0, "holds")]
    assert set(along.tried[0].seeds).isdisjoint(along.tried[1].seeds)
    assert along.condition(claim.limit) == "the window is 6 or more"


def test_an_undecided_judgement_gets_more_seeds(made_results, tmp_path):
    dial = parameter_dial("window", "the window", "row", "window", (1, 4), ours=1.0)
    base = compared(lambda: load("ship-turn"), "ship-fgo", "ship-ekf", "horizontal_rmse")
    limit = 0.808  # the ratio is 0.8: two thirds of a standard deviation of a run below it
    claim = Claim("c", "", "a is 28 % better than b", 1.0 - limit**1.5, base, (dial,))
    found = searching.search(claim, claim.dials, tmp_path, runs=3, judged=6)
    (tried,) = found.dials[0].tried
    assert len(found.ours.seeds) == 6
    assert len(tried.seeds) in looks(6)[1:]
    assert tried.standing(claim.limit) == "holds"
    assert [tried.level, found.ours.level] == [LEVEL / searching.TRIES, LEVEL]


def test_a_look_that_was_not_planned_decides_nothing(tmp_path):
    ratios = [0.5 + 0.001 * k for k in range(13)]
    assert deciding_interval(ratios[:12], 12).high < 0.6
    assert math.isnan(deciding_interval(ratios, 12).high)
    base = compared(lambda: load("ship-turn"), "ship-fgo", "ship-ekf", "horizontal_rmse")
    with pytest.raises(simnav.RequestError, match=r"judged = 70: it is doubled up to 1120 seeds.* at most 62"):
        searching.search(Claim("c", "", "", 0.1, base, ()), (), tmp_path, runs=3, judged=70)


def test_a_look_allows_for_the_others_and_for_a_run_that_is_worse_than_all():
    ratios = np.exp(np.linspace(-0.2, 0.2, 12)).tolist()
    found, one_try = deciding_interval(ratios, 12), deciding_interval(ratios, 12, LEVEL / 3)
    student = Point("", list(range(12)), ratios).ratio
    assert one_try.low < found.low < student.low < student.high < found.high < one_try.high
    worse = deciding_interval([*ratios[:-1], 2.0], 12)
    assert worse.high - worse.value > 2.0 * (found.high - found.value)


def test_a_score_that_a_method_lacks_is_said_after_the_first_seed(made_results, tmp_path):
    dial = parameter_dial("window", "the window", "row", "window", (1, 4))
    base = compared(lambda: load("ship-turn"), "ship-fgo", "ship-ekf", "smoothed_horizontal_rmse")
    claim = Claim("c", "", "a is 25 % better than b", 0.25, base, (dial,))
    with pytest.raises(simnav.RequestError, match=r"ship-fgo.* has no smoothed_horizontal_rmse on ship-turn-v1"):
        searching.search(claim, claim.dials, tmp_path, runs=6, judged=4)
    assert made_results["ship-ekf"] == {1000}


def test_the_judgement_may_begin_elsewhere(made_results, tmp_path):
    base = compared(lambda: load("ship-turn"), "ship-fgo", "ship-ekf", "horizontal_rmse")
    claim = Claim("c", "", "a is 3 % better than b", 0.03, base, ())
    found = searching.search(claim, (), tmp_path, runs=3, judged=4, judged_from=777_000)
    assert (found.verdict, found.ours.seeds[0]) == ("holds", 777_000)
    with pytest.raises(simnav.RequestError, match="seeds of the search are from 1000 to 1002"):
        searching.search(claim, (), tmp_path, runs=3, judged=4, judged_from=1002)


def test_a_score_of_late_outputs_runs_with_its_lag(made_results, monkeypatch, tmp_path):
    from simnav.leaderboard import claiming

    asked = {"than": "ship-ekf", "scenario": "ship-turn", "gain": 5.0, "score": "horizontal_rmse_lag_7"}
    made = claiming._own(ClaimRequest("ship-fgo", **asked))
    assert made.base().row.parameters == made.base().than.parameters == {"lags": "7"}


def test_an_answer_is_read_as_it_was_saved(tmp_path):
    made = answer(1.0, 0.8)
    stored.save(made, tmp_path)
    again = stored.read("c", tmp_path)
    assert again is not None
    assert again.sentence_of_verdict == made.sentence_of_verdict
    assert again.ours.gain.high == pytest.approx(made.ours.gain.high, abs=1e-5)
    kept = (tmp_path / "c.json").read_bytes()
    again_kept = stored.save(again, tmp_path).read_bytes()
    assert json.loads(again_kept)["ours"]["ratios"] == json.loads(kept)["ours"]["ratios"]
    (tmp_path / "c.json").write_text("{")
    with pytest.raises(ValueError, match="is damaged"):
        stored.read("c", tmp_path)
    assert stored.read("nothing", tmp_path) is None


@pytest.mark.parametrize("claim", claims(), ids=lambda c: c.name)
def test_the_stored_answers_are_those_of_the_declared_claims(claim):
    found = stored.read(claim.name)
    assert found is not None
    assert (found.gain, found.sentence, found.paper) == (claim.gain, claim.sentence, claim.paper)
    assert [(d.name, [p.value for p in d.points]) for d in found.dials] == [
        (d.name, list(d.values)) for d in claim.dials
    ]
    assert found.ours.gain.runs >= 3


def test_pages_count_claims_and_draw_them(tmp_path):
    answers = [answer(0.8, 1.0), answer(1.0, 0.8), answer(1.0, 0.95)]
    assert claim_count(answers) == "1 holds, 1 holds under a named condition, 1 does not hold"
    first, values = claim_sheets(answers)
    assert [r.cells[3] for r in first.rows] == ["holds", "holds if", "does not hold"]
    assert len(values.rows) == 9
    assert claim_sheets([]) == []
    (figure, *_) = claim_figures(answers[:1], tmp_path)
    assert figure.path.stat().st_size > 5000


def test_the_command_shows_and_lists(tmp_path):
    listed = json.loads(RUNNER.invoke(app, ["paper", "claim", "--json"]).stdout)
    assert [c["claim"] for c in listed["claims"]] == [c.name for c in claims()]
    shown = RUNNER.invoke(app, ["paper", "claim", "guo-sw-fgo", "--plot", str(tmp_path / "c.png")])
    assert "verdict:" in shown.stdout
    assert (tmp_path / "c.png").exists()
    refused = RUNNER.invoke(app, ["paper", "claim", "mao-2025", "--judged-from", "9000"])
    assert refused.exit_code == 2
    assert "'judged_from' cannot act here: the claims are listed" in refused.output


@pytest.mark.parametrize(
    ("how", "message"),
    [
        ({"claim": "guo-sw-fog"}, "did you mean"),
        (
            {"claim": "guo-sw-fgo", "holds_if": ["lagg"]},
            "has no condition 'lagg'; it has lag, lag-horizontal, outliers",
        ),
        ({"claim": "guo-sw-fgo", "holds_if": ["lag=a"]}, "the values should be numbers"),
        ({"claim": "guo-sw-fgo", "gain": 3.0}, "is a paper's claim"),
        ({"claim": "guo-sw-fgo", "judged_from": 9000}, "'judged_from' cannot act here: .* --holds-if all"),
        ({"claim": "guo-sw-fgo", "runs": 9, "workers": 1}, "'runs', 'workers' cannot act here"),
        ({"claim": "guo-sw-fgo", "holds_if": "lag", "score": "north_rmse"}, "'score' cannot act here"),
        ({**MINE, "runs": 9}, "'runs' cannot act here: a claim without a condition"),
        ({"claim": "auv-graph", "holds_if": ["fusion=waits"]}, "there is no choice 'waits'"),
        ({"claim": "ekf", "than": "sw-fgo", "gain": 10.0}, "'scenario' is missing"),
        ({"claim": "guo-sw-fgo", "holds_if": ["lag=nan"]}, "numbers"),
        ({"claim": "guo-sw-fgo", "holds_if": ["lag=-5"]}, "from 0 to 3600"),
        ({"claim": "mao-road-east", "holds_if": ["imu=-1"]}, "random_walk"),
        ({"claim": "jiang-turn", "holds_if": ["told=0"]}, "should be above 0"),
        ({"claim": "ekf", "than": "sw-fgo", "gain": 0.0, "scenario": "ship-turn"}, "between 0 and 100"),
        ({"claim": "ekf", "than": "sw-fgo", "gain": 9.0, "scenario": "ship-turn", "holds_if": "lag"}, "has values"),
        (
            {"claim": "ekf", "than": "sw-fgo", "gain": 9.0, "scenario": "ship-turn", "holds_if": "than.windo=1,2"},
            "no parameter 'windo'",
        ),
        ({**MINE, "claim": "ship-ekf", "than": "ship-fgo", "holds_if": "x=1,2"}, "no dial 'x'"),
        ({**MINE, "claim": "ekf"}, "ekf cannot run on ship-turn-v1: it needs an IMU; there is none"),
        ({**MINE, "than": "ekf"}, "ekf cannot run on ship-turn-v1: it needs an IMU; there is none"),
        ({**MINE, "holds_if": "row.window=1.5"}, "row.window=1.5: parameter 'window' .* is a whole number, not 1.5"),
        ({**MINE, "holds_if": "row.window=0,5"}, "row.window=0,5: .* at least 1 epoch"),
        ({**MINE, "holds_if": "lag=0,20"}, "a lag of 20 s is longer than the window, which holds the last 19 s"),
        ({**MINE, "holds_if": "lag=0.5"}, "a lag of 0.5 s is no multiple of the step of 1 s"),
        ({**MINE, "score": "horizontal_rmse_lag_20"}, "a lag of 20 s is longer than the window"),
        ({**MINE, "score": "horizontal_max", "holds_if": "lag=5"}, "horizontal_max is no score of a late output"),
        ({**MINE, "score": "horizontal_rmse_lag_7", "holds_if": "lag=5"}, "is no score of a late output"),
        ({**MINE, "holds_if": "duration_s=-5,9"}, "duration"),
        ({**MINE, "judged_from": 1003}, "needs later ones"),
        ({"claim": "mao-sigma-east", "holds_if": "lag=90"}, "a lag of 90 s is longer than the window"),
    ],
)
def test_mistakes_are_one_sentence_before_anything_runs(how, message, monkeypatch):
    monkeypatch.setattr(searching, "run_campaign", pytest.fail)
    with pytest.raises(simnav.RequestError, match=message) as error:
        simnav.claim(**how)
    assert "\n" not in str(error.value)


def test_the_claims_of_a_paper_of_ones_own_are_searched(monkeypatch, tmp_path):
    """Its tables are run first, because none come with simnav."""
    own = tmp_path / "mao-2025.toml"
    text = (FOLDER / "mao-2025.toml").read_text()
    own.write_text(text)
    searched: list[str] = []
    ran: list[int] = []

    def search(claim, *_, **__):
        searched.append(claim.name)
        return answer(1.0, 0.8)

    def run(paper, runs, *_, **__):
        ran.append(runs)
        return Reproduction(paper, range(runs), [], {}, [])

    monkeypatch.setattr(searching, "search", search)
    monkeypatch.setattr(reproduction, "reproduce", run)
    found = simnav.reproduce(str(own), holds_if=True, output=tmp_path / "out")
    assert found.answers is not None
    assert len(found.answers) == len(searched) == text.count("[[claim]]") > 2
    assert ran == [found.paper.runs]
    own.write_text(text[: text.index("[[claim]]")])
    reading._file.cache_clear()
    reading._paper.cache_clear()
    with pytest.raises(simnav.RequestError, match=r"mao-2025\.toml has no claim"):
        simnav.reproduce(str(own), holds_if=True, output=tmp_path / "out")
