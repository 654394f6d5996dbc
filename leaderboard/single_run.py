"""One run: several estimators over one recording, in this process."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from simnav.estimator.looking_back import PREFIX
from simnav.kinds import EQUATIONS, KINDS
from simnav.leaderboard.campaign.recorder import record_here
from simnav.leaderboard.campaign.request import EstimatorRequest
from simnav.leaderboard.figures.lag_figure import lag_figure
from simnav.leaderboard.figures.moving_picture import moving_picture
from simnav.leaderboard.figures.run_figure import run_figure
from simnav.leaderboard.ranking.ranking_table import consistency
from simnav.leaderboard.results.errors import RequestError, mistakes, printable
from simnav.leaderboard.results.frame import frame
from simnav.leaderboard.results.shown import Shown
from simnav.scoring import SCORES, protection_levels, score, stanford
from simnav.scoring.consistency import JUDGED
from simnav.scoring.ending import outcome, why_lost
from simnav.scoring.lagged import seconds_of
from simnav.scoring.trajectory_errors import TrajectoryErrors, trajectory_errors
from simnav.scoring.verdict import verdict

from .estimator_output import first_lines
from .ranking import tables

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from simnav.recording import Recording
    from simnav.scenario import Scenario
    from simnav.scoring import Stanford
    from simnav.trial import Trial

__all__ = ["EstimatorRun", "RunReport", "ScoreReport", "run_once", "score_of_files"]


#: Diagnostics that an estimator gives for each instrument that it uses.
_OF_INSTRUMENTS = ("innovation.", "residual.")


@dataclass(frozen=True, eq=False, repr=False)
class EstimatorRun:
    """What one estimator did.

    Attributes
    ----------
    estimator : str
        Label.
    parameters : mapping
        Parameters of the estimator that were set.
    reference : bool
        Whether the estimator receives the truth (a reference row).
    status, reason : str
        As in `simnav.trial.trial`; a run that is ``lost`` (`simnav.scoring.ending`) is not ``ok``.
    seconds : float
        Wall-clock time of the whole run [s].
    scores : mapping of str to float
        As in `simnav.scoring.SCORES`.
    trial : Trial
        Its estimates.
    """

    estimator: str
    parameters: Mapping[str, Any]
    reference: bool
    status: str
    reason: str
    seconds: float
    scores: Mapping[str, float]
    trial: Trial

    @property
    def failed(self) -> bool:
        """Whether it counts as a failure."""
        return self.status not in ("ok", "unsuitable")

    def __repr__(self) -> str:
        error = self.scores.get("horizontal_rmse", math.nan)
        return f"<EstimatorRun: {self.estimator}, {self.status}, horizontal RMSE {tables.number(error)} m>"


@dataclass(frozen=True, eq=False, repr=False)
class RunReport(Shown):
    """One run of several estimators.

    Attributes
    ----------
    recording : Recording
        What they were given, and the truth.
    simulation_seconds : float
        Wall-clock time of making it [s].
    estimators : tuple of EstimatorRun
        In the order in which they were asked for.
    scenario : Scenario or None
        Of the run; its obstacles are drawn.
    """

    recording: Recording
    simulation_seconds: float
    estimators: tuple[EstimatorRun, ...]
    scenario: Scenario | None = None

    def headline(self) -> str:
        """The run, and who took part."""
        labels = ", ".join(e.estimator for e in self.estimators)
        return f"{self.recording.scenario}, seed {self.recording.seed}: {labels}"

    def shown(self) -> Sequence[tables.Fitted]:
        """The table of the scores; with lags, that of outputs that are late, too."""
        found = run_table(self.recording, self.estimators)
        late = any("_lag_" in name for e in self.estimators for name in e.scores)
        return [found, lag_table(self.estimators)] if late else [found]

    def unseen(self, run: EstimatorRun) -> dict[str, str]:
        """Name and kind of the instruments of which an estimator shows no innovation and no residual.

        Those only whose kind has an equation of its own, or none: whether an estimator can use the others, its
        documentation says. Empty where the estimator did not run.
        """
        shown = {name.partition(".")[2] for name in run.trial.diagnostics if name.startswith(_OF_INSTRUMENTS)}
        own = {s.name: s.kind for s in self.recording.data.aids.values() if KINDS[s.kind].equation not in EQUATIONS}
        return {name: kind for name, kind in own.items() if len(run.trial) and name not in shown}

    def to_dict(self) -> dict[str, Any]:
        """What ``simnav run --json`` prints, but for the figure."""
        fields = ("estimator", "parameters", "reference", "status", "reason", "seconds", "scores")
        return {
            "scenario": self.recording.scenario,
            "seed": self.recording.seed,
            "duration": self.recording.duration,
            "note": self.recording.note,
            "draws": dict(self.recording.draws),
            "simulation_seconds": self.simulation_seconds,
            "estimators": [{name: getattr(e, name) for name in fields} for e in self.estimators],
            "scores": {name: {"title": s.title, "unit": s.unit, "better": s.better} for name, s in SCORES.items()},
        }

    def to_frame(self) -> Any:
        """A row an estimator, a column a score (SI units, radians); see `simnav.leaderboard.results.frame.frame`."""
        head = ("estimator", "reference", "status", "reason", "seconds")
        return frame([
            {**{name: getattr(e, name) for name in head}, **{s: e.scores.get(s, float("nan")) for s in SCORES}}
            for e in self.estimators
        ])  # fmt: skip

    def plot(self) -> Figure:
        """Tracks, errors with the bounds that were claimed, diagnostics.

        Raises
        ------
        RequestError
            If no estimator gave anything.
        """
        return run_figure(self.recording, self._drawn(), self._references(), self.scenario)

    def animate(self, path: Path) -> Path:
        """Write a moving picture of the run, a GIF: the vessel on its track, fixes, estimates with their ellipses.

        Parameters
        ----------
        path : Path
            The file.

        Returns
        -------
        Path
            The file.

        Raises
        ------
        RequestError
            If no estimator gave anything.
        """
        return moving_picture(self.recording, self._drawn(), path, self._references())

    def _drawn(self) -> list[tuple[str, Trial]]:
        trials = [(e.estimator, e.trial) for e in self.estimators]
        if not any(len(trial) for _, trial in trials):
            raise RequestError("there is nothing to draw: no estimator gave an estimate")
        return trials

    def _references(self) -> list[str]:
        return [e.estimator for e in self.estimators if e.reference]

    def plot_lags(self) -> Figure:
        """The latency-accuracy curve: horizontal RMSE against the delay of the output.

        Raises
        ------
        RequestError
            If no estimator ran with ``lags``.
        """
        base = "horizontal_rmse"
        names = _late_scores(self.estimators)
        if not names:
            raise RequestError("there is no output that is late: run with lags, like --lags 1/5/10")
        curves = {
            e.estimator: [(lag, float(e.scores[s])) for lag, s in ((0.0, base), *names) if e.scores.get(s, 0.0) > 0.0]
            for e in self.estimators
        }
        return lag_figure({k: v for k, v in curves.items() if v},
                          f"{self.recording.scenario}, seed {self.recording.seed}")  # fmt: skip

    def stanford(self, limit: float = 25.0) -> dict[str, Stanford]:
        """Errors beside protection levels, by label, of the estimators that have a protection level.

        Parameters
        ----------
        limit : float
            Alert limit [m]; 25 m is IMO A.915(22) outside of ports.
        """
        return {
            e.estimator: stanford([(e.trial, self.recording)], limit)
            for e in self.estimators
            if np.isfinite(protection_levels(e.trial)).any()
        }


@dataclass(frozen=True, eq=False, repr=False)
class ScoreReport(RunReport):
    """Estimates of one run that were made elsewhere; the attributes are those of `RunReport`, and:

    Attributes
    ----------
    trajectories : mapping of str to TrajectoryErrors
        Errors after an alignment and relative errors, by label; without files that have no positions.
    """

    trajectories: Mapping[str, TrajectoryErrors] = field(default_factory=dict)

    def shown(self) -> Sequence[tables.Fitted]:
        """The tables of the scores, and that of aligned and relative errors."""
        found = super().shown()
        return [*found, trajectory_table(self.trajectories)] if self.trajectories else found

    def to_dict(self) -> dict[str, Any]:
        """What ``simnav score --json`` prints, but for the figure."""
        return super().to_dict() | {"trajectories": {name: asdict(t) for name, t in self.trajectories.items()}}


def run_once(
    scenario: Scenario,
    requests: Sequence[EstimatorRequest],
    seed: int = 0,
    progress: Callable[..., None] | None = None,
) -> RunReport:
    """Run estimators over one recording; see `simnav.leaderboard.interface.run`."""
    from simnav.trial import run_trial

    with mistakes(ValueError):
        estimators = [request.make() for request in requests]
    started = time.perf_counter()
    recording = record_here(scenario, seed)
    simulated = time.perf_counter() - started
    report = progress or (lambda *_, **__: None)
    runs = []
    for k, (request, estimator) in enumerate(zip(requests, estimators, strict=True)):
        report(k, len(requests), note=request.label)
        started = time.perf_counter()
        with first_lines(request.label):
            trial = run_trial(estimator, recording)
        seconds = time.perf_counter() - started
        runs.append(_judged(request.label, request.parameters, estimator.reference, seconds, trial, recording))
    report(len(requests), len(requests))
    return RunReport(recording, simulated, tuple(runs), scenario)


def score_of_files(scenario: Scenario, paths: Sequence[Path], seed: int) -> ScoreReport:
    """Score files of estimates of one run; see `simnav.leaderboard.interface.score_files`."""
    from simnav.trial.estimate_file import trial_of_file

    started = time.perf_counter()
    recording = record_here(scenario, seed)
    simulated = time.perf_counter() - started
    runs = []
    for path in paths:
        with mistakes(ValueError, OSError):
            trial = trial_of_file(path, recording)
        runs.append(_judged(path.name, {}, False, math.nan, trial, recording))
    errors = {run.estimator: trajectory_errors(run.trial, recording) for run in runs if len(run.trial)}
    known = {name: found for name, found in errors.items() if found is not None}
    return ScoreReport(recording, simulated, tuple(runs), scenario, known)


def _judged(
    label: str, parameters: Mapping[str, Any], reference: bool, seconds: float, trial: Trial, recording: Recording
) -> EstimatorRun:
    """What an estimator did, with its scores and how it ended."""
    scores = score(trial, recording) if len(trial) else {}
    status = outcome(trial.status, scores)
    reason = why_lost(scores) if status == "lost" else printable(trial.reason)
    return EstimatorRun(label, parameters, reference, status, reason, seconds, scores, trial)


def _covariance(scores: Mapping[str, float]) -> str:
    """What the truth of this run says of the covariance: the worst verdict, and the NEES that it is from."""
    return consistency(verdict({group: np.array([scores.get(f"nees_{group}", math.nan)]) for group in JUDGED}))


def _late_scores(estimators: Sequence[EstimatorRun]) -> list[tuple[float, str]]:
    """The lags [s] that any estimator ran with, ascending, each with the name of its horizontal RMSE."""
    names = {n for e in estimators for n in e.scores if n.startswith("horizontal_rmse_lag_")}
    return sorted((seconds_of(name.rpartition("_")[2]), name) for name in names)


def lag_table(estimators: Sequence[EstimatorRun]) -> tables.Fitted:
    """Horizontal RMSE against the delay of the output: a row an estimator, a column a lag."""
    base = "horizontal_rmse"
    names = _late_scores(estimators)
    columns = ["estimator", "newest", *(f"{lag:g} s late" for lag, _ in names)]
    cells = [[e.estimator, *(tables.number(e.scores.get(s)) for s in (base, *(s for _, s in names)))]
             for e in estimators]  # fmt: skip
    same = ", ".join(e.estimator for e in estimators if _repeats(e.trial))
    caption = f"Without an estimate of earlier times; what they gave then is repeated: {same}." if same else ""
    return tables.Fitted("Horizontal RMSE [m] of an output that is late", columns, cells, columns, numeric=columns[1:],
                         caption=caption)  # fmt: skip


def trajectory_table(trajectories: Mapping[str, TrajectoryErrors]) -> tables.Fitted:
    """Errors after an alignment, and relative errors over times and distances: a row a file."""
    first = next(iter(trajectories.values()))
    times = [f"{r.span:g} s [m]" for r in first.over_times]
    distances = [f"{r.span:g} m [%]" for r in first.over_distances]
    turned = f"turned in {first.over_times[0].span:g} s [deg]"
    columns = ["estimates", "error [m]", "aligned [m]", *times, *distances, turned]
    cells = [
        [name + (" (height left out)" if t.dimensions == 2 else ""), tables.number(t.absolute),
         tables.number(t.aligned), *(tables.number(r.translation) for r in t.over_times),
         *(tables.number(100.0 * r.translation / r.span) for r in t.over_distances),
         tables.number(math.degrees(t.over_times[0].rotation))]
        for name, t in trajectories.items()
    ]  # fmt: skip
    return tables.Fitted(
        "Root mean squares of position errors in three dimensions", columns, cells, columns, numeric=columns[1:],
        caption="Aligned: after the rotation and translation that fit best, as by 'evo_ape -a'. Then the relative "
        "errors of the motion over a time, and over a distance along the true track, over all pairs of epochs.",
    )  # fmt: skip


def _repeats(trial: Trial) -> bool:
    """Whether the estimates of earlier times are those that were given then, for all lags above 0."""
    late = [change for name, change in trial.diagnostics.items()
            if name.startswith(PREFIX) and seconds_of(name.removeprefix(PREFIX)) > 0.0]  # fmt: skip
    return bool(late) and not any(np.nan_to_num(change).any() for change in late)


def run_table(recording: Recording, estimators: Sequence[EstimatorRun]) -> tables.Fitted:
    """Scores of the estimators, the best horizontal RMSE first."""

    def order(k: int) -> tuple[bool, float]:
        value = estimators[k].scores.get("horizontal_rmse", math.inf)
        return estimators[k].status != "ok", value if math.isfinite(value) else math.inf

    ordered = [estimators[k] for k in sorted(range(len(estimators)), key=order)]
    plain = ("horizontal_rmse", "r95", "horizontal_max", "vertical_rmse", "velocity_horizontal_rmse")
    smoothed = any(math.isfinite(e.scores.get("smoothed_horizontal_rmse", math.nan)) for e in ordered)
    cells = [
        [e.estimator + (" *" if e.reference else ""), e.status,
         *(tables.number(e.scores.get(s)) for s in plain),
         tables.number(math.degrees(e.scores.get("heading_rmse", math.nan))),
         _covariance(e.scores), tables.percent(e.scores.get("coverage_95")),
         tables.duration(e.scores.get("update_median")),
         tables.number(e.scores.get("smoothed_horizontal_rmse")) if smoothed else ""]
        for e in ordered
    ]  # fmt: skip
    columns = ["estimator", "status", "horizontal RMSE [m]", "R95 [m]", "max [m]", "vertical RMSE [m]",
               "velocity RMSE [m/s]", "heading RMSE [deg]", "NEES/dof", "95 % coverage", "per epoch",
               "smoothed [m]"]  # fmt: skip
    note = f"; {recording.note}" if recording.note else ""
    reference = [i for i, e in enumerate(ordered) if e.reference]
    return tables.Fitted(
        f"{recording.scenario}, seed {recording.seed}, {tables.duration(recording.duration)}{note}",
        columns,
        cells,
        [
            "estimator",
            "horizontal RMSE [m]",
            "status",
            "smoothed [m]",
            "R95 [m]",
            "NEES/dof",
            "max [m]",
            "heading RMSE [deg]",
            "per epoch",
        ],
        numeric=columns[2:],
        dim=reference,
        caption="* reference: it is told the truth" if reference else None,
    )
