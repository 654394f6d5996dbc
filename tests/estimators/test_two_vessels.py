"""Messages of another vessel in filters and windows: errors that last, covariance intersection, and declared errors."""

from __future__ import annotations

import re
from functools import cache
from typing import Any

import numpy as np
import pytest

from simnav import kinds
from simnav.estimator import UnsuitableScenario, make
from simnav.estimators.adaptations.intersection import share, weaken_position
from simnav.kinds import KINDS, Kind
from simnav.plugins import PluginError
from simnav.recording import Recording
from simnav.scoring.navigation_error import errors
from simnav.source import record
from simnav.trial import run_trial
from simnav.types import Array, Instruments
from tests.cases.two_vessels import two_vessels

#: Runs, and their length [s].
SEEDS, DURATION = range(1, 7), 150.0


@cache
def recorded(seed: int) -> Recording:
    return record(two_vessels(DURATION), seed)


def nees(row: str, recording: Recording) -> Array:
    """NEES of the horizontal position from 40 s on, divided by two."""
    trial = run_trial(make(row), recording)
    assert trial.covariance is not None, trial.reason
    error = errors(trial, recording)[40:, :2]
    return np.asarray(
        np.einsum("ni,ni->n", error, np.linalg.solve(trial.covariance[40:, :2, :2], error[..., None])[..., 0]) / 2
    )


def test_a_plain_filter_counts_one_error_many_times_and_the_intersection_does_not() -> None:
    """The error of the ship lasts as long as the run, so a run is one sample of two degrees of freedom."""
    plain, cautious = (np.mean([nees(row, recorded(s)).mean() for s in SEEDS]) for row in ("ekf", "ekf-ci"))
    # Of a consistent filter the mean over six runs is below 2.2 in 99 of 100 cases: chi-square of 12 over 12.
    assert plain > 5.0
    assert 0.1 < cautious < 2.2


def test_the_window_takes_the_messages_as_the_filter_does() -> None:
    filtered, window = (nees(row, recorded(2)) for row in ("ekf", "sw-fgo"))
    np.testing.assert_allclose(window.mean(), filtered.mean(), rtol=0.3)


def test_a_declared_error_is_a_state() -> None:
    """The oracle always knows that the error lasts; the plain filter does if the datasheet says so."""
    undeclared = record(two_vessels(DURATION), 2)
    declared = record(two_vessels(DURATION, declared=True), 2)
    np.testing.assert_array_equal(declared.data.aids["modem"].value, undeclared.data.aids["modem"].value)
    np.testing.assert_array_equal(declared.data.aids["modem"].side, undeclared.data.aids["modem"].side)
    found = {"oracle": nees("oracle", undeclared), "ekf": nees("ekf", declared)}
    for values in found.values():
        assert values.mean() < 4.6  # of two degrees of freedom over two: 99 of 100
    np.testing.assert_allclose(found["oracle"].mean(), found["ekf"].mean(), rtol=0.2, atol=0.1)


def test_a_share_is_the_best_one_and_the_intersection_holds_for_any_correlation() -> None:
    assert share(4.0, 1.0, 0.0) == pytest.approx(4.0 / 6.0, abs=0.006)
    assert share(1.9, 1.0, 0.0) == 1.0
    rng, sight = np.random.default_rng(1), np.array([[0.6, 0.8]])
    for _ in range(50):
        root = rng.standard_normal((2, 2))
        own, message = root @ root.T, float(rng.uniform(0.05, 0.5))
        w = share(float((sight @ own @ sight.T)[0, 0]), message, 0.0)
        if w == 1.0:
            continue
        weak, noise = own / w, message / (1.0 - w)
        gain = weak @ sight.T / (sight @ weak @ sight.T + noise)
        found = (np.eye(2) - gain @ sight) @ weak
        assert np.linalg.det(found) < np.linalg.det(own)
        # The worst correlation: the error of the message is along the own one, in any direction.
        direction = rng.standard_normal(2)
        common = np.linalg.cholesky(own) @ (direction / np.linalg.norm(direction)) * message**0.5
        left = np.eye(2) - gain @ sight
        cross = left @ common[:, None] @ gain.T
        true = left @ own @ left.T + gain * message @ gain.T + cross + cross.T
        assert np.linalg.eigvalsh(found - true).min() > -1e-9


def test_weakening_keeps_what_is_independent_of_the_position() -> None:
    root = np.random.default_rng(2).standard_normal((6, 6))
    P = root @ root.T
    weak = P.copy()
    weaken_position(weak, 3.0)
    np.testing.assert_allclose(weak[:, :2], 3.0 * P[:, :2])
    rest = [m[2:, 2:] - m[2:, :2] @ np.linalg.solve(m[:2, :2], m[:2, 2:]) for m in (P, weak)]
    np.testing.assert_allclose(rest[1], rest[0])


def test_it_needs_messages() -> None:
    scenario: Any = two_vessels(10.0)
    sheet = scenario.instruments_sheet()
    without = Instruments([s for s in sheet.values() if s.name != "modem"], sheet.imu, sheet.step)
    with pytest.raises(UnsuitableScenario, match="ekf-ci: it needs vessel_range; there is none"):
        make("ekf-ci").reset(recorded(1).start, without)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (lambda point, sheet: np.ones(2), r"message_noise of kind 'vessel_range'.*'modem:ship'.*shape \(1, 1\).*\[1.0"),
        (lambda point, sheet: -np.eye(1), r"a covariance of shape \(1, 1\), not \[\[-1.0\]\]"),
        (lambda point, sheet: point.side[10:] / point.side[10], "raised IndexError"),
    ],
)
def test_a_wrong_noise_of_a_message_is_named(wrong: Any, message: str) -> None:
    kind = KINDS["vessel_range"]
    right = kind.message_noise
    object.__setattr__(kind, "message_noise", wrong)
    try:
        trial = run_trial(make("ekf"), recorded(1))
    finally:
        object.__setattr__(kind, "message_noise", right)
    assert re.search(message, trial.reason)


def test_a_compiled_equation_has_no_noise_of_a_message() -> None:
    depth = KINDS["depth"]
    with pytest.raises(PluginError, match="message_noise has an equation of its own"):
        Kind("depth", "depth", depth.components, kinds.DEPTH, message_noise=lambda point, sheet: np.eye(1))
