"""The smoother against a batch least-squares solution and the two-filter form; consistency and gain on clean runs."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from simnav.estimator import make
from simnav.estimators.models.base import ErrorModel, Linearised
from simnav.estimators.solvers.kalman import KalmanEstimator
from simnav.estimators.solvers.smoother import Smoother, smoother_gains
from simnav.scenario import load
from simnav.scoring import errors
from simnav.scoring.consistency import GROUPS, nees, nees_band
from simnav.scoring.navigation_error import smoothed_errors
from simnav.simulation.simulator import simulate
from simnav.trial import run_trial
from simnav.types import Datasheet, Estimate, InitialState, Instruments, Measurement, Measurements

P0 = np.diag([4.0, 0.25])
DENSITY = 0.04  # of the velocity's white acceleration [m^2/s^3]


def motion(dt: float) -> tuple[np.ndarray, np.ndarray]:
    F = np.array([[1.0, dt], [0.0, 1.0]])
    return F, DENSITY * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])


class Line(ErrorModel):
    """Depth and its rate: white acceleration, depth measured by two instruments."""

    size = 2
    state = ("x",)

    def begin(self, start, instruments):
        self.time, self.sheets = start.time, instruments
        self.x = np.array([start.position[2], start.velocity[2]])
        return P0.copy()

    def observes(self, instrument):
        return True

    def propagate(self, covariance, until):
        if until > self.time:
            self.F, Q = motion(until - self.time)
            self.x = self.F @ self.x
            covariance[:] = self.F @ covariance @ self.F.T + Q
            self.time = until

    def carry(self, error, elapsed):
        error[...] = self.F @ error

    def measure(self, m):
        sigma = self.sheets[m.instrument].sigma
        return Linearised(m.value - self.x[:1], np.array([[1.0, 0.0]]), np.diag(sigma**2))

    def correct(self, dx):
        self.x += dx

    def estimate(self, covariance):
        full = np.eye(9)
        full[np.ix_([2, 5], [2, 5])] = covariance
        return Estimate(self.time, np.array([0.0, 0.0, self.x[0]]), np.array([0.0, 0.0, self.x[1]]), np.zeros(3), full)


def smoothed_line() -> KalmanEstimator:
    return KalmanEstimator(Line(), smoother=Smoother())


SHEETS = [Datasheet("a", "depth", 1.0, np.array([0.5])), Datasheet("b", "depth", 0.7, np.array([0.2]))]


@pytest.fixture(scope="module")
def line():
    """A smoother that has run: two instruments, together at times, one away for a while; 30 steps of 1 s."""
    rng = np.random.default_rng(5)
    measured = [(float(t), "a") for t in range(1, 31) if not 10 < t < 18]
    measured += [(round(0.7 * k, 6), "b") for k in range(1, 43) if not 8 < 0.7 * k < 20]  # 0.7 * 10 = 7: both
    measured.sort()
    values = [float(10.0 + 0.3 * t + rng.normal()) for t, _ in measured]
    estimator = smoothed_line()
    start = InitialState(0.0, np.array([0.0, 0.0, 9.0]), np.array([0.0, 0.0, 0.5]), np.zeros(3), np.eye(9))
    estimator.reset(start, Instruments(SHEETS))
    filtered = []
    for k in range(30):
        aids = [
            Measurement(t, name, "depth", np.array([v]))
            for (t, name), v in zip(measured, values, strict=True)
            if k < t <= k + 1
        ]
        filtered.append(estimator.update(Measurements(float(k), k + 1.0, None, aids)))
    return estimator, estimator.smooth(), measured, values, filtered


def sigma_of(name: str) -> float:
    return 0.5 if name == "a" else 0.2


def test_equals_batch_least_squares(line):
    """All states of all times at once, by one dense solve of the normal equations."""
    estimator, smoothed, measured, values, _ = line
    times = sorted({0.0, *range(1, 31), *(t for t, _ in measured)})
    n = 2 * len(times)
    J, h = np.zeros((n, n)), np.zeros(n)
    J[:2, :2] = np.linalg.inv(P0)
    h[:2] = J[:2, :2] @ (9.0, 0.5)
    for k in range(len(times) - 1):
        F, Q = motion(times[k + 1] - times[k])
        D = np.hstack([-F, np.eye(2)])
        J[2 * k : 2 * k + 4, 2 * k : 2 * k + 4] += D.T @ np.linalg.inv(Q) @ D
    for (t, name), v in zip(measured, values, strict=True):
        i = 2 * times.index(t)
        J[i, i] += sigma_of(name) ** -2
        h[i] += v * sigma_of(name) ** -2
    C = np.linalg.inv(J)
    x = C @ h
    at = [2 * times.index(float(t)) for t in range(1, 31)]
    np.testing.assert_allclose(smoothed.time, np.arange(1.0, 31.0))
    np.testing.assert_allclose(smoothed.position[:, 2], [x[i] for i in at], rtol=0, atol=1e-9)
    np.testing.assert_allclose(smoothed.velocity[:, 2], [x[i + 1] for i in at], rtol=0, atol=1e-9)
    expected = np.array([C[i : i + 2, i : i + 2] for i in at])
    np.testing.assert_allclose(estimator.smoothed_covariance[:, [2, 5]][:, :, [2, 5]], expected, rtol=0, atol=1e-10)


def test_equals_the_two_filter_form(line):
    """P^-1 = Pf^-1 + Pb^-1, forward posterior and backward prediction that starts without information."""
    estimator, smoothed, measured, values, filtered = line
    J, h = np.zeros((2, 2)), np.zeros(2)  # backward, just after the time at hand
    t = 30.0
    for k in range(29, -1, -1):
        end = k + 1.0
        Pf = filtered[k].covariance[np.ix_([2, 5], [2, 5])]
        xf = np.array([filtered[k].position[2], filtered[k].velocity[2]])
        P = np.linalg.inv(np.linalg.inv(Pf) + J)
        x = P @ (np.linalg.solve(Pf, xf) + h)
        assert x == pytest.approx([smoothed.position[k, 2], smoothed.velocity[k, 2]], abs=1e-8)
        np.testing.assert_allclose(estimator.smoothed_covariance[k][np.ix_([2, 5], [2, 5])], P, atol=1e-9)
        back = [(s, n, v) for (s, n), v in zip(measured, values, strict=True) if k < s <= end]
        for s, name, v in [*reversed(back), (float(k), "", 0.0)]:
            F, Q = motion(t - s)
            M = np.eye(2) + J @ Q
            J, h = F.T @ np.linalg.solve(M, J) @ F, F.T @ np.linalg.solve(M, h)
            t = s
            if name:
                J[0, 0] += sigma_of(name) ** -2
                h[0] += v * sigma_of(name) ** -2


def test_last_epoch_is_the_filters_and_earlier_ones_are_better(line):
    estimator, smoothed, _, _, filtered = line
    assert smoothed.position[-1, 2] == filtered[-1].position[2]
    np.testing.assert_array_equal(estimator.smoothed_covariance[-1], filtered[-1].covariance)
    before = np.array([f.covariance[2, 2] for f in filtered])
    assert np.all(estimator.smoothed_covariance[:-1, 2, 2] < before[:-1])


def test_a_second_call_gives_the_same_and_a_reset_forgets(line):
    estimator, smoothed, *_ = line
    np.testing.assert_array_equal(estimator.smooth().position, smoothed.position)
    fresh = smoothed_line()
    fresh.reset(InitialState(0.0, np.zeros(3), np.zeros(3), np.zeros(3), np.eye(9)), Instruments(SHEETS))
    assert fresh.smooth() is None


def test_gains_where_a_state_is_known_without_error_or_follows_from_another():
    rng = np.random.default_rng(1)
    A = rng.normal(size=(3, 3))
    P = np.zeros((1, 4, 4))
    P[0, :3, :3] = A @ A.T
    F = np.eye(4)[None] + 0.0
    F[0, 0, 1] = 0.5
    M = F @ P @ F.swapaxes(1, 2)
    M[0, :3, :3] += 0.1 * np.eye(3)
    G = smoother_gains(P, F, M)
    np.testing.assert_allclose(
        G[0, :3, :3], (P @ F.swapaxes(1, 2))[0, :3, :3] @ np.linalg.inv(M[0, :3, :3]), atol=1e-12
    )
    assert not G[0, 3].any()
    assert not G[0, :, 3].any()
    twin = np.ones((1, 2, 2))  # perfectly correlated: no inverse
    G = smoother_gains(twin, np.eye(2)[None], twin)
    np.testing.assert_allclose(G @ twin, twin, atol=1e-9)


def test_gains_of_an_error_that_only_fades():
    """A damped oscillation of unknown size: value and rate follow from each other, and each passes through zero.

    The matrix has an inverse in floating point, which means nothing. ``G M G'`` is at most P.
    """
    F = np.eye(3)
    F[:2, :2] = expm(0.1 * np.array([[0.0, 1.0], [-0.09, -0.18]]))
    size, seen = np.array([1.0, -0.4, 0.3]), np.array([1.0, 0.2, 1.0])
    P = np.outer(size, size) + np.diag([0.0, 0.0, 1.0])
    before, predicted = [], []
    for _ in range(400):
        before.append(P)
        M = F @ P @ F.T + np.diag([0.0, 0.0, 1e-4])
        predicted.append(M)
        gain = M @ seen / (seen @ M @ seen + 4.0)
        rest = np.eye(3) - np.outer(gain, seen)
        P = rest @ M @ rest.T + 4.0 * np.outer(gain, gain)
    P, M = np.array(before), np.array(predicted)
    G = smoother_gains(P, np.tile(F, (400, 1, 1)), M)
    explained = np.diagonal(G @ M @ G.swapaxes(1, 2), axis1=1, axis2=2) / np.diagonal(P, axis1=1, axis2=2)
    assert explained.max() < 1.001


@pytest.fixture(scope="module")
def open_sea():
    """Errors of filter and smoother over 50 short clean runs, and the smoother's covariances."""
    scenario = load("open-sea")
    scenario = scenario.model_copy(update={"duration": 120.0, "manoeuvres": scenario.manoeuvres[1:]})  # turns at once
    found = []
    for seed in range(50):
        recording = simulate(scenario, seed)
        estimator = make("ekf-rts")
        trial = run_trial(estimator, recording)
        assert trial.status == "ok", trial.reason
        found.append((errors(trial, recording), smoothed_errors(trial, recording), estimator.smoothed_covariance))
    return [np.array(x) for x in zip(*found, strict=True)]


