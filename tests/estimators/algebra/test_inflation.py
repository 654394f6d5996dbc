"""A wrong motion inflates what moves, keeps correlations, and spares the errors of the instruments."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.estimators.algebra.inflation import inflate_motion
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.models.kinematic import KinematicModel
from simnav.estimators.models.ship import ShipModel
from simnav.scenario import load
from simnav.source import record


@pytest.mark.parametrize(
    ("scenario", "model", "moving", "attitude"),
    [
        ("open-sea", InertialModel(), range(6), range(6, 9)),
        ("ship-straight", ShipModel(), (), ()),
        ("open-sea", KinematicModel(), range(6), ()),
    ],
    ids=["inertial", "ship", "kinematic"],
)
def test_what_is_doubted(scenario, model, moving, attitude):
    recording = record(load(scenario).with_values({"duration_s": 2.0}), 0)
    model.begin(recording.start, recording.instruments)
    root = np.random.default_rng(0).standard_normal((model.size, model.size))
    covariance = root @ root.T
    before, first = covariance.copy(), 3.0 * covariance.diagonal()
    inflate_motion(covariance, 100.0, first, model.moving)
    expected = np.ones(model.size)
    expected[list(moving)], expected[list(attitude)] = 100.0, 3.0
    np.testing.assert_allclose(covariance.diagonal() / before.diagonal(), expected)
    sigmas, old = np.sqrt(covariance.diagonal()), np.sqrt(before.diagonal())
    np.testing.assert_allclose(covariance / np.outer(sigmas, sigmas), before / np.outer(old, old), atol=1e-12)


def test_an_attitude_is_never_made_surer():
    recording = record(load("open-sea").with_values({"duration_s": 2.0}), 0)
    model = InertialModel()
    covariance = model.begin(recording.start, recording.instruments)
    first = covariance.diagonal().copy()
    covariance *= 4.0  # less certain than at the start
    inflate_motion(covariance, 10.0, first, model.moving)
    np.testing.assert_allclose(covariance.diagonal()[6:], 4.0 * first[6:])
