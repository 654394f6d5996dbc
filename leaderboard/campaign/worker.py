"""What a campaign's worker does: record a run, try every estimator on it, write the results."""

from __future__ import annotations

import contextlib
import importlib
import os
import random
import signal
import sys
import warnings
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from simnav.leaderboard.campaign.isolation import Outcome, isolate
from simnav.leaderboard.campaign.own_scores import OwnScores
from simnav.leaderboard.campaign.request import enlist
from simnav.leaderboard.campaign.session_class import receive
from simnav.leaderboard.results import store, trials
from simnav.leaderboard.results.provenance import here
from simnav.leaderboard.results.result import Result

if TYPE_CHECKING:
    from simnav.estimator import Estimator
    from simnav.recording import Recording
    from simnav.scenario import Scenario
    from simnav.trial import Trial

__all__ = ["Entrant", "Unit", "run_unit"]

#: What estimators import late; a worker that has it already starts the next one sooner.
_LIBRARIES = ("gtsam", "scipy", "filterpy", "numba", "pandas")

_prepared = False


@dataclass(frozen=True)
class Entrant:
    """An estimator that takes part, resolved: it can be imported in any folder, and is known by its sources.

    Attributes
    ----------
    name : str
        Registered name or absolute path.
    parameters : mapping
    label : str
    reference : bool
    source : str
        Digest.
    code : bytes
        The class itself, where no other process can import it.
    """

    name: str
    parameters: Mapping[str, Any]
    label: str
    reference: bool
    source: str
    code: bytes = b""

    def make(self) -> Estimator:
        """An instance, in the isolated process."""
        from simnav.estimator import make

        if self.code:
            enlist(receive(self.code))
        return make(self.name, **self.parameters)


@dataclass(frozen=True, eq=False)
class Unit:
    """One run and those who have not done it yet: what a worker is sent.

    Attributes
    ----------
    scenario : Scenario
    seed : int
    entrants : tuple of (Entrant, str)
        With the keys of their results.
    recording, simulator : str
        As in `Result`.
    folder : Path
    timeout : float
        Of an estimator [s].
    memory : int
        Of an estimator [bytes].
    parent : int
        Process that runs the campaign.
    scores : OwnScores
        Scores of others that workers must be sent.
    scoring : str
        As in `Result`.
    keep_trials : bool
        Keep what the estimators gave (`simnav.leaderboard.results.trials`).
    covariance_interval : float
        Least time between two covariances that are kept [s].
    """

    scenario: Scenario
    seed: int
    entrants: tuple[tuple[Entrant, str], ...]
    recording: str
    simulator: str
    folder: Path
    timeout: float
    memory: int
    parent: int
    scores: OwnScores = field(default_factory=OwnScores)
    scoring: str = ""
    keep_trials: bool = False
    covariance_interval: float = 0.0

    @property
    def weight(self) -> float:
        """About how much work it is."""
        return self.scenario.duration * len(self.entrants)

    def result(self, entrant: Entrant, key: str, status: str, reason: str) -> Result:
        """A result without scores."""
        return Result(
            scenario=self.scenario.id,
            seed=self.seed,
            estimator=entrant.label,
            parameters=dict(entrant.parameters),
            reference=entrant.reference,
            status=status,
            reason=reason,
            scores={},
            key=key,
            recording=self.recording,
            simnav=self.simulator,
            time_limit=self.timeout,
            memory_limit=self.memory,
            scoring="{}",  # nothing is scored yet
            scenario_digest=self.scenario.content_hash(),
            estimator_digest=entrant.source,
            provenance=here(),
        )


def _prepare_worker(parent: int) -> None:
    """Once a worker: Ctrl-C is the parent's business, and kernels are loaded before the first fork."""
    global _prepared
    if _prepared:
        return
    _prepared = True
    if os.getpid() != parent:
        with contextlib.suppress(ValueError):  # not in the main thread of a Dask worker
            signal.signal(signal.SIGINT, signal.SIG_IGN)
    from simnav.estimator import names
    from simnav.warmup import warmup

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of a broken plug-in the parent has warned
        warmup(load=True)
        names()


def run_unit(index: int, unit: Unit) -> tuple[int, Counter[str]]:
    """Record a run and try everyone on it; return how many ended how."""
    from simnav.source import record

    _prepare_worker(unit.parent)
    unit.scores.register()
    statuses: Counter[str] = Counter()
    recording: Recording | None = None
    try:
        recording = record(unit.scenario, unit.seed)
    except Exception as error:
        reason = f"no recording: {' '.join(str(error).split()) or type(error).__name__}"
        for entrant, key in unit.entrants:
            store.write(unit.folder, unit.result(entrant, key, "no-recording", reason))
            statuses["no-recording"] += 1
    if recording is not None:
        for entrant, key in unit.entrants:
            result = _try(unit, entrant, key, recording)
            store.write(unit.folder, result)
            statuses[result.status] += 1
    return index, statuses


def _try(unit: Unit, entrant: Entrant, key: str, recording: Recording) -> Result:
    """One estimator on one recording."""
    import numpy as np

    from simnav.scoring import score, series

    outcome: Outcome = isolate(
        _attempt,
        entrant,
        recording,
        timeout=unit.timeout,
        memory=unit.memory,
    )
    blank = replace(
        unit.result(entrant, key, outcome.status, outcome.reason),
        note=recording.note,
        draws=recording.draws,
        seconds=outcome.seconds,
        peak_memory=outcome.peak_memory,
    )
    if outcome.status != "ok":
        return blank
    trial, libraries = outcome.value
    for name in libraries:  # the next one need not import them again
        with contextlib.suppress(Exception):
            importlib.import_module(name)
    try:
        scores = score(trial, recording) if len(trial) else {}
        curves = series(trial, recording) if len(trial) else {}
    except Exception as error:
        return replace(blank, status="error", reason=f"it cannot be scored: {type(error).__name__}: {error}")
    if unit.keep_trials and len(trial):
        trials.write(unit.folder, key, trial, recording, covariance_interval=unit.covariance_interval)
    return replace(
        blank,
        status=trial.status,
        reason=trial.reason,
        scores=scores,
        scoring=unit.scoring if scores else blank.scoring,
        series={name: np.asarray(values, dtype=np.float32) for name, values in curves.items()},
    )


def _attempt(entrant: Entrant, recording: Recording) -> tuple[Trial, list[str]]:
    """In the isolated process: make the estimator and run it."""
    import numpy as np

    from simnav.trial import run_trial

    before = set(sys.modules)
    # Whoever draws from a global generator gets the same numbers in every campaign.
    random.seed(recording.seed)
    np.random.seed(recording.seed % 2**32)  # noqa: NPY002
    trial = run_trial(entrant.make(), recording)
    new = [m for m in sorted(set(sys.modules) - before) if m.partition(".")[0] in _LIBRARIES]
    return trial, new
