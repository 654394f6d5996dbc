"""Where an estimator stands: places that are no more than chance allows, and one sentence."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from simnav.leaderboard.ranking.runs import group
from simnav.leaderboard.ranking.standing import Standing, standing, standing_table
from simnav.leaderboard.results.result import Result

#: Factors of thirty seeds, with a geometric mean near 1.
SPREAD = [0.8, 1.3, 0.9, 1.1, 1.0, 1.25, 0.75, 1.05, 0.95, 1.15] * 3


def runs(label: str, error: float, spread: list[float]) -> list[Result]:
    return [
        Result("pond-v1", seed, label, {}, False, "ok", "", {"horizontal_rmse": error * factor})
        for seed, factor in enumerate(spread)
    ]


def stand(count: int) -> Standing:
    found = [
        *runs("mine", 1.0, SPREAD[:count]),
        *runs("ekf", 1.5, [1.0] * count),
        *runs("same", 1.01, SPREAD[:count][::-1]),
        *runs("best", 0.5, SPREAD[:count][::-1]),
    ]
    return standing(group(found)["pond-v1"], "mine", "pond-v1")


def test_the_places_are_those_that_chance_allows() -> None:
    found = stand(30)
    assert (found.place, found.last, found.of) == (2, 3, 4)
    assert found.places == "may be 2 to 3 of 4"
    assert [r.estimator for r in found.rows] == ["best", "mine", "same", "ekf"]


def test_a_few_seeds_decide_nothing() -> None:
    found = stand(3)
    assert (found.place, found.last, found.of) == (1, 4, 4)
    assert found.verdict("ekf").endswith("times that of ekf; fewer than 6 seeds cannot show a difference.")
    assert "seeds cannot show" not in stand(6).verdict("ekf")
    assert stand(30).verdict("same").endswith("; the difference may be chance.")


@pytest.mark.parametrize(
    ("plain", "said"),
    [
        ("ekf", r"its error is 0\.6\d+ times that of ekf \(95 %: 0\.\d+ to 0\.\d+ times\)\."),
        ("mine", r"mine may be 2 to 3 of 4 on pond-v1; its error is 2\.\d+ times that of best \(95 %: .* times\)\."),
        ("nobody", r"its error is 2\.\d+ times that of best \(95 %: .* times\)\."),
    ],
)
def test_the_verdict_is_one_sentence(plain: str, said: str) -> None:
    assert re.search(f"{said}$", stand(30).verdict(plain))


def test_the_first_row_is_told_its_gain_over_the_next() -> None:
    told = [replace(r, reference=True) for r in runs("oracle", 0.4, SPREAD)]
    by = group([*told, *runs("best", 0.5, SPREAD), *runs("next", 1.0, SPREAD), *runs("last", 2.0, SPREAD)])["pond-v1"]
    gain = "best is 1 of 3 on pond-v1; its error is 0.500 times that of next"
    assert standing(by, "best", "pond-v1").verdict("best").startswith(gain)
    assert standing({"best": by["best"]}, "best", "pond-v1").verdict("best") == "best is 1 of 1 on pond-v1."


def test_where_it_does_not_suit_there_is_no_place() -> None:
    found = standing(group(runs("ekf", 1.0, SPREAD))["pond-v1"], "mine", "pond-v1")
    assert (found.place, found.last, found.places) == (None, None, "cannot run")
    assert found.verdict("ekf") == "mine cannot run on pond-v1."


def test_a_reference_has_no_place_but_a_ratio() -> None:
    told = [replace(r, reference=True) for r in runs("oracle", 1.0, SPREAD)]
    found = standing(group([*told, *runs("ekf", 1.2, SPREAD)])["pond-v1"], "oracle", "pond-v1")
    assert (found.place, found.places) == (None, "is a reference and has no place")
    assert found.verdict("ekf").startswith("oracle is a reference and has no place on pond-v1; its error is 0.8")


def test_the_error_of_a_smoother_stands_beside_that_in_real_time() -> None:
    late = [replace(r, scores=dict(r.scores) | {"smoothed_horizontal_rmse": 0.7}) for r in runs("rts", 1.0, SPREAD)]
    table = standing_table(standing(group([*runs("ekf", 1.2, SPREAD), *late])["pond-v1"], "rts", "pond-v1"))
    column = table.columns.index("smoothed [m]")
    assert {row[0]: row[column] for row in table.rows} == {"rts": "0.700", "ekf": "–"}
    assert "smoothed [m]" not in standing_table(stand(30)).shown(200)


def test_a_p_value_that_no_data_could_make_small_is_not_shown() -> None:
    shown = {n: [row[-1] for row in standing_table(stand(n)).rows if row[-1]] for n in (3, 30)}
    assert shown[3] == ["–"] * 3
    assert "–" not in shown[30]
