"""A trial: one estimator run over one recording, step by step, with every failure caught and named.

The estimator sees copies, packet by packet: it can neither look ahead nor spoil the recording for the next one.
Its output is checked at every step; the first step that fails ends the trial, and all that came before is kept.

==================  ==================================================================================================
status              meaning
==================  ==================================================================================================
``ok``              every step gave a valid estimate
``error``           the estimator raised an exception
``invalid-output``  not an `Estimate`, wrong shape or time, NaN or infinity in an estimated component, a covariance that
                    is not symmetric or not positive semi-definite
``diverged``        finite, but horizontally more than `DIVERGENCE_LIMIT` from the truth
``out-of-memory``   the estimator raised MemoryError
``unsuitable``      an instrument is lacking that `Estimator.needs` names: no failure. To refuse a scenario that has all
                    of them (`UnsuitableScenario`) is an ``error``
==================  ==================================================================================================
"""

from __future__ import annotations

import copy
import inspect
import math
import time
import traceback
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simnav.estimator import Estimator, NeedsError, UnsuitableScenario, lacking
from simnav.recording import Recording
from simnav.types import COMPONENTS, Array, Estimate, ImuSamples, Measurements, NavigationStates

__all__ = ["DIVERGENCE_LIMIT", "Trial", "run_trial"]

#: Horizontal error [m] above which an estimate counts as diverged: no instrument of a vessel is of use that far off.
DIVERGENCE_LIMIT = 100e3

_TIME_TOLERANCE = 1e-6  # s; steps are multiples of the sample interval up to rounding
_ROUNDING = 1e-6  # of a correlation coefficient: asymmetry, and negative eigenvalues, up to this are rounding
_CHUNK = 1024  # covariances checked together
_EARTH_RADIUS = 6371e3
_ALL = np.ones(9, dtype=bool)
_PLACES = {"position": slice(0, 3), "velocity": slice(3, 6), "attitude": slice(6, 9)}  # in `COMPONENTS`


@dataclass(frozen=True, eq=False)
class Trial:
    """What an estimator gave on one recording, up to the end or to its failure: T epochs.

    Attributes
    ----------
    estimator : str
        Registered name, or the name of the class.
    status, reason : str
        See the module; ``reason`` is empty where the status is ``ok``.
    time : (T,) array
        Ends of the steps that were completed [s]: the first T of ``recording.data.truth.time``.
    position, velocity, attitude : (T, 3) array
        As in `Estimate`; NaN where a vector was not given.
    estimated : (T, 9) bool array
        Which of `COMPONENTS` were estimated.
    covariance : (T, 9, 9) array or None
        NaN at epochs without one; None where there was none at all or it was not kept.
    diagnostics : dict of str to (T, ...) array
        NaN at epochs without the diagnostic; arrays of changing length are padded with NaN.
    flagged : list of (instrument, time)
        Measurements that the estimator judged faulty.
    update_seconds : (T,) array
        Wall time of each update [s].
    smoothed : NavigationStates or None
        What ``smooth()`` returned: T states.
    reset_seconds, smooth_seconds : float
        Wall time of ``reset()`` and ``smooth()`` [s].
    """

    estimator: str
    status: str
    reason: str
    time: Array
    position: Array
    velocity: Array
    attitude: Array
    estimated: NDArray[np.bool_]
    covariance: Array | None
    diagnostics: dict[str, Array]
    flagged: list[tuple[str, float]]
    update_seconds: Array
    smoothed: NavigationStates | None = None
    reset_seconds: float = 0.0
    smooth_seconds: float = 0.0

    def __len__(self) -> int:
        return len(self.time)

    @property
    def failed(self) -> bool:
        """Whether the trial counts as a failure (an unsuitable scenario does not)."""
        return self.status not in ("ok", "unsuitable")


class _InvalidOutputError(Exception):
    """The estimator returned something that is no valid estimate."""


class _DivergedError(Exception):
    """The estimate is finite and useless."""


