"""What is minimised: the error of a row over that of its plain form, on training voyages.

For every voyage, the logarithm of the horizontal RMSE over that of the baseline on the same voyage, held within
`LARGEST`; an estimator that fails has the largest. The objective of a family is the mean over its voyages, and that of
several families the mean over them. On families of clean voyages (tag ``clean``) a row may lose `CLEAN` on average;
what it loses beyond that counts `PRICE` times, so that no robustness is bought on a clean day.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from simnav.estimator import make
from simnav.leaderboard.campaign.request import EstimatorRequest
from simnav.leaderboard.results.errors import RequestError, mistakes
from simnav.recording import Recording
from simnav.scenario import Scenario
from simnav.scoring import score
from simnav.source import record
from simnav.trial import run_trial

__all__ = ["BASELINES", "Figures", "Voyages", "only_training"]

#: Largest ratio of errors that counts.
LARGEST = 20.0
#: Ratio to the baseline that clean voyages may cost on average, and the price of what is beyond.
CLEAN, PRICE = 1.02, 10.0
#: What a row is compared with: on a vessel with an IMU, and without.
BASELINES = ("ekf", "ship-ekf")

Progress = Callable[..., None]


def only_training(scenario: Scenario) -> None:
    """RequestError if a scenario is not one for training: parameters are never chosen on what is ranked."""
    if not scenario.training:
        raise RequestError(
            f"{scenario.id} is no training family: parameters are chosen on voyages that are never ranked; "
            "'simnav list scenarios' shows the track 'training'"
        )


@dataclass(frozen=True)
class Figures:
    """What a row is worth with certain parameters.

    Attributes
    ----------
    objective : float
        Value that the search minimises.
    ratio : mapping of str to float
        Geometric mean of the error ratios, by family.
    lost : float
        Share of all voyages on which the error is above 1.5 times the baseline's.
    failed : int
        Voyages on which the row failed.
    """

    objective: float
    ratio: Mapping[str, float]
    lost: float
    failed: int

    def to_dict(self) -> dict[str, Any]:
        """The fields as values that JSON can hold."""
        return asdict(self)


@dataclass(frozen=True, eq=False)
class _Voyage:
    family: str
    recording: Recording
    baseline: float


class Voyages:
    """Recordings of training families, with the error of the baseline on each.

    Parameters
    ----------
    families : sequence of Scenario
        Training scenarios.
    seeds : range
        The same for all families.
    progress : callable, optional
        Called with how many of how many voyages are recorded, and ``note=`` the next.

    Raises
    ------
    RequestError
        If a scenario is not for training.
    """

    def __init__(self, families: Sequence[Scenario], seeds: range, progress: Progress | None = None):
        for family in families:
            only_training(family)
        self.families = {f.id: "clean" in f.tags for f in families}
        self.seeds = seeds
        self._voyages: list[_Voyage] = []
        report, total = progress or (lambda *_, **__: None), len(families) * len(seeds)
        for family in families:
            for seed in seeds:
                report(len(self._voyages), total, note=f"{family.id}, seed {seed}")
                with mistakes(ValueError):
                    recording = record(family, seed)
                name = BASELINES[recording.instruments.imu is None]
                self._voyages.append(_Voyage(family.id, recording, _rmse(name, {}, recording)))

    def __len__(self) -> int:
        return len(self._voyages)

    def figures(self, request: EstimatorRequest, parameters: Mapping[str, Any]) -> Figures:
        """The objective and what it is made of, of a row with some parameters beside its own."""
        values = {**request.parameters, **parameters}
        logs: dict[str, list[float]] = {family: [] for family in self.families}
        failed = 0
        for voyage in self._voyages:
            error = _rmse(request.name, values, voyage.recording)
            failed += not math.isfinite(error)
            ratio = math.log(error / voyage.baseline) if math.isfinite(error) else math.inf
            logs[voyage.family].append(min(max(ratio, -math.log(LARGEST)), math.log(LARGEST)))
        means = {family: float(np.mean(found)) for family, found in logs.items()}
        objective = float(np.mean(list(means.values())))
        for family, clean in self.families.items():
            if clean:
                objective += PRICE * max(0.0, means[family] - math.log(CLEAN))
        every = np.concatenate([np.array(found) for found in logs.values()])
        ratios = {family: math.exp(mean) for family, mean in means.items()}
        return Figures(objective, ratios, float(np.mean(every > math.log(1.5))), failed)


def _rmse(name: str, parameters: Mapping[str, Any], recording: Recording) -> float:
    """Horizontal RMSE [m]; infinite where the estimator fails."""
    try:
        estimator = make(name, **parameters)
    except ValueError:  # values that do not go together
        return math.inf
    trial = run_trial(estimator, recording, keep_covariance=False)
    if trial.status != "ok":
        return math.inf
    return max(score(trial, recording, ["horizontal_rmse"])["horizontal_rmse"], 1e-6)
