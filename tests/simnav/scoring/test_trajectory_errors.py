"""Aligned and relative errors of trajectories: against evo, and against closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from simnav.estimator import make
from simnav.geometry.local import geodetic_of_local, local_of_geodetic, turn_to_origin
from simnav.geometry.rotation import dcm_from_rotation_vector, dcm_from_rpy, quaternion_from_dcm, rpy_from_dcm
from simnav.scenario import load
from simnav.scoring.trajectory_errors import alignment, trajectory_errors
from simnav.source import record
from simnav.trial import run_trial

EPOCHS = 200


@pytest.fixture(scope="module")
def recording():
    return record(load("harbour-multipath").model_copy(update={"duration": float(EPOCHS)}), 3)


@pytest.fixture
def disturbed(recording):
    """The truth turned by 2 degrees about a slanted axis, moved by 8 m, and with noise, as a trial."""
    rng = np.random.default_rng(4)
    truth, origin = recording.data.truth, recording.start.position
    turn = dcm_from_rotation_vector(np.radians(2.0) * np.array([0.36, -0.48, 0.8]))
    local = local_of_geodetic(truth.position, origin) @ turn.T + [5.0, -6.0, 2.0] + rng.normal(0.0, 0.5, (EPOCHS, 3))
    position = geodetic_of_local(local, origin)
    body = turn @ turn_to_origin(truth.position, origin) @ dcm_from_rpy(truth.attitude)
    body = body @ np.stack([dcm_from_rotation_vector(r) for r in rng.normal(0.0, 0.01, (EPOCHS, 3))])
    attitude = rpy_from_dcm(np.swapaxes(turn_to_origin(position, origin), -1, -2) @ body)
    trial = run_trial(make("dead-reckoning"), recording)
    return replace(trial, position=position, attitude=attitude, estimated=np.ones((EPOCHS, 9), dtype=bool))


def test_they_are_those_of_evo(recording, disturbed):
    """M. Grupp, evo: Python package for the evaluation of odometry and SLAM."""
    trajectory = pytest.importorskip("evo.core.trajectory")
    from evo.core import metrics

    origin = recording.start.position

    def of(states):
        turns = turn_to_origin(states.position, origin) @ dcm_from_rpy(states.attitude)
        return trajectory.PoseTrajectory3D(local_of_geodetic(states.position, origin), quaternion_from_dcm(turns),
                                           np.arange(EPOCHS, dtype=np.float64))  # fmt: skip

    def value(metric, pair):
        metric.process_data(pair)
        return metric.get_statistic(metrics.StatisticsType.rmse)

    truth, estimate = of(recording.data.truth), of(disturbed)
    ours = trajectory_errors(disturbed, recording, times=(10.0, 60.0), distances=())
    assert ours.dimensions == 3
    assert value(metrics.APE(metrics.PoseRelation.translation_part), (truth, estimate)) == pytest.approx(ours.absolute)
    for relative in ours.over_times:
        delta = int(relative.span)
        for relation, mine in (("translation_part", relative.translation), ("rotation_angle_rad", relative.rotation)):
            metric = metrics.RPE(metrics.PoseRelation[relation], delta, metrics.Unit.frames, all_pairs=True)
            assert value(metric, (truth, estimate)) == pytest.approx(mine, rel=1e-6)
    estimate.align(truth)
    aligned = value(metrics.APE(metrics.PoseRelation.translation_part), (truth, estimate))
    assert aligned == pytest.approx(ours.aligned, rel=1e-9)
    assert ours.aligned < 1.0 < ours.absolute
    assert np.degrees(ours.turn) == pytest.approx(2.0, abs=0.2)


def test_over_distances_a_wrong_heading_is_a_share_of_the_way(recording, disturbed):
    """Positions turned by an angle about the vertical, without an attitude: 2 sin(angle / 2) of the distance."""
    truth, origin, angle = recording.data.truth, recording.start.position, np.radians(3.0)
    turn = dcm_from_rotation_vector(np.array([0.0, 0.0, angle]))
    straight = np.outer(2.0 * np.arange(1.0, EPOCHS + 1), [1.0, 0.0, 0.0])
    states = replace(truth, position=geodetic_of_local(straight, origin))
    there = replace(recording, data=replace(recording.data, truth=states))
    estimated = np.arange(9) < 2
    turned = replace(disturbed, position=geodetic_of_local(straight @ turn.T, origin),
                     estimated=np.tile(estimated, (EPOCHS, 1)))  # fmt: skip
    found = trajectory_errors(turned, there, times=(1e6,), distances=(50.0, 200.0))
    assert found.dimensions == 2
    for relative in found.over_distances:
        assert relative.translation == pytest.approx(relative.span * 2.0 * np.sin(0.5 * angle), rel=1e-6)
        assert relative.pairs == EPOCHS - relative.span / 2.0
        assert np.isnan(relative.rotation)
    assert (found.over_times[0].pairs, np.isnan(found.over_times[0].translation)) == (0, True)
    assert found.aligned < 1e-3
    assert found.turn == pytest.approx(angle, rel=1e-6)


def test_an_alignment_is_no_mirror():
    points = np.random.default_rng(1).normal(size=(20, 3))
    rotation, moved = alignment(points * [1.0, 1.0, -1.0], points)
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    assert np.abs(moved).max() < 1.0


def test_two_epochs_tell_nothing(recording, disturbed):
    estimated = disturbed.estimated.copy()
    estimated[2:] = False
    assert trajectory_errors(replace(disturbed, estimated=estimated), recording) is None
