"""The runs of all rows on one scenario, as a board counts them: the same seeds for each, relative to the same oracle.

**Runs that count.** The seeds that at least half of the rows have run (`simnav.leaderboard.ranking.evidence`).

**Figures.** The logarithm of the error of a run, divided by the error of an oracle on the same run. Seeds differ in how
hard they are, for a row and the oracle alike, so the ratio to the same run says more than the ratio to a mean over
other runs. Where the oracle has not run all seeds that count, the scenario's stored reference figure is the divisor.
Recorded voyages have no oracle; there the plain row on the same runs is the divisor.
"""

from __future__ import annotations

import math
import re
from collections.abc import Container, Mapping
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .board import Reference
from .evidence import common_seeds, notes_by_seed
from .plain_row import PLAIN as PLAIN_ROWS
from .plain_row import plain_row
from .plausibility import beats, below_floor, too_good
from .reference import ORACLES, PLAIN, reference_of
from .runs import Runs
from .statistics import FAILURE, FIRST, STAGES
from .tracks import RECORDED, SMOOTHED, Track

__all__ = ["CAP", "Cell", "ScenarioRuns"]

Array = NDArray[np.float64]

#: Logarithm of the ratio that a failed run has, and that no run exceeds.
CAP = math.log(FAILURE)
#: The plain smoothers: the floor of recorded voyages is a part of their error.
SMOOTHERS = PLAIN_ROWS[SMOOTHED]
_LEAST = math.log(1e-9)  # of an error of zero
_RECORDING = re.compile(r"recording '([^']*)'")


@dataclass(frozen=True, eq=False)
class Cell:
    """The runs of one row on one scenario that count.

    Attributes
    ----------
    runs : Runs
        Those runs.
    asked : int
        How many seeds the scenario asks; a row with fewer is incomplete.
    units : list
        The seed or the recording of each run.
    logs : (n,) array
        Logarithms of the ratios to the reference; infinite where a run failed.
    """

    runs: Runs
    asked: int
    units: list[Any]
    logs: Array

    @property
    def complete(self) -> bool:
        """Whether the row has run all seeds that the scenario asks."""
        return len(self.logs) == self.asked

    @property
    def capped(self) -> Array:
        """The logarithms as they count."""
        return np.minimum(self.logs, CAP)

    @property
    def failed(self) -> NDArray[np.bool_]:
        """Which runs failed."""
        return np.isinf(self.logs)

    @cached_property
    def by_unit(self) -> tuple[list[Any], Array]:
        """The units, each once, and the mean of what counts."""
        if len(set(self.units)) == len(self.units):
            return self.units, self.capped
        units = list(dict.fromkeys(self.units))
        index = np.array([units.index(u) for u in self.units])
        return units, np.bincount(index, self.capped) / np.bincount(index)


