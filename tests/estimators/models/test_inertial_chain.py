"""The factors of a window over the inertial model: against integrating again, and derivatives by differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from simnav.estimators.models.difference_prior import differences_at_mean
from simnav.estimators.models.dvl_calibration import DvlCalibrationModel
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.models.inertial_chain import InertialChain
from simnav.estimators.models.nine_state import NineStateModel
from simnav.estimators.models.propagation import correct_inertial
from simnav.estimators.solvers.window import WindowEstimator
from simnav.geometry.rotation import dcm_from_rotation_vector, dcm_from_rpy, left_jacobian, rotation_vector_from_dcm
from simnav.recording import Recording
from simnav.scenario import load
from simnav.source import record
from simnav.types import Array
from tests.cases import ROV
from tests.cases.derivatives import along

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
                chain.attach([m], np.eye(len(m.value))[None])
    return chain


def local(chain: InertialChain, k: int, other: InertialChain, j: int) -> Array:
    """Node k of a chain less node j of another."""
    a = {name: chain.nodes[name][k] for name in chain.front.state}
    b = {name: other.nodes[name][j] for name in chain.front.state}
    north = 6.37e6 * 1e-6
    # Metres per radian, by the correction itself
    moved = {name: value.copy() for name, value in b.items()}
    correct_inertial(*moved.values(), np.concatenate([[north, north, 0.0], np.zeros(len(a["calibration"]) + 12)]))
    metres = north / (moved["position"] - b["position"])[:2]
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


#: Shifts that a poor start brings about: 100 m, 10 m/s, 0.5 rad, 1 deg/s, 0.1 g.
LARGE = np.repeat([100.0, 10.0, 0.5, np.radians(1.0), 0.981], 3)
#: Of the blocks of a Jacobian, what counts as small: an error of that in the row's unit for one of `LARGE` in the
#: column's is far below what any motion factor knows (1e-3 m, 1e-4 m/s, 1e-6 rad).
NEGLIGIBLE = np.repeat([1e-3, 1e-4, 1e-6, 1e-12, 1e-9], 3)


def shifted(model: InertialModel, recording: Recording, until: float, seed: int) -> InertialChain:
    """Two nodes, the first far from where it was predicted, the second where the motion leads from there."""
    chain = InertialChain(model)
    chain.begin(recording.start, recording.instruments)
    packet = next(iter(recording.steps()))
    chain.load(packet.imu)
    chain.propagate(until)
    chain.extend()
    step = np.zeros((2, chain.size))
    m = min(chain.size, 15)
    step[0, :m] = LARGE[:m] * np.random.default_rng(seed).uniform(-1.0, 1.0, m)
    chain.retract(step)
    for _ in range(2):
        chain.linearise_motion()
        step[:] = 0.0
        step[1] = -chain.motions["residual"][0]
        chain.retract(step)
    chain.linearise_motion()
    np.testing.assert_allclose(chain.motions["residual"][0], 0.0, atol=1e-9)
    return chain


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("until", [0.2, 1.0])
@pytest.mark.parametrize(
    "model", [InertialModel, lambda: InertialModel(calibrate=False), NineStateModel, DvlCalibrationModel]
)
def test_the_motion_jacobian_is_its_derivative(model, recording: Recording, until: float, seed: int):
    """Block by block, far from where the motion was predicted: also where a bias has moved with the attitude."""
    chain = shifted(model(), recording, until, seed)
    n, m = chain.size, min(chain.size, 15)
    jacobian = chain.motions["jacobian"][0].copy()

    def residual() -> np.ndarray:
        chain.linearise_motion()
        return chain.motions["residual"][0]

    numeric = np.empty((n, n))
    for j in range(n):
        step = np.zeros((2, n))
        step[0, j] = 1e-5 * (LARGE[j] if j < 15 else 1.0)
        numeric[:, j] = -along(chain, step, residual) / step[0, j]
    for row in range(0, m, 3):
        for column in range(0, m, 3):
            ours, theirs = (J[row : row + 3, column : column + 3] for J in (jacobian, numeric))
            tolerance = max(1e-4 * np.max(np.abs(theirs)), NEGLIGIBLE[row] / LARGE[column])
            np.testing.assert_allclose(ours, theirs, atol=tolerance, err_msg=f"block {row}, {column}")
    np.testing.assert_allclose(jacobian[m:], numeric[m:], atol=1e-9)
    np.testing.assert_allclose(jacobian[:m, m:], 0.0, atol=0.0)


def test_the_derivative_by_the_heading_holds_the_shift_of_the_bias(recording: Recording):
    """With an accelerometer bias of 0.1 g that was found since, turning the node turns 0.1 g of specific force."""
    chain = InertialChain(InertialModel())
    chain.begin(recording.start, recording.instruments)
    chain.load(next(iter(recording.steps())).imu)
    chain.propagate(1.0)
    chain.extend()
    step = np.zeros((2, chain.size))
    step[0, 12] = 0.981
    chain.retract(step)
    chain.linearise_motion()
    added = (chain.motions["jacobian"][0] - chain.motions["transition"][0])[3:6, 8]
    bias = chain.motions["transition"][0][3:6, 12] * 0.981
    np.testing.assert_allclose(added, [-bias[1], bias[0], 0.0], atol=1e-9)
    assert np.hypot(*added[:2]) > 0.5


@pytest.mark.parametrize("sizes", [(1e-3, 1e-3), (9.8e-3, 9.8e-3), (0.01, 0.02), (0.5, 1.0), (3.0, 3.0), (3.0, 0.0)])
def test_rotations_compose_exactly(sizes: tuple[float, float]):
    """On both sides of where the series ends; through a shift taken off another."""
    rng = np.random.default_rng(3)
    chain = InertialChain(InertialModel())
    for _ in range(20):
        a, b = (size * v / np.linalg.norm(v) for size, v in zip(sizes, rng.normal(size=(2, 3))))
        shift, step = np.zeros(15), np.zeros(15)
        shift[6:9], step[6:9] = a, -b
        expected = dcm_from_rotation_vector(a) @ dcm_from_rotation_vector(b)
        found = dcm_from_rotation_vector(chain.relative_shift(shift, step)[6:9])
        np.testing.assert_allclose(found, expected, atol=5e-9)


def test_a_step_along_the_motion_leaves_the_linear_motion_errors(recording: Recording):
    """However large the rotation, where a straight step leaves the motion by centimetres a second."""
    chain = built(recording, 4.0)
    rng = np.random.default_rng(4)
    count, n = len(chain.nodes), chain.size
    chain.linearise_motion()
    m = chain.motions
    # A large step that obeys the linear motion up to small errors
    step, errors = np.zeros((count, n)), np.zeros((count - 1, n))
    step[0, :15] = SCALE * rng.normal(size=15)
    step[0, 8] = 0.7
    errors[:, :15] = 1e-3 * SCALE * rng.normal(size=(count - 1, 15))
    for k in range(count - 1):
        step[k + 1] = m["jacobian"][k] @ step[k] - m["residual"][k] + errors[k]
    along = chain.along_motion(step)
    np.testing.assert_array_equal(along[0], step[0])
    states = chain.copy_states()
    chain.retract(step)
    chain.linearise_motion()
    straight = m["residual"].copy()
    chain.restore_states(states)
    chain.retract(along)
    chain.linearise_motion()
    np.testing.assert_allclose(m["residual"], errors, atol=1e-7)
    assert np.max(np.abs(straight - errors)[:, 3:6]) > 0.03  # hundreds of sigmas of the motion


def folded(recording: Recording, spread: bool) -> InertialChain:
    """Measurements after the start: each at a node of its own, or all folded onto the first node."""
    chain = InertialChain(InertialModel())
    chain.begin(recording.start, recording.instruments)
    for packet in recording.steps():
        chain.load(packet.imu)
        for measurement in packet.aids:
            chain.propagate(measurement.time)
            if spread and chain.ahead > 0.0:
                chain.extend()
            chain.attach([measurement], 0.01 * np.eye(len(measurement.value))[None])
        break
    return chain


def test_a_folded_measurement_is_seen_through_the_motion(recording: Recording):
    """Its residual is that at a node of its own that has no motion error; its Jacobian the derivative of that."""
    at_nodes, onto_first = folded(recording, True), folded(recording, False)
    n = onto_first.size
    assert len(onto_first.nodes) == 1
    assert len(onto_first.between) == len(set(onto_first.aids["time"])) >= 2
    shift = np.zeros(n)
    shift[:15] = LARGE * np.random.default_rng(5).uniform(-0.5, 0.5, 15)
    onto_first.retract(shift[None].copy())
    step = np.zeros((len(at_nodes.nodes), n))
    step[0] = shift
    at_nodes.linearise_motion()
    for k in range(1, len(step)):
        step[k] = at_nodes.motions["jacobian"][k - 1] @ step[k - 1]
    at_nodes.retract(at_nodes.along_motion(step))
    at_nodes.linearise_motion()
    np.testing.assert_allclose(at_nodes.motions["residual"], 0.0, atol=1e-7)
    at_nodes.linearise_aids()
    onto_first.linearise_aids()
    np.testing.assert_allclose(onto_first.aids["residual"], at_nodes.aids["residual"], atol=2e-3)
    jacobian = onto_first.aids["jacobian"].copy()

    def residual() -> np.ndarray:
        onto_first.linearise_aids()
        return onto_first.aids["residual"]

    for j in range(15):
        one = np.zeros((1, n))
        one[0, j] = 1e-5 * LARGE[j]
        numeric = -along(onto_first, one, residual) / one[0, j]
        scale = np.abs(numeric).max(axis=1, keepdims=True)
        assert np.all(np.abs(jacobian[:, :, j] - numeric) < 0.04 * scale + 1e-3 / LARGE[j]), f"column {j}"


def test_folded_noise_is_the_measurements_and_the_motions(recording: Recording):
    chain = folded(recording, False)
    front = chain.front
    for packet in recording.steps():
        last = packet.aids[-1]
        break
    linearised = front.measure(last)
    assert linearised is not None
    H, d = linearised.jacobian, len(last.value)
    expected = 0.01 * np.eye(d) + H @ chain.between["noise"][-1] @ H.T
    for _ in range(2):  # it is added once
        chain.linearise_aids()
        np.testing.assert_allclose(chain.aids["noise"][-1][:d, :d], expected, rtol=1e-9)
        whitener = chain.aids["whitener"][-1][:d, :d]
        np.testing.assert_allclose(whitener @ expected @ whitener.T, np.eye(d), atol=1e-9)
    assert np.trace(expected) > 0.01 * d


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
    turned, mean = np.empty_like(P), np.empty(15)
    differences_at_mean(P, shift, turned, mean)
    np.testing.assert_allclose(turned, J @ P @ J.T, rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal(mean, shift)


@pytest.mark.parametrize("spacing", [0.0, 0.3, 1.0])
def test_a_step_in_compiled_code_is_that_by_methods(spacing: float):
    """Nodes, motions, factors and states to the last bit: a DVL at 23 Hz, a depth sensor and fixes (``rov.toml``)."""
    rov = record(load(ROV).model_copy(update={"duration": 6.0}), 2)
    compiled, methods = (WindowEstimator(InertialModel(), spacing=spacing) for _ in range(2))
    for estimator in (compiled, methods):
        estimator.reset(rov.start, rov.instruments)
    assert compiled._step is not None
    methods._step = None
    for packet in rov.steps():
        a, b = compiled.update(packet), methods.update(packet)
        np.testing.assert_equal(a.diagnostics, b.diagnostics)
        for name in ("nodes", "motions", "aids", "between"):
            ours, theirs = getattr(compiled.chain, name), getattr(methods.chain, name)
            assert len(ours) == len(theirs) > 0 or (name == "between" and spacing == 0.0)
            for column in ours.names:
                np.testing.assert_array_equal(ours[column], theirs[column], err_msg=f"{name}, {column}")
        assert compiled.chain.ahead == methods.chain.ahead
        for name in compiled.chain.front.state:
            np.testing.assert_array_equal(getattr(compiled.chain.front, name), getattr(methods.chain.front, name))


@pytest.mark.parametrize("compiled", [True, False])
def test_a_heading_near_the_vertical_is_not_used(recording: Recording, compiled: bool):
    """It counts as one that cannot be used, and leaves no node."""
    estimator = WindowEstimator(InertialModel())
    estimator.reset(recording.start, recording.instruments)
    estimator._step = estimator._step if compiled else None
    chain, packet = estimator.chain, next(iter(recording.steps()))
    chain.front.dcm[:] = dcm_from_rpy([0.0, np.pi / 2.0, 0.3])
    heading = next(m for m in packet.aids if m.kind == "gyrocompass")
    estimate = estimator.update(replace(packet, aids=[heading]))
    assert estimate.diagnostics["skipped"] == 1.0
    assert len(chain.nodes) == 1
    assert len(chain.aids) == 0
    assert chain.ahead > 0.0


def test_a_motion_or_a_reading_of_its_own_is_taken_by_methods(recording: Recording):
    for model, compiled in ((NineStateModel(), False), (DvlCalibrationModel(), False), (InertialModel(), True)):
        estimator = WindowEstimator(model)
        estimator.reset(recording.start, recording.instruments)
        assert (estimator._step is not None) == compiled
