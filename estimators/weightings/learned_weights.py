"""Weights of the factors of a window from a network, which sees the residuals of all of them.

The network has two hidden layers. It is asked for each measurement, and its output is the information of the
measurement as a part of what the datasheet says, which is the weight. It sees the residual of the measurement, those of
the same instrument before and after it and in the mean of the window, the mean size of the residuals of each group of
instruments, and that of the motion. Motion is weighted by its own residuals (`weigh_motion`).

Unlike the weight of an M-estimator, the weight is no function of one residual: a bias shows in the mean of the window
only. The recipe is `simnav.estimators.training.factor_network`. Weights of residuals that are learned, and not chosen,
are an idea of R. Ranftl and V. Koltun, *Deep fundamental matrix estimation*, ECCV 2018; the network, its inputs and its
targets are ours.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import asinh, log1p, sqrt

import numpy as np

from simnav.compiled import kernel
from simnav.estimators.networks.file import NetworkPiece
from simnav.estimators.networks.groups import GROUPS, group_of
from simnav.kernel_types import IntegerVector, Matrix, Vector
from simnav.structures import length, structure
from simnav.types import Array, Instruments

from .base import Factors
from .robust_weighting import RobustWeighting

__all__ = ["INPUTS", "RECIPE", "VERSION", "LearnedWeights", "inputs_of", "shapes_of"]

RECIPE, VERSION = "factor-network", 1
#: The inputs of the network, in order: components and size of the residual, whitened; size of the instrument's mean
#: residual, the residual along it, and the mean size; the sizes before and after; age and number of the instrument's
#: measurements; size of the motion's residuals; and, by group, which one it is, and the mean sizes.
INPUT = structure(
    component=3, magnitude=float, size_of_mean=float, along_mean=float, mean_size=float, size_before=float,
    size_after=float, age=float, number=float, motion=float, group=GROUPS, size_in_group=GROUPS,
)  # fmt: skip
NUMBER_OF_INPUTS = length(INPUT)
#: Names of the inputs.
INPUTS = (
    "component_0", "component_1", "component_2", "size", "size_of_mean", "along_mean", "mean_size", "size_before",
    "size_after", "age", "number", "motion", "is_fix", "is_velocity", "is_heading", "is_other", "mean_of_fixes",
    "mean_of_velocities", "mean_of_headings", "mean_of_others",
)  # fmt: skip


@kernel
def _fill(
    instrument: IntegerVector,
    components: IntegerVector,
    time: Vector,
    whitened: Matrix,
    norm: Vector,
    group: IntegerVector,
    motion: float,
    inputs: Matrix,
) -> None:
    """Overwrite the (M, n) inputs of M measurements (`INPUTS`); ``group`` is that of each instrument."""
    k = group.size
    count, size, mean = np.zeros(k), np.zeros(k), np.zeros((k, 3))
    in_group, of_group = np.zeros(GROUPS), np.zeros(GROUPS)
    last = np.full(k, -1, np.int64)
    newest = 0.0
    for i in range(norm.size):
        a, of_one = instrument[i], log1p(norm[i] / sqrt(components[i]))
        count[a] += 1.0
        size[a] += of_one
        in_group[group[a]] += 1.0
        of_group[group[a]] += of_one
        for c in range(3):
            mean[a, c] += whitened[i, c]
        newest = max(newest, time[i])
    for i in range(norm.size):
        a, own = instrument[i], inputs[i].view(INPUT)[0]
        along, square = 0.0, 0.0
        for c in range(3):
            m = mean[a, c] / count[a]
            along += whitened[i, c] * m
            square += m * m
            own.component[c] = asinh(whitened[i, c])
        own.magnitude = log1p(norm[i] / sqrt(components[i]))
        own.size_of_mean, own.along_mean, own.mean_size = log1p(sqrt(square)), asinh(along), size[a] / count[a]
        own.size_before, own.size_after = 0.0, 0.0
        if last[a] >= 0:
            before = inputs[last[a]].view(INPUT)[0]
            own.size_before, before.size_after = before.magnitude, own.magnitude
        last[a] = i
        own.age, own.number, own.motion = 0.3 * log1p(newest - time[i]), 0.3 * log1p(count[a]), motion
        for g in range(GROUPS):
            own.group[g] = 1.0 if g == group[a] else 0.0
            own.size_in_group[g] = of_group[g] / in_group[g] if in_group[g] > 0.0 else 0.0


def shapes_of(arrays: Mapping[str, Array]) -> dict[str, tuple[int, ...]]:
    """The shapes that the arrays of a network should have, by the length of its output weight."""
    units = np.size(arrays.get("output_weight", ()))
    return {
        "weight_0": (units, NUMBER_OF_INPUTS), "bias_0": (units,), "weight_1": (units, units), "bias_1": (units,),
        "output_weight": (units,), "output_bias": (1,),
    }  # fmt: skip


def inputs_of(factors: Factors, group: Mapping[str, int]) -> Array:
    """(M, n) array: the inputs of the network for the M measurements of a window.

    Parameters
    ----------
    factors : Factors
        The factors of the window.
    group : mapping of str to int
        Group of each instrument or channel, by name.
    """
    motion = factors.motion_norm
    size = log1p(sqrt(float(motion @ motion) / max(factors.motion_residual.size, 1)))
    groups = np.array([group.get(name, GROUPS - 1) for name in factors.names], dtype=np.int64)
    inputs: Array = np.empty((len(factors.norm), NUMBER_OF_INPUTS))
    _fill(
        np.ascontiguousarray(factors.instrument, dtype=np.int64),
        np.ascontiguousarray(factors.components, dtype=np.int64),
        np.ascontiguousarray(factors.time), np.ascontiguousarray(factors.whitened),
        np.ascontiguousarray(factors.norm), groups, size, inputs,
    )  # fmt: skip
    return inputs


class LearnedWeights(NetworkPiece, RobustWeighting):
    """Weights from a network, which sees the residuals of the whole window (see the module).

    Measurements of kinds that the network has not learned from keep the weight 1.

    Parameters
    ----------
    file : str
        Network of the recipe `simnav.estimators.training.factor_network`; empty: the one of ``budget``.
    budget : int
        Budget of training voyages of a network that comes with simnav: 1000 or 20000.

    Raises
    ------
    NetworkError
        If the file cannot be used.
    ValueError
        If no network of this budget comes with simnav.
    """

    def __init__(self, file: str = "", smallest: float = 1e-3, budget: int = 1000):
        super().__init__(smallest)
        self.network = self.chosen(file, budget, RECIPE, VERSION, shapes_of)

    def reset(self, instruments: Instruments) -> None:
        """Begin a run."""
        self._group = {name: group_of(sheet.kind) for name, sheet in instruments.items()}
        self._known = {name for name, sheet in instruments.items() if sheet.kind in self.network.kinds}

    def choose(self, factors: Factors) -> bool:
        """Set the weights of the measurements."""
        own, x = self.network.arrays, inputs_of(factors, self._group)
        for layer in ("0", "1"):
            x = np.tanh(x @ own[f"weight_{layer}"].T + own[f"bias_{layer}"])
        logits = x @ own["output_weight"] + own["output_bias"][0]
        known = np.array([name in self._known for name in factors.names])[factors.instrument]
        factors.weight[:] = np.where(known, 1.0 / (1.0 + np.exp(-np.clip(logits, -30.0, 30.0))), 1.0)
        return True