def run_trial(estimator: Estimator, recording: Recording, *, keep_covariance: bool = True) -> Trial:
    """Run an estimator over a recording.

    Parameters
    ----------
    estimator : Estimator
        If it is a reference, the recording is revealed to it first.
    recording : Recording
        Left as it is, whatever the estimator does to its input.
    keep_covariance : bool
        False saves 648 bytes an epoch; covariances are checked all the same.

    Returns
    -------
    Trial
        Never raises for what the estimator does; `KeyboardInterrupt` passes.
    """
    log = _Log(len(recording.data.truth.time), keep_covariance)
    status, reason = "ok", ""
    reset_seconds = smooth_seconds = 0.0
    smoothed = None
    where = "reset()"
    try:
        lack = lacking(estimator.needs, recording.instruments)
        if lack:
            return log.trial(estimator.name or type(estimator).__name__, "unsuitable", lack)
        if estimator.reference:
            estimator.reveal(recording)
        begun = time.perf_counter_ns()
        estimator.reset(copy.deepcopy(recording.start), copy.deepcopy(recording.instruments))
        reset_seconds = 1e-9 * (time.perf_counter_ns() - begun)
        truth = recording.data.truth.position
        for k, packet in enumerate(_private_steps(recording)):
            where = f"update() at {packet.time:g} s"
            begun = time.perf_counter_ns()
            estimate = estimator.update(packet)
            elapsed = 1e-9 * (time.perf_counter_ns() - begun)
            log.add(estimate, packet.time, elapsed, truth[k])
        log.check_covariances()
        where = "smooth()"
        begun = time.perf_counter_ns()
        smoothed = _checked_trajectory(estimator.smooth(), log)
        smooth_seconds = 1e-9 * (time.perf_counter_ns() - begun)
    except _DivergedError as e:
        status, reason = "diverged", f"{where}: {e}"
    except _InvalidOutputError as e:
        status, reason = "invalid-output", f"{where}: {e}"
    except MemoryError as e:
        status, reason = "out-of-memory", f"{where}: {_describe(e, estimator)}"
    except (Exception, SystemExit) as e:
        status, reason = "error", f"{where}: {_describe(e, estimator)}"
        if isinstance(e, UnsuitableScenario):
            reason = f"{where}: it refuses a scenario that has all instruments that its needs name ({e})"
        elif isinstance(e, NeedsError):
            reason = str(e)
    if status != "ok":
        try:
            log.check_covariances()
        except _InvalidOutputError as e:  # it came before the other failure
            status, reason = "invalid-output", f"update(): {e}"
    name = estimator.name or type(estimator).__name__
    trial = log.trial(name, status, reason)
    return replace(trial, smoothed=smoothed, reset_seconds=reset_seconds, smooth_seconds=smooth_seconds)


def _private_steps(recording: Recording) -> Iterator[Measurements]:
    """The packets of a recording, holding copies."""
    aids = {name: replace(s, value=s.value.copy()) for name, s in recording.data.aids.items()}
    for packet in replace(recording, data=replace(recording.data, aids=aids)).steps():
        imu = packet.imu
        if imu is not None:
            imu = ImuSamples(imu.time.copy(), imu.interval.copy(), imu.angular_rate.copy(), imu.specific_force.copy())
        yield Measurements(packet.start, packet.time, imu, packet.aids)


def _describe(error: BaseException, estimator: Estimator) -> str:
    """Type, message and place of an exception: the innermost line in the estimator's own file, else the innermost."""
    frames = traceback.extract_tb(error.__traceback__)[1:]
    try:
        own = Path(inspect.getfile(type(estimator))).name
    except (OSError, TypeError):
        own = ""
    inside = [f for f in frames if Path(f.filename).name == own] or list(frames)
    place = f" ({Path(inside[-1].filename).name}:{inside[-1].lineno} in {inside[-1].name})" if inside else ""
    message = " ".join(str(error).split())
    return f"{type(error).__name__}{': ' if message else ''}{message[:500]}{place}"


