"""The recipe of `simnav.estimators.weightings.learned_weights`: a network that weighs the factors of a window.

1. A window runs over training voyages, and the inputs of the network are noted at the last iteration of some epochs.
   The targets are `simnav.estimators.training.information`. On every second voyage all factors have the weight 1, and
   on the others that of the targets.
2. PyTorch trains two hidden layers by the squared error of the logarithm of the output. Each voyage has the same
   weight.

Run it; it takes less than half an hour on one core::

    pip install '.[learn]'
    python -m simnav.estimators.training.factor_network --voyages 300 --seed 0 --output factor_network.npz
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from simnav.estimators.models.suitable import Suitable
from simnav.estimators.networks.file import Network
from simnav.estimators.solvers.window import WindowEstimator
from simnav.estimators.weightings.base import Factors
from simnav.estimators.weightings.learned_weights import (
    NUMBER_OF_INPUTS,
    RECIPE,
    VERSION,
    LearnedWeights,
    inputs_of,
    shapes_of,
)
from simnav.recording import Recording
from simnav.types import Array

from .information import information
from .recipe import Fitted, Recipe, recorded

__all__ = ["FAMILIES", "Noted", "fit", "gather", "train"]

FAMILIES = ("training-voyages", "training-ships", "training-gnss-faults", "training-clean", "training-outages")
#: One of so many epochs of a window is noted: neighbouring ones hardly differ.
EVERY = 7
UNITS, BATCH, RATE = 24, 1024, 3e-3
#: Smallest weight that is learned.
LEAST = 1e-3


@dataclass(frozen=True, eq=False)
class Noted:
    """The measurements of some windows of one voyage: (k, n) inputs, (k,) targets, and the kinds of instruments."""

    inputs: Any
    target: Any
    kinds: tuple[str, ...]


class _Noting(LearnedWeights):
    """Notes the inputs of the network, and weighs by the targets or not at all."""

    def __init__(self, recording: Recording, leads: bool):
        self.smallest, self._leads = 1e-3, leads
        self.network = Network(RECIPE, VERSION, {})
        streams = {name: s for name, s in recording.data.aids.items() if not s.channels}
        self._targets = {name: (s.time, information(recording, s)) for name, s in streams.items()}
        self._epoch = 0
        self._last: tuple[Array, Array] | None = None
        self.inputs: list[Array] = []
        self.targets: list[Array] = []

    def begin(self) -> None:
        if self._last is not None and self._epoch % EVERY == 0:
            self.inputs.append(self._last[0].astype(np.float32))
            self.targets.append(self._last[1].astype(np.float32))
        self._epoch += 1

    def choose(self, factors: Factors) -> bool:
        target = np.ones(len(factors.norm))
        for a, name in enumerate(factors.names):
            if name in self._targets:
                times, worth = self._targets[name]
                own = factors.instrument == a
                target[own] = worth[np.minimum(np.searchsorted(times, factors.time[own] - 1e-6), len(times) - 1)]
        self._last = inputs_of(factors, self._group), target
        factors.weight[:] = target if self._leads else 1.0
        return True


def gather(recordings: Iterable[Recording]) -> list[Noted]:
    """Run the window over voyages, and note inputs and targets of each."""
    found = []
    for k, recording in enumerate(recordings):
        noting = _Noting(recording, leads=k // len(FAMILIES) % 2 == 1)
        solver = WindowEstimator(Suitable(), weighting=noting, tolerance=0.05)
        solver.reset(recording.start, recording.instruments)
        for packet in recording.steps():
            solver.update(packet)
        kinds = tuple(sorted({s.kind for s in recording.data.aids.values() if not s.channels}))
        nothing = np.empty((0, NUMBER_OF_INPUTS), np.float32), np.empty(0, np.float32)
        inputs, targets = np.concatenate([nothing[0], *noting.inputs]), np.concatenate([nothing[1], *noting.targets])
        found.append(Noted(inputs, targets, kinds))
    return found


def fit(data: Sequence[Noted], checked: Sequence[Noted], epochs: int, seed: int) -> Fitted:
    """Train a network; needs PyTorch. The network of the best epoch on the validation is returned."""
    import torch

    torch.set_num_threads(1)
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    layers = torch.nn.Sequential(
        torch.nn.Linear(NUMBER_OF_INPUTS, UNITS), torch.nn.Tanh(), torch.nn.Linear(UNITS, UNITS), torch.nn.Tanh(),
        torch.nn.Linear(UNITS, 1),
    )  # fmt: skip

    def joined(parts: Sequence[Noted]) -> list[Any]:
        parts = [p for p in parts if len(p.target)]
        weight = np.concatenate([np.full(len(p.target), 1.0 / len(p.target), np.float32) for p in parts])
        arrays = np.concatenate([p.inputs for p in parts]), np.concatenate([p.target for p in parts]), weight
        return [torch.from_numpy(a) for a in arrays]

    x, y, w = joined(data)
    x_checked, y_checked, w_checked = joined(checked)
    w, w_checked = w / w.mean(), w_checked / w_checked.mean()

    def squared(x: Any, y: Any, w: Any) -> Any:
        return ((torch.nn.functional.logsigmoid(layers(x)[:, 0]) - torch.log(y.clamp(min=LEAST))) ** 2 * w).mean()

    steps = -(-len(y) // BATCH)
    optimizer = torch.optim.Adam(layers.parameters(), lr=RATE)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, RATE, total_steps=epochs * steps)
    training, validation, best, begin = [], [], (np.inf, dict[str, Array]()), time.process_time()
    for _ in range(epochs):
        order, total = torch.from_numpy(rng.permutation(len(y))), 0.0
        for at in range(0, len(y), BATCH):
            rows = order[at : at + BATCH]
            loss = squared(x[rows], y[rows], w[rows])
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            schedule.step()
            total += loss.item() * len(rows)
        with torch.no_grad():
            validation.append(squared(x_checked, y_checked, w_checked).item())
        training.append(total / len(y))
        if validation[-1] < best[0]:
            best = validation[-1], _arrays(layers)
    kinds = tuple(sorted({kind for part in data for kind in part.kinds}))
    seconds = (time.process_time() - begin) / epochs
    return Fitted(Network(RECIPE, VERSION, best[1], kinds), steps, training, validation, seconds)


def _arrays(layers: Any) -> dict[str, Array]:
    """The parameters of PyTorch as `simnav.estimators.weightings.learned_weights` takes them."""
    first, second, last = layers[0], layers[2], layers[4]
    own = {
        "weight_0": first.weight, "bias_0": first.bias, "weight_1": second.weight, "bias_1": second.bias,
        "output_weight": last.weight[0], "output_bias": last.bias,
    }  # fmt: skip
    arrays = {name: tensor.detach().numpy().astype(np.float64) for name, tensor in own.items()}
    assert {name: a.shape for name, a in arrays.items()} == shapes_of(arrays)
    return arrays


def train(data: Sequence[Noted], checked: Sequence[Noted], epochs: int, seed: int) -> Fitted:
    """Train on what was noted on the first voyages of `FAMILIES`, and add the record of the training."""
    return recorded(fit(data, checked, epochs, seed), FAMILIES, len(data), seed)


RECIPE_OF_ROW = Recipe(
    "Train the network that weighs the factors of a window.", "net-fgo",
    "squared error of the logarithm of the information", FAMILIES, 300, 4, gather, train,
)  # fmt: skip

if __name__ == "__main__":
    RECIPE_OF_ROW.command("factor_network")
