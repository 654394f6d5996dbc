"""What is too good to be true: on recorded voyages, whose reference is public, and where notes are forged."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from simnav.estimator.registry import registered
from simnav.leaderboard.ranking import reference
from simnav.leaderboard.ranking.board import Reference
from simnav.leaderboard.ranking.ranking import rank
from simnav.leaderboard.ranking.superseded import superseded_by
from simnav.leaderboard.results.provenance import Provenance
from simnav.leaderboard.results.result import Result
from simnav.leaderboard.standard.readme import tables

#: Horizontal errors [m] of the plain filter, the plain smoother and an honest row, by recording.
PLAIN = {"dive 1": 7.0, "dive 2": 2.0, "dive 3": 1.5}


def runs(label: str, part: float, *, smoothed: float = 0.0, note: bool = True, **fields: Any) -> list[Result]:
    """Six seeds over three recordings, with a part of the plain filter's error."""
    found = []
    for seed in range(6):
        name = f"dive {1 + seed % 3}"
        scores = {"horizontal_rmse": part * PLAIN[name], "update_median": 1e-4}
        scores |= {"smoothed_horizontal_rmse": smoothed * PLAIN[name]} if smoothed else {}
        given = {"note": f"recording {name!r}; IMU samples were means" if note else ""} | fields
        found.append(Result("car-kitti-v1", seed, label, {}, label.startswith("oracle"), "ok", "", scores, **given))
    return found


def standing(results: list[Result], label: str) -> tuple[str, str]:
    (track,) = rank(results).tracks[:1]
    (found,) = (r for r in track.rows if r.estimator == label)
    return found.standing, found.why


@pytest.fixture(autouse=True)
def no_stored_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reference, "stored", dict)


@pytest.mark.parametrize("part", [1e-9, 1e-3, 0.01, 0.02])
@pytest.mark.parametrize("sealed", ["", "5ce1"])
def test_a_row_that_reads_a_public_reference_is_not_ranked(part: float, sealed: str) -> None:
    made = Provenance(seal=sealed)
    plain = runs("ekf", 1.0, provenance=made) + runs("ekf-rts", 1.0, smoothed=0.1, provenance=made)
    found, why = standing(plain + runs("reader", part, provenance=made), "reader")
    assert found == "implausible"
    assert "it may hold the reference, which is public" in why


def test_it_is_found_without_a_smoother_by_the_stored_figure_and_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    assert standing(runs("ekf", 1.0) + runs("reader", 0.01), "reader")[0] == "implausible"
    assert standing(runs("reader", 1e-9), "reader")[0] == "implausible"
    assert standing(runs("honest", 0.5), "honest")[0] == "ranked"
    figures = {"car-kitti-v1": {"horizontal_rmse": Reference(3.0, "ekf", 6, 0.5, stored=True)}}
    monkeypatch.setattr(reference, "stored", lambda: figures)
    assert standing(runs("reader", 0.01), "reader")[0] == "implausible"


def test_one_recording_that_is_read_is_enough() -> None:
    reader = [replace(r, scores={"horizontal_rmse": 0.02}) if "dive 2" in r.note else r for r in runs("reader", 0.9)]
    others = runs("ekf", 1.0) + runs("ekf-rts", 1.0, smoothed=0.5)
    assert standing(others + reader, "reader")[0] == "implausible"


def test_honest_rows_are_ranked() -> None:
    """Rows that are better than the plain smoother by more than any row of simnav is on a recorded voyage."""
    others = runs("ekf", 1.0) + runs("ekf-rts", 1.0, smoothed=0.5)
    for part in (0.35, 0.5, 0.9, 3.0):
        assert standing(others + runs("honest", part), "honest")[0] == "ranked"
    assert standing(others, "ekf-rts")[0] == "identical"  # in real time it is ekf, and no more than that


def test_a_recorded_scenario_is_recorded_whatever_the_notes_say() -> None:
    bare = [r for label in ("ekf", "honest") for r in runs(label, 1.0, note=False)]
    assert rank(bare).scenario("car-kitti-v1").unit == "recording"


def test_notes_make_no_simulated_scenario_recorded() -> None:
    """Also where each row says so, the catalogue does not know the scenario, or its track is given."""
    forged = [r for label in ("oracle", "ekf", "rival") for r in runs(label, 1.0)] + runs("thief", 1e-6)
    for name, tracks in (
        ("open-sea-v1", None),
        ("open-sea-v1", {"open-sea-v1": "aided-ins"}),
        ("my-sea-v1", {"my-sea-v1": "sea"}),
    ):
        board = rank([replace(r, scenario=name) for r in forged], tracks=tracks)
        assert board.scenario(name).unit == "seed"
        (thief,) = (r for r in board.scenario(name).rows if r.estimator == "thief")
        assert thief.standing == "implausible"


def test_the_board_says_what_is_known_of_seeds_and_references() -> None:
    said = " ".join(rank(runs("ekf", 1.0) + runs("mine", 0.9)).tracks[0].remarks)
    assert "Seeds are public: anybody can simulate the runs" in said
    assert "1 of 1 scenarios is recorded: logs and references can be downloaded by anybody" in said
    sealed = [replace(r, provenance=Provenance(seal="5ce1")) for r in runs("ekf", 1.0) + runs("mine", 0.9)]
    assert "Seeds are sealed (5ce1)" in " ".join(rank(sealed).tracks[0].remarks)


def test_the_board_says_which_results_are_of_an_older_version(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registered("ekf"), "version", 3)
    monkeypatch.setattr(registered("ukf"), "version", 1)
    found = [replace(r, estimator_version=2) for r in runs("ekf", 1.0)] + runs("mine", 0.9) + runs("ukf", 1.1)
    track = rank(found).tracks[0]
    assert {r.estimator: r.superseded for r in track.rows if r.superseded} == {"ekf": "version 2; simnav has version 3"}
    assert "Some results are of an older version: ekf (version 2; simnav has version 3)." in track.remarks
    older = "Until the next edition, some results are of an older version: `ekf` (version 2; simnav has version 3)."
    assert older in tables(rank(found), found)
    own = [r for r in found if r.estimator == "ekf"]
    newer = [replace(r, estimator_version=3) for r in own]
    assert superseded_by("ekf", own + newer) == "version 2 in some scenarios; simnav has version 3"


def test_the_board_says_what_a_row_learned_from() -> None:
    learned = {"learned_from": [[5, 68]], "trained_on": {"scenario": "training-gnss-faults-v2", "voyages": 64}}
    track = rank(runs("ekf", 1.0) + runs("mine", 0.9, learned=learned)).tracks[0]
    (mine,) = (r for r in track.rows if r.estimator == "mine")
    assert mine.learned == "learned from 64 voyages of training-gnss-faults-v2"
    assert "Learned, as the rows say: mine learned from 64 voyages of training-gnss-faults-v2." in track.remarks
    assert not next(r for r in track.rows if r.estimator == "ekf").learned
