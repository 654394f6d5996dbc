"""What a campaign's worker does: record a run, try every estimator on it, write the results."""

from __future__ import annotations

import importlib
import os
import signal
import threading
import time
import warnings
from collections import Counter
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from simnav.estimator.registry import discover_own
from simnav.leaderboard.campaign.confinement.attempt import Attempt, close_server, prepare, try_estimator
from simnav.leaderboard.campaign.confinement.reachable_kernels import reachable_kernels
from simnav.leaderboard.campaign.confinement.session import Limits
from simnav.leaderboard.results import store, trials
from simnav.leaderboard.results.errors import named, printable
from simnav.leaderboard.results.provenance import here
from simnav.leaderboard.results.result import Result
from simnav.scoring import score, series
from simnav.simulation.version import SIMULATOR_VERSION

from .entrant import Entrant
from .own_scores import OwnScores
from .recorder import NoRecordingError, record_within, time_limit
from .seal import PUBLIC, Seal

if TYPE_CHECKING:
    from simnav.recording import Recording
    from simnav.scenario import Scenario

__all__ = ["Unit", "judged", "run_unit", "start_worker"]

_loaded: set[str] = set()  # modules whose kernels are here; "" stands for those of recordings
_PATIENCE = 5.0  # for a result that is being stored when the worker must end [s]
_REASON = 2000  # characters of a reason
_results = threading.Lock()  # held while a result is stored, and for good by who ends the worker


@dataclass(frozen=True, eq=False)
class Unit:
    """One run and those who have not done it yet: what a worker is sent.

    Attributes
    ----------
    scenario : Scenario
        The scenario.
    seed : int
        The seed.
    entrants : tuple of (Entrant, str)
        Estimators, each with the key of its result.
    recording, simulator : str
        As in `Result`.
    folder : Path
        Folder of the results.
    limits : Limits
        Limits of an estimator.
    scores : OwnScores
        Scores of others that workers must be sent.
    scoring : str
        As in `Result`.
    keep_trials : bool
        Keep what the estimators gave (`simnav.leaderboard.results.trials`).
    covariance_interval : float
        Least time between two covariances that are kept [s].
    confinement : str
        ``process``, ``bubblewrap`` or ``none``.
    seal : Seal
        Seal from which the seed is derived; `seed` is then the number of the run.
    """

    scenario: Scenario
    seed: int
    entrants: tuple[tuple[Entrant, str], ...]
    recording: str
    simulator: str
    folder: Path
    limits: Limits
    scores: OwnScores = field(default_factory=OwnScores)
    scoring: str = ""
    keep_trials: bool = False
    covariance_interval: float = 0.0
    confinement: str = "process"
    seal: Seal = PUBLIC

    @property
    def weight(self) -> float:
        """About how much work it is."""
        return self.scenario.duration * len(self.entrants)

    def result(self, entrant: Entrant, key: str, status: str, reason: str, confinement: str = "") -> Result:
        """A result without scores."""
        return Result(
            scenario=self.scenario.id,
            seed=self.seed,
            estimator=entrant.label,
            parameters=dict(entrant.parameters),
            reference=entrant.reference,
            status=status,
            reason=printable(" ".join(reason[:_REASON].split())),
            scores={},
            key=key,
            recording=self.recording,
            simnav=self.simulator,
            time_limit=self.limits.timeout,
            memory_limit=self.limits.memory,
            scoring="{}",  # nothing is scored yet
            scenario_digest=self.scenario.content_hash(),
            estimator_digest=entrant.source,
            provenance=here(confinement, self.seal.hash),
            learned=entrant.learned,
            simulator_version=SIMULATOR_VERSION,
            estimator_version=entrant.version,
        )


