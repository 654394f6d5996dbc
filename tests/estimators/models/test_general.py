"""A model of a third party, in plain NumPy: filter, sigma points, smoother, window and full graph work with it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from simnav.estimators.models.chain import chain_of
from simnav.estimators.models.general import GeneralModel
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.models.readings import READINGS
from simnav.estimators.solvers.full_graph import FullGraph
from simnav.estimators.solvers.iterated import Iteration
from simnav.estimators.solvers.kalman import KalmanEstimator
from simnav.estimators.solvers.sigma_point import SigmaPointEstimator
from simnav.estimators.solvers.smoother import Smoother
from simnav.estimators.solvers.window import WindowEstimator
from simnav.kinds import EQUATIONS, KINDS, NavigationPoint
from simnav.plugins import import_file
from simnav.recording import Recording
from simnav.scenario import parse
from simnav.scoring import errors
from simnav.source import record
from simnav.testing.contract_check import contract_recording
from simnav.trial import run_trial
from simnav.types import Measurement
from tests.cases.derivatives import along, innovation
from tests.cases.fjord import true_blocks

TEXT = """name = "sound"
version = 1
title = "A ship without an IMU"
plugins = ["late_fix.py"]
duration_s = 90.0
[start]
latitude_deg = 54.0
longitude_deg = 7.9
heading_deg = 20.0
speed_m_s = 6.0
[vessel]
kind = "ship"
[[manoeuvre]]
kind = "hold"
duration_s = 20.0
[[manoeuvre]]
kind = "turn"
angle_deg = 120.0
[instruments.gyrocompass]
sigma_deg = 0.3
bias_deg = 0.3
[instruments.fix]
kind = "late_fix"
sigma_m = 2.0
delay_s = 0.5
"""
PLAIN = TEXT.replace('kind = "late_fix"', 'kind = "gnss_position"').replace("delay_s = 0.5", "")


@pytest.fixture
def model(plugins) -> type[GeneralModel]:
    return import_file(plugins / "steady_turn.py").SteadyTurn


@pytest.fixture
def recording(plugins) -> Recording:
    return record(parse(TEXT, folder=plugins), 1)


def test_the_readings_are_those_of_the_compiled_equations():
    """At a tilted state, for each kind of simnav; the compiled form takes the gyroscopes' output."""
    recording = contract_recording(0)  # it has one instrument of each kind
    assert set(READINGS) == set(EQUATIONS)
    compiled = InertialModel(calibrate=False)
    seen = set()
    for sheet in recording.instruments.values():
        if not sheet.equation:
            continue
        sheet = replace(sheet, lever_arm=np.array([2.0, 1.0, -0.5]))
        only = type(recording.instruments)([sheet], recording.instruments.imu)
        covariance = compiled.begin(replace(recording.start, attitude=np.array([0.3, -0.2, 2.5])), only)
        compiled.load(next(recording.steps()).imu)
        compiled.propagate(covariance, 1.0)
        point = NavigationPoint(1.0, compiled.position, compiled.velocity, compiled.dcm, np.zeros(3))
        turning = compiled.raw_rate - compiled.dcm.T @ _earth(compiled.position[0])
        reading = READINGS[sheet.equation](point._replace(angular_rate=turning), sheet)
        found = compiled.measure(Measurement(1.0, sheet.name, sheet.kind, reading))
        assert found.innovation == pytest.approx(np.zeros(len(reading)), abs=2e-5), sheet.kind
        seen.add(KINDS[sheet.kind].equation)
    assert seen == set(EQUATIONS)


def _earth(latitude: float) -> np.ndarray:
    return 7.292115e-5 * np.array([np.cos(latitude), 0.0, -np.sin(latitude)])


def test_it_has_its_own_states_the_biases_and_the_blocks(model, recording):
    made = model()
    covariance = made.begin(recording.start, recording.instruments)
    assert made.size == 6 + 1 + 1
    made.propagate(covariance, 1.0)
    made.extra[:] = 0.01, 0.4
    for name in ("gyrocompass", "fix"):
        stream = recording.data.aids[name]
        m = Measurement(1.0, name, stream.kind, stream.value[1])
        jacobian = made.measure(m).jacobian
        for k in range(made.size):
            e = np.zeros(made.size)
            e[k] = 1e-4
            numeric = (innovation(made, m, -e) - innovation(made, m, e)) / 2e-4
            np.testing.assert_allclose(jacobian[:, k], numeric, atol=1e-5 * max(1.0, np.abs(jacobian).max()))