@pytest.mark.parametrize("group", GROUPS)
def test_smoothed_is_consistent_and_better(open_sea, group):
    """Over 50 runs the ANEES is in its 95 % band, over all epochs and at most of them; so is the RMSE as promised."""
    filtered, smoothed, covariance = open_sea
    index = GROUPS[group]
    low, high = nees_band(len(index), 50)
    anees = np.mean([nees(e, p, index)[0] for e, p in zip(smoothed, covariance, strict=True)], axis=0) / len(index)
    assert low < anees.mean() < high
    assert np.mean((low < anees) & (anees < high)) > 0.8
    before, after = (np.sqrt(np.mean(e[..., index] ** 2)) for e in (filtered, smoothed))
    assert after < (0.9 if group != "attitude" else 1.0) * before
    promised = np.sqrt(np.mean(np.diagonal(covariance, axis1=2, axis2=3)[..., index], axis=(0, 1)))
    actual = np.sqrt(np.mean(smoothed[..., index] ** 2, axis=(0, 1)))
    np.testing.assert_allclose(actual, promised, rtol=0.15)


def test_forward_it_is_the_ekf():
    recording = simulate(load("open-sea").model_copy(update={"duration": 60.0}), 3)
    ekf, rts = (run_trial(make(name), recording) for name in ("ekf", "ekf-rts"))
    np.testing.assert_array_equal(ekf.position, rts.position)
    np.testing.assert_array_equal(ekf.covariance, rts.covariance)


