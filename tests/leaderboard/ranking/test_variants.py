"""Variants of one row are found by name and by what they estimate, and which are ranked depends on no result."""

from __future__ import annotations

import numpy as np

from simnav.leaderboard.ranking.variants import MOST, families, surplus


def logs(rng: np.random.Generator, runs: int = 40) -> dict[object, float]:
    return dict(enumerate(rng.normal(0.0, 1.0, runs).tolist()))


def test_labels_of_one_row_are_a_family_also_of_simnavs_own():
    rng = np.random.default_rng(0)
    rows = {label: logs(rng) for label in ("ekf(gate=3)", "ekf", "ekf(gate=1)", "ekf(gate=2)", "imm")}
    (found,) = families(rows, lambda name: True)
    assert found == ["ekf", "ekf(gate=1)", "ekf(gate=2)", "ekf(gate=3)"]
    assert surplus([found]) == {"ekf(gate=3)": found}


def test_copies_of_others_are_found_and_rows_of_simnav_are_no_copies():
    rng = np.random.default_rng(1)
    own = logs(rng)
    copies = {f"mine-{k}": {run: x + 0.01 * rng.normal() for run, x in own.items()} for k in range(5)}
    rows = {"ekf": own, "iekf": own, "other": logs(rng), **copies}
    (found,) = families(rows, lambda name: name in ("ekf", "iekf"))
    assert found == [f"mine-{k}" for k in range(5)]
    assert list(surplus([found])) == found[MOST:]


def test_which_variants_are_ranked_does_not_depend_on_their_errors():
    rng = np.random.default_rng(2)
    rows = {f"a(k={k})": logs(rng) for k in range(6)}
    better = {label: {run: x - 5.0 * k for run, x in mine.items()} for k, (label, mine) in enumerate(rows.items())}
    assert surplus(families(rows, bool)).keys() == surplus(families(better, bool)).keys()


def test_rows_that_agree_in_half_of_their_runs_are_no_copies():
    rng = np.random.default_rng(3)
    a, b = logs(rng), logs(rng)
    half = {run: a[run] if run % 2 else b[run] for run in a}
    assert families({"a": a, "half": half}, lambda name: False) == []
