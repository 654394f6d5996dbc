"""Terrain matching: how many windows give a fix, how wrong the fixes are, and how sure they claim to be.

The voyages are those of `tests.cases.over_terrain.matched`, each over reliefs of several seeds. A false match is
further from the truth than 20 m and than five times its sigma.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any

import numpy as np

from simnav.simulation.simulator import simulate
from simnav.types import KINDS
from tests.cases.over_terrain import matched

#: Seeds of the reliefs, runs over each, and length of a run [s].
RELIEFS, RUNS, DURATION = (7101, 7102, 7103), 2, 600.0
_PROFILE = {"kind": "multibeam_profile", "beams": 7, "swath_deg": 60.0, "rate_hz": 0.5}
_TOLD = {"chart_error_m": 0.5, "chart_error_time_s": 25.0}
_FLAT = {"roughness_m": 0.3, "slope_percent": 0.5}

#: What is varied: relief, sounder, computer.
_CASES: Mapping[str, tuple[dict[str, Any], dict[str, Any], dict[str, Any]]] = {
    "altimeter, relief of 6 m": ({}, {}, {}),
    "multibeam profile, relief of 6 m": ({}, _PROFILE, {}),
    "altimeter, relief of 2 m": ({"roughness_m": 2.0}, {}, {}),
    "altimeter, relief of 2 m, uniqueness = 1": ({"roughness_m": 2.0}, {}, {"uniqueness": 1.0}),
    "altimeter, relief of 0.3 m": (_FLAT, {}, {}),
    "altimeter, relief of 0.3 m, uniqueness = 1": (_FLAT, {}, {"uniqueness": 1.0}),
    "altimeter, error of the chart 0.5 m, told": ({"chart_error_m": 0.5}, _TOLD, {}),
    "altimeter, 10 % of the soundings false": ({}, {"false_readings": 0.1}, {}),
    "multibeam profile, error of the chart 0.5 m, told": ({"chart_error_m": 0.5}, _PROFILE | _TOLD, {}),
    "multibeam profile, error of the chart 0.5 m, not told": ({"chart_error_m": 0.5}, _PROFILE, {}),
}
#: Where the sigmas should be those of the errors.
_PROMISED = (
    "altimeter, relief of 6 m",
    "multibeam profile, relief of 6 m",
    "multibeam profile, error of the chart 0.5 m, told",
)


def _part(name: str) -> dict[str, float]:
    """Share of windows with a fix, RMS and median error [m], mean NEES over 2, share of false matches."""
    bottom, sounder, computer = _CASES[name]
    errors, sigmas, windows = [], [], 0
    for relief in RELIEFS:
        scenario = matched(DURATION, bottom={"seed": relief} | bottom, sounder=sounder, match=computer)
        for seed in range(RUNS):
            recording = simulate(scenario, 7200 + seed)
            stream, truth = recording.data.aids["match"], recording.data.truth
            place = truth.position[np.searchsorted(truth.time, stream.time - 1e-6), :2]
            errors.append(KINDS[stream.kind].difference(stream.value, place))
            sigmas.append(stream.sigma)
            windows += len(stream) + len(stream.dropped)
    error, sigma = np.concatenate(errors), np.concatenate(sigmas)
    if not len(error):
        return {"fixes": 0.0}
    distance = np.linalg.norm(error, axis=1)
    false = distance > np.maximum(20.0, 5.0 * np.linalg.norm(sigma, axis=1))
    return {
        "fixes": len(error) / windows,
        "rms": float(np.sqrt(np.mean(distance**2))),
        "median": float(np.median(distance)),
        "nees": float(np.mean((error / sigma) ** 2)),
        "false": float(np.mean(false)),
    }


def parts() -> Mapping[str, Callable[[], Any]]:
    """What is measured."""
    return {name.replace(" ", "-"): partial(_part, name) for name in _CASES}


def rows(found: Mapping[str, Any]) -> Iterator[tuple[str, str, str, bool]]:
    """What was measured, and what is promised."""
    for name in _CASES:
        one = found.get(name.replace(" ", "-"))
        if one is None:
            continue
        figure = f"fixes {100.0 * one['fixes']:.0f} %"
        if one["fixes"]:
            figure += (
                f", error {one['rms']:.1f} m (median {one['median']:.1f} m), NEES {one['nees']:.2f}, "
                f"false {100.0 * one['false']:.0f} %"
            )
        if name in _PROMISED:
            yield name, figure, "NEES 0.7 to 1.4, no false match", 0.7 <= one["nees"] <= 1.4 and one["false"] == 0.0
        else:
            yield name, figure, "none", True
