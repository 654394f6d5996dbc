"""States that instruments of a third party bring along: in models, points, chains, and in every solver.

Each case is one file of `tests/simnav/plugins`: a magnetometer with six states of iron, fixes with a late time stamp,
the beams of a DVL that share a scale, and ranges by a clock with a drift. The last two are there again as instruments
with channels (`tests/estimators/test_channels.py`): what all solvers do with blocks is the same for them.
"""

from __future__ import annotations

import copy
from dataclasses import replace

import numpy as np
import pytest

from simnav.environment import EstimatorAgent, NavigationEnv
from simnav.estimator import find, make, names, unsuitable
from simnav.estimators.bound import bound_of_run
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.models.inertial_chain import InertialChain
from simnav.estimators.models.inertial_points import InertialPoints
from simnav.recording import Recording
from simnav.scenario import parse
from simnav.scoring import errors, nees_band
from simnav.simulation.simulator import ideal
from simnav.source import record
from simnav.testing.contract_check import check
from simnav.trial import Trial, run_trial
from simnav.types import Instruments, Measurement
from tests.cases.block_consistency import DURATION, ROWS, WITHIN, block_errors, consistency
from tests.cases.derivatives import along, innovation
from tests.cases.fjord import CASES, CHANNEL_CASES, fjord, true_blocks

#: Runs of the solvers, of the smoothers and of a ship; `tests/audit/state_blocks.py` takes more.
RUNS, SMOOTHED_RUNS, SHIP_RUNS = 5, 3, 6
#: Steps of the finite differences: position, velocity, attitude, biases.
STEPS = np.repeat([1.0, 1e-2, 1e-5, 1e-5, 1e-3], 3)
OF_CASE = {"iron": ("magnetometer", 6), "delay": ("fix", 1), "beams": ("beam_2", 1), "clock": ("transponder_0", 2)}


@pytest.fixture(params=CASES)
def case(request) -> str:
    return request.param


@pytest.fixture(params=[*CASES, *CHANNEL_CASES])
def any_case(request) -> str:
    return request.param


def begun(model: InertialModel, recording: Recording, name: str, until: float = 3.0) -> Measurement:
    """Begin a model, and bring it to the measurement of an instrument at a time; its blocks are not zero."""
    covariance = model.begin(replace(recording.start, attitude=np.array([0.3, -0.2, 2.5])), recording.instruments)
    for packet in recording.steps():
        model.load(packet.imu)
        model.propagate(covariance, min(packet.time, until))
        if packet.time >= until:
            break
    sigma = np.sqrt(np.diag(covariance)[15:])
    model.calibration += np.where(np.arange(len(sigma)) % 2, 0.3, -0.4) * sigma
    stream = recording.data.aids[name]
    return Measurement(until, name, stream.kind, stream.value[np.searchsorted(stream.time, until - 1e-6)])


def test_the_model_appends_the_blocks_once_and_has_their_jacobian(plugins, case):
    name, size = OF_CASE[case]
    recording = record(fjord(plugins, case, duration=4.0), 2)
    model = InertialModel()
    m = begun(model, recording, name)
    assert model.size == 15 + size
    jacobian = model.measure(m).jacobian
    sigmas = np.concatenate([np.atleast_1d(b.sigma) for b in recording.instruments[name].blocks])
    numeric = np.empty_like(jacobian)
    for k, h in enumerate([*STEPS, *(0.01 * sigmas)]):
        e = np.zeros(model.size)
        e[k] = h
        numeric[:, k] = (innovation(model, m, -e) - innovation(model, m, e)) / (2.0 * h)
    scale = np.abs(jacobian).max()
    np.testing.assert_allclose(jacobian, numeric, atol=1e-4 * scale, rtol=1e-3)
    assert np.abs(jacobian[:, 15:]).max() > 0.0


def test_a_reading_alone_gives_the_jacobian_by_differences(plugins, case):
    name, _ = OF_CASE[case]
    model = InertialModel()
    m = begun(model, record(fjord(plugins, case, duration=4.0), 2), name)
    given = model.measure(m)
    whole = model.own[name]._observation
    model.own[name]._observation = lambda point, sheet: whole(point, sheet)[0]
    found = model.measure(m)
    assert np.array_equal(found.innovation, given.innovation)
    np.testing.assert_allclose(found.jacobian, given.jacobian, atol=1e-4 * np.abs(given.jacobian).max(), rtol=1e-3)


