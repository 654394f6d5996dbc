"""The factors of a window over the inertial model: against integrating again, and derivatives by differences."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.models.inertial_chain import InertialChain
from simnav.recording import Recording
from simnav.rotation import left_jacobian, rotation_vector_from_dcm
from simnav.scenario import load
from simnav.source import record
from simnav.types import Array

#: Scales of an error: position, velocity, attitude, gyroscope and accelerometer bias.
SCALE = np.repeat([3.0, 0.1, 0.02, 1e-4, 1e-2], 3)


@pytest.fixture(scope="module")
def recording() -> Recording:
    """Half a minute of a rolling ship, with calibration states."""
    return record(load("harbour-multipath").model_copy(update={"duration": 30.0}), 3)


def built(recording: Recording, until: float, first: Array | None = None) -> InertialChain:
    """A chain of a node a second; the state at the start is corrected by ``first``."""
    chain = InertialChain(InertialModel())
    chain.begin(recording.start, recording.instruments)
    if first is not None:
        chain.front.correct(first)
        for name in chain.front.state:
            chain.nodes[name][0] = getattr(chain.front, name)
    for packet in recording.steps():
        if packet.time > until:
            break
        chain.load(packet.imu)
        chain.propagate(packet.time)
        chain.extend()
        for m in packet.aids:
            if m.time >= packet.time - 1e-6:
                chain.attach(m, np.eye(len(m.value)))
    return chain


def local(chain: InertialChain, k: int, other: InertialChain, j: int) -> Array:
    """Node k of a chain less node j of another."""
    a = {name: chain.nodes[name][k] for name in chain.front.state}
    b = {name: other.nodes[name][j] for name in chain.front.state}
    probe = InertialModel()
    probe.position, probe.velocity = b["position"].copy(), b["velocity"].copy()
    north = 6.37e6 * 1e-6
    # Metres per radian, by the correction itself
    probe.dcm, probe.bias, probe.calibration = b["dcm"].copy(), b["bias"].copy(), b["calibration"].copy()
    probe.correct(np.concatenate([[north, north, 0.0], np.zeros(len(a["calibration"]) + 12)]))
    metres = north / (probe.position - b["position"])[:2]
    d = np.empty(chain.size)
    d[:2] = (a["position"] - b["position"])[:2] * metres
    d[2] = -(a["position"] - b["position"])[2]
    d[3:6] = a["velocity"] - b["velocity"]
    d[6:9] = rotation_vector_from_dcm(a["dcm"] @ b["dcm"].T)
    d[9:15] = a["bias"] - b["bias"]
    d[15:] = a["calibration"] - b["calibration"]
    return d


def test_preintegrated_motion_is_integrating_again(recording: Recording):
    """A second from a node that was moved by 3 m, 0.1 m/s, 1 deg, 20 deg/h and 1 mg."""
    chain = built(recording, 1.0)
    n = chain.size
    rng = np.random.default_rng(1)
    dx = np.zeros(n)
    dx[:15] = SCALE * rng.normal(size=15)
    again = built(recording, 1.0, dx)
    step = np.zeros((2, n))
    step[0] = dx
    chain.retract(step)
    chain.linearise_motion()
    # Its residual: the node that stayed, less where the samples lead from the one that was moved.
    expected = local(chain, 1, again, 1)
    error = chain.motions["residual"][0] - expected
    assert np.max(np.abs(expected[:3])) > 1.0
    assert np.max(np.abs(error[:3])) < 1e-5
    assert np.max(np.abs(error[3:6])) < 1e-5
    assert np.max(np.abs(error[6:9])) < 1e-7
    np.testing.assert_allclose(error[9:], 0.0, atol=1e-12)
    # To first order only, the velocity would be off by more than a hundred times that.
    linear = -chain.motions["transition"][0] @ dx
    assert np.max(np.abs(linear[3:6] - expected[3:6])) > 1e-3


def test_the_motion_jacobian_is_its_derivative(recording: Recording):
    chain = built(recording, 1.0)
    n = chain.size
    rng = np.random.default_rng(2)
    step = np.zeros((2, n))
    step[:, :15] = SCALE * rng.normal(size=(2, 15))
    chain.retract(step)
    chain.linearise_motion()
    jacobian, residual = chain.motions["jacobian"][0].copy(), chain.motions["residual"][0].copy()
    states = chain.copy_states()
    for j in range(n):
        size = 1e-4 * (SCALE[j] if j < 15 else 1.0)
        derivative = []
        for sign in (1.0, -1.0):
            step = np.zeros((2, n))
            step[0, j] = sign * size
            chain.retract(step)
            chain.linearise_motion()
            derivative.append(chain.motions["residual"][0] - residual)
            chain.restore_states(states)
        numeric = -(derivative[0] - derivative[1]) / (2.0 * size)
        tolerance = 2e-2 * np.max(np.abs(jacobian[:, j]))  # the derivative of the logarithm: half the residual's angle
        np.testing.assert_allclose(jacobian[:, j], numeric, atol=tolerance, err_msg=f"column {j}")


def test_all_aids_at_once_are_what_the_model_says_of_each(recording: Recording):
    chain = built(recording, 5.0)
    chain.linearise_aids()
    assert len(chain.aids) >= 10
    front, state = chain.front, chain.front.snapshot()
    packets = {(m.instrument, round(m.time, 6)): m for p in recording.steps() for m in p.aids}
    for i in range(len(chain.aids)):
        row = {
            name: chain.aids[name][i] for name in ("node", "instrument", "time", "residual", "jacobian", "components")
        }
        front.restore([chain.nodes[name][row["node"]] for name in front.state])
        front.raw_rate[:] = chain.nodes["raw_rate"][row["node"]]
        m = packets[chain.names[row["instrument"]], round(float(row["time"]), 6)]
        one = front.measure(m)
        assert one is not None
        assert row["components"] == len(one.innovation)
        np.testing.assert_allclose(row["residual"][: len(one.innovation)], one.innovation, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(row["jacobian"][: len(one.innovation)], one.jacobian, rtol=1e-12, atol=1e-12)
    front.restore(state)


def test_a_step_back_and_forth_leaves_nothing(recording: Recording):
    chain = built(recording, 3.0)
    before = chain.copy_states()
    rng = np.random.default_rng(3)
    step = np.zeros((len(chain.nodes), chain.size))
    step[:, :15] = 0.01 * SCALE * rng.normal(size=(len(step), 15))
    chain.retract(step)
    chain.linearise_motion()
    assert np.max(np.abs(chain.motions["residual"])) > 1e-3
    chain.restore_states(before)
    chain.linearise_motion()
    np.testing.assert_allclose(chain.motions["residual"], 0.0, atol=1e-15)
    chain.retract(step)
    chain.retract(-step)
    chain.linearise_motion()
    np.testing.assert_allclose(chain.motions["residual"], 0.0, atol=1e-8)


@pytest.mark.parametrize("size", [0.0, 1e-9, 1e-3, 0.03, 0.04, 0.5, 2.0])
def test_a_covariance_about_another_attitude_is_turned_by_the_left_jacobian(size: float):
    """On both sides of where the series ends (0.032 rad)."""
    rng = np.random.default_rng(5)
    root, axis = rng.normal(size=(15, 15)), np.array([0.48, -0.6, 0.64])
    P, shift = root @ root.T, rng.normal(size=15)
    shift[6:9] = size * axis
    J = np.eye(15)
    J[6:9, 6:9] = left_jacobian(shift[6:9])
    np.testing.assert_allclose(InertialChain(InertialModel()).turned(P, shift), J @ P @ J.T, rtol=1e-9, atol=1e-9)
