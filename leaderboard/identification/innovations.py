"""The innovations of the plain filter over a recording, for an assumption, and the likelihood that they give it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf, radians

import numpy as np
from numpy.typing import NDArray

from simnav.estimator import UnsuitableScenario
from simnav.estimators.models.suitable import Suitable
from simnav.estimators.solvers.innovations import InnovationKeeper
from simnav.log.table import LogError
from simnav.recording import Recording, packets
from simnav.types import Array, Estimate, InitialState, Instruments, Measurements

from .assumption import Assumption

__all__ = ["Innovations", "Likelihood", "StateValues", "Stream", "common", "neighbours", "run_filter"]

#: Sigma of the heading at the start, where the heading itself is fitted [rad].
_HEADING_SIGMA = radians(0.01)
#: Stamps that differ by less belong to one reading [s].
_SAME = 1e-6
#: Steps of the filter [s]; its innovations are those of the row, whose steps are shorter.
_STEP = 60.0
#: Sets of delays of which the steps are kept.
_KEPT = 8


@dataclass(frozen=True, eq=False)
class Stream:
    """The innovations of one instrument.

    Attributes
    ----------
    time : (n,) array
        Stamps of the readings [s], as in the log.
    value : (n, d) array
        Innovations.
    covariance : (n, d, d) array
        Their covariances by the filter.
    """

    time: Array
    value: Array
    covariance: Array

    @cached_property
    def inverse(self) -> Array:
        """(n, d, d) inverses of the covariances."""
        return np.asarray(np.linalg.inv(self.covariance), dtype=np.float64)

    @cached_property
    def nis(self) -> Array:
        """(n,) normalised innovations squared."""
        return np.asarray(np.einsum("ni,nij,nj->n", self.value, self.inverse, self.value))

    @cached_property
    def white(self) -> Array:
        """(n, d) innovations times the inverse of the Cholesky factor of their covariance: unit variance, if true."""
        factor = np.linalg.cholesky(self.covariance)
        return np.asarray(np.linalg.solve(factor, self.value[:, :, None])[:, :, 0])

    @property
    def log_likelihood(self) -> float:
        """Sum of -1/2 (NIS + log det S)."""
        return float(-0.5 * np.sum(self.nis + np.linalg.slogdet(self.covariance)[1]))


#: Innovations by instrument.
Innovations = Mapping[str, Stream]


@dataclass(frozen=True, eq=False)
class StateValues:
    """What the filter knows of the constant errors of the instruments at the end.

    Attributes
    ----------
    place : mapping of str to slice
        Where the blocks of states, ``INSTRUMENT.NAME``, are in the rest.
    value : (m,) array
        The states, SI units.
    covariance : (m, m) array
        Their covariance.
    """

    place: Mapping[str, slice]
    value: Array
    covariance: Array

    def sigma(self, label: str) -> Array:
        """(k,) standard deviations of a block."""
        return np.asarray(np.sqrt(np.maximum(self.covariance.diagonal()[self.place[label]], 0.0)))


def run_filter(
    start: InitialState, instruments: Instruments, steps: list[Measurements]
) -> tuple[InnovationKeeper, list[Estimate]]:
    """Run the plain filter (of the inertial model, without an IMU of the ship model) to the end.

    Returns
    -------
    solver : InnovationKeeper
        After the last step.
    estimates : list of Estimate
        One for each step.

    Raises
    ------
    LogError
        If the model lacks an instrument.
    """
    solver = InnovationKeeper(Suitable())
    solver.reports_all = True
    try:
        solver.reset(start, instruments)
    except UnsuitableScenario as error:
        raise LogError(f"the error model cannot be identified: {error}") from None
    with np.errstate(all="ignore"):
        return solver, [solver.update(step) for step in steps]


class Likelihood:
    """The likelihood of assumptions about a recording.

    Parameters
    ----------
    recording : Recording
        The recording.
    until : float
        Readings after this time are not used [s].
    times : (k,) array, optional
        Ascending times of estimates [s]. Default: a few.
    """

    def __init__(self, recording: Recording, until: float = inf, times: Array | None = None):
        data = recording.data
        streams = {n: replace(s.as_delivered(), arrival=np.empty(0)) for n, s in data.aids.items()}
        self._recording = replace(recording, data=replace(data, aids=streams))
        self._until, self.start, self._times = until, recording.start, times
        self._known: dict[tuple[tuple[str, float], ...], list[Measurements]] = {(): self._cut(self._recording)}

    def _cut(self, recording: Recording) -> list[Measurements]:
        data, last = recording.data, min(self._until, recording.data.end)
        times = np.arange(data.start + _STEP, last, _STEP) if self._times is None else self._times
        return list(packets(data, np.append(times[times < last], last)))

    def _delayed(self, delays: Mapping[str, float]) -> list[Measurements]:
        """The steps with stamps put back; those of the last few sets of delays are kept."""
        key = tuple(sorted((n, d) for n, d in delays.items() if d))
        if key not in self._known:
            if len(self._known) > _KEPT:
                self._known.clear()
            self._known[key] = self._moved(delays)
        return self._known[key]

    def _moved(self, delays: Mapping[str, float]) -> list[Measurements]:
        data = self._recording.data
        aids = {n: replace(s, time=s.time - delays.get(n, 0.0)) for n, s in data.aids.items()}
        aids = {n: s.rows(s.time > data.start) for n, s in aids.items()}
        return self._cut(replace(self._recording, data=replace(data, aids=aids)))

    def run(self, assumed: Assumption, heading: bool = True) -> tuple[InnovationKeeper, list[Estimate]]:
        """The filter and its estimates; ``heading``: with the assumed heading at the start, and hardly a sigma."""
        start = self.start
        if heading:
            attitude, covariance = start.attitude.copy(), start.covariance.copy()
            attitude[2] += assumed.heading
            covariance[8], covariance[:, 8] = 0.0, 0.0
            covariance[8, 8] = _HEADING_SIGMA**2
            start = replace(start, attitude=attitude, covariance=covariance)
        return run_filter(start, assumed.instruments, self._delayed(assumed.delays))

    def innovations(self, assumed: Assumption, heading: bool = True) -> Innovations:
        """The innovations by instrument; see `run`."""
        kept: dict[str, list[tuple[float, Array, Array]]] = {}
        for one in self.run(assumed, heading)[0].kept:
            time = one.time + assumed.delays.get(one.instrument, 0.0)
            kept.setdefault(one.instrument, []).append((time, one.value, one.covariance))
        return {
            name: Stream(*(np.array(part) for part in zip(*rows, strict=True))) for name, rows in kept.items()
        }  # fmt: skip

    def estimates(self, assumed: Assumption) -> list[tuple[float, Estimate]]:
        """Times [s] and estimates; the heading at the start is that of the log."""
        return [(e.time, e) for e in self.run(assumed, heading=False)[1]]

    def states(self, assumed: Assumption) -> StateValues:
        """The constant errors at the end of the run; their covariance is that under the assumption."""
        solver, (*_, estimate) = self.run(assumed)
        blocks = solver.model.blocks  # type: ignore[attr-defined]  # both models of `Suitable` have them
        values = {n: v for n, (v, _) in (estimate.states or {}).items()}
        rows, place = list[int](), dict[str, slice]()
        for name, value in values.items():
            place[name] = slice(len(rows), len(rows) + len(value))
            at = blocks.at[name]
            rows += range(at.start, at.stop)
        everything = np.concatenate([*values.values(), np.empty(0)])
        return StateValues(place, everything, solver.covariance[np.ix_(rows, rows)])


def neighbours(white: Array) -> float:
    """The mean correlation of neighbouring innovations over the components, from (n, d) normalised ones."""
    centred = white - white.mean(axis=0)
    return float(np.mean(np.sum(centred[1:] * centred[:-1], axis=0) / np.maximum(np.sum(centred**2, axis=0), 1e-300)))


def common(first: Stream, second: Stream) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Masks of the readings of two streams that both have."""
    a, b = np.round(first.time / _SAME).astype(np.int64), np.round(second.time / _SAME).astype(np.int64)
    if len(a) == len(b) and (a == b).all():
        every: NDArray[np.bool_] = np.ones(len(a), np.bool_)
        return every, every
    return np.isin(a, b), np.isin(b, a)