def test_points_are_the_model_s_own_prediction_at_each(plugins, case):
    name, _ = OF_CASE[case]
    recording = record(fjord(plugins, case, duration=4.0), 2)
    model = InertialPoints()
    m = begun(model, recording, name)
    sigmas = np.concatenate([np.atleast_1d(b.sigma) for b in recording.instruments[name].blocks])
    scale = np.concatenate([np.repeat([20.0, 0.5, 0.2, 1e-4, 1e-2], 3), sigmas])
    points = scale * np.random.default_rng(3).standard_normal((20, model.size))
    expected = np.array([innovation(model, m, np.zeros(model.size)) - innovation(model, m, e) for e in points])
    found = model.observe_points(m, points)
    np.testing.assert_allclose(found, expected, atol=1e-4 * np.abs(expected).max())


def test_a_clock_moves_by_its_drift_in_model_points_and_chain(plugins):
    recording = record(fjord(plugins, "clock", duration=4.0), 2)
    chain, points = InertialChain(InertialModel()), InertialPoints()
    covariance = chain.begin(recording.start, recording.instruments)
    points.begin(recording.start, recording.instruments)
    packet = next(recording.steps())
    moved = np.zeros((2, 17))
    moved[0, 16] = moved[1, 15] = 1.0
    points.load(packet.imu)
    points.calibration[:] = 3.0, 0.5
    noise = points.propagate_points(moved, 1.0)
    assert points.calibration == pytest.approx([3.5, 0.5])
    assert moved[0, 15:] == pytest.approx([1.0, 1.0])
    assert moved[1, 15:] == pytest.approx([1.0, 0.0])
    block = recording.instruments["transponder_0"].blocks[0]
    assert noise[15:, 15:] == pytest.approx(block.noise(1.0))
    chain.load(packet.imu)
    chain.propagate(1.0)
    assert chain.predicted_covariance(covariance)[15:, 15:] == pytest.approx(block.covariance(1.0))
    chain.extend()
    chain.propagate(1.0)
    step = np.zeros((2, 17))
    step[0, 15:] = 1.0, 0.2
    chain.linearise_motion()
    J = chain.motions["jacobian"][0].copy()

    def look():
        chain.linearise_motion()
        return chain.motions["residual"][0]

    assert along(chain, step, look) == pytest.approx(-J @ step[0], abs=1e-9)
    assert (J @ step[0])[15:] == pytest.approx([1.2, 0.2])


# --- solvers


@pytest.fixture(scope="module")
def runs() -> dict[str, list[Recording]]:
    """Recordings of the cases that were asked for."""
    return {}


def recordings(runs, plugins, case) -> list[Recording]:
    scenario = fjord(plugins, case, duration=DURATION)
    if case not in runs:
        runs[case] = [record(scenario, seed) for seed in range(RUNS)]
    return runs[case]


def unaware(recording: Recording) -> Recording:
    """The recording with datasheets that say that the states are zero, although they are not."""
    given = recording.instruments
    sheets = [
        replace(sheet, blocks=tuple(replace(block, sigma=0.0, density=0.0) for block in sheet.blocks))
        for sheet in given.values()
    ]
    return replace(recording, instruments=Instruments(sheets, given.imu, given.step))


def test_all_solvers_are_consistent_and_filter_and_window_agree(plugins, runs, any_case):
    scenario, made = fjord(plugins, any_case, duration=DURATION), recordings(runs, plugins, any_case)
    found = {row: consistency(row, scenario, made) for row in ROWS}
    for row, figures in found.items():
        assert figures.motion_kept, (row, figures)
        assert figures.blocks_kept, (row, figures)
    for row, part in WITHIN.items():
        assert found[row].rmse == pytest.approx(found["ekf"].rmse, rel=part), row


@pytest.mark.parametrize("row", ["ekf", "oracle"])
def test_a_row_that_is_not_told_of_the_states_is_not_consistent(plugins, runs, row, any_case):
    """So few runs are enough to see it."""
    scenario, made = fjord(plugins, any_case, duration=DURATION), recordings(runs, plugins, any_case)
    assert not consistency(row, scenario, [unaware(recording) for recording in made], blocks=False).motion_kept


def test_the_smoother_and_the_full_graph_carry_them(plugins, runs, any_case):
    made = recordings(runs, plugins, any_case)[:SMOOTHED_RUNS]
    rmse = {}
    for row in ("ekf", "ekf-rts", "ekf-two-filter", "fgo-full", "oracle-rts"):
        trials = [run_trial(make(row), recording) for recording in made]
        assert {t.status for t in trials} == {"ok"}, trials[0].reason
        each = [t if t.smoothed is None else replace_smoothed(t) for t in trials]
        rmse[row] = np.sqrt(np.mean([np.mean(errors(t, r)[:, :2] ** 2) for t, r in zip(each, made, strict=True)]))
    assert rmse["ekf-rts"] < 0.9 * rmse["ekf"]
    assert rmse["ekf-two-filter"] == pytest.approx(rmse["ekf-rts"], rel=1e-3)
    assert rmse["fgo-full"] == pytest.approx(rmse["ekf-rts"], rel=0.05)
    assert rmse["oracle-rts"] == pytest.approx(rmse["ekf-rts"], rel=0.1)


