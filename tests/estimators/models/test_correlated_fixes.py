"""States for the slow error of fixes: the datasheets that they come from, and what they are worth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from simnav.estimator import make
from simnav.estimators.models.correlated_fixes import CorrelatedFixes, with_correlated_fixes
from simnav.types import Datasheet, Instruments

DVL = Datasheet("dvl", "dvl", 1.0, np.full(3, 0.05), phase=0.333, lever_arm=np.array([1.0, 0.5, 3.0]))
WHITE = Datasheet("gnss", "gnss_position", 1.0, np.array([1.5, 1.5, 3.0]), lever_arm=np.array([2.0, -1.0, -8.0]))
SLOW = replace(WHITE, bias_instability=np.array([3.0, 3.0, 6.0]), correlation_time=60.0)


def silent(recording):
    """The recording with a datasheet that says nothing of the slow error."""
    sheets = Instruments([WHITE, DVL], recording.instruments.imu, recording.instruments.step)
    return replace(recording, instruments=sheets)


def test_a_datasheet_is_completed_and_a_larger_slow_error_holds():
    told = with_correlated_fixes(Instruments([WHITE, replace(SLOW, name="other"), DVL]), 1.0, 90.0)
    np.testing.assert_array_equal(told["gnss"].bias_instability, [1.5, 1.5, 3.0])
    assert told["gnss"].correlation_time == 90.0
    np.testing.assert_array_equal(told["gnss"].sigma, WHITE.sigma)
    np.testing.assert_array_equal(told["other"].bias_instability, SLOW.bias_instability)
    assert told["other"].correlation_time == 60.0
    wider = with_correlated_fixes(Instruments([SLOW]), 4.0, 90.0)["gnss"]
    np.testing.assert_array_equal(wider.bias_instability, [6.0, 6.0, 12.0])
    assert wider.correlation_time == 60.0
    assert not told["dvl"].bias_instability.any()


def test_with_the_right_parameters_it_is_the_ekf_that_is_told(recording_of, run_over):
    recording = recording_of(3, 60.0, aids=(SLOW, DVL))
    expected, P = run_over(make("ekf"), recording)
    errors, Q = run_over(make("gm-ekf", slow=2.0, slow_time=60.0), silent(recording))
    np.testing.assert_allclose(errors, expected, atol=1e-12)
    np.testing.assert_allclose(Q, P, rtol=1e-12)


def test_without_a_slow_error_it_is_the_ekf(recording_of, run_over):
    recording = recording_of(3, 30.0)
    expected, _ = run_over(make("ekf"), recording)
    errors, _ = run_over(make("gm-ekf", slow=0.0), recording)
    np.testing.assert_allclose(errors, expected, atol=1e-12)


def test_it_is_consistent_where_the_ekf_is_sure_of_a_shared_error(recording_of, run_over):
    """Over 10 runs whose fixes have a slow error of twice the white one, at a minute."""

    def mean_nees(name: str, **parameters) -> float:
        found = []
        for seed in range(10):
            errors, P = run_over(make(name, **parameters), silent(recording_of(seed, 150.0, aids=(SLOW, DVL))))
            e = errors[30::20, :2]
            found.append(np.einsum("ti,ti->t", e, np.linalg.solve(P[30::20, :2, :2], e[..., None])[..., 0]).mean() / 2)
        return float(np.mean(found))

    plain, ours = mean_nees("ekf"), mean_nees("gm-ekf", slow=2.0, slow_time=60.0)
    assert plain > 5.0
    assert 0.4 < ours < 2.0


def test_a_ship_without_an_imu_has_the_states_too(recording_of):
    sheets = Instruments([WHITE, Datasheet("compass", "gyrocompass", 1.0, np.full(1, 0.01))])
    estimator, plain = make("gm-ekf"), make("ship-ekf")
    for each in (estimator, plain):
        each.reset(recording_of(0, 2.0).start, sheets)
    assert estimator.model.size == plain.model.size + 2


@pytest.mark.parametrize(("name", "value"), [("slow", -1.0), ("slow_time", 0.0), ("slow_time", float("inf"))])
def test_a_senseless_parameter_is_refused(name: str, value: float):
    with pytest.raises(ValueError, match=name):
        CorrelatedFixes(**{name: value})
