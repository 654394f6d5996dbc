"""The reference figure: the oracle is consistent and attains its bound, with an IMU and without."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.estimators.models.true_motion import true_motion
from simnav.estimators.reference import reference_figure
from simnav.geometry.earth import relative_position
from simnav.scenario import Scenario, load
from simnav.simulator import simulate
from simnav.spec import SpecError
from simnav.strapdown import integrate


def shortened(name: str, duration: float) -> Scenario:
    return load(name).model_copy(update={"duration": duration})


@pytest.mark.parametrize("name", ["ship-straight", "ship-turn", "gnss-noise-step"])
def test_the_oracle_is_right(name: str):
    """Within three standard errors of the limits of ``python -m tests.agreement.reference``."""
    found = reference_figure(shortened(name, 200.0), range(24), 4)
    assert found.runs == 24
    assert found.ratio_standard_error < 0.1
    assert found.nees_standard_error < 0.2
    assert 0.97 - 3.0 * found.ratio_standard_error < found.ratio < 1.08 + 3.0 * found.ratio_standard_error
    assert 0.95 - 3.0 * found.nees_standard_error < found.nees < 1.05 + 3.0 * found.nees_standard_error


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
        reference_figure(load("car-kitti"), range(2))
    with pytest.raises(ValueError, match="at least two runs, not 1"):
        reference_figure(load("open-sea"), [0])