def start_worker(parent: int) -> None:
    """Prepare a process that was started for a campaign, before it is given any run.

    Ctrl-C is left to the campaign's process, and the worker ends when that process is gone. A campaign can die between
    the start of a worker and the first run that it sends.

    Parameters
    ----------
    parent : int
        Process that runs the campaign.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()


def _prepare_worker(unit: Unit) -> None:
    """Start the server of estimators, and load the kernels of this process, each once."""
    if unit.confinement != "none":  # it loads its kernels while the first recording is made
        wanted = {module for entrant, _ in unit.entrants if not entrant.reference for module in entrant.kernels}
        prepare(unit.confinement, unit.seal.unreadable(unit.folder), loaded=wanted)
    here = [entrant for entrant, _ in unit.entrants if entrant.reference or unit.confinement == "none"]
    _load_kernels({module for entrant in here for module in entrant.kernels})


def _load_kernels(modules: set[str]) -> None:
    """Load the kernels of what is made in forks of this process: of recordings, and of estimators if there are any."""
    from simnav.compiled import kernels

    missing = {"", *modules} - _loaded
    if not missing:
        return
    _loaded.update(missing)
    importlib.import_module("simnav.simulation.simulator")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        if modules:
            discover_own()
        of_recordings = (k for k in kernels() if not k.__module__.startswith("simnav.estimators."))
        for kernel in (*of_recordings, *reachable_kernels(modules)):
            kernel.compile()


def _end_with(parent: int) -> None:
    """End this worker within seconds of the campaign's process, whatever killed that."""
    while os.getppid() == parent:
        time.sleep(1.0)
    _results.acquire(timeout=_PATIENCE)  # estimators that lose their server now have not failed
    close_server()
    os._exit(1)


def _store(folder: Path, result: Result) -> None:
    with _results:
        store.write(folder, result)


def run_unit(index: int, unit: Unit) -> tuple[int, Counter[str]]:
    """Record a run and try everyone on it; return how many ended how."""
    _prepare_worker(unit)
    unit.scores.register()
    statuses: Counter[str] = Counter()
    recording: Recording | None = None
    try:
        seed = unit.seal.seed(unit.scenario.id, unit.seed)
        recording = record_within(unit.scenario, seed, max(unit.limits.timeout, time_limit(unit.scenario)))
    except NoRecordingError as error:
        reason = f"no recording: {error}"
        for entrant, key in unit.entrants:
            _store(unit.folder, unit.result(entrant, key, "no-recording", reason))
            statuses["no-recording"] += 1
    if recording is not None:
        for entrant, key in unit.entrants:
            hidden = unit.seal.unreadable(unit.folder)
            made = try_estimator(entrant, recording, unit.limits, unit.confinement, hidden, sealed=unit.seal.secret)
            result = judged(unit, entrant, key, recording, made)
            try:
                _store(unit.folder, result)
            except store.StoreError:
                raise  # of the disk
            except Exception as error:  # of what it answered
                result = unit.result(entrant, key, "error", f"its result cannot be stored: {named(error)}")
                _store(unit.folder, result)
            statuses[result.outcome] += 1
    return index, statuses


def judged(unit: Unit, entrant: Entrant, key: str, recording: Recording, made: Attempt) -> Result:
    """The result of an attempt, with its scores; the trial is kept where that is wanted.

    Raises
    ------
    StoreError
        If the trial cannot be kept, because of the disk. What the estimator answered raises nothing.
    """
    trial = made.trial
    if trial is not None:
        storable = {name.encode(errors="backslashreplace").decode(): v for name, v in trial.diagnostics.items()}
        trial = replace(trial, diagnostics=storable)
    blank = replace(
        unit.result(entrant, key, made.status, made.reason, made.confinement),
        note=recording.note,
        draws=recording.draws,
        seconds=made.seconds,
        peak_memory=made.peak_memory,
    )
    if trial is None:
        return blank
    try:
        scores = score(trial, recording) if len(trial) else {}
        curves = series(trial, recording) if len(trial) else {}
        with np.errstate(over="ignore"):
            kept = {name: np.asarray(values, dtype=np.float32) for name, values in curves.items()}
        if unit.keep_trials and len(trial):
            trials.write(unit.folder, key, trial, recording, covariance_interval=unit.covariance_interval)
    except store.StoreError:
        raise  # of the disk
    except Exception as error:
        return replace(blank, status="error", reason=f"it cannot be scored: {printable(named(error))}")
    return replace(blank, scores=scores, scoring=unit.scoring if scores else blank.scoring, series=kept)
