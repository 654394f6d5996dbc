"""Scores of an output that may be late: the error of the estimates of earlier times.

``horizontal_rmse_lag_10`` is the horizontal RMSE of the estimates that an estimator gives of the times 10 s before,
once 10 s more of measurements are known. A run with the parameter ``lags`` (`simnav.estimator.looking_back`) has them,
for each of its lags; any lag has a score, and its name ends in the seconds (``_lag_29``, ``_lag_0p5``). They are scores
of their own, beside those of the newest state, which are the same with and without ``lags``.

A lag of an estimate of measurement noise (``sigma_east_rmse_lag_10``) means: the sigma that is reported at t + 10 s is
compared with the true one at t. An estimate from a window of innovations describes the middle of the window and not
its end.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from simnav.geometry.earth import displace
from simnav.geometry.rotation import wrap_angle
from simnav.scoring.accuracy import rms
from simnav.scoring.navigation_error import horizontal, state_errors
from simnav.scoring.noise_estimation import sigma_errors
from simnav.scoring.registry import Score, ScoringInput, register_family
from simnav.trial import Trial
from simnav.types import Array, NavigationStates

__all__ = ["lagged_errors", "lags_in", "seconds_of"]

_PREFIX = "lagged."
_BETWEEN = "_lag_"
_TOLERANCE = 1e-6


def lags_in(trial: Trial) -> list[str]:
    """The lags of a trial, as the names of its diagnostics have them."""
    return [name.removeprefix(_PREFIX) for name in trial.diagnostics if name.startswith(_PREFIX)]


def seconds_of(lag: str) -> float:
    """The seconds of a lag as names have it; ValueError if it is none.

    >>> seconds_of("0p5")
    0.5
    """
    if not lag.replace("p", "", 1).isdecimal():
        raise ValueError(f"{lag!r} is no lag; it should be seconds, like 10 or 0p5")
    return float(lag.replace("p", "."))


def _later(trial: Trial, lag: str) -> int:
    """Number of steps of a lag; the number of epochs if the trial is shorter."""
    if len(trial) < 2:
        return len(trial)
    return min(round(seconds_of(lag) / float(np.median(np.diff(trial.time)))), len(trial))


def lagged_errors(scored: ScoringInput, lag: str) -> Array:
    """Errors of the estimates of earlier times.

    Parameters
    ----------
    scored : ScoringInput
        Of a run with this lag.
    lag : str
        The lag as names have it.

    Returns
    -------
    (n, 9) array
        Errors at the first n epochs of the run, like `simnav.scoring.errors`; NaN in components that are not known.
    """
    trial, steps = scored.trial, _later(scored.trial, lag)
    change = trial.diagnostics[f"{_PREFIX}{lag}"][steps:]
    n = len(change)
    position, offset = trial.position[:n].copy(), change[:, :3]
    flat = np.where(np.isfinite(offset), offset, 0.0)
    origin = np.where(np.isfinite(position), position, 0.0)
    moved = np.where(np.isfinite(position), displace(origin, flat), np.nan)
    states = NavigationStates(
        trial.time[:n], moved, trial.velocity[:n] + change[:, 3:6], wrap_angle(trial.attitude[:n] + change[:, 6:])
    )
    known = trial.estimated[:n] & np.isfinite(change)
    known[:, 6:] = trial.estimated[:n, 6:]
    return state_errors(states, scored.recording.data.truth[:n], known)


def _of_errors(measure: Callable[[Array], Array], factor: str, scored: ScoringInput) -> float:
    if f"{_PREFIX}{factor}" not in scored.trial.diagnostics:
        return float("nan")
    error = scored.shared(_Errors(factor))
    return rms(measure(error))


class _Errors:
    """`lagged_errors` of a lag, as a function that `ScoringInput.shared` can keep."""

    def __init__(self, lag: str):
        self.lag = lag

    def __call__(self, scored: ScoringInput) -> Array:
        return lagged_errors(scored, self.lag)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Errors) and other.lag == self.lag

    def __hash__(self) -> int:
        return hash((_Errors, self.lag))


def _of_sigmas(axis: str, lag: str, scored: ScoringInput) -> float:
    if f"{_PREFIX}{lag}" not in scored.trial.diagnostics:
        return float("nan")
    steps = _later(scored.trial, lag)
    parts = [sigma_errors(scored.trial, stream, axis, steps)[1] for stream in scored.recording.data.aids.values()]
    return rms(np.concatenate(parts)) if parts else float("nan")


def _component(column: int, error: Array) -> Array:
    return error[:, column]


def _position(error: Array) -> Array:
    return np.asarray(np.sqrt((error[:, :3] ** 2).sum(axis=1)))


#: Score of the newest state -> title of the score with a lag, unit, and function of (lag, input).
_KINDS: dict[str, tuple[str, str, Callable[[str, ScoringInput], float]]] = {
    "horizontal_rmse": ("Horizontal RMSE", "m", partial(_of_errors, horizontal)),
    "position_rmse": ("Position RMSE (3-D)", "m", partial(_of_errors, _position)),
    "sigma_north_rmse": ("Estimated sigma north, RMSE", "m", partial(_of_sigmas, "north")),
    "sigma_east_rmse": ("Estimated sigma east, RMSE", "m", partial(_of_sigmas, "east")),
}
for _axis, _name, _column, _unit in (
    ("north", "North RMSE", 0, "m"), ("east", "East RMSE", 1, "m"), ("vertical", "Vertical RMSE", 2, "m"),
    ("velocity_north", "North velocity RMSE", 3, "m/s"), ("velocity_east", "East velocity RMSE", 4, "m/s"),
    ("heading", "Heading RMSE", 8, "rad"),
):  # fmt: skip
    _KINDS[f"{_axis}_rmse"] = (_name, _unit, partial(_of_errors, partial(_component, _column)))


@register_family
class Lagged:
    """The scores with a lag."""

    @staticmethod
    def score(name: str) -> Score | None:
        """The score of a name; None if it is none of these."""
        base, between, lag = name.rpartition(_BETWEEN)
        if not between or base not in _KINDS:
            return None
        try:
            seconds = seconds_of(lag)
        except ValueError:
            return None
        title, unit, function = _KINDS[base]
        return Score(partial(function, lag), name, f"{title}, {seconds:g} s late", unit, "lower", False)

    @staticmethod
    def names(trial: Trial) -> Iterator[str]:
        """The names of those that apply to a trial."""
        for lag in lags_in(trial):
            for base in _KINDS:
                yield f"{base}{_BETWEEN}{lag}"
