"""Integrity: protection levels against their definition, the kinds of epochs, the scores and the diagram."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

from simnav.leaderboard import cli
from simnav.leaderboard.figures.stanford import stanford_diagrams
from simnav.scoring import SCORES, protection_levels, score, stanford
from simnav.scoring.integrity import ALERT_LIMITS, KINDS_OF_EPOCHS, RISK, Stanford

K = np.sqrt(-2.0 * np.log(RISK))


def covariance(steps: int, *sigmas: float) -> np.ndarray:
    """Of all epochs, diagonal; the first two sigmas are horizontal."""
    return np.broadcast_to(np.diag(np.square([*sigmas, *[1.0] * (9 - len(sigmas))])), (steps, 9, 9)).copy()


def test_a_circular_error_exceeds_the_level_with_the_risk():
    """By simulation, at a risk that can be counted."""
    rng = np.random.default_rng(3)
    radius = np.hypot(*rng.normal(size=(2, 200_000)))
    level = np.sqrt(-2.0 * np.log(1e-2))
    assert np.mean(radius > level) == pytest.approx(1e-2, rel=0.1)


def test_the_level_is_of_the_semi_major_axis(recording, make_trial):
    turn = np.array([[np.cos(0.4), -np.sin(0.4)], [np.sin(0.4), np.cos(0.4)]])
    p = covariance(100, 1.0, 1.0)
    p[:, :2, :2] = turn @ np.diag([9.0, 1.0]) @ turn.T
    trial = make_trial(recording, np.zeros(9), covariance=p)
    np.testing.assert_allclose(protection_levels(trial), 3.0 * K)
    np.testing.assert_allclose(protection_levels(trial, 1e-7), 3.0 * np.sqrt(-2.0 * np.log(1e-7)))


def test_a_level_of_the_estimator_s_own_wins(recording, make_trial):
    own = np.linspace(1.0, 100.0, 100)
    trial = make_trial(
        recording, np.zeros(9), covariance=covariance(100, 1.0, 1.0), diagnostics={"protection_level": own}
    )
    np.testing.assert_array_equal(protection_levels(trial), own)
    with pytest.raises(ValueError, match="one number an epoch"):
        protection_levels(replace(trial, diagnostics={"protection_level": np.ones((100, 2))}))
    assert np.isnan(protection_levels(make_trial(recording, np.zeros(9)))).all()


def test_the_five_kinds():
    error = np.array([1.0, 20.0, 30.0, 30.0, 70.0, np.inf])
    level = np.array([5.0, 10.0, 10.0, 50.0, 50.0, np.inf])
    diagram = Stanford(error, level, 25.0)
    assert [KINDS_OF_EPOCHS[k] for k in diagram.kind] == [*KINDS_OF_EPOCHS, "unavailable"]
    assert diagram.shares["hazardously misleading"] == pytest.approx(1 / 6)
    assert sum(diagram.shares.values()) == pytest.approx(1.0)


def test_the_scores_of_a_run(recording, make_trial):
    """Errors of 30 m on a tenth of the epochs, and levels that know of half of them."""
    error, own = np.zeros((100, 9)), np.full(100, 10.0)
    error[:10, 0], own[:5] = 30.0, 40.0
    found = score(make_trial(recording, error, diagnostics={"protection_level": own}), recording)
    assert found["protection_exceeded"] == pytest.approx(0.05)
    assert found["integrity_risk_25"] == pytest.approx(0.05)
    assert found["integrity_availability_25"] == pytest.approx(0.95)
    assert found["integrity_availability_2_5"] == 0.0
    assert found["integrity_risk_2_5"] == 0.0
    assert found["within_10_m"] == pytest.approx(0.9)
    assert found["within_100_m"] == 1.0
    assert [SCORES[f"integrity_risk_{x}"].better for x in ("25", "2_5")] == ["lower", "lower"]
    assert ALERT_LIMITS == (25.0, 2.5)


def test_without_a_level_there_is_no_integrity_and_still_an_accuracy(recording, make_trial):
    found = score(make_trial(recording, np.full(9, 8.0)), recording)
    for name in ("protection_exceeded", "integrity_risk_25", "integrity_availability_25"):
        assert np.isnan(found[name])
    assert found["within_10_m"] == 0.0
    assert found["within_100_m"] == 1.0


def test_epochs_that_a_failed_trial_did_not_reach_are_not_available(recording, make_trial):
    trial = make_trial(recording, np.zeros((40, 9)), covariance=covariance(40, 1.0, 1.0), status="error")
    trial = replace(trial, update_seconds=trial.update_seconds[:40])
    found = score(trial, recording, ["integrity_availability_25", "within_10_m", "protection_exceeded"])
    assert found["integrity_availability_25"] == pytest.approx(0.4)
    assert found["within_10_m"] == pytest.approx(0.4)
    assert found["protection_exceeded"] == 0.0


def test_a_diagram_of_several_runs_counts_all_epochs_and_is_drawn(recording, make_trial):
    error = np.zeros((100, 9))
    error[:, 0] = np.linspace(0.0, 60.0, 100)
    trial = make_trial(recording, error, covariance=covariance(100, 4.0, 4.0))
    diagram = stanford([(trial, recording), (trial, recording)], 25.0)
    counts = diagram.histogram(np.linspace(0.0, 50.0, 11))
    assert counts.sum() == len(diagram.error) == 200
    assert np.flatnonzero(counts.sum(axis=0)).tolist() == [3]  # 4 K = 19.2 m
    assert counts[-1].sum() == 2 * int((error[:, 0] >= 45.0).sum())
    document = json.loads(json.dumps(diagram.to_dict()))
    assert document["epochs"] == 200
    assert np.sum(document["histogram"]) == 200
    figure = stanford_diagrams({"one": diagram, "two": diagram}, title="both")
    assert [ax.get_title(loc="left") or ax.get_title() for ax in figure.axes] == ["one", "two"]
    with pytest.raises(ValueError, match="at least one"):
        stanford_diagrams({})
    assert stanford([], 25.0).shares["normal"] != stanford([], 25.0).shares["normal"]  # NaN


def test_the_command_draws_diagrams_of_those_that_have_a_level(tmp_path):
    path = tmp_path / "integrity.png"
    words = [
        "run",
        "ship-straight",
        "-e",
        "ship-ekf,gnss-only",
        "--stanford",
        str(path),
        "--alert-limit",
        "10",
        "--json",
    ]
    done = CliRunner().invoke(cli.app, words)
    assert done.exit_code == 0, done.output
    document = json.loads(done.stdout)
    assert path.stat().st_size > 1000
    assert document["stanford_plot"] == str(path)
    assert set(document["stanford"]) == {"ship-ekf", "gnss-only"}
    for diagram in document["stanford"].values():
        assert diagram["limit"] == 10.0
        assert sum(diagram["shares"].values()) == pytest.approx(1.0)