class _Log:
    """Checks the estimates and collects them; ``n`` of them are good."""

    def __init__(self, steps: int, keep_covariance: bool):
        self.n = 0
        self.time = np.full(steps, np.nan)
        self.vectors = {name: np.full((steps, 3), np.nan) for name in _PLACES}
        self.estimated = np.zeros((steps, 9), dtype=bool)
        self.seconds = np.full(steps, np.nan)
        self.diagnostics: dict[str, list[tuple[int, Array]]] = {}
        self.flags: list[tuple[int, str, float]] = []
        self.keep = keep_covariance
        self.covariance: Array | None = None
        self.chunk: list[tuple[int, Array]] = []
        self.steps = steps

    def add(self, estimate: object, end: float, seconds: float, truth: Array) -> None:
        """Take one estimate, or raise and leave the log as it was."""
        if not isinstance(estimate, Estimate):
            raise _InvalidOutputError(f"expected an Estimate, got {type(estimate).__name__}")
        stamp = _number(estimate.time, "time")
        if not abs(stamp - end) <= _TIME_TOLERANCE:
            raise _InvalidOutputError(f"time of the estimate is {stamp!r}, the step ends at {end!r}")
        vectors = {n: _array(getattr(estimate, n), n, (3,)) for n in self.vectors if getattr(estimate, n) is not None}
        if estimate.estimated is not None and np.shape(estimate.estimated) != (9,):
            raise _InvalidOutputError(f"estimated has shape {np.shape(estimate.estimated)}, expected (9,)")
        mask = _ALL if estimate.estimated is None and len(vectors) == 3 else estimate.mask()
        for name, vector in vectors.items():
            if not all(map(math.isfinite, vector.tolist())):
                wanted = mask[_PLACES[name]] if name != "attitude" else _attitude_given(mask[6:])
                if not np.isfinite(vector[wanted]).all():
                    raise _InvalidOutputError(f"{name} is not finite: {vector.tolist()}")
        covariance = None if estimate.covariance is None else _array(estimate.covariance, "covariance", (9, 9)).copy()
        if not isinstance(estimate.diagnostics, Mapping):
            raise _InvalidOutputError(f"diagnostics is a dict, not {type(estimate.diagnostics).__name__}")
        if not isinstance(estimate.flagged, Iterable):
            raise _InvalidOutputError(f"flagged is a list, not {type(estimate.flagged).__name__}")
        diagnostics = {str(n): _array(v, f"diagnostic {n!r}", None) for n, v in estimate.diagnostics.items()}
        for name, value in diagnostics.items():
            if name in self.diagnostics and self.diagnostics[name][0][1].ndim != value.ndim:
                raise _InvalidOutputError(f"diagnostic {name!r} changes its number of dimensions")
        flags = [_flag(f) for f in estimate.flagged]
        if mask[0] and mask[1]:
            distance = _distance(vectors["position"], truth)
            if distance > DIVERGENCE_LIMIT:  # never where the truth is not known
                raise _DivergedError(
                    f"horizontal error {distance / 1e3:.0f} km is above the limit of {DIVERGENCE_LIMIT / 1e3:.0f} km"
                )
        k = self.n
        self.n += 1
        self.time[k], self.seconds[k], self.estimated[k] = end, seconds, mask
        for name, vector in vectors.items():
            self.vectors[name][k] = vector
        for name, value in diagnostics.items():
            self.diagnostics.setdefault(name, []).append((k, value.copy()))
        self.flags += [(k, *f) for f in flags]
        if covariance is not None:
            self.chunk.append((k, covariance))
            if len(self.chunk) >= _CHUNK:
                self.check_covariances()

    def check_covariances(self) -> None:
        """Check those since the last call; at a bad one, forget all from its epoch on and raise."""
        if not self.chunk:
            return
        epochs = np.array([k for k, _ in self.chunk])
        p = np.stack([c for _, c in self.chunk])
        self.chunk = []
        known = self.estimated[epochs]
        p[~(known[:, :, None] & known[:, None, :])] = np.nan
        bad, why = _first_bad_covariance(p, known)
        if bad is not None:
            self.n = int(epochs[bad])
            epochs, p = epochs[:bad], p[:bad]
        if self.keep:
            if self.covariance is None:
                self.covariance = np.full((self.steps, 9, 9), np.nan)
            self.covariance[epochs] = p
        if bad is not None:
            raise _InvalidOutputError(f"at {self.time[self.n]:g} s the covariance {why}")

    def trial(self, estimator: str, status: str, reason: str) -> Trial:
        n = self.n
        diagnostics = {}
        for name, items in self.diagnostics.items():
            kept = [(k, v) for k, v in items if k < n]
            if kept:
                shape = [max(sizes) for sizes in zip(*(v.shape for _, v in kept), strict=True)]
                diagnostics[name] = np.full((n, *shape), np.nan)
                for k, v in kept:
                    diagnostics[name][k, ...][tuple(slice(s) for s in v.shape)] = v
        return Trial(
            estimator=estimator,
            status=status,
            reason=reason,
            time=self.time[:n],
            position=self.vectors["position"][:n],
            velocity=self.vectors["velocity"][:n],
            attitude=self.vectors["attitude"][:n],
            estimated=self.estimated[:n],
            covariance=None if self.covariance is None else self.covariance[:n],
            diagnostics=diagnostics,
            flagged=[(name, t) for k, name, t in self.flags if k < n],
            update_seconds=self.seconds[:n],
        )