def test_ship_smoother_bridges_an_outage():
    recording = simulate(load("ship-dead-reckoning").model_copy(update={"duration": 700.0}), 2)
    trial = run_trial(make("ship-ekf-rts"), recording)
    assert trial.status == "ok", trial.reason
    away = slice(500, 560)  # no GNSS
    filtered, smoothed = (
        np.sqrt(np.mean(np.sum(e[away, :2] ** 2, axis=1)))
        for e in (errors(trial, recording), smoothed_errors(trial, recording))
    )
    assert smoothed < 0.6 * filtered


@pytest.mark.parametrize("name", ["ekf-rts", "student-t-rts", "ekf-two-filter"])
def test_a_copy_shares_what_is_past_and_goes_its_own_way(name):
    """A copy is made before each packet where readings come late: it must not take longer as the run does."""
    recording = simulate(load("auv-survey").model_copy(update={"duration": 120.0}), 2)
    packets = list(recording.steps())
    alone, copied = make(name), make(name)
    parts = {}
    for estimator in (alone, copied):
        estimator.reset(recording.start, recording.instruments)
    for k, packet in enumerate(packets):
        alone.update(packet)
        copied.update(packet)
        if k in (10, 100):
            parts[k] = {}
            other = deepcopy(copied, parts[k])
            for wrong in packets[k + 1 : k + 8]:
                other.update(replace(wrong, aids=[]))
            other.smooth()
    assert len(parts[100]) < 1.2 * len(parts[10])
    there, here = alone.smooth(), copied.smooth()
    np.testing.assert_array_equal(there.position, here.position)
    np.testing.assert_array_equal(alone.solver.smoother.smoothed_covariance, copied.solver.smoother.smoothed_covariance)
