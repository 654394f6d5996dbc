"""Whether rows are right about themselves and agree where instruments bring states along: a few runs, or many."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from simnav.estimator import make
from simnav.recording import Recording
from simnav.scenario import Scenario
from simnav.scoring import errors, nees_band
from simnav.trial import Trial, run_trial
from simnav.types import Array
from tests.cases.fjord import true_blocks

__all__ = ["DURATION", "LEVEL", "ROWS", "WITHIN", "Consistency", "block_errors", "consistency"]

#: Length of a run [s], and the epochs at which it is judged: the middle and the end.
DURATION, EPOCHS = 40.0, [19, -1]
#: Rows that have the same states; for some of them, by how much the horizontal error may differ from that of the first.
ROWS = ("ekf", "ukf", "iekf", "inekf", "sw-fgo", "gnc-fgo", "oracle")
WITHIN = {"sw-fgo": 0.02, "ukf": 0.02, "oracle": 0.05}
#: Probability of the band of a mean NEES.
LEVEL = 0.999

_GROUPS = [slice(0, 3), slice(3, 6), slice(6, 9)]


@dataclass(frozen=True)
class Consistency:
    """Figures of a row over some runs.

    Attributes
    ----------
    motion : (2, 3) array
        Mean NEES by degree of freedom of position, velocity and attitude at two epochs.
    blocks : (2,) array
        Likewise, of all blocks together.
    rmse : float
        Horizontal error [m].
    runs : int
        Number of runs.
    """

    motion: Array
    blocks: Array
    rmse: float
    runs: int

    @property
    def motion_kept(self) -> bool:
        """Whether the motion is within its band at both epochs."""
        low, high = nees_band(3, self.runs, LEVEL)
        return bool(np.all((low < self.motion) & (self.motion < high)))

    @property
    def blocks_kept(self) -> bool:
        """Whether the blocks are within their band at both epochs."""
        low, high = nees_band(1, self.runs, LEVEL)
        return bool(np.all((low < self.blocks) & (self.blocks < high)))


def block_errors(trial: Trial, truth: dict[str, Array]) -> dict[str, Array]:
    """By label, the (T, k) errors of the reported blocks in sigmas."""
    return {
        label: (trial.diagnostics[f"state.{label}"] - value) / trial.diagnostics[f"sigma.{label}"]
        for label, value in truth.items()
    }


def consistency(row: str, scenario: Scenario, recordings: Sequence[Recording], *, blocks: bool = True) -> Consistency:
    """The figures of a row on recordings of a scenario; with ``blocks`` false, those of blocks are left out."""
    motion, brought, square = [], [], []
    for recording in recordings:
        trial = run_trial(make(row), recording)
        assert trial.status == "ok", (row, trial.reason)
        assert trial.covariance is not None
        e, P = errors(trial, recording), trial.covariance
        motion.append([[e[k, a] @ np.linalg.solve(P[k, a, a], e[k, a]) / 3.0 for a in _GROUPS] for k in EPOCHS])
        if blocks:
            own = block_errors(trial, true_blocks(scenario, recording.seed, trial.time))
            brought.append([np.mean([np.mean(z[k] ** 2) for z in own.values()]) for k in EPOCHS])
        square.append(np.mean(e[:, :2] ** 2))
    mean = np.mean(brought, axis=0) if blocks else np.full(len(EPOCHS), np.nan)
    return Consistency(np.mean(motion, axis=0), mean, float(np.sqrt(np.mean(square))), len(recordings))
