"""The estimates of a fit in the units of a scenario file, and the figures of datasheets that follow from them.

A size that the log tells takes the place of the datasheet's, as the root of its mean square over what the log allows:
the few swings of a slow error in a log tell its size badly, and the middle would be too small on average. A constant
error x with the standard deviation s is a state of the row, whose sigma in the datasheet becomes sqrt(x^2 + s^2) where
that is more, also where the log does not tell it and the datasheet knows none. A lever arm or a delay that differs from
the datasheet by three standard deviations or more is corrected.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from simnav.scenario import Scenario
from simnav.spec import UNITS, Spec, unit_of
from simnav.types import Array, Instruments

from .assumption import HEADING, Parameter
from .search import Fitted

__all__ = ["AXES", "CONSTANTS", "PLACES", "Estimated", "enlarged", "estimates", "replaced", "without"]

#: Half a 95 % interval, in standard deviations.
_HALF = 1.96
#: A size is told if the standard deviation of its logarithm is below this, a constant if its own is below this part of
#: what was assumed before, and a lever arm if its own is below this [m] or it differs by more than chance.
_TOLD_SIZE, _TOLD_PART, _TOLD_ARM = 1.0, 0.5, 1.0
#: A lever arm or delay is corrected from so many standard deviations on.
_CORRECTED = 3.0
#: A number of which so much of the prior is left is not in the model at all.
_ABSENT = 0.95
#: A heading at the start that is so many sigmas off contradicts the scenario.
_CONTRADICTS = 2.0
_TRIADS = ("gyroscope", "accelerometer")
AXES = ("forward", "starboard", "down")


@dataclass(frozen=True)
class Estimated:
    """A figure of the error model.

    Attributes
    ----------
    key : str
        Its key in the scenario, like ``instruments.dvl.scale_percent``; without a key what it is.
    part : str
        Which components; empty for all.
    value, low, high : float
        The estimate and its 95 % interval, in the unit of the key.
    now : float
        What the scenario says; for a constant its sigma (of a lever arm itself).
    told : bool
        Whether the log tells it.
    constant : bool
        Whether it is an error of this log, constant in it, and not the size of a random one.
    """

    key: str
    part: str
    value: float
    low: float
    high: float
    now: float
    told: bool
    constant: bool

    @property
    def label(self) -> str:
        """Key and part."""
        return f"{self.key} ({self.part})" if self.part else self.key


def _key(spec: Spec, figure: str) -> tuple[str, float]:
    """The key of a figure, and its unit in SI."""
    for key, (name, info) in type(spec).toml_keys().items():
        if name == figure:
            return key, UNITS.get(unit_of(info) or "", 1.0)
    raise KeyError(figure)


def _place(scenario: Scenario, instrument: str, figure: str) -> tuple[str, Spec | None, str, float]:
    """Path of the table, its specification, key and unit of a figure."""
    if instrument == HEADING:
        return "initial_error", scenario.initial_error, "attitude_deg", UNITS["deg"]
    if instrument in _TRIADS:
        assert scenario.imu is not None
        spec: Spec = getattr(scenario.imu, instrument)
        return f"instruments.imu.{instrument}", spec, *_key(spec, figure)
    if figure == "delay":
        return f"log.instruments.{instrument}", None, "offset_s", 1.0
    aid = scenario.aids[instrument]
    return f"instruments.{instrument}", aid, *_key(aid, figure)


def _now(spec: Spec | None, figure: str, components: tuple[int, ...]) -> float:
    if spec is None:
        return 0.0
    value = np.atleast_1d(getattr(spec, figure))
    return float(value[list(components)].mean() if components and len(value) > 1 else value[0])


@dataclass(frozen=True, eq=False)
class _Constant:
    """A block of constant errors among the states of the filter."""

    instrument: str
    figure: str
    value: Array
    sigma: Array
    prior: Array


def _constants(fitted: Fitted) -> Iterator[_Constant]:
    instruments, states = fitted.maximum.assumed.instruments, fitted.states
    for label, place in states.place.items():
        name, _, figure = label.partition(".")
        value, sigma = states.value[place], states.sigma(label)
        if name in instruments and figure in ("bias", "scale", "misalignment"):
            sheet = instruments[name]
            prior = np.broadcast_to(np.atleast_1d(getattr(sheet, figure))[: len(value)], value.shape)
            if figure != "bias" or not sheet.bias_instability.any():
                yield _Constant(name, figure, value, sigma, prior)
        elif figure.removesuffix("_bias") in _TRIADS:
            triad = figure.removesuffix("_bias")
            assert instruments.imu is not None
            prior = np.full(3, getattr(instruments.imu, triad).bias)
            yield _Constant(triad, "bias", value, sigma, prior)


def _parts(constant: _Constant) -> tuple[str, ...]:
    n = len(constant.value)
    return AXES[:n] if n > 1 else ("",)


def _fitted(fitted: Fitted) -> Iterator[tuple[Parameter, float, float]]:
    """The numbers that were fitted, with their standard deviations; those that the filter does not use are left out."""
    maximum = fitted.maximum
    sigma = np.sqrt(maximum.covariance.diagonal()).tolist()
    for parameter, x, s in zip(maximum.parameters, maximum.x.tolist(), sigma, strict=True):
        if s < _ABSENT * parameter.spread or not parameter.size:
            yield parameter, x, s


def estimates(scenario: Scenario, fitted: Fitted) -> list[Estimated]:
    """All figures of a fit, with intervals."""
    found = []
    for p, x, s in _fitted(fitted):
        path, spec, key, unit = _place(scenario, p.instrument, p.figure)
        low, value, high = (p.value(x + k * s) / unit for k in (-_HALF, 0.0, _HALF))
        if p.figure == "delay":
            low, value, high = -high, -value, -low  # of the offset that puts the stamps back
            now = 0.0
        else:
            now = _now(spec, p.figure if p.instrument != HEADING else "attitude", p.components or (
                (2,) if p.instrument == HEADING else ())) / unit  # fmt: skip
        if p.figure == "lever_arm":
            told = s < _TOLD_ARM or _beyond_chance(p.value(x) - _stated(scenario, p), s)
        else:
            told = s < (_TOLD_SIZE if p.size else _TOLD_PART * p.spread)
        part = "error of the heading" if p.instrument == HEADING else p.part
        found.append(Estimated(f"{path}.{key}", part, value, low, high, now, told, not p.size))
    for c in _constants(fitted):
        path, spec, key, unit = _place(scenario, c.instrument, c.figure)
        for k, part in enumerate(_parts(c)):
            value, half = float(c.value[k]) / unit, _HALF * float(c.sigma[k]) / unit
            now = _now(spec, c.figure, (k,)) / unit
            told = bool(c.sigma[k] < _TOLD_PART * c.prior[k])
            found.append(Estimated(f"{path}.{key}", part, value, value - half, value + half, now, told, True))
    return found


def _rounded(value: float) -> float:
    return float(f"{value:.3g}")


class _Table:
    """The figures of a scenario that are replaced: by path of the table, key and component."""

    def __init__(self, scenario: Scenario):
        self.scenario, self.found = scenario, dict[str, dict[str, Any]]()

    def put(self, instrument: str, figure: str, value: float | Mapping[int, float]) -> None:
        """Replace a figure (SI units), or some of its components."""
        path, spec, key, unit = _place(self.scenario, instrument, figure)
        table = self.found.setdefault(path, {})
        if not isinstance(value, Mapping):
            table[key] = _rounded(value / unit)
            return
        whole = table.get(key)
        if whole is None:
            name = "attitude" if instrument == HEADING else figure
            whole = [_rounded(float(v) / unit) for v in np.atleast_1d(getattr(spec, name))]
        for k, v in value.items():
            whole[k if len(whole) > 1 else 0] = _rounded(v / unit)
        table[key] = whole

    def has(self, instrument: str, figure: str) -> bool:
        """Whether a figure is replaced."""
        path, _, key, _ = _place(self.scenario, instrument, figure)
        return key in self.found.get(path, {})

    def finished(self) -> dict[str, dict[str, Any]]:
        """The tables; a vector of one number is a number."""
        return {
            path: {k: v[0] if isinstance(v, list) and len(v) == 1 else v for k, v in table.items()}
            for path, table in self.found.items()
        }


def replaced(scenario: Scenario, fitted: Fitted) -> dict[str, dict[str, Any]]:
    """The figures of a scenario that the fit replaces: by path of the table, then by key, in the units of the keys."""
    table, sheets = _Table(scenario), fitted.maximum.assumed.instruments
    found = list(_fitted(fitted))
    changed = {p.instrument for p, _, _ in found if p.figure == "bias_instability"}
    for p, x, s in found:
        value = p.value(x)
        if p.instrument == HEADING:
            sigma = float(scenario.initial_error.attitude[2])
            if s < _TOLD_PART * p.spread and abs(value) > _CONTRADICTS * sigma:
                table.put(HEADING, "error", {2: float(np.hypot(value, s))})
        elif p.figure == "delay":
            channel = None if scenario.log is None else scenario.log.instruments.get(p.instrument)
            if channel is not None and channel.source == "file" and _corrects(fitted, p, value, s):
                table.put(p.instrument, "delay", channel.offset - value)
        elif p.figure == "lever_arm":
            if _corrects(fitted, p, value - _stated(scenario, p), s):
                table.put(p.instrument, p.figure, {p.components[0]: value})
        elif s < _TOLD_SIZE or p.instrument in changed or _outside(scenario, p, x, s):
            used = p.value(x + min(s * s, s))  # the mean square of a log-normal size; see the module
            table.put(p.instrument, p.figure, dict.fromkeys(p.components, used) if p.components else used)
    for name, sheet in sheets.items():
        aid = scenario.aids.get(name)
        if aid is not None and sheet.bias_instability.any():
            if np.any(aid.figure("bias")):
                table.put(name, "bias", dict.fromkeys(range(len(sheet.bias)), 0.0))
            if table.has(name, "bias_instability") and not table.has(name, "correlation_time"):  # which is not told
                table.put(name, "correlation_time", sheet.correlation_time)
    for name in _TRIADS:
        if sheets.imu is not None and any(p.instrument == name and p.figure == "bias_instability" for p, _, _ in found):
            table.put(name, "correlation_time", getattr(sheets.imu, name).correlation_time)
    for c in _constants(fitted):
        _put_constant(scenario, table, c)
    return table.finished()


#: Beginnings of keys: where an instrument is and how late it is, and its constant errors.
PLACES, CONSTANTS = ("lever_arm_m", "offset_s"), ("bias_m", "bias_deg", "scale_", "misalignment_")


def without(changes: Mapping[str, Mapping[str, Any]], keys: tuple[str, ...]) -> dict[str, dict[str, Any]]:
    """The figures of `replaced` but for the keys with some beginnings."""
    kept = {path: {k: v for k, v in figures.items() if not k.startswith(keys)} for path, figures in changes.items()}
    return {path: figures for path, figures in kept.items() if figures}


def enlarged(scenario: Scenario, instruments: Instruments, names: Iterable[str]) -> dict[str, dict[str, Any]]:
    """The in-run biases of some instruments and triads in other datasheets, as of `replaced`."""
    table = _Table(scenario)
    for name in names:
        sheet = getattr(instruments.imu, name) if name in _TRIADS else instruments[name]
        size: Any = sheet.bias_instability
        table.put(name, "bias_instability", size if name in _TRIADS else dict(enumerate(size.tolist())))
        table.put(name, "correlation_time", sheet.correlation_time)
    return table.finished()


def _corrects(fitted: Fitted, p: Parameter, difference: float, s: float) -> bool:
    """Whether a lever arm or delay differs by more than chance, of an instrument whose model suffices."""
    return p.instrument not in fitted.coloured and _beyond_chance(difference, s)


def _beyond_chance(difference: float, s: float) -> bool:
    return abs(difference) > _CORRECTED * s


def _stated(scenario: Scenario, p: Parameter) -> float:
    return float(np.atleast_1d(getattr(scenario.aids[p.instrument], p.figure))[p.components[0]])


def _outside(scenario: Scenario, p: Parameter, x: float, s: float) -> bool:
    """Whether the datasheet is outside of the interval of a size."""
    _, spec, _, _ = _place(scenario, p.instrument, p.figure)
    now = _now(spec, p.figure, p.components)
    return not p.value(x - _HALF * s) <= now <= p.value(x + _HALF * s)


def _put_constant(scenario: Scenario, table: _Table, c: _Constant) -> None:
    """The sigma of a constant error: a small value makes no sigma smaller; what is not told stays, but for a 0."""
    _, spec, _, _ = _place(scenario, c.instrument, c.figure)
    stated = np.array([_now(spec, c.figure, (k,)) for k in range(len(c.value))])
    size = np.hypot(c.value, c.sigma)
    told = (c.sigma < _TOLD_PART * c.prior) | (stated == 0.0)
    if c.instrument in _TRIADS and told.any():
        size = np.full(len(size), np.sqrt(np.mean(size[told] ** 2)))
    larger = told & (size > stated)
    if not larger.any():
        return
    if c.instrument in _TRIADS or len(size) == 1:
        table.put(c.instrument, c.figure, float(size[0]))
    else:
        table.put(c.instrument, c.figure, {k: float(size[k]) for k in np.flatnonzero(larger).tolist()})
