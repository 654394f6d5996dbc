"""The Cramer-Rao bound: against closed forms, its order, and the oracle that attains it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm, solve_discrete_are

from simnav.estimator import make
from simnav.estimators.bound import KINDS, Bound, bound, bound_of_run
from simnav.scenario import Scenario, load
from simnav.sensors.faults import GrossError, Multipath, NoiseStep, Outage
from simnav.sensors.imu import AccelerometerSpec, GyroscopeSpec, ImuSpec
from simnav.simulation.simulator import ideal, simulate
from simnav.spec import SpecError
from simnav.trial import run_trial
from simnav.types import COMPONENTS


def shortened(name: str, duration: float, **changes) -> Scenario:
    return load(name).model_copy(update={"duration": duration, **changes})


@pytest.fixture(scope="module")
def drift() -> Scenario:
    """Perfect gyroscopes, accelerometers of white noise only, and position fixes: three double integrators."""
    scenario = load("open-sea")
    gnss = scenario.instruments["gnss"].model_copy(update={"lever_arm": (0.0, 0.0, 0.0)})
    imu = ImuSpec(rate=50.0, gyroscope=GyroscopeSpec(), accelerometer=AccelerometerSpec(random_walk=0.02))
    start = scenario.initial_error.model_copy(update={"attitude": (1e-7, 1e-7, 1e-7)})
    return shortened("open-sea", 120.0, instruments={"imu": imu, "gnss": gnss}, initial_error=start, sea=None)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_fixes_and_white_acceleration_reach_the_riccati_fixed_point(drift: Scenario, axis: int):
    """p' = v, v' = white noise of density q, p measured each second: the discrete algebraic Riccati equation."""
    q, r = 0.02**2, drift.instruments["gnss"].sigma[axis] ** 2
    g = 2.0 * 9.8 / 6.378e6 if axis == 2 else 0.0  # gravity falls with height
    F = expm(np.array([[0.0, 1.0], [g, 0.0]]))
    Q = q * np.array([[1 / 3, 1 / 2], [1 / 2, 1.0]])
    predicted = solve_discrete_are(F.T, np.array([[1.0], [0.0]]), Q, np.array([[r]]))
    posterior = predicted - predicted[:, :1] @ predicted[:1] / (predicted[0, 0] + r)
    found = bound(drift, [0]).covariance[-1][np.ix_([axis, axis + 3], [axis, axis + 3])]
    np.testing.assert_allclose(found, posterior, rtol=2e-3)


def test_a_constant_position_is_known_as_one_over_n(drift: Scenario):
    """No noise in the motion, the velocity known: the information of n fixes adds to that of the start."""
    imu = ImuSpec(rate=50.0, gyroscope=GyroscopeSpec(), accelerometer=AccelerometerSpec())
    start = drift.initial_error.model_copy(update={"velocity": (1e-9, 1e-9, 1e-9), "position": (2.0, 3.0, 4.0)})
    still = drift.model_copy(
        update={"instruments": {**drift.instruments, "imu": imu}, "initial_error": start, "duration": 40.0}
    )
    found = bound(still, [0])
    sigma = np.array(drift.instruments["gnss"].sigma)
    n = np.searchsorted(simulate(still, 0).data.aids["gnss"].time, found.time + 1e-6)
    expected = 1.0 / np.sqrt(np.array([2.0, 3.0, 4.0]) ** -2.0 + n[:, None] / sigma**2)
    np.testing.assert_allclose(found.sigma[:, :2], expected[:, :2], rtol=1e-4)


def test_the_kinds_agree_without_faults_and_are_in_order_with_them():
    clean = shortened("open-sea", 60.0)
    a, b, c = (bound(clean, [1], kind) for kind in KINDS)
    np.testing.assert_allclose(a.covariance, b.covariance)
    np.testing.assert_allclose(a.covariance, c.covariance)
    faults = (
        NoiseStep(instruments=("gnss",), factor=2.0, start=20.0),
        GrossError(instruments=("gnss",), probability=0.3, size_position=(2.0, 9.0), start=20.0),
    )
    wrong = shortened("open-sea", 60.0, faults=faults)
    clean_, flags, mix = (bound(wrong, range(4), kind) for kind in KINDS)
    np.testing.assert_allclose(clean_.covariance, bound(clean, range(4)).covariance, rtol=1e-9)
    assert np.all(flags.sigma[25:, :3] > clean_.sigma[25:, :3])
    assert mix.horizontal_rms > 1.003 * flags.horizontal_rms
    np.testing.assert_allclose(mix.sigma[:19], flags.sigma[:19], rtol=1e-12)


def test_an_outage_is_no_information_and_multipath_is_a_state():
    out = shortened("open-sea", 60.0, faults=(Outage(instruments=("gnss",), start=20.0),))
    without = bound(out, [0])
    everything = bound(shortened("open-sea", 60.0), [0])
    assert np.all(without.sigma[25:, 0] > 1.1 * everything.sigma[25:, 0])
    # Multipath of no correlation is noise, one that never changes says where the vessel moves, not where it is.
    sigma = 6.0
    horizontal = {}
    for time in (0.001, 10.0, 1e6):
        fault = Multipath(instruments=("gnss",), sigma_position=sigma, correlation_time=time)
        horizontal[time] = bound(shortened("open-sea", 60.0, faults=(fault,)), [0]).horizontal[-1]
    gnss = load("open-sea").instruments["gnss"]
    louder = gnss.model_copy(update={"sigma": tuple(np.hypot(gnss.sigma, sigma))})
    instruments = {**load("open-sea").instruments, "gnss": louder}
    noise = bound(shortened("open-sea", 60.0, instruments=instruments), [0]).horizontal[-1]
    assert horizontal[0.001] == pytest.approx(noise, rel=1e-6)
    assert horizontal[0.001] < horizontal[10.0] < horizontal[1e6]


@pytest.mark.parametrize("kind", KINDS)
def test_what_comes_after_helps(kind: str):
    """The bound of smoothed output is below that of real time, except at the end."""
    scenario = shortened("open-sea", 40.0)
    online, smoothed = bound(scenario, [0], kind), bound(scenario, [0], kind, smoothed=True)
    np.testing.assert_allclose(smoothed.covariance[-1], online.covariance[-1], rtol=1e-9)
    assert np.all(smoothed.sigma[:-5, :6] < 0.98 * online.sigma[:-5, :6])
    assert smoothed.summary()["smoothed"]


def test_the_bound_of_several_runs_is_the_mean_of_theirs():
    """What a run draws can be known: so runs with many hits and runs with few are not averaged in information."""
    scenario = shortened(
        "open-sea", 40.0, faults=(GrossError(instruments=("gnss",), probability=0.5, size_position=(30.0, 60.0)),)
    )
    each = [bound_of_run(ideal(scenario, s)) for s in (0, 1)]
    np.testing.assert_allclose(bound(scenario, [0, 1]).covariance, 0.5 * (each[0] + each[1]), rtol=1e-12)


@pytest.mark.parametrize(("name", "duration", "rtol"), [("poor-heading", 60.0, 5e-3), ("lone-dvl", 150.0, 2e-2)])
def test_the_covariance_of_the_oracle_is_the_bound_of_its_run(name: str, duration: float, rtol: float):
    """It is linearised about the truth, not about its estimate or what its IMU measured.

    However wrong the heading was at the start; and with the bias of a MEMS accelerometer a DVL does not tell the
    heading. The white noise of that IMU is left in the samples within a step, and changes the variances by 1 %.
    """
    scenario = shortened(name, duration)
    oracle = run_trial(make("oracle"), simulate(scenario, 3))
    ours, expected = (np.diagonal(c, axis1=1, axis2=2) for c in (oracle.covariance, bound_of_run(ideal(scenario, 3))))
    np.testing.assert_allclose(ours, expected, rtol=rtol)


def test_summary_and_a_ship_without_imu():
    found = bound(shortened("ship-dead-reckoning", 30.0), [0])
    assert isinstance(found, Bound)
    assert np.isnan(found.sigma[:, 6:8]).all()  # the oracle is told of roll and pitch
    summary = found.summary()
    assert set(summary["rms"]) == {*COMPONENTS[:6], "attitude_down"}
    assert summary["horizontal_last_m"] == pytest.approx(np.hypot(*found.sigma[-1, :2]))
    assert summary["scenario"] == "ship-dead-reckoning-v1"


def test_what_has_no_bound():
    with pytest.raises(SpecError, match="recorded run"):
        bound(load("car-kitti"), [0])
    with pytest.raises(SpecError, match="there are: clean, flags, mix"):
        bound(load("open-sea"), [0], "best")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="at least one seed"):
        bound(load("open-sea"), [])
    lonely = shortened("open-sea", 10.0, instruments={"imu": load("open-sea").instruments["imu"]})
    with pytest.raises(SpecError, match="open-sea-v1, seed 0: there is no bound"):
        bound(lonely, [0])
