"""Delays, lever arms, mounting and noise of the instruments of a log, by comparison with its reference.

For each instrument the difference from the reference is minimised over its delay; for each delay the lever arm (or the
constant offset, and the scale of a speed) follows by least squares, with less weight on outliers. The sigma of a result
is that of the least-squares fit, with the scatter of the residuals; that of the delay comes from the curvature of the
sum of squares. Residuals of an instrument are correlated, so that its sigmas are rather too small.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from simnav.geometry.earth import relative_position
from simnav.geometry.rotation import dcm_from_rpy, skew, wrap_angle
from simnav.kinds import BODY_VELOCITY, DEPTH, HEADING, HORIZONTAL_POSITION, POSITION, VELOCITY, WATER_SPEED
from simnav.log.channel import Series, list_recordings, read_channel
from simnav.log.imu_alignment import imu_alignment
from simnav.log.imu_series import ImuSeries, read_imu
from simnav.log.likelihood import effective_samples
from simnav.log.readings import ProbableReading, probable_readings
from simnav.log.source import LogSource
from simnav.types import KINDS, Array, NavigationStates

if TYPE_CHECKING:
    from simnav.scenario import Scenario

__all__ = ["Alignment", "align"]

#: Delays that are tried: so many seconds either way, first in coarse, then in fine steps.
_WIDEST, _COARSE, _FINE = 5.0, 0.25, 0.02
#: An instrument is compared at most at so many of its times.
_MOST = 4000
#: Fewer common times say nothing.
_LEAST = 20
#: A lever arm is only found where the vessel turns: below this standard error [m].
_KNOWN = 2.0
_NORMAL = 1.4826
#: A mounting [rad] or a lever arm of a DVL [m] that is larger is probably none.
_STEEP, _LONG = np.radians(10.0), 5.0
#: A scale is found where speeds differ by this part of the largest.
_SPREAD = 0.3
#: A delay is another one than none if the sum of squares falls by this multiple of the variance of a residual.
_SIGNIFICANT = 16.0


@dataclass(frozen=True)
class Alignment:
    """What the comparison of one instrument with the reference says.

    Attributes
    ----------
    recording, instrument : str
        What was compared.
    rows : int
        Number of readings.
    delay, delay_sigma : float
        By how much the instrument is late, relative to the scenario as it is [s]; NaN where the motion does not tell.
    parameters : mapping of str to (float, float)
        Further results by name, with sigma: ``lever_arm_x`` [m], ``offset`` (in the unit of the component), ``scale``.
    residual : mapping of str to float
        Robust standard deviation of what is left, by component [m, m/s, rad].
    datasheet : mapping of str to float
        The sigma of the scenario, likewise.
    remark : str
        What could not be found.
    curve : tuple of (float, float)
        Delays that were tried [s], and the mean square of what is left with each, over its smallest value.
    """

    recording: str
    instrument: str
    rows: int
    delay: float
    delay_sigma: float
    parameters: dict[str, tuple[float, float]]
    residual: dict[str, float]
    datasheet: dict[str, float]
    remark: str = ""
    curve: tuple[tuple[float, float], ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Plain."""
        return {k: (None if isinstance(v, float) and not np.isfinite(v) else v) for k, v in vars(self).items()}


#: From states, times and values: (n, d) differences, their (n, d, p) derivatives, and the names of the p parameters.
_Model = Callable[[NavigationStates, Array, Array], "tuple[Array, Array, tuple[str, ...]]"]


def align(scenario: Scenario, seed: int = 0) -> list[Alignment]:
    """Compare every instrument of a recording with the reference.

    Parameters
    ----------
    scenario : Scenario
        With a ``[log]``.
    seed : int
        Number of the recording.

    Returns
    -------
    list of Alignment
        One for each instrument that is measured, and for the IMU where the reference has an attitude.

    Raises
    ------
    LogError
        If the log cannot be used.
    """
    source = LogSource(scenario, seed)
    log = source.scenario.log
    assert log is not None
    names = list_recordings(log)
    recording = names[seed % len(names)]
    found = []
    for name, spec in source.scenario.aids.items():
        where = log.instruments[name]
        if where.source != "file":
            continue
        series = read_channel(log, where.channel(), spec.kind, recording)
        found.append(_aligned(recording, name, spec.kind, series, source))
    if log.imu is not None and log.reference.attitude is not None:
        found.append(_aligned_imu(recording, source, read_imu(log, log.imu, recording)))
    kinds = {name: spec.kind for name, spec in source.scenario.aids.items()}
    return _warned(found, kinds, probable_readings(source.scenario, recording))