def replace_smoothed(trial: Trial) -> Trial:
    """The trial with what was smoothed in place of the estimates."""
    s = trial.smoothed
    return replace(trial, position=s.position, velocity=s.velocity, attitude=s.attitude)


def test_the_bound_has_them(plugins, any_case):
    scenario = fjord(plugins, any_case, duration=DURATION)
    perfect = ideal(scenario, 3)
    covariance = bound_of_run(perfect)
    sigma = np.sqrt(covariance[:, range(2), range(2)].sum(axis=1))
    trial = run_trial(make("ekf"), record(scenario, 3))
    reported = np.sqrt(trial.covariance[:, range(2), range(2)].sum(axis=1))
    assert sigma[-20:] == pytest.approx(reported[-20:], rel=0.1)
    # Were the states known, the bound would be lower.
    told = bound_of_run(unaware(perfect))
    share = np.diagonal(told[-1]) / np.diagonal(covariance[-1])
    assert share.max() < 1.0 + 1e-9
    assert share.min() < 0.995


@pytest.mark.parametrize("row", ["ekf-9", "federated", "imm", "heading-bank", "gtsam-isam2", "student-t-rts"])
def test_other_rows_run_and_stay_honest(plugins, runs, row, any_case):
    """A model without calibration states counts them as noise, local filters have each their own."""
    for recording in recordings(runs, plugins, any_case)[:2]:
        estimator = make(row)
        trial = run_trial(estimator, recording)
        if row == "gtsam-isam2" and unsuitable(estimator, recording.instruments):  # its factors know no such position
            assert trial.status == "unsuitable"
            continue
        assert trial.status == "ok", trial.reason
        e, P = errors(trial, recording), trial.covariance
        k = -1
        assert e[k, :2] @ np.linalg.solve(P[k, :2, :2], e[k, :2]) < 25.0


@pytest.mark.parametrize("case", ["beams", "clock", *CHANNEL_CASES])
def test_every_estimator_meets_them_and_runs_or_says_what_it_needs(plugins, case):
    recording = record(fjord(plugins, case, duration=6.0), 1)
    trials = [run_trial(make(name), recording) for name in names() if not find(name).slow]
    assert not {t.estimator: t.reason for t in trials if t.failed}
    assert sum(t.status == "ok" for t in trials) > 40


# --- reports, environment, contract


def test_an_agent_in_the_environment_gives_the_numbers_of_the_trial(plugins, any_case):
    scenario = fjord(plugins, any_case, duration=10.0)
    trial = run_trial(make("ekf"), record(scenario, 5))
    agent, env = EstimatorAgent(make("ekf")), NavigationEnv(scenario)
    observation, info = env.reset(seed=5)
    agent.reset(info)
    for k in range(10):
        action = agent.act(observation)
        assert np.array_equal(agent.estimate.position, trial.position[k])
        for label, (value, sigma) in agent.estimate.states.items():
            assert np.array_equal(value, trial.diagnostics[f"state.{label}"][k])
            assert np.array_equal(sigma, trial.diagnostics[f"sigma.{label}"][k])
        observation, *_ = env.step(action)


def test_they_sail_on_a_trajectory_of_others(plugins):
    """Block form and steps give the same numbers there, too."""
    file, tables = CASES["beams"]
    text = (plugins / "poses.toml").read_text().replace('["poses.py"]', f'["poses.py", "{file}"]')
    text = text.replace("sigma_m = 0.0", "sigma_m = 1.0").replace("sigma_m_s = 0.0", "sigma_m_s = 0.1")
    scenario = parse(text + tables[tables.index("[instruments.beam_0]") :], folder=plugins)
    trial = run_trial(make("ekf"), recording := record(scenario, 1))
    e, P = errors(trial, recording)[-1, :3], trial.covariance[-1, :3, :3]
    assert e @ np.linalg.solve(P, e) < 16.3  # 0.999 of chi-square with three degrees of freedom
    own = block_errors(trial, true_blocks(scenario, 1, trial.time))
    assert np.abs(own["sound_speed"][-1]) < 3.3
    assert trial.diagnostics["sigma.sound_speed"][-1, 0] < 0.015  # it was 0.02
    agent, env = EstimatorAgent(make("ekf")), NavigationEnv(scenario)
    observation, info = env.reset(seed=1)
    agent.reset(info)
    for k in range(5):
        action = agent.act(observation)
        assert np.array_equal(agent.estimate.position, trial.position[k])
        observation, *_ = env.step(action)