def test_the_chain_has_the_derivative_of_the_motion(model, recording):
    chain = chain_of(model())
    chain.begin(recording.start, recording.instruments)
    chain.front.x[4] = 0.02
    chain.nodes["x"][0] = chain.front.x
    for time in (0.7, 2.0):
        chain.propagate(time)
        chain.extend()
    rng = np.random.default_rng(1)
    step = 1e-3 * rng.standard_normal((3, chain.size))

    def look():
        chain.linearise_motion()
        return chain.motions["residual"]

    chain.linearise_motion()
    J = chain.motions["jacobian"].copy()
    expected = step[1:] - np.einsum("kij,kj->ki", J, step[:-1])
    np.testing.assert_allclose(along(chain, step, look), expected, atol=1e-7)


@pytest.mark.parametrize(("text", "near"), [(PLAIN, 0.02), (TEXT, 0.2)], ids=["fixes", "late fixes"])
def test_every_solver_works_with_it_and_they_agree(model, plugins, text, near):
    """Where the delay is not known, a window takes its product with the velocity anew, and a filter does not."""
    scenario = parse(text, folder=plugins)
    recording = record(scenario, 1)
    solvers = {
        "ekf": KalmanEstimator(model()),
        "smoother": KalmanEstimator(model(), smoother=Smoother()),
        "points": SigmaPointEstimator(model()),
        "window": WindowEstimator(model()),
        "folded": WindowEstimator(model(), window=5, spacing=2.5),
    }
    trials = {name: run_trial(solver, recording) for name, solver in solvers.items()}
    assert {t.status for t in trials.values()} == {"ok"}, {n: t.reason for n, t in trials.items()}
    smoothed = {
        name: replace(t, position=t.smoothed.position, velocity=t.smoothed.velocity, attitude=t.smoothed.attitude)
        for name, t in trials.items()
        if t.smoothed is not None
    }
    rmse = {
        name: float(np.sqrt(np.mean(errors(smoothed.get(name, t), recording)[10:, :2] ** 2)))
        for name, t in trials.items()
    }
    for name in ("points", "window"):
        assert rmse[name] == pytest.approx(rmse["ekf"], rel=near), rmse
    assert rmse["folded"] == pytest.approx(rmse["ekf"], rel=0.2), rmse
    assert rmse["ekf"] < 1.5, rmse  # a fix has 2 m, and may be 0.5 s times 6 m/s late
    assert rmse["smoother"] < 0.9 * rmse["ekf"], rmse
    truth = true_blocks(scenario, 1, trials["ekf"].time).get("fix.delay")
    for trial in trials.values() if truth is not None else ():
        z = (trial.diagnostics["state.fix.delay"] - truth)[-1] / trial.diagnostics["sigma.fix.delay"][-1]
        assert np.abs(z) < 3.0
        assert trial.diagnostics["sigma.fix.delay"][-1] < 0.35  # it was 0.5 s


def test_a_full_graph_works_with_it(model, plugins):
    """Over half a minute, for it solves all epochs anew at each; it agrees with the smoother."""
    recording = record(parse(PLAIN, folder=plugins).model_copy(update={"duration": 35.0}), 1)
    graph, smoother = (
        run_trial(solver, recording) for solver in (FullGraph(model()), KalmanEstimator(model(), smoother=Smoother()))
    )
    assert {graph.status, smoother.status} == {"ok"}, graph.reason
    assert graph.smoothed is not None
    assert smoother.smoothed is not None
    apart = (graph.smoothed.position - smoother.smoothed.position)[:, :2] * 6.37e6
    assert np.sqrt(np.mean(apart**2)) < 0.2


def test_an_iterated_filter_works_with_it(model, plugins):
    recording = record(parse(PLAIN, folder=plugins), 1)
    once, iterated = (run_trial(KalmanEstimator(model(), iteration=i), recording) for i in (None, Iteration()))
    assert {once.status, iterated.status} == {"ok"}
    first, second = (np.sqrt(np.mean(errors(t, recording)[:, :2] ** 2)) for t in (once, iterated))
    assert second == pytest.approx(first, rel=0.03)


def test_it_is_consistent(model, plugins):
    scenario = parse(TEXT, folder=plugins).model_copy(update={"duration": 60.0})
    nees = []
    for seed in range(12):
        recording = record(scenario, seed)
        trial = run_trial(KalmanEstimator(model()), recording)
        e, P = errors(trial, recording)[-1, :2], trial.covariance[-1, :2, :2]
        nees.append(e @ np.linalg.solve(P, e) / 2.0)
    assert 0.2 < np.mean(nees) < 2.0  # its motion is not quite the vessel's
