"""The invariant filter against the textbook form on SE_2(3), and where it pays: a heading that is far off."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from simnav.estimators.rows.kalman import Ekf, InvariantEkf
from simnav.geometry import earth
from simnav.geometry.rotation import (
    dcm_from_rotation_vector,
    dcm_from_rpy,
    rotation_vector_from_dcm,
    rpy_from_dcm,
    skew,
)
from simnav.types import Datasheet, Instruments, Measurement, Measurements

DEG = np.pi / 180.0
SHEETS = (
    Datasheet("gnss", "gnss_position", 1.0, 0.5 * np.ones(3), lever_arm=np.array([20.0, 4.0, -10.0])),
    Datasheet("dvl", "dvl", 1.0, 0.02 * np.ones(3), scale=0.01, misalignment=0.01 * np.ones(3)),
)


def wedge(xi: np.ndarray) -> np.ndarray:
    """Of (phi, nu, rho): the element of the Lie algebra."""
    m = np.zeros((5, 5))
    m[:3, :3], m[:3, 3], m[:3, 4] = skew(xi[:3]), xi[3:6], xi[6:9]
    return m


def textbook(error: str, C, v, p, rest, P, H, R, residual):
    """One update in the coordinates of the invariant error: T, gain, group exponential, back (Barrau and Bonnabel).

    ``P`` and ``H`` are of the public error (position, velocity, attitude, rest); so is what returns.
    """
    n = len(P)

    def coordinates(C, v, p):
        T = np.eye(n)
        T[:9, :9] = 0.0
        if error == "left":
            T[0:3, 6:9] = T[3:6, 3:6] = T[6:9, 0:3] = C.T
        else:
            T[0:3, 6:9] = T[3:6, 3:6] = T[6:9, 0:3] = np.eye(3)
            T[3:6, 6:9], T[6:9, 6:9] = skew(v), skew(p)
        return T

    T = coordinates(C, v, p)
    G = H @ np.linalg.inv(T)
    S_xi = T @ P @ T.T
    K = S_xi @ G.T @ np.linalg.inv(G @ S_xi @ G.T + R)
    xi = K @ residual
    after = S_xi - K @ G @ S_xi
    X = np.eye(5)
    X[:3, :3], X[:3, 3], X[:3, 4] = C, v, p
    X = X @ expm(wedge(xi[:9])) if error == "left" else expm(wedge(xi[:9])) @ X
    back = np.linalg.inv(coordinates(X[:3, :3], X[:3, 3], X[:3, 4]))
    return X[:3, :3], X[:3, 3], X[:3, 4], rest + xi[9:], back @ after @ back.T


@pytest.mark.parametrize("error", ["left", "right"])
@pytest.mark.parametrize("origin", [0.0, 1e3])
def test_an_update_is_the_textbooks(recording_of, error: str, origin: float):
    """State and covariance after one measurement, with corrections of tens of degrees; the origin does not matter."""
    recording = recording_of(5, 2.0)
    sigmas = np.array([2.0, 2.0, 2.0, 0.5, 0.5, 0.5, 0.2, 0.2, 0.8])
    start = replace(recording.start, covariance=np.diag(sigmas**2))
    estimator = InvariantEkf(error=error)
    estimator.reset(start, Instruments(SHEETS, recording.instruments.imu))
    model, P = estimator.model, estimator.covariance
    root = np.random.default_rng(1).standard_normal(P.shape)
    s = np.sqrt(np.diag(P))
    P[:] = s[:, None] * (np.eye(len(P)) + 0.3 * root @ root.T / len(P)) * s
    for name, offset in (("gnss", np.array([12.0, -9.0, 1.0])), ("dvl", np.array([-2.0, 3.0, 0.5]))):
        sheet = model.instruments[name]
        m = Measurement(0.0, name, sheet.kind, np.zeros(3))
        predicted = -model.measure(m).innovation
        value = earth.displace(model.position, model.dcm @ sheet.lever_arm + offset) if name == "gnss" else (
            predicted + offset
        )  # fmt: skip
        m = m._replace(value=value)
        residual, H, R = (x.copy() for x in model.measure(m))
        place, C, v = model.position.copy(), model.dcm.copy(), model.velocity.copy()
        p = origin * np.array([1.0, -2.0, 0.5])
        rest = np.concatenate([model.bias, model.calibration])
        wanted = textbook(error, C, v, p, rest, P.copy(), H, R, residual)
        estimator.update(Measurements(0.0, 0.0, None, [m]))
        turned = rotation_vector_from_dcm(model.dcm @ C.T)
        assert np.linalg.norm(turned) > 0.05
        np.testing.assert_allclose(model.dcm, wanted[0], atol=1e-9)
        np.testing.assert_allclose(model.velocity, wanted[1], atol=1e-9)
        np.testing.assert_allclose(earth.relative_position(model.position, place), wanted[2] - p, atol=1e-4)
        np.testing.assert_allclose(np.concatenate([model.bias, model.calibration]), wanted[3], atol=1e-10)
        scale = np.sqrt(np.outer(np.diag(wanted[4]), np.diag(wanted[4])))
        np.testing.assert_allclose(P / scale, wanted[4] / scale, atol=1e-7)
        np.testing.assert_allclose(P / scale, P.T / scale, atol=1e-12)
        assert np.linalg.eigvalsh(P / scale).min() > 0.0


def test_small_errors_give_the_ekf(recording_of, run_over):
    recording = recording_of(6, 100.0)
    a, P = run_over(Ekf(), recording)
    sigma = np.sqrt(np.diagonal(P, axis1=1, axis2=2))
    for error in ("left", "right"):
        b, Q = run_over(InvariantEkf(error=error), recording)
        assert np.abs((a - b) / sigma).max() < 0.1
        late = [np.diagonal(x[20:], axis1=1, axis2=2) for x in (P, Q)]
        np.testing.assert_allclose(late[1], late[0], rtol=0.01)


@pytest.mark.parametrize(("aid", "better"), [("gnss", "left"), ("dvl", "right")])
def test_it_converges_from_a_heading_that_is_far_off(recording_of, run_over, aid: str, better: str):
    """Headings off by 60 to 130 degrees: the error whose measurement is invariant finds them; the EKF does not."""
    aids = [Datasheet("gnss", "gnss_position", 1.0, np.ones(3))]
    if aid == "dvl":
        aids.append(Datasheet("dvl", "dvl", 1.0, 0.02 * np.ones(3)))
    sigmas = np.array([1.0, 1.0, 1.0, 0.1, 0.1, 0.1, 1.0 * DEG, 1.0 * DEG, 75.0 * DEG])
    late = {"ekf": [], "left": [], "right": []}
    for seed in range(8):
        recording = recording_of(seed, 90.0, aids=tuple(aids), sigmas=sigmas)
        true = dcm_from_rpy(recording.initial_truth.attitude[0])
        off = dcm_from_rotation_vector(np.array([0.0, 0.0, (60.0 + 10.0 * seed) * (-1) ** seed * DEG]))
        recording = replace(recording, start=replace(recording.start, attitude=rpy_from_dcm(off @ true)))
        for name in late:
            errors, _ = run_over(Ekf() if name == "ekf" else InvariantEkf(error=name), recording)
            late[name].append(np.abs(errors[-20:, 8]).mean() / DEG)
    other = {"left": "right", "right": "left"}[better]
    assert max(late[better]) < 3.0
    assert np.median(late[better]) < 0.2 * np.median(late["ekf"])
    assert np.median(late[better]) < 0.5 * np.median(late[other])


def test_bad_parameter():
    with pytest.raises(ValueError, match='error is \'middle\'; it must be "left" or "right"'):
        InvariantEkf(error="middle")
