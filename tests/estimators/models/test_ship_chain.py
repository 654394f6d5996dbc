"""The chain of the ship model: derivatives by finite differences; window against filter, smoother and full graph."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from simnav.estimators.models.ship import ShipModel
from simnav.estimators.models.ship_chain import ShipChain
from simnav.estimators.rows.kalman import ShipEkf
from simnav.estimators.rows.smoothers import ShipEkfRts
from simnav.estimators.rows.windows import ShipFgo, ShipFgoFull
from simnav.geometry import earth
from simnav.recording import Recording
from simnav.scenario import load
from simnav.source import record
from simnav.types import Datasheet, InitialState, Instruments, Measurement
from tests.cases.derivatives import along

#: Position, velocity and heading: what a ship's filter estimates.
PARTS = [0, 1, 3, 4, 8]

SHEETS = (
    Datasheet("gnss", "gnss_position", 1.0, np.full(3, 3.0), bias=np.ones(3), lever_arm=np.array([20.0, 3.0, -15.0])),
    Datasheet("velocity", "gnss_velocity", 1.0, np.full(3, 0.1), lever_arm=np.array([20.0, 3.0, 0.0])),
    Datasheet("depth", "depth", 1.0, np.ones(1)),
    Datasheet("dvl", "dvl", 1.0, np.full(3, 0.1), lever_arm=np.array([20.0, 3.0, 0.0])),
    Datasheet("compass", "gyrocompass", 1.0, np.full(1, 0.01), bias_instability=np.full(1, 0.01),
              correlation_time=600.0),
    Datasheet("log", "speed_log", 1.0, np.full(1, 0.1), bias=np.full(1, 0.1), scale=0.02,
              lever_arm=np.array([0.0, 2.0, 0.0])),
    Datasheet("terrain", "terrain_fix", 1.0, np.full(2, 3.0)),
)  # fmt: skip


@pytest.fixture
def chain() -> ShipChain:
    """Nodes at 0, 0.7 and 3.2 s on a turn at the date line, with a measurement of each instrument on the last two."""
    start = InitialState(
        0.0, np.array([0.9, np.pi - 1e-7, 30.0]), np.array([3.0, 6.0, 0.0]), np.array([0.0, 0.0, 1.1]), 0.01 * np.eye(9)
    )
    chain = ShipChain(ShipModel())
    chain.begin(start, Instruments(SHEETS))
    front = chain.front
    front.x[4] = 0.02  # turning
    front.x[7:] = 0.01
    chain.nodes["x"][0] = front.x
    for time in (0.7, 3.2):
        chain.propagate(time)
        chain.extend()
        for sheet in SHEETS:
            if chain.observes(sheet):
                value = np.full(len(sheet.sigma), 0.5)
                if sheet.kind in ("gnss_position", "terrain_fix"):
                    value = np.array([0.9, -np.pi, 0.0])[: len(sheet.sigma)]
                measurement = Measurement(time, sheet.name, sheet.kind, value)
                chain.attach([measurement], front.measure(measurement).noise[None])
    return chain


def residuals(chain: ShipChain) -> tuple[np.ndarray, np.ndarray]:
    chain.linearise_motion()
    chain.linearise_aids()
    return chain.motions["residual"].copy(), chain.aids["residual"].copy()


def test_no_residual_where_the_front_went(chain: ShipChain):
    """The motion factor is the model's own step: nothing is left over on the way that the model went itself."""
    motion, _ = residuals(chain)
    np.testing.assert_allclose(motion, 0.0, atol=1e-8)  # m; a unit in the last place of a longitude
    np.testing.assert_allclose(chain.motions["jacobian"], chain.motions["transition"], rtol=1e-12, atol=1e-12)


def test_derivatives_by_central_differences(chain: ShipChain):
    """Away from where the front went, for a step of each component of each node."""
    rng = np.random.default_rng(0)
    n = chain.size
    chain.retract(rng.standard_normal((3, n)) * np.where(np.arange(n) < 2, 30.0, 0.02))
    residuals(chain)
    transitions, aids = chain.motions["jacobian"].copy(), chain.aids["jacobian"].copy()
    assert chain.base == 0
    for node in range(3):
        for k in range(n):
            h = 1.0 if k < 2 else 1e-5
            step = np.zeros((3, n))
            step[node, k] = h
            motion_slope, aid_slope = (along(chain, step, lambda i=i: residuals(chain)[i]) / h for i in range(2))
            for factor in range(2):
                expected = np.zeros(n)
                if node == factor:
                    expected = -transitions[factor, :, k]
                elif node == factor + 1:
                    expected[k] = 1.0
                np.testing.assert_allclose(motion_slope[factor], expected, atol=3e-4)
            for i, at in enumerate(chain.aids["node"]):
                expected = -aids[i, :, k] if at == node else np.zeros(3)
                np.testing.assert_allclose(aid_slope[i], expected, atol=3e-4)


