"""Estimates of earlier times: the parameter ``lags``, which every estimator has.

A window and a smoother know the past better than the present. With ``lags=5/10/30`` an estimator gives, at each step,
its estimates of the times 5, 10 and 30 s before the end of the step, too: ``sw-fgo:window=31,lags=5/10/30``. They
follow from the measurements up to the end of the step, so nothing is known before it is measured. An estimator that
does not look back (`Estimator.earlier` returns None) repeats the estimate that it gave at that time.

An estimate of an earlier time is recorded as its difference from the estimate that was given at that time, in the
diagnostic ``lagged.LAG``: north, east, down [m]; velocity north-east-down [m/s]; roll, pitch, yaw [rad]. So kept
trials, which are in single precision, hold it exactly enough. `simnav.scoring.lagged` has the scores. The estimate at
the end of the step, and all its scores, are as without ``lags``.
"""

from __future__ import annotations

import math
import re
from collections import deque
from collections.abc import Collection, Sequence
from typing import Any

import numpy as np

from simnav.estimator.contract import Estimator, EstimatorError
from simnav.estimator.needs import Needs
from simnav.geometry.earth import relative_position
from simnav.geometry.rotation import wrap_angle
from simnav.types import Array, Estimate, InitialState, Instruments, Measurements, NavigationStates

__all__ = ["LAGS", "LookingBack", "inner_of", "lag_text", "lags_of"]

#: Name of the parameter.
LAGS = "lags"
#: Prefix of the diagnostics; the lag in seconds follows.
PREFIX = "lagged."

_LONGEST = 3600.0  # s; each second takes memory
_TOLERANCE = 1e-6


def lags_of(value: Any) -> tuple[float, ...]:
    """The lags of a parameter ``lags`` [s], ascending, each once.

    Parameters
    ----------
    value : str, float or sequence of float
        A text has them with a slash or a comma between.

    Raises
    ------
    EstimatorError
        If they are not times from 0 to 3600 s; one sentence.

    Examples
    --------
    >>> lags_of("10/5/29.5"), lags_of(10)
    ((5.0, 10.0, 29.5), (10.0,))
    """
    parts = re.split("[/,]", value) if isinstance(value, str) else [value] if isinstance(value, (int, float)) else value
    try:
        found = sorted({float(part) for part in parts})
    except (TypeError, ValueError):
        found = []
    if not found or not all(0.0 <= lag <= _LONGEST for lag in found):
        raise EstimatorError(f"lags = {value!r} should be times from 0 to {_LONGEST:g} s, like lags=5/10/30")
    return tuple(found)


def lag_text(lag: float) -> str:
    """A lag as names of diagnostics and scores have it.

    >>> lag_text(10.0), lag_text(0.5)
    ('10', '0p5')
    """
    return f"{lag:.6g}".replace(".", "p")


class LookingBack(Estimator):
    """An estimator that also gives its estimates of earlier times.

    Parameters
    ----------
    inner : Estimator
        The estimator.
    lags : sequence of float
        How long ago these times are [s]: multiples of the step of the run.

    Attributes
    ----------
    inner : Estimator
        The estimator.
    lags : tuple of float
        As given.
    """

    def __init__(self, inner: Estimator, lags: Sequence[float]):
        self.inner, self.lags = inner, tuple(lags)

    @property
    def needs(self) -> Needs:
        """What the estimator needs."""
        return self.inner.needs

    def observes(self, instruments: Instruments) -> Collection[str] | None:
        """What the estimator uses."""
        return self.inner.observes(instruments)

    @property
    def learned_from(self) -> Sequence[tuple[int, int]]:
        """What the estimator learned from."""
        return self.inner.learned_from

    def require(self, instruments: Instruments) -> None:
        """Refuse lags that a run with these instruments cannot have.

        Raises
        ------
        ValueError
            If a lag is no multiple of the step, or longer than the estimator can look back; one sentence.
        """
        step = instruments.step
        for lag in self.lags:
            if not math.isclose(lag, round(lag / step) * step, abs_tol=_TOLERANCE):
                raise ValueError(f"a lag of {lag:g} s is no multiple of the step of {step:g} s")
        reach = self.inner.longest_lag(instruments)
        if self.lags[-1] > reach + _TOLERANCE:
            raise ValueError(
                f"a lag of {self.lags[-1]:g} s is longer than the window, which holds the last {reach:g} s: "
                "set 'window' to more epochs"
            )

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Start a run; ValueError as of `require`."""
        self.require(instruments)
        self._steps = [round(lag / instruments.step) for lag in self.lags]
        self._given: deque[Array] = deque(maxlen=max(self._steps) + 1)
        self._names = [f"{PREFIX}{lag_text(lag)}" for lag in self.lags]
        self.inner.reset(start, instruments)

    def update(self, measurements: Measurements) -> Estimate:
        """Process one step; the estimates of earlier times are diagnostics."""
        given: Any = self.inner.update(measurements)
        if not isinstance(given, Estimate):
            return given  # type: ignore[no-any-return]  # whoever reads the answer refuses it
        estimate = given
        vectors = (estimate.position, estimate.velocity, estimate.attitude)
        self._given.append(np.concatenate([np.full(3, np.nan) if v is None else v for v in vectors]))
        found = self.inner.earlier(self.lags)
        later = {}
        for row, (name, count) in enumerate(zip(self._names, self._steps, strict=True)):
            then = self._given[-1 - count] if count < len(self._given) else None
            if then is None:
                later[name] = np.full(9, np.nan)
            elif found is None or count == 0:
                later[name] = np.where(np.isfinite(then), 0.0, np.nan)
            else:
                later[name] = _difference(found[row], then)
        estimate.diagnostics = {**estimate.diagnostics, **later}
        return estimate

    def smooth(self) -> NavigationStates | None:
        """The smoothed trajectory of the estimator."""
        return self.inner.smooth()

    def reveal(self, recording: Any) -> None:
        """Pass the truth to a reference."""
        self.inner.reveal(recording)

    def __getattribute__(self, name: str) -> Any:
        if name in ("name", "reference", "slow", "version"):  # they are the class's in Estimator
            return getattr(object.__getattribute__(self, "inner"), name)
        return object.__getattribute__(self, name)

    def __getattr__(self, name: str) -> Any:
        if name == "inner" or name.startswith("__"):
            raise AttributeError(name)
        return getattr(self.inner, name)


def inner_of(estimator: Estimator) -> Estimator:
    """The estimator itself, without what looks back for it."""
    return estimator.inner if isinstance(estimator, LookingBack) else estimator


def _difference(now: Array, then: Array) -> Array:
    """One state minus another, (9,): north-east-down [m], velocities [m/s], roll, pitch, yaw [rad]."""
    position = relative_position(now[:3], np.where(np.isfinite(then[:3]), then[:3], 0.0))
    if not math.isfinite(now[2]):
        position[2] = np.nan
    return np.concatenate([position, now[3:6] - then[3:6], wrap_angle(now[6:] - then[6:])])
