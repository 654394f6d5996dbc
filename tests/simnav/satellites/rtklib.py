"""RTKLIB's answers, by pyrtklib: an independent computation of orbits, clocks and delays."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
import pytest

rtk = pytest.importorskip("pyrtklib")

_INAV = 0b101


def array(values: Any) -> Any:
    """An array of doubles for RTKLIB."""
    values = np.atleast_1d(values)
    made = rtk.Arr1Ddouble(len(values))
    for k, value in enumerate(values):
        made[k] = float(value)
    return made


def navigation(path: str) -> Any:
    """RTKLIB's table of a navigation file."""
    table = rtk.nav_t()
    assert rtk.readrnx(path, 1, "", rtk.obs_t(), table, rtk.sta_t()) >= 0
    return table


def messages(table: Any) -> Iterator[tuple[str, int, float, Any]]:
    """Satellite, GPS week and second of the reference time, and message; of Galileo those of I/NAV only."""
    letters = {rtk.SYS_GPS: "G", rtk.SYS_GAL: "E", rtk.SYS_CMP: "C"}
    for k in range(table.n):
        message = table.eph[k]
        number, week = rtk.Arr1Dint(1), rtk.Arr1Dint(1)
        letter = letters.get(rtk.satsys(message.sat, number))
        if letter is None or (letter == "E" and not message.code & _INAV):
            continue
        second = rtk.time2gpst(message.toe, week)
        yield f"{letter}{number[0]:02d}", week[0], second, message


def state(message: Any, later: float) -> tuple[np.ndarray, float]:
    """Position [m] and clock [s] of a message at a time after its reference time."""
    position, clock = array(np.zeros(3)), array(0.0)
    rtk.eph2pos(rtk.timeadd(message.toe, later), message, position, clock, array(0.0))
    return np.array([position[k] for k in range(3)]), clock[0]


def delays(
    week: int, second: float, position: np.ndarray, direction: tuple[float, float], klobuchar: np.ndarray
) -> tuple[float, float, float]:
    """Ionosphere, troposphere [m] and wet mapping at a GPS time, for azimuth and elevation."""
    time, place, towards = rtk.gpst2time(week, second), array(position), array(direction)
    wet, zenith = array(0.0), array([0.0, np.pi / 2.0])
    dry = rtk.tropmapf(time, place, towards, wet)
    hydrostatic = rtk.tropmodel(time, place, zenith, 0.0)
    vapour = rtk.tropmodel(time, place, zenith, 0.5) - hydrostatic
    return rtk.ionmodel(time, array(klobuchar), place, towards), hydrostatic * dry + vapour * wet[0], wet[0]


def point(path: str, week: int, second: float, satellites: Sequence[str], raw: np.ndarray) -> np.ndarray:
    """RTKLIB's position [m] of pseudoranges on L1 at a time of the receiver's clock, with Klobuchar's ionosphere."""
    observations = rtk.Arr1Dobsd_t(len(satellites))
    for j, name in enumerate(satellites):
        one = observations[j]
        one.time, one.rcv, one.sat = rtk.gpst2time(week, second), 1, rtk.satid2no(name)
        one.P[0], one.code[0], one.SNR[0] = raw[j], rtk.CODE_L1C, 45000
    options = rtk.prcopt_default
    options.mode, options.navsys, options.elmin = rtk.PMODE_SINGLE, rtk.SYS_GPS | rtk.SYS_GAL, 0.0
    options.ionoopt, options.tropopt = rtk.IONOOPT_BRDC, rtk.TROPOPT_OFF
    solution, message, states = rtk.sol_t(), rtk.Arr1Dchar(256), rtk.Arr1Dssat_t(rtk.MAXSAT)
    directions = array(np.zeros(2 * len(satellites)))
    table = navigation(path)
    assert rtk.pntpos(
        observations.ptr, len(satellites), table, options, solution, directions, states.ptr, message
    )  # fmt: skip
    return np.array([solution.rr[k] for k in range(3)])


def points(
    observed: str, path: str, delay: Callable[[str, float], float] | None, step: int = 1
) -> dict[int, np.ndarray]:
    """RTKLIB's positions [m] of an observation file of one day, by the seconds since noon, rounded.

    Its own model of the troposphere is used, or if `delay` is given, the delay [m] of a satellite at a second of the
    day is subtracted. An epoch without a solution is left out; one of ``step`` is solved, by GPS and Galileo.
    """
    observations = rtk.obs_t()
    assert rtk.readrnx(observed, 1, "", observations, rtk.nav_t(), rtk.sta_t()) > 0
    rtk.sortobs(observations)
    options, table, found = rtk.prcopt_default, navigation(path), {}
    options.mode, options.navsys, options.elmin = rtk.PMODE_SINGLE, rtk.SYS_GPS | rtk.SYS_GAL, 0.0
    options.ionoopt, options.tropopt = rtk.IONOOPT_BRDC, rtk.TROPOPT_SAAS if delay is None else rtk.TROPOPT_OFF
    letters = {rtk.SYS_GPS: "G", rtk.SYS_GAL: "E"}
    every = [observations.data[k] for k in range(observations.n)]
    every = [one for one in every if rtk.satsys(one.sat, rtk.Arr1Dint(1)) in letters]
    second = [rtk.time2gpst(one.time, rtk.Arr1Dint(1)) % 86400.0 for one in every]
    for time in sorted(set(second))[::step]:
        rows = [k for k, other in enumerate(second) if other == time]
        epoch = rtk.Arr1Dobsd_t(len(rows))
        for j, k in enumerate(rows):
            number = rtk.Arr1Dint(1)
            letter = letters[rtk.satsys(every[k].sat, number)]
            if delay is not None:
                every[k].P[0] -= delay(f"{letter}{number[0]:02d}", time)
            epoch[j] = every[k]
        solution, states = rtk.sol_t(), rtk.Arr1Dssat_t(rtk.MAXSAT)
        directions = array(np.zeros(2 * len(rows)))
        if rtk.pntpos(
            epoch.ptr, len(rows), table, options, solution, directions, states.ptr, rtk.Arr1Dchar(256)
        ):  # fmt: skip
            found[round(time - 43200.0)] = np.array([solution.rr[k] for k in range(3)])
    return found