def test_a_step_along_the_motion_leaves_the_linear_motion_errors(chain: ShipChain):
    rng = np.random.default_rng(6)
    n = chain.size
    residuals(chain)
    jacobian, before = chain.motions["jacobian"].copy(), chain.motions["residual"].copy()
    errors = 1e-3 * rng.standard_normal((2, n))
    step = np.zeros((3, n))
    step[0] = rng.standard_normal(n) * np.where(np.arange(n) < 2, 30.0, 0.02)
    step[0, 3] = 1.0  # the heading
    for k in range(2):
        step[k + 1] = jacobian[k] @ step[k] - before[k] + errors[k]
    along, states = chain.along_motion(step), chain.copy_states()
    chain.retract(step)
    straight = residuals(chain)[0]
    chain.restore_states(states)
    chain.retract(along)
    motion, _ = residuals(chain)
    np.testing.assert_allclose(motion, errors, atol=2e-5)  # the radii change over metres
    assert np.max(np.abs(straight - errors)[:, :2]) > 0.3


def test_a_folded_measurement_is_one_at_a_node_without_motion_error(recording_of):
    """The same residual, and the derivative of it through the motion, far from where the front went."""
    found = []
    for spread in (True, False):
        chain = ShipChain(ShipModel())
        recording = recording_of(1, 5.0, imu=None)
        chain.begin(recording.start, recording.instruments)
        for m in next(iter(recording.steps())).aids:
            if not chain.observes(recording.instruments[m.instrument]):
                continue
            chain.propagate(m.time)
            if spread and chain.ahead > 0.0:
                chain.extend()
            chain.attach([m], np.eye(chain.front.nominal_noise(m).shape[0])[None])
        found.append(chain)
    nodes, first = found
    n = first.size
    assert len(first.nodes) == 1
    assert len(first.between) >= 2
    step = np.zeros((len(nodes.nodes), n))
    step[0] = np.random.default_rng(7).standard_normal(n) * np.where(np.arange(n) < 2, 30.0, 0.02)
    step[0, 3] = 0.8
    first.retract(step[:1].copy())
    nodes.linearise_motion()
    for k in range(1, len(step)):
        step[k] = nodes.motions["jacobian"][k - 1] @ step[k - 1]
    nodes.retract(nodes.along_motion(step))
    np.testing.assert_allclose(residuals(nodes)[0], 0.0, atol=2e-5)
    first.linearise_aids()
    np.testing.assert_allclose(first.aids["residual"], nodes.aids["residual"], atol=1e-3)  # one step or several
    jacobian = first.aids["jacobian"].copy()
    for k in range(n):
        one = np.zeros((1, n))
        one[0, k] = 1.0 if k < 2 else 1e-5
        slope = along(first, one, lambda: residuals(first)[1]) / one[0, k]
        np.testing.assert_allclose(jacobian[:, :, k], -slope, atol=3e-4)


def test_aids_are_those_of_the_model(chain: ShipChain):
    """All at once on their nodes, and one by one at the front: the same."""
    residuals(chain)
    newest = chain.aids["node"] == 2
    seen = []
    for name, components, residual, jacobian, value in zip(
        *(chain.aids[column][newest] for column in ("instrument", "components", "residual", "jacobian", "value")),
        strict=True,
    ):
        sheet = SHEETS[name]
        one = chain.front.measure(Measurement(3.2, sheet.name, sheet.kind, value[: len(sheet.sigma)]))
        m = len(one.innovation)
        assert components == m
        np.testing.assert_array_equal(residual[:m], one.innovation)
        np.testing.assert_array_equal(jacobian[:m], one.jacobian)
        assert not residual[m:].any()
        assert not jacobian[m:].any()
        seen.append(sheet.kind)
    assert len(seen) == len(SHEETS) - 1  # all but the depth sensor


def test_retract_takes_what_it_adds_off_the_prior(chain: ShipChain):
    step = np.zeros((3, chain.size))
    step[0] = np.arange(chain.size)
    before, x = chain.nodes["position"].copy(), chain.nodes["x"].copy()
    chain.retract(step)
    np.testing.assert_array_equal(chain.prior.shift, -step[0])
    np.testing.assert_allclose(
        earth.relative_position(chain.nodes["position"][0], before[0]), [0.0, 1.0, 0.0], atol=1e-8
    )
    np.testing.assert_array_equal(chain.nodes["x"][0], x[0] + np.where(np.arange(chain.size) < 2, 0.0, step[0]))
    np.testing.assert_array_equal(chain.nodes["x"][1:], x[1:])


