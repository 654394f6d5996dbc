"""How well a logistic classifier tells real windows from simulated ones: the area under its ROC curve."""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simnav.spec import SpecError
from simnav.types import Array

from .features import Windows

__all__ = ["Verdict", "area", "judge"]

#: With fewer recordings than this, each is cut into this many parts, which then count as recordings.
_RECORDINGS = 3
#: Strength of the regularisation of the classifier: inverse, as scikit-learn has it.
_REGULARISATION = 0.1
_RESAMPLES = 1000


@dataclass(frozen=True, eq=False)
class Verdict:
    """What the classifier found.

    Attributes
    ----------
    auc : float
        Area under the ROC curve over windows of runs that the classifier was not trained on: 0.5 if it cannot tell real
        windows from simulated ones, 1 if it tells all.
    interval : (float, float)
        95 % interval, by a bootstrap over recordings and simulated runs.
    single : (f,) array
        Area under the ROC curve of each feature alone, 0.5 to 1.
    real, simulated : (f,) arrays
        Median of each feature.
    parts : bool
        Whether parts of recordings count as recordings.
    """

    auc: float
    interval: tuple[float, float]
    single: Array
    real: Array
    simulated: Array
    parts: bool


def area(real: Array, simulated: Array) -> float:
    """The probability that a simulated score is above a real one; ties count half (Mann and Whitney)."""
    order = np.sort(real)
    below = np.searchsorted(order, simulated, side="left") + np.searchsorted(order, simulated, side="right")
    return float(np.mean(below) / (2.0 * len(real)))


def judge(real: Windows, simulated: Windows, seed: int = 0) -> Verdict:
    """Train and cross-validate the classifier.

    Parameters
    ----------
    real, simulated : Windows
        The windows; each has at least three.
    seed : int
        Seed of the bootstrap.

    Raises
    ------
    SpecError
        If there are too few windows, or scikit-learn is not installed.
    """
    for name, windows in (("the log", real), ("the simulation", simulated)):
        if len(windows.values) < _RECORDINGS:
            raise SpecError(f"{name} has {len(windows.values)} windows of 60 s; at least {_RECORDINGS} are wanted")
    groups, parts = _groups(real)
    mine, _ = _groups(simulated)
    values = np.concatenate([real.values, simulated.values])
    label = np.repeat([0, 1], [len(real.values), len(simulated.values)])
    group = np.concatenate([groups, mine])
    score = np.empty(len(values))
    for fold in range(min(5, len(np.unique(groups)), len(np.unique(mine)))):
        k = min(5, len(np.unique(groups)), len(np.unique(mine)))
        held = group % k == fold
        score[held] = _fitted(values[~held], label[~held]).decision_function(values[held])
    single = np.array([area(real.values[:, k], simulated.values[:, k]) for k in range(values.shape[1])])
    return Verdict(
        area(score[label == 0], score[label == 1]),
        _interval(score, label, group, seed),
        np.maximum(single, 1.0 - single),
        np.median(real.values, axis=0),
        np.median(simulated.values, axis=0),
        parts,
    )


def _groups(windows: Windows) -> tuple[NDArray[np.int64], bool]:
    """A number for each window: its run, or, where runs are few, the part of the run that it begins in."""
    if len(np.unique(windows.run)) >= _RECORDINGS:
        return windows.run, False
    group = np.empty(len(windows.run), dtype=np.int64)
    for run in np.unique(windows.run):
        own = windows.run == run
        place = np.argsort(np.argsort(windows.start[own]))
        group[own] = run * _RECORDINGS + place * _RECORDINGS // own.sum()
    return group, True


def _fitted(values: Array, label: NDArray[np.int64]) -> Any:
    try:
        linear = importlib.import_module("sklearn.linear_model")  # an extra: there or not
        pipeline = importlib.import_module("sklearn.pipeline")
        scaling = importlib.import_module("sklearn.preprocessing")
    except ImportError:
        raise SpecError("simnav log realism needs scikit-learn: pip install 'simnav[realism]'") from None
    model = linear.LogisticRegression(C=_REGULARISATION, class_weight="balanced", max_iter=1000)
    return pipeline.make_pipeline(scaling.StandardScaler(), model).fit(values, label)


def _interval(score: Array, label: NDArray[np.int64], group: NDArray[np.int64], seed: int) -> tuple[float, float]:
    rng, areas = np.random.default_rng(seed), []
    by_group = [[score[(label == side) & (group == g)] for g in np.unique(group[label == side])] for side in (0, 1)]
    for _ in range(_RESAMPLES):
        drawn = [
            np.concatenate([groups[k] for k in rng.integers(len(groups), size=len(groups))]) for groups in by_group
        ]
        areas.append(area(*drawn))
    low, high = np.quantile(areas, [0.025, 0.975]).tolist()
    return low, high