def _attitude_given(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which of roll, pitch, yaw the estimated components (north, east, down) of the attitude error need."""
    level = bool(mask[0] or mask[1])
    return np.array([level, level, bool(mask[2])])


def _number(value: Any, name: str) -> float:
    try:
        return float(value)
    except (TypeError, ValueError):
        raise _InvalidOutputError(f"{name} is not a number: {value!r}") from None


def _array(value: Any, name: str, shape: tuple[int, ...] | None) -> Array:
    try:
        if np.iscomplexobj(value):  # conversion would drop the imaginary part
            raise TypeError
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise _InvalidOutputError(f"{name} is not an array of real numbers: {type(value).__name__}") from None
    if shape is not None and array.shape != shape:
        raise _InvalidOutputError(f"{name} has shape {array.shape}, expected {shape}")
    return array


def _flag(item: Any) -> tuple[str, float]:
    try:
        instrument, when = item
    except (TypeError, ValueError):
        instrument = when = None
    if not isinstance(instrument, str):
        raise _InvalidOutputError(f"flagged holds pairs (instrument, time), not {item!r}")
    return instrument, _number(when, "time of a flagged measurement")


def _distance(position: Array, truth: Array) -> float:
    """Rough horizontal distance [m], on a sphere: it only has to tell 100 km from less."""
    north = float(position[0] - truth[0])
    east = math.remainder(float(position[1] - truth[1]), 2.0 * math.pi) * math.cos(float(truth[0]))
    return _EARTH_RADIUS * math.hypot(north, east)


def _first_bad_covariance(p: Array, estimated: NDArray[np.bool_]) -> tuple[int | None, str]:
    """Index of the first covariance that is not finite, symmetric and positive semi-definite, and why."""
    variance = np.diagonal(p, axis1=1, axis2=2)
    unknown = ~(estimated[:, :, None] & estimated[:, None, :])
    infinite: NDArray[np.bool_] = ~np.all(np.isfinite(p) | unknown, axis=(1, 2))
    negative: NDArray[np.bool_] = np.any(variance < 0.0, axis=1)
    sigma = np.sqrt(np.where(variance > 0.0, variance, 1.0))
    p = np.where(unknown | infinite[:, None, None], 0.0, p) / sigma[:, :, None] / sigma[:, None, :]
    asymmetric: NDArray[np.bool_] = np.any(np.abs(p - p.swapaxes(1, 2)) > _ROUNDING, axis=(1, 2))
    p = 0.5 * (p + p.swapaxes(1, 2))
    try:  # much faster than eigenvalues, and enough where all is well
        np.linalg.cholesky(p + _ROUNDING * np.eye(9))
        indefinite = np.zeros(len(p), dtype=bool)
    except np.linalg.LinAlgError:
        indefinite = np.linalg.eigvalsh(p)[:, 0] < -_ROUNDING
    bad: NDArray[np.intp] = np.flatnonzero(infinite | negative | asymmetric | indefinite)
    if len(bad) == 0:
        return None, ""
    k = int(bad[0])
    if infinite[k]:
        return k, "is not finite"
    if negative[k]:
        j = int(np.nanargmin(variance[k]))
        return k, f"has a negative variance of {COMPONENTS[j]}: {variance[k, j]:g}"
    return k, "is not symmetric" if asymmetric[k] else "is not positive semi-definite"


def _checked_trajectory(states: object, log: _Log) -> NavigationStates | None:
    """The smoothed trajectory, copied, or None; raises where it does not fit the run."""
    if states is None:
        return None
    if not isinstance(states, NavigationStates):
        raise _InvalidOutputError(f"expected NavigationStates or None, got {type(states).__name__}")
    n = log.n
    times = _array(states.time, "time", (n,)).copy()
    if not (np.abs(times - log.time[:n]) <= _TIME_TOLERANCE).all():
        raise _InvalidOutputError("the times are not the ends of the steps")
    vectors = {name: _array(getattr(states, name), name, (n, 3)).copy() for name in log.vectors}
    given: NDArray[np.bool_] = np.any(log.estimated[:n], axis=0)
    for name, vector in vectors.items():
        wanted = given[_PLACES[name]] if name != "attitude" else _attitude_given(given[6:])
        if not np.isfinite(vector[:, wanted]).all():
            raise _InvalidOutputError(f"{name} is not finite")
    return NavigationStates(times, **vectors)
