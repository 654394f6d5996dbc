"""A run that begins without attitude or heading: how much worse is it, once it is aligned, than one that knew them?

Training voyages on which nothing is wrong are recorded once. A row takes each twice: from the start of the scenario,
and from one that does not know the attitude (or the heading). The horizontal error from the alignment to the end is
divided by that of the known start. A known start knows more than its attitude: a known heading calibrates the mounting
of the DVL, and a known level the accelerometers. Nothing gives that back to a row that had to find both, and its
covariance is then larger, too. So the ratio is beside that of the standard deviations.

The ratio of one voyage has a wide distribution: the errors of the two starts are two draws. So a mean stands beside its
standard error, and there are enough voyages that it is a few hundredths.

Moored, the heading is compared with the closed form ``b / (Omega cos(latitude))`` of the drift b of the gyroscopes in
that time (P. D. Groves 2013, section 5.6.2).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from math import cos, hypot, pi, sqrt
from typing import Any, Literal, NamedTuple, get_args

import numpy as np

from simnav.estimator import make
from simnav.geometry.earth import ROTATION_RATE, relative_position
from simnav.geometry.rotation import wrap_angle
from simnav.recording import Recording
from simnav.scenario import Scenario, load
from simnav.source import record
from simnav.types import Array
from simnav.world.initial_state import draw_start

__all__ = ["Compared", "Run", "begun", "compared", "moored", "parts", "rows", "without"]

What = Literal["heading", "attitude"]
#: Families, and how many parts of `VOYAGES` each has.
FAMILIES = {"training-clean": 1, "training-mems": 4}
#: Voyages of a part, the first of them, and how much the error may grow.
VOYAGES, FIRST, MOST = 40, 910_000, 1.1
#: Rows of each solver, over fewer voyages of the first family, and the row that is recommended, over those of both.
ROWS, RECOMMENDED, FEW = ("ukf", "sw-fgo", "gnc-fgo", "inekf", "vb-akf", "federated", "dead-reckoning"), "mh-ekf", 6
#: In the name of a part: its number comes next.
_NUMBER = ", part "
#: Moored: gyroscope bias [deg/h], runs, and when the heading is compared [s].
BIAS, RUNS, MOORED = 0.05, 40, 240.0


def without(recording: Recording, scenario: Scenario, seed: int, what: What) -> Recording:
    """The recording with a start that does not know its heading, or its attitude."""
    covariance = recording.start.covariance.copy()
    unknown = slice(8, 9) if what == "heading" else slice(6, 9)
    covariance[unknown], covariance[:, unknown] = 0.0, 0.0
    covariance[range(9)[unknown], range(9)[unknown]] = pi**2
    return replace(recording, start=draw_start(recording.initial_truth, covariance, scenario.root(seed)))


class Run(NamedTuple):
    """A row over a recording.

    Attributes
    ----------
    aligned : float
        When it was aligned [s]; infinite if never.
    error, predicted : (T,) array
        Horizontal error, and its standard deviation by the row's covariance [m].
    heading : (T,) array
        Error of the heading [rad]; NaN before there is one.
    """

    aligned: float
    error: Array
    predicted: Array
    heading: Array


class Compared(NamedTuple):
    """An unknown start beside a known one, from the alignment on; NaN where a row was never aligned.

    Attributes
    ----------
    aligned : float
        When the row was aligned [s].
    ratio, predicted : float
        Root of the mean squared horizontal error over that of the known start, and what the covariances say of it.
    """

    aligned: float
    ratio: float
    predicted: float


def begun(name: str, recording: Recording) -> Run:
    """Let a row process a recording."""
    row = make(name)
    row.reset(recording.start, recording.instruments)
    truth, aligned = recording.data.truth, np.inf
    n = len(truth.time)
    found, variance, heading = np.empty((n, 3)), np.full(n, np.nan), np.full(n, np.nan)
    for k, packet in enumerate(recording.steps()):
        estimate = row.update(packet)
        assert estimate.position is not None
        found[k] = estimate.position
        if estimate.covariance is not None:
            variance[k] = estimate.covariance[0, 0] + estimate.covariance[1, 1]
        if estimate.attitude is not None:
            heading[k] = wrap_angle(estimate.attitude[2] - truth.attitude[k, 2])
        if aligned == np.inf and not estimate.diagnostics.get("aligning"):
            aligned = packet.time
    error = np.hypot(*relative_position(found, truth.position)[:, :2].T)
    return Run(aligned, error, np.sqrt(variance), heading)


def compared(row: str, family: str, what: What, seed: int) -> Compared:
    """A row without and with a known start, on one voyage."""
    scenario = load(family)
    known = record(scenario, seed)
    blind = begun(row, without(known, scenario, seed, what))
    after = known.data.truth.time >= blind.aligned
    if not after.any():
        return Compared(np.inf, np.nan, np.nan)
    told = begun(row, known)

    def ratio(one: Array, other: Array) -> float:
        return float(np.sqrt(np.nanmean(one[after] ** 2) / np.nanmean(other[after] ** 2)))

    return Compared(blind.aligned, ratio(blind.error, told.error), ratio(blind.predicted, told.predicted))


def moored(seed: int) -> float:
    """The heading error of ``ekf`` moored for some minutes, over the closed form."""
    scenario = load("moored-alignment").with_values({"name": "moored", "draw.grade": BIAS, "duration_s": MOORED})
    recording = record(scenario, seed)
    heading = begun("ekf", recording).heading[-1]
    assert recording.instruments.imu is not None
    gyroscope = recording.instruments.imu.gyroscope
    drift = hypot(gyroscope.bias, gyroscope.bias_instability, gyroscope.random_walk / sqrt(MOORED))
    return float(heading) * ROTATION_RATE * cos(recording.initial_truth.position[0, 0]) / drift


def _voyages(row: str, family: str, what: What, first: int, count: int) -> list[Compared]:
    return [compared(row, family, what, seed) for seed in range(first, first + count)]


def parts() -> Mapping[str, Callable[[], Any]]:
    """Each family without attitude and without heading by the EKF, each row on a few voyages, and the moored runs."""
    whats: tuple[What, ...] = get_args(What)
    found: dict[str, Callable[[], Any]] = {
        f"ekf without {what}, {family}{_NUMBER}{k}": partial(
            _voyages, "ekf", family, what, FIRST + k * VOYAGES, VOYAGES
        )
        for family, count in FAMILIES.items()
        for what in whats
        for k in range(count)
    }
    for k, family in enumerate(FAMILIES):
        for row in (RECOMMENDED,) if k else (*ROWS, RECOMMENDED):
            found[f"{row} without attitude, {family}"] = partial(_voyages, row, family, "attitude", FIRST, FEW)
    found["moored"] = lambda: [moored(seed) for seed in range(FIRST, FIRST + RUNS)]
    return found


def rows(found: Mapping[str, Any]) -> Iterator[tuple[str, str, str, bool]]:
    """A row for each row and family: its parts are taken together."""
    together: dict[str, list[Any]] = {}
    for name, values in found.items():
        together.setdefault(name.partition(_NUMBER)[0], []).extend(values)
    for name, values in together.items():
        if name == "moored":
            size = float(np.sqrt(np.mean(np.square(values))))
            figure = f"{size:.2f} times the closed form (root of the mean square of {len(values)} runs)"
            yield f"heading after {MOORED:g} s at the quay, {BIAS:g} deg/h", figure, "at most 1.25", size <= 1.25
            continue
        aligned, ratio, predicted = np.array(values).T
        known = np.isfinite(aligned)
        mean, told = (float(np.exp(np.log(x[known]).mean())) for x in (ratio, predicted))
        scatter = mean * float(np.log(ratio[known]).std(ddof=1)) / sqrt(known.sum())
        late = np.quantile(aligned, 0.9, method="higher")
        figure = (
            f"{mean:.3f} +- {scatter:.3f} times the error (geometric mean; median {np.median(ratio[known]):.3f}, worst "
            f"{ratio[known].max():.2f}; by the covariances {told:.3f}), aligned on {known.sum()} of {len(known)} "
            f"voyages after {np.median(aligned):.0f} s (median), {late:.0f} s (90 %)"
        )
        yield name, figure, f"at most {MOST:g}", mean <= MOST
