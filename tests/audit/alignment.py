"""A run that begins without attitude or heading: how much worse is it, once it is aligned, than one that knew them?

Training voyages on which nothing is wrong are recorded once. A row takes each twice: from the start of the scenario,
and from one that does not know the attitude (or the heading). The horizontal error from the alignment to the end is
divided by that of the known start. The known start knows more than its attitude: a bias of the accelerometers shows
itself in a level that is known. So single voyages have more, where the fixes are better than what the IMU can make of
them, and others less.

Moored, the heading is compared with the closed form ``b / (Omega cos(latitude))`` of the drift b of the gyroscopes in
that time (P. D. Groves 2013, section 5.6.2).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from math import cos, hypot, pi, sqrt
from typing import Any, Literal, get_args

import numpy as np

from simnav.estimator import make
from simnav.geometry.earth import ROTATION_RATE, relative_position
from simnav.geometry.rotation import wrap_angle
from simnav.recording import Recording
from simnav.scenario import Scenario, load
from simnav.source import record
from simnav.types import Array
from simnav.world.initial_state import draw_start

__all__ = ["begun", "compared", "moored", "parts", "rows", "without"]

What = Literal["heading", "attitude"]
FAMILIES = ("training-clean", "training-mems")
#: Voyages of a part, the first of them, and how much the error may grow.
VOYAGES, FIRST, MOST = 40, 910_000, 1.1
#: Rows of each solver, over fewer voyages.
ROWS, FEW = ("ukf", "sw-fgo", "gnc-fgo", "inekf", "vb-akf", "federated", "gtsam-fixed-lag", "dead-reckoning"), 6
#: Moored: gyroscope bias [deg/h], runs, and when the heading is compared [s].
BIAS, RUNS, MOORED = 0.05, 40, 240.0


def without(recording: Recording, scenario: Scenario, seed: int, what: What) -> Recording:
    """The recording with a start that does not know its heading, or its attitude."""
    covariance = recording.start.covariance.copy()
    unknown = slice(8, 9) if what == "heading" else slice(6, 9)
    covariance[unknown], covariance[:, unknown] = 0.0, 0.0
    covariance[range(9)[unknown], range(9)[unknown]] = pi**2
    return replace(recording, start=draw_start(recording.initial_truth, covariance, scenario.root(seed)))


def begun(name: str, recording: Recording) -> tuple[float, Array, Array]:
    """A row over a recording: when it was aligned [s], its horizontal errors [m], and those of its heading [rad]."""
    row = make(name)
    row.reset(recording.start, recording.instruments)
    truth, aligned = recording.data.truth, np.inf
    found, heading = np.empty((len(truth.time), 3)), np.full(len(truth.time), np.nan)
    for k, packet in enumerate(recording.steps()):
        estimate = row.update(packet)
        assert estimate.position is not None
        found[k] = estimate.position
        if estimate.attitude is not None:
            heading[k] = wrap_angle(estimate.attitude[2] - truth.attitude[k, 2])
        if aligned == np.inf and not estimate.diagnostics.get("aligning"):
            aligned = packet.time
    return aligned, np.hypot(*relative_position(found, truth.position)[:, :2].T), heading


def compared(row: str, family: str, what: What, seed: int) -> tuple[float, float]:
    """When a row was aligned [s], and its error from then on over that of a known start; infinity and NaN if never."""
    scenario = load(family)
    known = record(scenario, seed)
    aligned, error, _ = begun(row, without(known, scenario, seed, what))
    after = known.data.truth.time >= aligned
    if not after.any():
        return np.inf, np.nan
    return aligned, float(np.sqrt(np.mean(error[after] ** 2) / np.mean(begun(row, known)[1][after] ** 2)))


def moored(seed: int) -> float:
    """The heading error of ``ekf`` moored for some minutes, over the closed form."""
    scenario = load("moored-alignment").with_values({"name": "moored", "draw.grade": BIAS, "duration_s": MOORED})
    recording = record(scenario, seed)
    heading = begun("ekf", recording)[2][-1]
    assert recording.instruments.imu is not None
    gyroscope = recording.instruments.imu.gyroscope
    drift = hypot(gyroscope.bias, gyroscope.bias_instability, gyroscope.random_walk / sqrt(MOORED))
    return float(heading) * ROTATION_RATE * cos(recording.initial_truth.position[0, 0]) / drift


def _voyages(row: str, family: str, what: What, count: int) -> list[tuple[float, float]]:
    return [compared(row, family, what, seed) for seed in range(FIRST, FIRST + count)]


def parts() -> Mapping[str, Callable[[], Any]]:
    """Each family without attitude and without heading by the EKF, each row on a few voyages, and the moored runs."""
    whats: tuple[What, ...] = get_args(What)
    found: dict[str, Callable[[], Any]] = {
        f"ekf without {what}, {family}": partial(_voyages, "ekf", family, what, VOYAGES)
        for family in FAMILIES
        for what in whats
    }
    for row in ROWS:
        found[f"{row} without attitude, {FAMILIES[0]}"] = partial(_voyages, row, FAMILIES[0], "attitude", FEW)
    found["moored"] = lambda: [moored(seed) for seed in range(FIRST, FIRST + RUNS)]
    return found


def rows(found: Mapping[str, Any]) -> Iterator[tuple[str, str, str, bool]]:
    """A row for each part."""
    for name, values in found.items():
        if name == "moored":
            ratio = float(np.sqrt(np.mean(np.square(values))))
            figure = f"{ratio:.2f} times the closed form (root of the mean square of {len(values)} runs)"
            yield f"heading after {MOORED:g} s at the quay, {BIAS:g} deg/h", figure, "at most 1.25", ratio <= 1.25
            continue
        aligned, ratio = np.array(values).T
        known = np.isfinite(aligned)
        mean = float(np.exp(np.log(ratio[known]).mean()))
        late = np.quantile(aligned, 0.9, method="higher")
        figure = (
            f"{mean:.3f} times the error (geometric mean; median {np.median(ratio[known]):.3f}, worst "
            f"{ratio[known].max():.2f}), aligned on {known.sum()} of {len(known)} voyages after "
            f"{np.median(aligned):.0f} s (median), {late:.0f} s (90 %)"
        )
        yield name, figure, f"at most {MOST:g} times", mean <= MOST
