"""Navigation errors: estimate minus truth, resolved in the local north-east-down frame of the truth."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from simnav.geometry.earth import relative_position
from simnav.geometry.rotation import dcm_from_rpy, rotation_vector_from_dcm
from simnav.recording import Recording
from simnav.trial import Trial
from simnav.types import Array, NavigationStates

__all__ = ["attitude_error", "errors", "held_errors", "horizontal", "smoothed_errors", "state_errors"]


def errors(trial: Trial, recording: Recording) -> Array:
    """Errors of a trial at its epochs.

    Parameters
    ----------
    trial : Trial
        The estimates.
    recording : Recording
        The recording of the trial, with the truth.

    Returns
    -------
    (T, 9) array
        Errors in the order of `simnav.types.COMPONENTS` [m, m/s, rad]; NaN if a component was not estimated, or if the
        reference of a real log does not hold it.

    Raises
    ------
    ValueError
        If the trial's times are not those of the recording.
    """
    truth = recording.data.truth[: len(trial)]
    if len(truth) != len(trial) or not np.allclose(truth.time, trial.time, rtol=0.0, atol=1e-6):
        raise ValueError(f"the trial of {trial.estimator} was not run on this recording of {recording.scenario}")
    states = NavigationStates(trial.time, trial.position, trial.velocity, trial.attitude)
    return state_errors(states, truth, trial.estimated)


def held_errors(trial: Trial, recording: Recording) -> Array:
    """Errors like `errors`; but at an epoch without a position, the error of the last position before it.

    So an estimator gains nothing if it gives no position in difficult situations. Before the first position, the
    initial position is used. Horizontal position and height are held separately, and only if the estimator gives them
    at any epoch.
    """
    states = NavigationStates(trial.time, trial.position, trial.velocity, trial.attitude)
    states, estimated = _held(states, trial.estimated, recording.start.position)
    return state_errors(states, recording.data.truth[: len(trial)], estimated)


def _held(
    states: NavigationStates, estimated: NDArray[np.bool_], start: Array
) -> tuple[NavigationStates, NDArray[np.bool_]]:
    """States without gaps in the position, and the mask of the components that are estimated."""
    position, estimated = states.position.copy(), estimated.copy()
    for part in (slice(0, 2), slice(2, 3)):
        known: NDArray[np.bool_] = np.asarray((estimated[:, part] & np.isfinite(position[:, part])).all(axis=1))
        if not known.any() or known.all():
            continue
        last = np.maximum.accumulate(np.where(known, np.arange(len(position)), -1))
        position[:, part] = np.where((last >= 0)[:, None], position[last, part], start[part])
        estimated[:, part] = True
    return NavigationStates(states.time, position, states.velocity, states.attitude), estimated


def smoothed_errors(trial: Trial, recording: Recording) -> Array | None:
    """Errors of the smoothed trajectory, like `held_errors`; None if the estimator does not smooth."""
    if trial.smoothed is None:
        return None
    known: NDArray[np.bool_] = np.any(trial.estimated, axis=0)
    if not known.any():  # the estimator only smooths
        known = np.ones(9, dtype=bool)
    states, estimated = _held(trial.smoothed, np.broadcast_to(known, trial.estimated.shape), recording.start.position)
    return state_errors(states, recording.data.truth[: len(trial)], estimated)


def state_errors(states: NavigationStates, truth: NavigationStates, estimated: NDArray[np.bool_]) -> Array:
    """Errors of n states.

    Parameters
    ----------
    states, truth : NavigationStates
        Estimated and true states at the same n times.
    estimated : (n, 9) bool array
        The components that ``states`` holds.

    Returns
    -------
    (n, 9) array
        Position error north, east, down, with the WGS-84 radii at the truth [m]; velocity error [m/s]; attitude error
        as in `attitude_error` [rad].
    """
    origin = truth.position.copy()
    origin[:, 2] = np.where(np.isfinite(origin[:, 2]), origin[:, 2], 0.0)  # a reference without height
    position = relative_position(states.position, origin)
    position[:, 2] = truth.position[:, 2] - states.position[:, 2]
    velocity = states.velocity - truth.velocity
    attitude = attitude_error(states.attitude, truth.attitude, estimated[:, 6:])
    error = np.concatenate([position, velocity, attitude], axis=1)
    return np.where(estimated & np.isfinite(error), error, np.nan)


def attitude_error(attitude: Array, truth: Array, estimated: NDArray[np.bool_] | None = None) -> Array:
    """Rotation vector of C_est C_true^T, in north-east-down axes, exact up to pi.

    Parameters
    ----------
    attitude, truth : (n, 3) array
        Roll, pitch, yaw [rad].
    estimated : (n, 3) bool array, optional
        Components (north, east, down) that are estimated; all by default.

    Returns
    -------
    (n, 3) array
        Rotation vectors [rad]. If only the heading is estimated or known, roll and pitch are assumed to be equal, so
        the result is the difference of the headings. If only roll and pitch are, the headings are assumed to be equal.
    """
    attitude, truth = np.asarray(attitude, dtype=np.float64), np.asarray(truth, dtype=np.float64)
    if estimated is None:
        estimated = np.ones(attitude.shape, dtype=bool)
    known = np.isfinite(attitude) & np.isfinite(truth)
    level = estimated[:, :2].any(axis=1) & known[:, :2].all(axis=1)
    heading = estimated[:, 2] & known[:, 2]
    both = np.stack([level, level, heading], axis=1)
    common = np.where(np.isfinite(truth), truth, 0.0)
    vector = rotation_vector_from_dcm(
        dcm_from_rpy(np.where(both, attitude, common)) @ dcm_from_rpy(common).swapaxes(-1, -2)
    )
    return np.where(both & estimated, vector, np.nan)


def horizontal(error: Array) -> Array:
    """Length of the horizontal position error [m]: (n, 9) -> (n,)."""
    return np.hypot(error[:, 0], error[:, 1])