class ScenarioRuns:
    """One scenario with its rows: those that have runs, and those that it does not suit.

    Parameters
    ----------
    name : str
        Versioned id.
    by : mapping of str to Runs
        All runs by estimator.
    track : Track
        The track that is ranked, with its score.
    recorded : bool or None
        Whether the scenario is of recorded voyages, as the catalogue says; None for one that is not in it.
    apart : container of str
        Rows that have no say in which seeds count.
    staged : bool
        Whether rows may have more seeds than others (`simnav.leaderboard.ranking.statistics.stages`). The seeds that
        count for all are then at most the first 30, and a row with all seeds of a later stage has these.

    Attributes
    ----------
    stratum : str
        Scenarios of one stratum count as one where a mean is taken over several. Default: the name of the scenario.
    cells : dict of str to Cell
        By estimator, of those that the scenario suits.
    unsuitable : dict of str to str
        Estimators that the scenario does not suit, and why.
    reference : Reference
        What the errors are divided by.
    plain : str
        The plain row; empty where none has all seeds.
    seeds : list of int
        Seeds that count for all rows.
    order : list of int
        These, and in a staged scenario those after them, of which a row may have the first ones.
    """

    def __init__(
        self,
        name: str,
        by: Mapping[str, Runs],
        track: Track,
        recorded: bool | None = None,
        apart: Container[str] = (),
        staged: bool = False,
    ):
        self.name, self.stratum, self.track = name, name, track
        self.unsuitable = {n: why for n in sorted(by) if (why := by[n].unsuitable())}
        entries = {n: by[n] for n in sorted(by) if by[n].tried and n not in self.unsuitable}
        if track.score == SMOOTHED and track.name == "post-processing":  # whoever never smooths is not in it
            entries = {n: r for n, r in entries.items() if np.isfinite(r.scores(track.score)).any()}
        self.notes = notes_by_seed([r for runs in entries.values() for r in runs.tried])
        voters = [r for n, r in entries.items() if not r.reference and n not in apart]
        voters = voters or [r for r in entries.values() if not r.reference] or list(entries.values())
        self.staged = staged
        self.seeds = common_seeds([{r.seed for r in runs.tried} for runs in voters])
        self.order = sorted({r.seed for runs in voters for r in runs.tried}) if staged else self.seeds
        if staged:
            self.seeds = self.seeds[:FIRST]
        self.errors = {n: self._errors(r) for n, r in entries.items()}
        self.recorded = track.name == RECORDED or (self._said_to_be_recorded() if recorded is None else recorded)
        self._smoothed = {n: _column(by[n], SMOOTHED) for n in SMOOTHERS if n in by}
        self._stored = reference_of(name, track.score, entries, self.recorded)
        self.divisor, self.reference = self._reference()
        self.plain = plain_row(track.score, {n for n in entries if self._is_complete(n)})
        self.cells = {n: self._cell(r) for n, r in entries.items()}

    def _said_to_be_recorded(self) -> bool:
        """What the notes say of a scenario that is not in the catalogue; of a recorded one there is no oracle."""
        if any(ORACLES.get(self.track.score, "oracle") == n for n in self.errors):
            return False
        return bool(self.notes) and all(_RECORDING.match(note) for note in self.notes.values())

    def _errors(self, runs: Runs) -> dict[int, float]:
        """The error by seed; infinite where a run failed or has no position."""
        return _column(runs, self.track.score)

    def _is_complete(self, name: str) -> bool:
        """Whether a row has a finite error above zero on every seed that counts."""
        mine = self.errors.get(name, {})
        return bool(self.seeds) and all(0.0 < mine.get(seed, math.inf) < math.inf for seed in self.seeds)

    def _reference(self) -> tuple[Mapping[int, float], Reference]:
        """What is divided by, by seed, and in words: an oracle on the same runs, or else a fixed figure."""
        name = ORACLES.get(self.track.score, "oracle")
        if self.recorded:
            name = plain_row(self.track.score, {n for n in self.errors if self._is_complete(n)})
        if not name or not self._is_complete(name):
            return dict.fromkeys(self.order, self._stored.value), self._stored
        mine = {s: e for s in self.order if 0.0 < (e := self.errors[name].get(s, math.inf)) < math.inf}
        logs = np.log([mine[seed] for seed in self.seeds])
        spread = float(logs.std(ddof=1)) if len(logs) > 1 else math.nan
        return mine, Reference(math.exp(float(logs.mean())), name, len(logs), spread, paired=True)

    def _cell(self, runs: Runs) -> Cell:
        counts = set(self.seeds)
        used = counts | self._further(runs)
        there = [r for r in runs.tried if r.seed in used]
        logs = [self.log(runs.estimator, r.seed) for r in there]
        same = len(there) == len(runs.results)
        counted = runs if same else Runs(there) if there else runs
        return Cell(counted, len(counts), [self.unit(r.seed) for r in there], np.array(logs, dtype=np.float64))

    def _further(self, runs: Runs) -> set[int]:
        """The seeds that count for a row beyond those of all: up to the last stage that it has whole."""
        mine = {r.seed for r in runs.tried}
        parts = [self.order[: stage.seeds] for stage in STAGES] if self.staged else []
        whole = [part for part in parts if all(seed in mine and seed in self.divisor for seed in part)]
        return {seed for part in whole for seed in part}

    def in_stratum(self, name: str) -> ScenarioRuns:
        """The same runs as a part of a stratum."""
        made = copy(self)
        made.stratum = name
        return made

    def of_rows(self, names: Container[str]) -> ScenarioRuns:
        """The runs of some rows alone; what their errors are divided by stays."""
        made = copy(self)
        made.cells = {name: cell for name, cell in self.cells.items() if name in names}
        return made

    @cached_property
    def seals(self) -> frozenset[str]:
        """Hashes of the keys from which the seeds follow; an empty text for public seeds."""
        return frozenset(r.provenance.seal for cell in self.cells.values() for r in cell.runs.results)

    def log(self, name: str, seed: int) -> float:
        """Logarithm of the ratio of a row's error to the reference in one run; infinite where the run failed."""
        return _ratio(self.errors[name][seed], self.divisor[seed])

    def unit(self, seed: int) -> Any:
        """The independent unit of a run: its seed, or its recording."""
        if not self.recorded:
            return seed
        note = self.notes[seed]
        found = _RECORDING.match(note)
        return found.group(1) if found else note

    def implausible(self, name: str, scenarios: int = 1) -> bool:
        """Whether a row is better here than what is possible: than an oracle on the same runs, or its stored figure.

        On recorded voyages: far better than the plain smoother, or the plain filter where there is none.
        """
        if self.cells[name].runs.reference:
            return False
        if self.recorded:
            return self._below_floor(name)
        oracle = self.errors.get(ORACLES.get(self.track.score, "oracle"), {})
        mine = {seed: error for seed, error in self.errors[name].items() if math.isfinite(error)}
        pairs = [_ratio(error, oracle[seed]) for seed, error in mine.items() if 0.0 < oracle.get(seed, 0.0) < math.inf]
        if beats(pairs, scenarios):
            return True
        logs = [_ratio(error, self._stored.value) for seed, error in mine.items() if seed in self.divisor]
        return self._stored.bounds and too_good(logs, self._stored, scenarios)

    def _below_floor(self, name: str) -> bool:
        if self.track.score not in ORACLES:  # no position error
            return False
        mine = {seed: error for seed, error in self.errors[name].items() if math.isfinite(error)}
        units = {seed: self.unit(seed) for seed in mine}
        smoother = next((n for n in SMOOTHERS if n in self._smoothed), "")
        if smoother and name != smoother:
            return below_floor(mine, self._smoothed[smoother], "smoother", units)
        filters = [n for n in PLAIN if n in self.errors and n != name]
        others = self.errors[filters[0]] if filters else dict.fromkeys(mine, self._stored.value)
        if not filters and not self._stored.estimator:
            others = {}
        return below_floor(mine, others, "filter", units)


def _column(runs: Runs, score: str) -> dict[int, float]:
    """A score by seed; infinite where a run failed or does not have it."""
    pairs = zip(runs.results, runs.column(score).tolist(), strict=True)
    return {r.seed: v if r.status == "ok" and math.isfinite(v) else math.inf for r, v in pairs if r.tried}


def _ratio(error: float, divisor: float) -> float:
    return max(math.log(error / divisor), _LEAST) if error > 0.0 else _LEAST
