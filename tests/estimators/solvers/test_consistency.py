"""Consistency of the filters with an IMU over 50 seeds on matched clean scenarios: ANEES within its 95 % band.

The realised biases of the IMU, which no recording holds, are read off the simulated IMU: the same seed and datasheet
without white noise, fed with zeros, delivers its turn-on bias and random walk, for each process has a stream of its
own.

The federated filter is exact where it resets and no instrument has states of its own, and is among the others there.
Elsewhere its covariance is an upper bound (`simnav.estimators.solvers.federated`). How far it is above is found by
taking the covariance of all local filters' errors together, which the filter does not know, through every step that it
does; by that covariance its errors are in the band, and by its own never above.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from simnav.estimator import make
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.solvers.federated import FederatedEstimator
from simnav.geometry import earth, rotation
from simnav.recording import Recording
from simnav.scenario import Scenario, load
from simnav.scoring import nees_band
from simnav.source import record
from tests.cases.realised import imu_biases

SEEDS = 50
DURATION = 100.0
FILTERS = {
    "ekf": ("ekf", {}),
    "iekf": ("iekf", {}),
    "inekf": ("inekf", {}),
    "inekf, right": ("inekf", {"error": "right"}),
    "ekf-23": ("ekf-23", {"lever_arm": 0.0, "delay": 0.0}),
    "ukf": ("ukf", {}),
    "ckf": ("ckf", {}),
}
LINEAR = {"kf": ("kf", {}), "kf-23": ("kf-23", {"lever_arm": 0.0, "delay": 0.0}), "inertial": ("inertial", {})}
GROUPS = {"position": slice(0, 3), "velocity": slice(3, 6), "attitude": slice(6, 9), "biases": slice(9, 15)}


def open_sea() -> Scenario:
    """As it is: made for this, but the turn comes at once."""
    s = load("open-sea")
    return s.model_copy(update={"duration": DURATION, "manoeuvres": s.manoeuvres[1:]})


def uuv() -> Scenario:
    """The UUV of Zhan et al. (2026) without faults; its DVL draws a scale factor and a misalignment."""
    s = load("uuv-surface")
    dvl = s.instruments["dvl"].model_copy(update={"speed_noise": 0.0, "bias": (0.0, 0.0, 0.0)})
    changes = {"faults": (), "duration": DURATION, "instruments": {**s.instruments, "dvl": dvl}}
    return s.model_copy(update={**changes, "manoeuvres": s.manoeuvres[1:]})


def aligned() -> Scenario:
    """The open sea within the range of a linear filter: aligned to 0.05 degrees, accelerometers of 20 ug."""
    s = open_sea()
    imu, start = s.instruments["imu"], s.initial_error
    better = imu.accelerometer.model_copy(update={"bias": 0.1 * imu.accelerometer.bias})
    return s.model_copy(
        update={
            "initial_error": start.model_copy(update={"attitude": tuple(0.1 * x for x in start.attitude)}),
            "instruments": {**s.instruments, "imu": imu.model_copy(update={"accelerometer": better})},
        }
    )


SCENARIOS = {f.__name__: f for f in (open_sea, uuv, aligned)}
Run = tuple[Recording, np.ndarray]
Errors = tuple[np.ndarray, np.ndarray]


@pytest.fixture(scope="module")
def runs() -> Callable[[str], list[Run]]:
    """Recordings of a scenario with the biases of the IMU, one a seed; made once for all filters."""
    made: dict[str, list[Run]] = {}

    def get(name: str) -> list[Run]:
        if name not in made:
            scenario = SCENARIOS[name]()
            recordings = [record(scenario, seed) for seed in range(SEEDS)]
            made[name] = [(r, imu_biases(scenario, r.seed, r.data.truth.time)) for r in recordings]
        return made[name]

    return get


def errors(estimator, recording: Recording, true_bias: np.ndarray) -> Errors:
    """Errors (T, 15) of position, velocity, attitude and biases, and their covariances (T, 15, 15)."""
    estimator.reset(recording.start, recording.instruments)
    position, velocity, attitude, bias, covariance = [], [], [], [], []
    for packet in recording.steps():
        estimate = estimator.update(packet)
        position.append(estimate.position)
        velocity.append(estimate.velocity)
        attitude.append(estimate.attitude)
        bias.append(estimator.model.bias + (estimator.x[9:15] if hasattr(estimator, "x") else 0.0))
        covariance.append(estimator.covariance[:15, :15].copy())
    truth = recording.data.truth
    turn = rotation.dcm_from_rpy(np.array(attitude)) @ np.swapaxes(rotation.dcm_from_rpy(truth.attitude), 1, 2)
    e = np.hstack([
        earth.relative_position(np.array(position), truth.position),
        np.array(velocity) - truth.velocity,
        rotation.rotation_vector_from_dcm(turn),
        np.array(bias) - true_bias,
    ])  # fmt: skip
    return e, np.array(covariance)


@pytest.fixture(scope="module")
def errors_of(runs) -> Callable[..., Errors]:
    """Errors (seeds, T, 15) and covariances of a filter over a scenario."""
    made: dict[str, Errors] = {}

    def get(scenario: str, row: str, **parameters) -> Errors:
        key = f"{scenario} {row} {parameters}"
        if key not in made:
            each = [errors(make(row, **parameters), *run) for run in runs(scenario)]
            made[key] = np.array([e for e, _ in each]), np.array([P for _, P in each])
        return made[key]

    return get


@pytest.mark.parametrize("group", GROUPS)
@pytest.mark.parametrize("name", FILTERS)
@pytest.mark.parametrize("scenario", ["open_sea", "uuv"])
def test_filters_with_feedback(errors_of, assert_consistent, scenario: str, name: str, group: str):
    row, parameters = FILTERS[name]
    e, P = errors_of(scenario, row, **parameters)
    at = GROUPS[group]
    assert_consistent(e[..., at], P[..., at, at])


@pytest.mark.parametrize("group", GROUPS)
@pytest.mark.parametrize("name", LINEAR)
def test_linear_filters_within_their_range(errors_of, assert_consistent, name: str, group: str):
    row, parameters = LINEAR[name]
    e, P = errors_of("aligned", row, **parameters)
    at = GROUPS[group]
    assert_consistent(e[..., at], P[..., at, at])


def test_the_linear_filter_out_of_its_range(errors_of):
    """Milli-g accelerometers: after 100 s free inertial navigation is off by 1 m/s, and velocity is not consistent."""
    e, P = errors_of("uuv", "kf")
    e, P = e[:, -20:, 3:6], P[:, -20:, 3:6, 3:6]
    assert np.mean(e * np.linalg.solve(P, e[..., None])[..., 0]) > 5.0


@pytest.mark.parametrize("group", GROUPS)
def test_federated_where_it_is_exact(errors_of, assert_consistent, group: str):
    e, P = errors_of("open_sea", "federated")
    at = GROUPS[group]
    assert_consistent(e[..., at], P[..., at, at])


def analysed(reset_locals: bool) -> FederatedEstimator:
    """The filter with ``actual``, the covariance of the errors of all local filters together, and ``left`` of it.

    All start from one error and have the same motion and noise, 11' (x) P_0 and 11' (x) Q; everything that the filter
    does to their estimates is linear.
    """

    class Analysed(FederatedEstimator):
        def reset(self, start, instruments):
            super().reset(start, instruments)
            n = self.model.size
            self.at = {name: slice(i * n, (i + 1) * n) for i, name in enumerate(self._locals)}
            self.all = np.ones((len(self.at), len(self.at)))
            self.actual = np.kron(self.all, self.covariance)

        def _step(self, until):
            elapsed, before = until - self.model.time, self.covariance.copy()
            super()._step(until)
            if elapsed > 0.0:
                F = np.eye(self.model.size)
                self.model.carry(F, elapsed)
                Q = self.covariance - F @ before @ F.T
                F = np.kron(np.eye(len(self.at)), F)
                self.actual = F @ self.actual @ F.T + np.kron(self.all, Q)

        def correct(self, dynamics, choice, readings, k, prediction):
            m = self._measurements[k]
            at, P = self.at[m.instrument], self._locals[m.instrument].covariance.copy()
            _, H, R = self.model.measure(m)
            gain = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
            A = np.eye(len(self.actual))
            A[at, at] -= gain @ H
            self.actual = A @ self.actual @ A.T
            self.actual[at, at] += gain @ R @ gain.T
            return super().correct(dynamics, choice, readings, k, prediction)

        def _fuse(self):
            before = {name: local.covariance.copy() for name, local in self._locals.items()}
            information = {name: np.linalg.inv(P[:15, :15]) for name, P in before.items()}
            fused = np.linalg.inv(sum(information.values()))
            W, A = np.zeros((15, len(self.actual))), np.eye(len(self.actual))
            for name, at in self.at.items():
                W[:, at.start : at.start + 15] = fused @ information[name]
            super()._fuse()
            self.left = W @ self.actual @ W.T
            if self.reset_locals:
                for name, at in self.at.items():
                    own, common = self._locals[name].own, slice(at.start, at.start + 15)
                    moved = W - A[common]
                    A[own + at.start] += before[name][own, :15] @ information[name] @ moved
                    A[common] = W
                self.actual = A @ self.actual @ A.T

    return Analysed(InertialModel(), reset_locals=reset_locals)


BOUNDS = [("open_sea", "federated-no-reset"), ("uuv", "federated"), ("uuv", "federated-no-reset")]


@pytest.fixture(scope="module", params=BOUNDS, ids=" ".join)
def federated(request, runs, errors_of) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Errors of all seeds, the filter's covariances, and those by analysis of the first run: the track is the same."""
    scenario, row = request.param
    estimator, (recording, _) = analysed(row == "federated"), runs(scenario)[0]
    estimator.reset(recording.start, recording.instruments)
    left = []
    for packet in recording.steps():
        estimator.update(packet)
        left.append(estimator.left)
    return *errors_of(scenario, row), np.array(left)


@pytest.mark.parametrize("group", GROUPS)
def test_federated_is_as_far_off_as_its_architecture_makes_it(federated, assert_consistent, group: str):
    """By the covariance from analysis it is in the band; by its own not above, and below it where that says so."""
    e, P, left = federated
    at = GROUPS[group]
    e, P, left = e[..., at], P[..., at, at], left[:, at, at]
    assert_consistent(e, np.broadcast_to(left, P.shape))
    assert np.mean(e * np.linalg.solve(P, e[..., None])[..., 0]) < nees_band(at.stop - at.start, SEEDS)[1]


def test_the_covariance_of_the_federated_filter_is_an_upper_bound(federated):
    """At every epoch: almost exact after the first, and more than a tenth of some variance for nothing in the end."""
    _, P, left = federated
    scale = 1.0 / np.sqrt(np.diagonal(P[0], axis1=1, axis2=2))
    spare = (P[0] - left) * scale[:, :, None] * scale[:, None, :]
    assert np.linalg.eigvalsh(spare).min() > -1e-6
    assert np.abs(spare[0]).max() < 0.1
    assert np.diagonal(spare[-1]).max() > 0.1
