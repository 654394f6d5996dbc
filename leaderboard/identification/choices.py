"""What can be fitted of a log: sizes of errors, and constants, with what is usual of each."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from math import inf, radians

import numpy as np

from simnav.kinds import BODY_VELOCITY, WATER_SPEED
from simnav.scenario import Scenario
from simnav.sensors.instrument import AidSpec
from simnav.types import KINDS, Datasheet, ImuDatasheet, TriadDatasheet

from .assumption import HEADING, Assumption, Parameter

__all__ = ["coloured", "fitted_aids", "heading", "in_run", "places", "sizes", "with_wide_states", "without_bias"]

#: Prior standard deviation of the logarithm of a size, and of a correlation time.
_SIZE, _TIME = 3.0, 2.0
#: Prior standard deviations: lever arm (up to a mast of a ship) [m], delay [s]; of the heading at the start at least
#: [rad].
_ARM, _DELAY, _HEADING = 10.0, 0.5, radians(3.0)
#: Step of the derivatives by a delay, without an IMU, and the least with one: a sample of it [s].
_DELAY_STEP, _LEAST_STEP = 0.05, 0.005
#: The smallest size to begin with [SI units]: of readings, of gyroscopes and of accelerometers.
_LEAST = 1e-4
_LEAST_OF: dict[str, tuple[float, float]] = {"gyroscope": (1e-6, 1e-7), "accelerometer": (1e-5, 1e-5)}
#: Sigmas of constant errors in the fit, at least: bias by unit, of a DVL [m/s], scale [-], mounting [rad]. With a wide
#: one the bias of a DVL takes over the slow error of the fixes.
_BIAS, _DVL_BIAS = {"m_s": 0.05, "deg": radians(2.0)}, 0.02
_SCALE, _MOUNTING = 0.03, radians(3.0)
#: Turn-on biases of an IMU in the fit are so many times those of the datasheet, and at least so large [SI units].
_TIMES, _TURN_ON = 5.0, {"gyroscope": radians(0.1) / 3600.0, "accelerometer": 2e-4}
#: Correlation times with which a coloured error begins [s], and its size as parts of the white noise.
_BEGINS, _PARTS = (5.0, 25.0, 120.0), (0.5, 1.0)
#: Correlation time of an in-run bias of the IMU of which the datasheet has none [s].
_IN_RUN_TIME = 300.0


def fitted_aids(scenario: Scenario, assumed: Assumption) -> dict[str, Datasheet]:
    """The instruments whose errors are fitted: those without channels that have one figure ``sigma`` of their own."""
    return {
        name: sheet
        for name, sheet in assumed.instruments.items()
        if name in scenario.aids
        and "sigma" in type(scenario.aids[name]).model_fields
        and not sheet.channels
        and not sheet.sources
        and not sheet.stated
    }


def _has(spec: AidSpec, figure: str) -> bool:
    return figure in type(spec).model_fields


def _groups(sheet: Datasheet) -> list[tuple[tuple[int, ...], str]]:
    d = len(KINDS[sheet.kind].errors)
    return [((0, 1), "horizontal"), ((2,), "vertical")] if d == 3 else [(tuple(range(d)), "")]


def with_wide_states(scenario: Scenario, assumed: Assumption) -> Assumption:
    """The assumption with constant errors of the instruments as states with wide priors, and no named processes."""
    for name, sheet in fitted_aids(scenario, assumed).items():
        spec, changes = scenario.aids[name], dict[str, object]()
        unit = KINDS[sheet.kind].components[0].error_unit
        if _has(spec, "bias") and unit in _BIAS and sheet.equation != "velocity":
            changes["bias"] = np.maximum(sheet.bias, _DVL_BIAS if sheet.equation == BODY_VELOCITY else _BIAS[unit])
        if _has(spec, "scale") and sheet.equation in (BODY_VELOCITY, WATER_SPEED):
            changes["scale"] = max(sheet.scale, _SCALE)
        if _has(spec, "misalignment"):
            changes["misalignment"] = np.maximum(sheet.misalignment, _MOUNTING)
        assumed = assumed.with_sheet(name, lambda s, c=changes: replace(s, processes=(), **c))  # type: ignore[misc]
    if assumed.instruments.imu is not None:
        assumed = assumed.with_imu(_with_wide_biases)
    return assumed


def _with_wide_biases(imu: ImuDatasheet) -> ImuDatasheet:
    def wide(name: str, triad: TriadDatasheet) -> TriadDatasheet:
        return replace(triad, bias=max(_TIMES * triad.bias, _TURN_ON[name]))

    return replace(
        imu, gyroscope=wide("gyroscope", imu.gyroscope), accelerometer=wide("accelerometer", imu.accelerometer)
    )


def _size(name: str, figure: str, group: tuple[int, ...], part: str, first: float) -> Parameter:
    return Parameter(name, figure, group, first, _SIZE, part=part)


def sizes(scenario: Scenario, assumed: Assumption, of: Iterable[str] | None = None) -> list[Parameter]:
    """White noise of the instruments, and the coloured errors that they are assumed to have.

    Parameters
    ----------
    scenario : Scenario
        The scenario.
    assumed : Assumption
        Gives the values to begin with.
    of : iterable of str, optional
        Only these instruments, ``gyroscope`` and ``accelerometer``. Default: all.
    """
    found: list[Parameter] = []
    for name, sheet in fitted_aids(scenario, assumed).items():
        for group, part in _groups(sheet):
            found.append(_size(name, "sigma", group, part, max(float(sheet.sigma[list(group)].mean()), _LEAST)))
        for group, part in _groups(sheet):
            if sheet.bias_instability[list(group)].any():
                first = float(sheet.bias_instability[list(group)].mean())
                found.append(_size(name, "bias_instability", group, part, first))
        if sheet.bias_instability.any() and sheet.correlation_time < inf:
            found.append(Parameter(name, "correlation_time", (), sheet.correlation_time, _TIME))
    imu = assumed.instruments.imu
    for name, (white, _) in _LEAST_OF.items() if imu is not None else ():
        triad: TriadDatasheet = getattr(imu, name)
        found.append(_size(name, "random_walk", (), "", max(triad.random_walk, white)))
        if triad.bias_instability:
            found.append(_size(name, "bias_instability", (), "", triad.bias_instability))
    chosen = None if of is None else set(of)
    return [p for p in found if chosen is None or p.instrument in chosen]


def coloured(scenario: Scenario, assumed: Assumption) -> Iterator[tuple[str, list[Assumption]]]:
    """Instruments that may have a coloured error but have none yet, each with assumptions to begin with."""
    for name, sheet in fitted_aids(scenario, assumed).items():
        if not _has(scenario.aids[name], "bias_instability") or sheet.bias_instability.any():
            continue
        white = without_bias(assumed, name)
        changes = [
            {"bias_instability": part * sheet.sigma, "correlation_time": time}
            for part in _PARTS
            for time in _BEGINS
            if time > 2.0 / sheet.rate
        ]
        yield name, [white.with_sheet(name, lambda s, c=c: replace(s, **c)) for c in changes]  # type: ignore[misc]


def without_bias(assumed: Assumption, name: str) -> Assumption:
    """The assumption that an instrument has no constant bias."""
    return assumed.with_sheet(name, lambda s: replace(s, bias=np.zeros(len(s.bias))))


def in_run(assumed: Assumption) -> Iterator[Assumption]:
    """For each triad of an IMU that may have an in-run bias but has none yet, an assumption to begin with."""
    imu = assumed.instruments.imu
    for name, (_, least) in _LEAST_OF.items() if imu is not None else ():
        triad: TriadDatasheet = getattr(imu, name)
        if not triad.bias_instability:
            time = min(triad.correlation_time, _IN_RUN_TIME)
            changed = replace(triad, bias_instability=10.0 * least, correlation_time=time)
            yield assumed.with_imu(lambda i, n=name, c=changed: replace(i, **{n: c}))  # type: ignore[misc]


def places(scenario: Scenario, assumed: Assumption) -> list[Parameter]:
    """Delays of the instruments, and with an IMU their lever arms."""
    found, imu = [], assumed.instruments.imu
    step = _DELAY_STEP if imu is None else max(_LEAST_STEP, 1.0 / imu.rate)
    for name, sheet in fitted_aids(scenario, assumed).items():
        if _has(scenario.aids[name], "lever_arm") and imu is not None:
            for k, axis in enumerate(("forward", "starboard", "down")):
                first = float(sheet.lever_arm[k])
                found.append(Parameter(name, "lever_arm", (k,), first, _ARM, size=False, part=axis))
        # Without an IMU the fixes are the clock: only the other instruments can be late by it.
        if sheet.equation and sheet.equation != WATER_SPEED and (imu is not None or sheet.role != "fix"):
            found.append(Parameter(name, "delay", (), 0.0, _DELAY, size=False, step=step))
    return found


def heading(sigma: float) -> Parameter:
    """The error of the heading at the start, from its sigma [rad]."""
    return Parameter(HEADING, "error", (), 0.0, max(sigma, _HEADING), size=False)