def test_a_shared_block_is_reported_once(plugins):
    trial = run_trial(make("ekf"), record(fjord(plugins, "beams", duration=5.0), 1))
    assert [name for name in trial.diagnostics if name.startswith("state.")] == ["state.sound_speed"]
    own = run_trial(make("federated"), record(fjord(plugins, "beams", duration=5.0), 1))
    assert sum(name.startswith("state.beam_") for name in own.diagnostics) == 4


def test_the_contract_test_passes_with_such_kinds(plugins):
    fjord(plugins, "beams")
    fjord(plugins, "clock")
    fjord(plugins, "iron")
    fjord(plugins, "delay")
    report = check("ekf")
    assert report.passed, report


def test_a_run_that_is_copied_goes_on_as_before(plugins):
    recording = record(fjord(plugins, "clock", duration=8.0), 1)
    first = make("sw-fgo")
    first.reset(recording.start, recording.instruments)
    packets = list(recording.steps())
    for packet in packets[:4]:
        first.update(packet)
    second = copy.deepcopy(first)
    for packet in packets[4:]:
        a, b = first.update(packet), second.update(packet)
        assert np.array_equal(a.position, b.position)
        assert all(np.array_equal(a.states[n][0], b.states[n][0]) for n in a.states)


# --- a ship without an IMU


SHIP = """name = "sound"
version = 1
title = "A ship without an IMU"
plugins = ["{file}"]
duration_s = 60.0
[start]
latitude_deg = 54.0
longitude_deg = 7.9
heading_deg = 20.0
speed_m_s = 4.0
[vessel]
kind = "ship"
[[manoeuvre]]
kind = "hold"
duration_s = 10.0
[[manoeuvre]]
kind = "turn"
angle_deg = 200.0
[instruments.gyrocompass]
sigma_deg = 0.3
[instruments.speed_log]
sigma_m_s = 0.05
"""


@pytest.mark.parametrize(("name", "row"), [("delay", "ship-ekf"), ("delay", "ship-ukf"), ("delay", "ship-fgo")])
def test_a_ship_s_model_carries_them(plugins, name, row):
    file, tables = CASES[name]
    scenario = parse(SHIP.format(file=file) + tables, folder=plugins)
    nees, blocks = [], []
    for seed in range(SHIP_RUNS):
        trial = run_trial(make(row), recording := record(scenario, seed))
        assert trial.status == "ok", trial.reason
        e, P = errors(trial, recording)[-1, :2], trial.covariance[-1, :2, :2]
        nees.append(e @ np.linalg.solve(P, e) / 2.0)
        own = block_errors(trial, true_blocks(scenario, seed, trial.time))
        blocks.append(own["fix.delay"][-1, 0] ** 2)
    assert trial.diagnostics["sigma.fix.delay"][-1, 0] < 0.45  # it was 0.5 s
    for found, d in ((nees, 2), (blocks, 1)):
        low, high = nees_band(d, SHIP_RUNS, 0.999)
        assert low < np.mean(found) < high


def test_a_ship_s_model_leaves_clocks_alone(plugins):
    file, tables = CASES["clock"]
    fix = '[instruments.fix]\nkind = "gnss_position"\nsigma_m = 2.0\n'
    scenario = parse(SHIP.format(file=file) + fix + tables, folder=plugins).model_copy(update={"duration": 10.0})
    trial = run_trial(make("ship-ekf"), record(scenario, 1))
    assert trial.status == "ok"
    assert not any("transponder" in name for name in trial.diagnostics)


def test_a_fault_and_a_block_are_both_states_of_the_oracle(plugins):
    fault = '[[fault]]\nkind = "bias_step"\ninstruments = "beam_1"\nstart_s = 15\noffset_m_s = 0.3\n'
    recording = record(fjord(plugins, "beams", duration=40.0, tables=fault), 2)
    oracle, ekf = (run_trial(make(row), recording) for row in ("oracle", "ekf"))
    assert {oracle.status, ekf.status} == {"ok"}
    told, plain = (np.abs(errors(t, recording)[-20:, 3:5]).mean() for t in (oracle, ekf))
    assert told < 0.7 * plain
    own = block_errors(oracle, true_blocks(fjord(plugins, "beams"), 2, oracle.time))
    assert np.abs(own["sound_speed"][-1]) < 3.0