def _warned(found: list[Alignment], kinds: Mapping[str, str], other: list[ProbableReading]) -> list[Alignment]:
    """The results, with a warning where a stream is probably read wrongly, or a figure is too large to be one."""
    wrong = {r.stream: r for r in other}
    of_imu = next((wrong[n] for n in ("imu", "gyroscope", "accelerometer") if n in wrong), None)
    everywhere = [r for n, r in wrong.items() if n.startswith("reference") or n == "positions"]
    warned = []
    for one in found:
        said = [one.remark]
        reading = of_imu if one.instrument == "imu" else wrong.get(one.instrument)
        for r in filter(None, [reading, *everywhere]):
            said.append(f"do not use these figures: {r.sentence()}")
        if len(said) == 1:
            said += [
                f"a {n.replace('_', ' ')} of {np.degrees(v):.3g} deg is mostly a wrong axis; look at each axis first"
                for n, (v, e) in one.parameters.items()
                if n.startswith("mounting") and abs(v) > max(_STEEP, 3.0 * e)
            ]
            body = one.instrument in kinds and KINDS[kinds[one.instrument]].equation == BODY_VELOCITY
            said += [
                f"a {n.replace('_', ' ')} of {v:.3g} m is mostly a wrong axis or clock of a DVL; look at them first"
                for n, (v, e) in one.parameters.items()
                if body and n.startswith("lever_arm") and abs(v) > max(_LONG, 3.0 * e)
            ]
        warned.append(replace(one, remark="; ".join(filter(None, said))))
    return warned


def _aligned_imu(recording: str, source: LogSource, imu: ImuSeries) -> Alignment:
    delay, sigma, mounting, remark, costs = imu_alignment(source, imu)
    return Alignment(recording, "imu", len(imu.mean), delay, sigma, mounting, {}, {}, remark, relative_costs(costs))


