"""The self-test of a row against the fixes that it sets aside."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from simnav.estimator import make, names
from simnav.estimators.fix_test import FixTest
from simnav.geometry.earth import displace, relative_position
from simnav.geometry.rotation import dcm_from_rpy
from simnav.scenario import load
from simnav.source import record
from simnav.trial import run_trial
from simnav.types import Datasheet, Estimate, Instruments, Measurement, Measurements

HERE = np.array([0.9, 0.2, 3.0])
LEVER = np.array([8.0, -2.0, -10.0])
HEADING = 0.7
ANTENNA = np.array([np.cos(HEADING) * 8.0 + np.sin(HEADING) * 2.0, np.sin(HEADING) * 8.0 - np.cos(HEADING) * 2.0, 0.0])


def contradictions(offsets: np.ndarray, sigma: float = 0.5, late: float = 0.0, attitude: bool = True) -> list[bool]:
    """After each fix, whether it contradicts an estimate that stands still; fixes are ``late`` seconds old."""
    sheet = Datasheet("gnss", "gnss_position", 1.0, np.full(3, 1.0), lever_arm=LEVER)
    test = FixTest(Instruments((sheet,)))
    velocity = np.array([3.0, -4.0, 0.0])
    found = []
    for k, offset in enumerate(offsets):
        time = float(k + 1)
        estimate = Estimate(
            time,
            HERE,
            velocity,
            np.array([0.0, 0.0, HEADING]) if attitude else None,
            covariance=np.diag([*[sigma**2] * 6, *[1e-4] * 3]),
            diagnostics={"inconsistent": 0.0, "other": 1.0},
        )
        fix = displace(HERE, ANTENNA + offset - late * velocity)
        m = Measurement(time - late, "gnss", "gnss_position", fix)
        judged = test.judge(Measurements(time - 1.0, time, None, [m]), estimate)
        assert judged.diagnostics["other"] == 1.0
        assert judged.diagnostics["inconsistent"] == float(test.contradicted)
        found.append(test.contradicted)
    return found


@pytest.mark.parametrize("noise", [1.0, 8.0])
def test_noise_is_no_contradiction_however_large(noise):
    """Eight times the datasheet's noise has no direction. (One of a hundred courses is found correlated by chance.)"""
    rng = np.random.default_rng(5)
    share = np.mean([contradictions(noise * rng.standard_normal((100, 3))) for _ in range(10)])
    assert share < (0.001 if noise == 1.0 else 0.03)


def test_gross_errors_are_none_and_an_offset_is_one_while_it_lasts():
    rng = np.random.default_rng(6)
    offsets = rng.standard_normal((200, 3))
    offsets[20:60:10, :2] += 40.0 * rng.choice([-1.0, 1.0], (4, 2))
    offsets[100:150, 0] += 20.0
    found = np.array(contradictions(offsets))
    assert not found[:100].any()
    assert found[112:150].all()
    assert not found[180:].any()


def test_who_admits_its_error_is_not_contradicted():
    offsets = np.tile([30.0, 0.0, 0.0], (60, 1))
    assert any(contradictions(offsets, sigma=3.0))
    assert not any(contradictions(offsets, sigma=30.0))


def test_a_fix_is_compared_at_its_own_time_and_at_the_antenna():
    assert not any(contradictions(np.zeros((60, 3)), sigma=0.1, late=0.9))
    assert not any(contradictions(np.zeros((60, 3)), sigma=0.1, attitude=False))  # the antenna lies in some direction
    assert any(contradictions(np.tile([9.0, 0.0, 0.0], (60, 1)), sigma=0.1, late=0.9))


def turning(sigma: float, steps: int = 60) -> bool:
    """Whether precise fixes contradict true estimates of a vessel that weaves and heels; fixes are 0.7 s old."""
    arm = np.array([3.0, -5.0, -4.0])
    sheet = Datasheet("gnss", "gnss_position", 1.0, np.full(3, sigma), lever_arm=arm)
    test, rng = FixTest(Instruments((sheet,))), np.random.default_rng(3)

    def pose(t: float) -> tuple[np.ndarray, np.ndarray]:
        return (
            np.array([4.0 * t, 6.0 * np.sin(0.4 * t), 0.0]),
            np.array([0.2 * np.sin(0.4 * t), 0.05, 3.0 + np.sin(0.4 * t)]),
        )

    for k in range(1, steps + 1):
        place, attitude = pose(k)
        velocity = np.array([4.0, 2.4 * np.cos(0.4 * k), 0.0])
        estimate = Estimate(float(k), displace(HERE, place), velocity, attitude, covariance=np.eye(9) * 1e-8)
        then, turned = pose(k - 0.7)
        fix = displace(HERE, then + dcm_from_rpy(turned) @ arm + sigma * rng.standard_normal(3))
        test.judge(
            Measurements(k - 1.0, float(k), None, [Measurement(k - 0.7, "gnss", "gnss_position", fix)]), estimate
        )
        if test.contradicted:
            return True
    return False


def test_precise_fixes_agree_with_a_vessel_that_turns_and_heels():
    """Straight back from the end of the step, and level, the antenna would be off by up to 0.9 m."""
    assert not turning(0.15)


def test_without_a_finite_fix_nothing_happens():
    assert not any(contradictions(np.full((20, 3), np.nan)))


def test_who_may_set_fixes_aside_tests_itself():
    tested = {name for name in names() if getattr(make(name), "sets_aside", False)}
    assert {"iae", "gnc-fgo", "anfis-ekf", "imm", "federated", "solution-separation", "gated-ekf"} <= tested
    assert not {"ekf", "sw-fgo", "dead-reckoning", "oracle", "oracle-times"} & tested


def test_a_row_that_rejects_the_truth_says_so():
    """It starts two hundred metres away, rejects the fixes for ten seconds, and then takes them back."""
    recording = record(load("open-sea").model_copy(update={"duration": 80.0}), 3)
    start = replace(recording.start, position=displace(recording.start.position, np.array([200.0, 0.0, 0.0])))
    trial = run_trial(make("gated-ekf"), replace(recording, start=start))
    away = np.hypot(*relative_position(trial.position, recording.data.truth.position)[:, :2].T) > 50.0
    said = trial.diagnostics["inconsistent"] > 0.5
    assert away[:10].all()
    assert said[11:30].all()
    assert not (away | said)[-10:].any()
