"""Errors of a trajectory as programs for odometry report them: absolute, after an alignment, and relative.

The absolute error is that of the position in three dimensions; in two where the height is not estimated. The alignment
is the rotation and translation, without a scale, that make it least. The relative error is the difference between the
estimated and the true motion over a time or a distance, over all pairs of epochs. With an attitude a motion is resolved
in the body axes at its begin, so an error of the heading at the begin does not count; without one it is resolved in
the axes of the start, and counts.

Sources: S. Umeyama, *Least-squares estimation of transformation parameters between two point patterns*, IEEE
Transactions on Pattern Analysis and Machine Intelligence 13(4), 1991, equations 40 to 43; J. Sturm et al., *A benchmark
for the evaluation of RGB-D SLAM systems*, IROS 2012, equations 1 to 3 (over times); A. Geiger, P. Lenz and R. Urtasun,
*Are we ready for autonomous driving? The KITTI vision benchmark suite*, CVPR 2012 (over distances).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from simnav.geometry.local import local_of_geodetic, turn_to_origin
from simnav.geometry.rotation import dcm_from_rpy
from simnav.recording import Recording
from simnav.trial import Trial
from simnav.types import Array

__all__ = ["DISTANCES", "TIMES", "RelativeError", "TrajectoryErrors", "alignment", "trajectory_errors"]

#: Over which times [s] and distances [m] relative errors are computed, unless told otherwise.
TIMES, DISTANCES = (10.0, 60.0, 300.0), (100.0, 1000.0, 5000.0)
_TOLERANCE = 1e-6


@dataclass(frozen=True)
class RelativeError:
    """Relative error over one time or distance.

    Attributes
    ----------
    span : float
        The time [s] or the distance along the true track [m].
    pairs : int
        Number of pairs of epochs: each epoch with the first one that is at least so far behind it.
    translation : float
        Root mean square of the length of the difference [m]; NaN without pairs.
    rotation : float
        Root mean square of its angle [rad]; NaN without an attitude.
    """

    span: float
    pairs: int
    translation: float
    rotation: float


@dataclass(frozen=True)
class TrajectoryErrors:
    """Errors of a trajectory.

    Attributes
    ----------
    dimensions : int
        3, or 2 where the height is not estimated.
    absolute, aligned : float
        Root mean square of the position error as it is, and after the alignment [m].
    turn : float
        Angle of the rotation of the alignment [rad].
    over_times, over_distances : tuple of RelativeError
        Relative errors.
    """

    dimensions: int
    absolute: float
    aligned: float
    turn: float
    over_times: tuple[RelativeError, ...]
    over_distances: tuple[RelativeError, ...]


def alignment(estimate: Array, truth: Array) -> tuple[Array, Array]:
    """The rotation R (d, d) and translation t (d,) for which the sum of squares of R x + t - y is least.

    Parameters
    ----------
    estimate, truth : (n, d) array
        Points x and y.
    """
    x, y = estimate.mean(axis=0), truth.mean(axis=0)
    u, _, vt = np.linalg.svd((truth - y).T @ (estimate - x))
    signs = np.ones(len(x))
    signs[-1] = np.sign(np.linalg.det(u) * np.linalg.det(vt))
    rotation = (u * signs) @ vt
    return rotation, y - rotation @ x


def trajectory_errors(
    trial: Trial, recording: Recording, times: Sequence[float] = TIMES, distances: Sequence[float] = DISTANCES
) -> TrajectoryErrors | None:
    """Compare the estimates of a run with its truth.

    Parameters
    ----------
    trial : Trial
        The estimates.
    recording : Recording
        The run.
    times, distances : sequence of float
        Of the relative errors [s], [m].

    Returns
    -------
    TrajectoryErrors or None
        None where fewer than three epochs have an estimated and a true position.
    """
    n, origin = len(trial), recording.start.position
    states = recording.data.truth
    d = 3 if trial.estimated[:, 2].all() else 2
    known = np.isfinite(states.position[:n]).all(axis=1) & np.isfinite(trial.position[:, :d]).all(axis=1)
    known &= trial.estimated[:, :2].all(axis=1)
    if known.sum() < 3:
        return None
    time, place = trial.time[known], states.position[:n][known]
    guess = trial.position[known]
    if d == 2:  # the height does not count
        guess = np.column_stack([guess[:, :2], place[:, 2]])
    truth, estimate = local_of_geodetic(place, origin), local_of_geodetic(guess, origin)
    turns = None
    angles = states.attitude[:n][known], trial.attitude[known]
    if d == 3 and trial.estimated[known, 6:].all() and all(np.isfinite(a).all() for a in angles):
        turns = (
            turn_to_origin(place, origin) @ dcm_from_rpy(angles[0]),
            turn_to_origin(guess, origin) @ dcm_from_rpy(angles[1]),
        )
    rotation, moved = alignment(estimate[:, :d], truth[:, :d])
    aligned = estimate[:, :d] @ rotation.T + moved
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(truth, axis=0), axis=1))])
    return TrajectoryErrors(
        d,
        _rms(estimate[:, :d] - truth[:, :d]),
        _rms(aligned - truth[:, :d]),
        _angle(rotation[None])[0] if d == 3 else abs(math.atan2(rotation[1, 0], rotation[0, 0])),
        tuple(_relative(span, time, truth[:, :d], estimate[:, :d], turns) for span in times),
        tuple(_relative(span, along, truth[:, :d], estimate[:, :d], turns) for span in distances),
    )


def _relative(
    span: float, passed: Array, truth: Array, estimate: Array, turns: tuple[Array, Array] | None
) -> RelativeError:
    """The error over a span of what has passed (time or distance)."""
    first: NDArray[np.int64] = np.arange(len(passed))
    last = np.searchsorted(passed, passed + span - _TOLERANCE)
    first, last = first[last < len(passed)], last[last < len(passed)]
    if not len(first):
        return RelativeError(span, 0, math.nan, math.nan)
    motions = truth[last] - truth[first], estimate[last] - estimate[first]
    if turns is None:
        return RelativeError(span, len(first), _rms(motions[1] - motions[0]), math.nan)
    inside = [np.einsum("nji,nj->ni", turn[first], motion) for turn, motion in zip(turns, motions, strict=True)]
    changes = [np.swapaxes(turn[first], -1, -2) @ turn[last] for turn in turns]
    angles = _angle(np.swapaxes(changes[0], -1, -2) @ changes[1])
    return RelativeError(span, len(first), _rms(inside[1] - inside[0]), float(np.sqrt(np.mean(angles**2))))


def _rms(difference: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(difference**2, axis=1))))


def _angle(rotations: Array) -> Array:
    """(n,) angles of (n, 3, 3) rotations [rad], also of small ones: from both the sine and the cosine."""
    r = rotations
    axis = np.stack([r[:, 2, 1] - r[:, 1, 2], r[:, 0, 2] - r[:, 2, 0], r[:, 1, 0] - r[:, 0, 1]], axis=-1)
    return np.asarray(np.arctan2(0.5 * np.linalg.norm(axis, axis=1), 0.5 * (np.trace(r, axis1=1, axis2=2) - 1.0)))