@pytest.fixture(scope="module")
def straight() -> Recording:
    """Five minutes ahead, nothing wrong: as linear as a ship's data are."""
    return record(load("ship-straight").model_copy(update={"duration": 300.0}), 1)


@pytest.fixture(scope="module")
def turning() -> Recording:
    return record(load("ship-turn").model_copy(update={"duration": 200.0}), 2)


def rmse(errors: np.ndarray) -> np.ndarray:
    return np.sqrt(np.mean(errors[30:, PARTS] ** 2, axis=0))


def in_sigma(errors: np.ndarray, others: np.ndarray, covariances: np.ndarray) -> np.ndarray:
    """Differences of two estimates in units of the sigmas that they give."""
    return (errors - others)[:, PARTS] / np.sqrt(np.diagonal(covariances, axis1=1, axis2=2))[:, PARTS]


def test_window_and_filter_agree_on_linear_data(straight: Recording, run_over):
    """Issue 4's 2 %; and the same covariances."""
    errors, covariances = run_over(ShipFgo(), straight)
    filtered, filter_covariances = run_over(ShipEkf(), straight)
    np.testing.assert_allclose(rmse(errors), rmse(filtered), rtol=0.02)
    sigmas, filter_sigmas = (
        np.sqrt(np.diagonal(c, axis1=1, axis2=2))[30:, PARTS] for c in (covariances, filter_covariances)
    )
    np.testing.assert_allclose(sigmas, filter_sigmas, rtol=0.005)


@pytest.mark.parametrize("data", ["straight", "turning"])
def test_what_left_the_window_is_not_lost(data: str, request, run_over):
    """The newest state of a window of 20 and of the full graph: apart by what linearising the past anew brings."""
    recording = request.getfixturevalue(data)
    errors, covariances = run_over(ShipFgo(), recording)
    full, _ = run_over(ShipFgoFull(), recording)
    assert np.abs(in_sigma(errors, full, covariances)).max() < 0.02


@pytest.mark.parametrize("data", ["straight", "turning"])
def test_batch_solution_and_smoother_agree(data: str, request, run_over):
    """The full graph's trajectory and the filter's, smoothed: one linearised where it ends up, the other on the way."""
    recording = request.getfixturevalue(data)
    graph, smoother = ShipFgoFull(), ShipEkfRts()
    trajectories = []
    for estimator in (graph, smoother):
        run_over(estimator, recording)
        trajectories.append(estimator.smooth())
    batch, smoothed = trajectories
    np.testing.assert_array_equal(batch.time, recording.data.truth.time)
    difference = np.concatenate(
        [
            earth.relative_position(batch.position, smoothed.position)[:, :2],
            (batch.velocity - smoothed.velocity)[:, :2],
            (batch.attitude - smoothed.attitude)[:, 2:],
        ],
        axis=1,
    )
    sigmas, smoother_sigmas = (
        np.sqrt(np.diagonal(e.smoothed_covariance, axis1=1, axis2=2))[:, PARTS] for e in (graph, smoother)
    )
    assert np.abs(difference / sigmas).max() < 0.1
    np.testing.assert_allclose(sigmas, smoother_sigmas, rtol=0.01)


def test_a_window_of_one_epoch_is_an_iterated_filter(turning: Recording, run_over):
    errors, covariances = run_over(ShipFgo(window=1), turning)
    filtered, _ = run_over(ShipEkf(), turning)
    assert np.sqrt(np.mean(in_sigma(errors, filtered, covariances) ** 2)) < 0.1


def test_measurements_between_the_steps_find_their_nodes(straight: Recording, run_over):
    """Compass and GNSS at times of their own: the front runs ahead of the newest node to the end of each step."""
    aids = dict(straight.data.aids)
    for name, late in (("gyrocompass", 0.25), ("gnss", 0.75)):
        aids[name] = replace(aids[name], time=aids[name].time - late)
    shifted = replace(straight, data=replace(straight.data, aids=aids))
    errors, covariances = run_over(ShipFgo(), shifted)
    full, _ = run_over(ShipFgoFull(), shifted)
    filtered, _ = run_over(ShipEkf(), shifted)
    assert np.abs(in_sigma(errors, full, covariances)).max() < 0.02
    assert np.abs(in_sigma(errors, filtered, covariances)[30:]).max() < 0.1
