"""The iterated filter against the maximum a posteriori estimate, found by another optimiser."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import least_squares

from simnav.estimator import make
from simnav.estimators.rows.kalman import Ekf, IteratedEkf
from simnav.geometry.rotation import left_jacobian, rotation_vector_from_dcm, skew
from simnav.types import Datasheet, Instruments, Measurement, Measurements
from tests.estimators.test_inertial_model import difference

ARM = np.array([30.0, 4.0, -10.0])
GNSS = Datasheet("gnss", "gnss_position", 1.0, 0.5 * np.ones(3), lever_arm=ARM)
DVL = Datasheet("dvl", "dvl", 1.0, 0.02 * np.ones(3))


@pytest.mark.parametrize("size", [0.0, 1e-5, 1e-3, 0.3, 2.5])
def test_left_jacobian_by_finite_differences(size: float):
    phi = size * np.array([0.6, -0.64, 0.48])
    numeric = np.empty((3, 3))
    for k in range(3):
        d = 1e-6 * np.eye(3)[k]
        turn = expm(skew(phi + d)) @ expm(skew(phi - d)).T
        numeric[:, k] = rotation_vector_from_dcm(turn) / 2e-6
    np.testing.assert_allclose(left_jacobian(phi), numeric, atol=1e-8)


def taken(estimator, recording, sheet: Datasheet, value: np.ndarray, sigmas: np.ndarray):
    """The estimator after one measurement at its start."""
    start = replace(recording.start, covariance=np.diag(sigmas**2))
    estimator.reset(start, Instruments((sheet,), recording.instruments.imu))
    measurement = Measurement(0.0, sheet.name, sheet.kind, value)
    estimate = estimator.update(Measurements(-1e-3, 0.0, None, [measurement]))
    return estimate, estimator


CASES = {
    # Half a metre and a lever arm of thirty: it tells the heading, which is off by 40 degrees.
    "lever arm": (GNSS, np.array([0.3, 0.3, 0.3, 0.1, 0.1, 0.1, 0.1, 0.1, 0.7])),
    "dvl": (DVL, np.array([1.0, 1.0, 1.0, 0.05, 0.05, 0.05, 0.1, 0.1, 0.8])),
}


@pytest.mark.parametrize("case", CASES)
def test_it_finds_the_maximum_a_posteriori(recording_of, case: str):
    recording = recording_of(5, 2.0)
    sheet, sigmas = CASES[case]
    reference = Ekf()
    reference.reset(recording.start, Instruments((sheet,), recording.instruments.imu))
    model = reference.model
    truth = np.concatenate([[0.2, -0.3, 0.1, 0.03, -0.02, 0.05, 0.05, -0.08, 0.7], np.zeros(model.size - 9)])
    saved = model.snapshot()

    def innovation(dx: np.ndarray, value: np.ndarray) -> np.ndarray:
        model.restore(saved)
        model.correct(dx)
        return model.measure(Measurement(0.0, sheet.name, sheet.kind, value)).innovation

    zero = np.zeros(3)
    value = np.array([0.9, 0.1, 0.0]) if sheet is GNSS else zero
    for _ in range(3):  # Newton on the value that the truth would give
        e = innovation(truth, value)
        if sheet is GNSS:
            from simnav.geometry.earth import displace

            value = displace(value, -e)
        else:
            value = value - e
    full = np.sqrt(np.diag(reference.covariance)).copy()
    full[:9] = sigmas

    def whitened(y: np.ndarray) -> np.ndarray:
        """Of the prior and of the measurement; the sum of squares is minus twice the log of the posterior."""
        return np.concatenate([y, innovation(full * y, value) / sheet.sigma])

    noise = reference.model.noise[sheet.name]
    assert np.allclose(noise, np.diag(sheet.sigma**2))
    best = least_squares(whitened, np.zeros(model.size), jac="3-point", diff_step=1e-4, xtol=1e-14, ftol=1e-14)

    costs = {}
    for name, estimator in {
        "ekf": Ekf(), "iekf": IteratedEkf(limit=50, threshold=1e-8), "one": IteratedEkf(limit=1),
    }.items():  # fmt: skip
        estimate, used = taken(estimator, recording, sheet, value, sigmas)
        model.restore(saved)
        correction = difference(used.model, model)
        costs[name] = float(np.sum(whitened(correction / full) ** 2))
        if name == "iekf":
            np.testing.assert_allclose(correction / full, best.x, atol=2e-5)
            assert 2 < estimate.diagnostics["iterations"] < 50
    assert costs["iekf"] == pytest.approx(2.0 * best.cost, rel=1e-6)
    assert costs["one"] == pytest.approx(costs["ekf"], rel=1e-9)
    assert costs["iekf"] < 0.5 * costs["ekf"]


def test_small_errors_take_two_linearisations_and_give_the_ekf(recording_of, run_over):
    recording = recording_of(6, 100.0)
    a, P = run_over(Ekf(), recording)
    b, Q = run_over(IteratedEkf(), recording)
    sigma = np.sqrt(np.diagonal(P, axis1=1, axis2=2))
    assert np.abs((a - b) / sigma).max() < 0.1
    late = [np.diagonal(x[20:], axis1=1, axis2=2) for x in (P, Q)]
    np.testing.assert_allclose(late[1], late[0], rtol=0.01)
    estimator = IteratedEkf()
    estimator.reset(recording.start, recording.instruments)
    counts = [estimator.update(p).diagnostics["iterations"] for p in recording.steps()]
    assert set(counts[50:]) <= {1.0, 2.0}


@pytest.mark.parametrize(
    ("parameters", "sentence"), [({"limit": 0}, "limit is 0"), ({"threshold": 0.0}, "threshold is")]
)
def test_bad_parameters(parameters: dict, sentence: str):
    with pytest.raises(ValueError, match=sentence):
        IteratedEkf(**parameters)


def test_a_filter_may_iterate_until_the_heading_is_known(recording_of):
    """Above the limit it is ``iekf``, below it ``ekf``."""
    recording = recording_of(5, 60.0, aids=(GNSS, DVL))  # without a compass, the heading takes a while
    poor = np.diag(recording.start.covariance).copy()
    poor[8] = np.radians(30.0) ** 2
    start = replace(recording.start, covariance=np.diag(poor))
    both = {"iekf": IteratedEkf(), "ekf": Ekf(), "switch": Ekf(iterate_above_deg=1.5)}
    for estimator in both.values():
        estimator.reset(start, recording.instruments)
    sigmas, iterated = [], []
    for packet in recording.steps():
        out = {name: estimator.update(packet) for name, estimator in both.items()}
        if len(sigmas) == 0:
            np.testing.assert_array_equal(out["switch"].position, out["iekf"].position)
            assert np.any(out["switch"].position != out["ekf"].position)
        sigmas.append(np.degrees(np.sqrt(out["switch"].covariance[8, 8])))
        iterated.append("iterations" in out["switch"].diagnostics)
    assert iterated[0]
    assert sigmas[-1] < 1.5
    assert not iterated[-1]


@pytest.mark.parametrize("name", ["ekf", "ekf-23", "ekf-9", "iae", "huber-kf", "vb-akf", "mckf"])
def test_rows_over_the_inertial_model_take_it(name: str, recording_of):
    recording = recording_of(5, 3.0)
    estimator = make(name, iterate_above_deg="0")
    estimator.reset(recording.start, recording.instruments)
    assert estimator.update(next(iter(recording.steps()))).diagnostics["iterations"] >= 1.0


def test_a_model_without_an_attitude_does_not_iterate_by_its_heading(recording_of):
    recording = recording_of(5, 3.0, imu=None)
    estimator = make("huber-kf", iterate_above_deg=0.001)
    estimator.reset(recording.start, recording.instruments)
    assert "iterations" not in estimator.update(next(iter(recording.steps()))).diagnostics


def test_a_limit_that_makes_no_sense():
    with pytest.raises(ValueError, match="0 deg or more, not -1"):
        Ekf(iterate_above_deg=-1.0)