def _aligned(recording: str, name: str, kind: str, series: Series, source: LogSource) -> Alignment:
    sheet, definition = source.instruments[name], KINDS[kind]
    sigmas = dict(zip(definition.errors, np.atleast_1d(sheet.sigma).tolist(), strict=False))
    blank = Alignment(recording, name, len(series.time), np.nan, np.nan, {}, {}, sigmas)
    model = _models(np.asarray(sheet.lever_arm)).get(str(definition.equation))
    if model is None:
        return _with(blank, remark=f"there is no comparison for instruments of kind {kind!r}")
    every = max(1, len(series.time) // _MOST)
    time, value = series.time[::every], series.value[::every]
    inside = _always_known(source, time)
    if np.sum(inside) >= _LEAST:  # the same readings at all delays: otherwise their number would decide
        time, value = time[inside], value[inside]
    attempts: dict[float, tuple[float, Array, Array, tuple[str, ...], Array]] = {}

    def cost(delay: float) -> float:
        if delay not in attempts:
            attempts[delay] = _fit(model, source, time - delay, value)
        return attempts[delay][0]

    coarse = np.arange(-_WIDEST, _WIDEST + 0.5 * _COARSE, _COARSE)
    best = min(coarse, key=cost)
    if not np.isfinite(cost(best)):
        return _with(blank, remark=f"fewer than {_LEAST} readings are where the reference is known")
    fine = np.arange(best - _COARSE, best + _COARSE + 0.5 * _FINE, _FINE)
    delay = float(min(fine, key=cost))
    independent = _independent(attempts[delay][4])
    if independent * (cost(0.0) / cost(delay) - 1.0) < _SIGNIFICANT:  # no worse than without a delay
        delay = 0.0
    _, solution, covariance, parameters, residual = attempts[delay]
    count = _independent(residual)
    scatter = {
        n: float(_NORMAL * np.median(np.abs(r - np.median(r))))
        for n, r in zip(definition.errors, residual.T, strict=False)
    }
    curvature = (cost(delay + _COARSE) + cost(delay - _COARSE) - 2.0 * cost(delay)) / _COARSE**2
    sharp = curvature > 0.0 and np.isfinite(curvature)
    sigma = float(np.sqrt(2.0 * cost(delay) / (max(count - len(solution), 1.0) * curvature))) if sharp else np.nan
    remark = ""
    if not sharp or sigma > 1.0 or abs(delay) >= _WIDEST - _FINE:
        if delay != 0.0 and np.isfinite(cost(0.0)):
            _, solution, covariance, parameters, residual = attempts[0.0]
        delay, sigma, remark = np.nan, np.nan, "the motion is too steady to tell a delay"
    spread = np.sqrt(np.diag(covariance) * residual.size / _independent(residual))
    told = {n: (float(s), float(e)) for n, s, e in zip(parameters, solution, spread, strict=True)}
    if any(n.startswith("lever_arm") and e > _KNOWN for n, (_, e) in told.items()):
        told = {n: v for n, v in told.items() if not n.startswith("lever_arm")}
        remark = "; ".join(filter(None, [remark, "the vessel turns too little to tell a lever arm"]))
    return Alignment(
        recording,
        name,
        len(time),
        delay,
        sigma,
        told,
        scatter,
        sigmas,
        remark,
        relative_costs({d: a[0] for d, a in attempts.items()}),
    )


def _always_known(source: LogSource, time: Array) -> NDArray[np.bool_]:
    """(n,) at which times the reference is known also before the longest delay that is tried, and after it."""
    ends = [source.reference_states(time + shift).position for shift in (-_WIDEST, _WIDEST)]
    return np.asarray(np.isfinite(ends).all(axis=(0, 2)), dtype=np.bool_)


def _independent(residual: Array) -> float:
    """Number of independent values among (n, d) residuals: those that change slowly say less than white ones."""
    return float(sum(map(effective_samples, residual.T)))


def relative_costs(costs: Mapping[float, float]) -> tuple[tuple[float, float], ...]:
    """Delays in ascending order, with the cost of each over the smallest one; those without a cost are left out."""
    known = {d: c for d, c in costs.items() if np.isfinite(c)}
    least = max(min(known.values(), default=1.0), 1e-300)
    return tuple((float(d), float(known[d] / least)) for d in sorted(known))


def _with(blank: Alignment, remark: str) -> Alignment:
    return Alignment(**{**vars(blank), "remark": remark})


def _fit(
    model: _Model, source: LogSource, time: Array, value: Array
) -> tuple[float, Array, Array, tuple[str, ...], Array]:
    """Sum of squares with few outliers, solution, covariance, names and (n, d) residuals at a delay."""
    states = source.reference_states(time)
    difference, derivative, names = model(states, time, value)
    known = np.isfinite(difference).all(axis=1) & np.isfinite(derivative).all(axis=(1, 2))
    difference, derivative = difference[known], derivative[known]
    p = derivative.shape[2]
    if len(difference) < _LEAST:
        return np.inf, np.zeros(p), np.full((p, p), np.inf), names, difference
    b = difference.reshape(-1)
    a = derivative.reshape(len(b), p)
    weight: Array = np.ones(len(b))
    solution: Array = np.zeros(p)
    for _ in range(4):  # Huber's weights, with the scale of the residuals
        if p:
            solution = np.asarray(np.linalg.lstsq(a * weight[:, None], b * weight, rcond=None)[0], dtype=np.float64)
        residual = b - a @ solution
        scale = max(1.345 * _NORMAL * float(np.median(np.abs(residual))), 1e-12)
        weight = np.sqrt(np.minimum(1.0, scale / np.maximum(np.abs(residual), 1e-300)))
    total = float(np.sum((weight * residual) ** 2))
    normal = (a * weight[:, None]).T @ (a * weight[:, None])
    variance = total / max(len(b) - p, 1)
    covariance = variance * np.linalg.pinv(normal)
    if p and np.linalg.matrix_rank(normal) < p:
        covariance = covariance + np.diag(np.where(np.diag(normal) < 1e-9 * len(b), np.inf, 0.0))
    return total / len(b), solution, covariance, names, residual.reshape(difference.shape)


def _models(lever_arm: Array) -> dict[str, _Model]:
    """By equation; the lever arm is that of the scenario, and what is found is added to it."""
    arms = tuple(f"lever_arm_{axis}" for axis in "xyz")

    def position(states: NavigationStates, time: Array, value: Array) -> tuple[Array, Array, tuple[str, ...]]:
        dcm = dcm_from_rpy(np.nan_to_num(states.attitude))
        d = value.shape[1]
        measured = value if d == 3 else np.column_stack([value, states.position[:, 2]])
        difference = relative_position(measured, states.position)[:, :d]
        if not np.isfinite(states.attitude).all(axis=1).any():
            return difference, _constant(difference), ("offset_north", "offset_east", "offset_down")[:d]
        return difference - (dcm @ lever_arm)[:, :d], dcm[:, :d], arms

    def body(states: NavigationStates, time: Array, value: Array) -> tuple[Array, Array, tuple[str, ...]]:
        dcm, rate = dcm_from_rpy(states.attitude), _rate(states)
        own = np.einsum("nji,nj->ni", dcm, states.velocity) + np.cross(rate, lever_arm)
        return value - own, skew(rate), arms

    def velocity(states: NavigationStates, time: Array, value: Array) -> tuple[Array, Array, tuple[str, ...]]:
        difference = value[:, :2] - states.velocity[:, :2]
        if not np.isfinite(states.attitude).all(axis=1).any():
            return difference, np.zeros((len(time), 2, 0)), ()
        dcm, rate = dcm_from_rpy(states.attitude), _rate(states)  # of the antenna
        turning = np.asarray(dcm @ skew(rate))[:, :2]
        return difference - turning @ lever_arm, turning, arms

    def heading(states: NavigationStates, time: Array, value: Array) -> tuple[Array, Array, tuple[str, ...]]:
        difference = wrap_angle(value - states.attitude[:, 2:])
        return difference, _constant(difference), ("offset",)

    def speed(states: NavigationStates, time: Array, value: Array) -> tuple[Array, Array, tuple[str, ...]]:
        yaw = states.attitude[:, 2]
        ahead = states.velocity[:, 0] * np.cos(yaw) + states.velocity[:, 1] * np.sin(yaw)
        difference, one = value - ahead[:, None], np.ones((len(ahead), 1, 1))
        known = ahead[np.isfinite(ahead)]
        low, high = np.percentile(known, [5.0, 95.0]) if len(known) else (0.0, 0.0)
        if high - low < _SPREAD * abs(high):  # a scale cannot be told from an offset
            return difference, one, ("offset",)
        return difference, np.concatenate([one, ahead[:, None, None]], axis=2), ("offset", "scale")

    def depth(states: NavigationStates, time: Array, value: Array) -> tuple[Array, Array, tuple[str, ...]]:
        difference = value + states.position[:, 2:]
        return difference, _constant(difference), ("offset",)

    return {POSITION: position, HORIZONTAL_POSITION: position, BODY_VELOCITY: body, VELOCITY: velocity,
            HEADING: heading, WATER_SPEED: speed, DEPTH: depth}  # fmt: skip


def _constant(difference: Array) -> Array:
    """Derivatives by a constant offset of each component."""
    d = difference.shape[1]
    return np.tile(np.eye(d), (len(difference), 1, 1))


def _rate(states: NavigationStates) -> Array:
    """(n, 3) angular rates of the body, by differences of the attitude over the times [rad/s]."""
    dcm = dcm_from_rpy(states.attitude)
    between = np.diff(states.time)
    turned = np.swapaxes(dcm[:-1], 1, 2) @ dcm[1:]
    pairs = ((2, 1), (0, 2), (1, 0))
    small = 0.5 * np.stack([turned[:, i, j] - turned[:, j, i] for i, j in pairs], axis=-1)
    rate = small / np.maximum(between, 1e-9)[:, None]
    return np.vstack([rate[:1], 0.5 * (rate[1:] + rate[:-1]), rate[-1:]]) if len(rate) else np.zeros((len(dcm), 3))
