"""Answers that are judged together: the same outcome as one after the other, wherever the row of them is cut."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

from simnav.scoring.consistency import nees
from simnav.trial.log import DivergedError, TrialLog
from simnav.trial.wire import EstimateEncoder, InvalidOutputError
from simnav.types import Estimate, NavigationStates

STEPS = 60


@pytest.fixture
def truth(monkeypatch: pytest.MonkeyPatch) -> NavigationStates:
    monkeypatch.setattr("simnav.trial.log._CHUNK", 16)  # so that few epochs are several chunks; no user sets it
    time = np.arange(1.0, STEPS + 1.0)
    position = np.tile([0.9, 3.1415, 0.0], (STEPS, 1))
    position[10] = np.nan  # not known there
    return NavigationStates(time, position, np.zeros((STEPS, 3)), np.zeros((STEPS, 3)))


def change_nothing(estimate: Estimate, rng: np.random.Generator) -> None:
    pass


def another_time(estimate: Estimate, rng: np.random.Generator) -> None:
    estimate.time += rng.choice([1e-7, 1e-5])


def flags(estimate: Estimate, rng: np.random.Generator) -> None:
    estimate.flagged = [("gnss", estimate.time)] * int(rng.integers(1, 3))


def more_diagnostics(estimate: Estimate, rng: np.random.Generator) -> None:
    estimate.diagnostics = {"a": rng.normal(size=int(rng.integers(1, 3))), "b": 1.0}


def matrix(estimate: Estimate, rng: np.random.Generator) -> None:
    estimate.diagnostics = {"a": np.eye(2)}  # another number of dimensions


def no_velocity(estimate: Estimate, rng: np.random.Generator) -> None:
    estimate.velocity = None


def some_components(estimate: Estimate, rng: np.random.Generator) -> None:
    estimate.estimated = np.arange(9) < 2
    assert estimate.attitude is not None
    estimate.attitude = estimate.attitude * np.nan


def not_finite(estimate: Estimate, rng: np.random.Generator) -> None:
    assert estimate.position is not None
    estimate.position = estimate.position + np.array([0.0, np.inf, 0.0])


def far_away(estimate: Estimate, rng: np.random.Generator) -> None:
    assert estimate.position is not None
    estimate.position = estimate.position + np.array([100e3 / 6371e3 * rng.choice([0.98, 0.995, 1.001]), 0.0, 0.0])


def across_the_date_line(estimate: Estimate, rng: np.random.Generator) -> None:
    assert estimate.position is not None
    estimate.position = estimate.position - np.array([0.0, 2.0 * np.pi, 0.0])


def no_covariance(estimate: Estimate, rng: np.random.Generator) -> None:
    estimate.covariance = None


def indefinite(estimate: Estimate, rng: np.random.Generator) -> None:
    estimate.covariance = -np.eye(9)


GOOD = [change_nothing, flags, more_diagnostics, no_velocity, some_components, across_the_date_line, no_covariance]
BAD = [another_time, matrix, not_finite, far_away, indefinite]


def estimates(rng: np.random.Generator, truth: NavigationStates) -> list[Estimate]:
    """Runs of estimates of one form, and in every other case a bad one among them."""
    found = []
    change = change_nothing
    bad = int(rng.integers(0, 2 * STEPS))
    for k in range(STEPS):
        if rng.random() < 0.15:
            change = GOOD[int(rng.integers(len(GOOD)))]
        position = np.array([0.9, 3.1415, 0.0]) + 1e-6 * rng.normal(size=3)
        spread = rng.normal(size=(9, 9))
        estimate = Estimate(
            truth.time[k],
            position,
            rng.normal(size=3),
            rng.normal(size=3),
            spread @ spread.T,
            diagnostics={"x": 1.0 * k},
        )
        change(estimate, rng)
        if k == bad:
            BAD[int(rng.integers(len(BAD)))](estimate, rng)
        found.append(estimate)
    return found


@pytest.mark.parametrize(
    ("variances", "beside", "reason"),
    [
        ([5e-324, 1.0], 0.0, "has a variance of north of 5e-324: it should be 0 or at least 1e-100"),
        ([5e-324, 5e-324], 1e-5, "has a variance of north of 5e-324: it should be 0 or at least 1e-100"),
        ([1.0, 1e-310], 0.0, "has a variance of east of 1e-310: it should be 0 or at least 1e-100"),
        ([1.7e308, 1.0], 0.0, "has an entry beyond 1e+100"),
        ([1.0, 1.0], 1e300, "has an entry beyond 1e+100"),
        ([1e-100, 1e-100], 1e100, "is not positive semi-definite"),
        ([1.0, 0.0], 0.5, "is not positive semi-definite"),
        ([1e-100, 0.0], 0.0, ""),
        ([1e100, 1e-100], 0.9, ""),
    ],
)
def test_no_covariance_is_beyond_what_can_be_computed_with(
    truth: NavigationStates, variances: list[float], beside: float, reason: str
) -> None:
    covariance = np.eye(9)
    covariance[[0, 1], [0, 1]] = variances
    covariance[0, 1] = covariance[1, 0] = beside
    log, encode = TrialLog(truth, True), EstimateEncoder()
    estimate = Estimate(
        time=float(truth.time[0]), position=truth.position[0], velocity=truth.velocity[0], attitude=truth.attitude[0],
        covariance=covariance,
    )  # fmt: skip
    log.add(encode(estimate), 0.0)
    if reason:
        with pytest.raises(InvalidOutputError, match=re.escape(reason)):
            log.check_covariances()
    else:
        log.check_covariances()
        values, _ = nees(np.full((1, 9), 3.0), covariance[None], (0, 1))
        assert values[0] > 0.0


def outcome(log: TrialLog, answers: list[bytes], cuts: list[int] | None) -> tuple[Any, ...]:
    """How it ended and what is kept, where answers are laid by until the cuts or, for None, added one by one."""
    try:
        for k, answer in enumerate(answers):
            if cuts is None:
                log.add(answer, 0.5 * k)
            else:
                log.put(answer, 0.5 * k)
                if k in cuts:
                    log.settle()
        log.settle()
        log.check_covariances()
        end: tuple[Any, ...] = ("ok",)
    except Exception as error:
        end = (type(error), str(error), log.step)
    trial = log.trial("it", "", "")
    arrays = [trial.time, trial.position, trial.velocity, trial.attitude, trial.estimated, trial.update_seconds]
    arrays += [np.zeros(0) if trial.covariance is None else trial.covariance]
    arrays += [trial.diagnostics[name] for name in trial.diagnostics]
    return end, log.n, trial.flagged, list(trial.diagnostics), [(a.shape, a.tobytes()) for a in arrays]


@pytest.mark.parametrize("limit", [np.inf, 4000.0])
def test_together_or_one_by_one(truth: NavigationStates, limit: float) -> None:
    ends = set()
    for seed in range(100):
        rng = np.random.default_rng(seed)
        encode = EstimateEncoder()
        answers = [encode(estimate) for estimate in estimates(rng, truth)]
        if rng.random() < 0.3:  # one that no encoder makes
            k = int(rng.integers(STEPS))
            answers[k] = [answers[k][:-8], answers[k] + bytes(8), b"", bytes(24), b"\3" + answers[k][1:]][seed % 5]
        cuts = sorted(rng.choice(STEPS, 4))
        one_by_one = outcome(TrialLog(truth, True, limit), answers, None)
        assert outcome(TrialLog(truth, True, limit), answers, cuts) == one_by_one
        ends.add(one_by_one[0][0])
    assert ends >= ({"ok", InvalidOutputError, DivergedError} if limit == np.inf else {MemoryError, InvalidOutputError})


def taken(truth: NavigationStates, diagnostics: list[Any], limit: float = 1 << 30) -> TrialLog:
    """A log with estimates of these diagnostics; what cannot be taken raises."""
    log, encode = TrialLog(truth, True, limit), EstimateEncoder()
    for k, given in enumerate(diagnostics):
        position = np.array([0.9, 3.1415, 0.0])
        log.add(encode(Estimate(float(truth.time[k]), position=position, diagnostics=given)), 1e-3)
    return log


def test_diagnostics_are_bounded_as_arrays_of_the_trial(truth: NavigationStates) -> None:
    """Not only as they arrive: each is as large as the largest of it, at every step."""
    ragged = [{"x": np.zeros((10**5, 1))}, {"x": np.zeros((1, 10**5))}]
    with pytest.raises(MemoryError):
        taken(truth, ragged)
    with pytest.raises(MemoryError, match="any memory"):
        taken(truth, [{"x": np.zeros((10**6, 1))}, {"x": np.zeros((1, 10**6))}], np.inf)  # 480 TB
    with pytest.raises(MemoryError, match="more than 8 MiB"):
        taken(truth, [{"x": np.zeros(20_000)}], 8 << 20)  # 0.16 MB, but 9.6 MB in 60 steps
    assert taken(truth, [{"x": np.zeros(10_000)}], 8 << 20).trial("x", "ok", "").diagnostics["x"].shape == (1, 10_000)


@pytest.mark.parametrize("shape", [(0,), (0, 3), (3, 0), (1, 0, 2)])
def test_an_empty_diagnostic_is_one(truth: NavigationStates, shape: tuple[int, ...]) -> None:
    log = taken(truth, [{"x": np.zeros(shape)}, {}, {"x": np.zeros(shape)}])
    assert log.trial("x", "ok", "").diagnostics["x"].shape == (3, *shape)


@pytest.mark.parametrize(
    ("given", "why"),
    [({1: 0.0, "1": np.zeros(3)}, "'1' is given twice"), ({"x": np.zeros((1,) * 17)}, "17 dimensions, more than 16")],
)
def test_what_cannot_be_an_array_of_the_trial(truth: NavigationStates, given: dict[Any, Any], why: str) -> None:
    with pytest.raises(InvalidOutputError, match=why):
        taken(truth, [given])


@pytest.mark.parametrize("variance", [5e-324, 1e-300, 0.0, 1.0])
@pytest.mark.parametrize("covariance", [1e308, -1e308, 1e200, 2.5])
def test_no_covariance_goes_beyond_what_lapack_can_do(
    truth: NavigationStates, variance: float, covariance: float
) -> None:
    p = np.eye(9)
    p[0, 0], p[0, 1], p[1, 0] = variance, covariance, covariance
    log = TrialLog(truth, True)
    vectors = {"position": np.array([0.9, 3.1415, 0.0]), "velocity": np.zeros(3), "attitude": np.zeros(3)}
    log.add(EstimateEncoder()(Estimate(float(truth.time[0]), covariance=p, **vectors)), 1e-3)
    if 0.0 < variance < 1e-100:
        reason = "a variance of north of .*: it should be 0 or at least 1e-100"
    else:
        reason = r"an entry beyond 1e\+100" if abs(covariance) > 1e100 else "not positive semi-definite"
    with pytest.raises(InvalidOutputError, match=reason):
        log.check_covariances()
    assert log.n == 0
