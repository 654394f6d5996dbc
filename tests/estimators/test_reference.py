"""The oracle is right: consistent, at its bound, and white innovations; with an IMU and without, from any start."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.estimator import make
from simnav.estimators.models.true_motion import true_motion
from simnav.estimators.reference import ReferenceFigure, oracle_run
from simnav.geometry.earth import relative_position
from simnav.scenario import Scenario, load
from simnav.scoring import score
from simnav.simulation.simulator import simulate
from simnav.spec import SpecError
from simnav.strapdown import integrate
from simnav.trial import run_trial

#: A start from a poor heading, a current, a DVL beside a compass with deviation, an IMU with scale factors, no IMU.
SHORT = {
    "poor-heading": 60.0,
    "auv-water-track": 60.0,
    "rov-inspection": 20.0,
    "harbour-multipath": 60.0,
    "fishing-vessel": 80.0,
}


def shortened(name: str, duration: float) -> Scenario:
    return load(name).model_copy(update={"duration": duration})


@pytest.mark.parametrize("name", SHORT)
def test_the_oracle_is_right(name: str):
    """Within four standard errors of 1; ``python -m tests.agreement.reference`` measures it more sharply."""
    runs = [oracle_run(shortened(name, SHORT[name]), seed) for seed in range(200, 212)]
    for smoothed in (False, True):
        found = ReferenceFigure.of(name, runs, smoothed)
        assert found.ratio_standard_error < 0.2
        assert abs(found.ratio - 1.0) < 4.0 * found.ratio_standard_error
        assert abs(found.nees - 1.0) < 4.0 * found.nees_standard_error


def test_the_figure_is_of_the_row_of_the_board_also_where_readings_come_late():
    """An oracle that left late fixes out had the error of dead reckoning, and rows were said to be better than it."""
    scenario = shortened("late-aids", 120.0)
    found, recording = oracle_run(scenario, 200), simulate(scenario, 200)
    trial = run_trial(make("oracle"), recording)
    assert found.rms == pytest.approx(score(trial, recording, ["horizontal_rmse"])["horizontal_rmse"], rel=1e-3)
    assert found.rms < 1.5 * found.bound
    assert found.bound < 0.8  # m: without fixes it is 1.4 m, that of the start


@pytest.mark.parametrize("name", SHORT)
def test_the_innovations_of_the_oracle_are_as_large_as_it_says(name: str):
    """Their normalised squares, of which a few runs hold thousands: so this is the sharpest test of its noise."""
    total, count = 0.0, 0
    for seed in range(300, 306):
        recording = simulate(shortened(name, SHORT[name]), seed)
        oracle = make("oracle")
        oracle.reveal(recording)
        oracle.reset(recording.start, recording.instruments)
        for packet in recording.steps():
            for key, value in oracle.update(packet).diagnostics.items():
                if key.startswith("nis.") and np.isfinite(value):
                    total += float(value)
                    count += recording.data.aids[key.removeprefix("nis.")].value.shape[1]
    assert count > 500
    assert abs(total / count - 1.0) < 4.0 * np.sqrt(2.0 / count)


def test_the_true_motion_leads_to_where_the_ship_is():
    """Without the short waves between epochs the position would drift by a metre and more."""
    recording = simulate(load("ship-turn"), 0)
    first, truth = recording.initial_truth, recording.data.truth
    samples = true_motion(recording)
    assert samples.time[-1] == pytest.approx(truth.time[-1])
    states = integrate(first.position[0], first.velocity[0], first.attitude[0], samples)
    at = np.searchsorted(states.time, truth.time - 1e-6)
    off = relative_position(states.position[at], truth.position)
    # white noise of 3e-4 m/s/sqrt(s), integrated twice, of which the attitude's has a share
    sigma = 3e-4 * np.sqrt(truth.time**3 / 3.0)
    assert np.all(np.abs(off[:, :2]) < 0.1 + 6.0 * sigma[:, None])


def test_what_has_no_reference_figure():
    with pytest.raises(SpecError, match="recorded run"):
        oracle_run(load("car-kitti"), 0)
    with pytest.raises(ValueError, match="at least two runs, not 1"):
        ReferenceFigure.of("open-sea", [oracle_run(shortened("open-sea", 5.0), 0)])
