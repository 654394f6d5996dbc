"""The recipe of `simnav.estimators.adaptations.learned_noise`: a recurrent network that sets the noise of each reading.

1. A filter runs over training voyages, and the inputs of the network are noted at each reading. The targets are
   `simnav.estimators.training.information`. On every second voyage the filter uses the noise of the datasheets, and on
   the others that of the targets. So the network sees the innovations of a filter that was misled, and those of one
   that was not; with the network, the filter will be between the two.
2. PyTorch trains a layer of gated units by the squared error of the logarithm of the output, whose minimum is the mean
   logarithm of the target given all innovations so far. Each instrument of a voyage is a sequence of equal weight.

Run it; it takes less than half an hour on one core::

    pip install '.[learn]'
    python -m simnav.estimators.training.noise_network --voyages 1000 --seed 0 --output noise_network.npz
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from simnav.compiled import kernel
from simnav.estimators.adaptations.learned_noise import (
    HIDDEN,
    MEMORY,
    NUMBER_OF_INPUTS,
    RECIPE,
    SETTINGS,
    VERSION,
    LearnedNoise,
    set_by_network,
)
from simnav.estimators.adaptations.rules import copied
from simnav.estimators.models.filtering import Prediction
from simnav.estimators.models.filtering import Readings as ReadingsOfStep
from simnav.estimators.models.suitable import Suitable
from simnav.estimators.networks.file import Network
from simnav.estimators.networks.recurrent import shapes
from simnav.estimators.solvers.iterated import poor_heading
from simnav.estimators.solvers.kalman import KalmanEstimator
from simnav.kernel_types import Vector
from simnav.recording import Recording
from simnav.structures import filled, length, structure
from simnav.types import Array, Instruments

from .information import information
from .recipe import Fitted, Recipe, recorded

__all__ = ["FAMILIES", "Readings", "fit", "gather", "train"]

#: Whole voyages with and without an IMU, faults of receivers, outages, poor IMUs, and nothing wrong.
FAMILIES = (
    "training-voyages", "training-ships", "training-gnss-faults", "training-clean", "training-outages",
    "training-poor-imu-faults",
)  # fmt: skip
#: Largest factor on a sigma that is learned.
HIGHEST = 30.0
#: Units of the network; longest part of a sequence in a step of the training; sequences in a batch; rate of learning.
HIDDEN_UNITS, LONGEST, BATCH, RATE = 16, 256, 64, 6e-3


@dataclass(frozen=True, eq=False)
class Readings:
    """The readings of one instrument of one voyage.

    Attributes
    ----------
    kind : str
        Kind of the instrument.
    inputs : (k, n) float32 array
        Inputs of the network at each reading.
    target : (k,) float32 array
        The information of each reading, in (0, 1].
    """

    kind: str
    inputs: Any
    target: Any


#: A row of the table of an instrument: time and target of a reading, whether it was noted, and its inputs.
ROW = structure(time=float, target=float, noted=int, inputs=NUMBER_OF_INPUTS)
#: Before the table: number of its rows that are past, and whether the target is used.
TABLE = structure(past=int, leads=int)
_WEIGHTS, _TABLE = length(SETTINGS), length(TABLE)


@kernel(passed=True)
def noted_noise(
    settings: Vector, memory: Vector, common: Vector, readings: ReadingsOfStep, k: int, prediction: Prediction
) -> float:
    """Note the inputs in the table behind the memory of the network; use the noise of the datasheet or the target."""
    asked = set_by_network(settings, memory, common, readings, k, prediction)
    copied(prediction.nominal, prediction.noise)
    own = settings[:_WEIGHTS].view(SETTINGS)[0]
    begin = HIDDEN + own.units
    table, rows = memory[begin : begin + _TABLE].view(TABLE)[0], memory[begin + _TABLE :].view(ROW)
    while table.past < rows.size and rows[table.past].time < readings.time[k] - 1e-9:
        table.past += 1
    if table.past == rows.size or asked == 0.0:
        return 0.0
    row, inputs = rows[table.past], memory[:HIDDEN].view(MEMORY)[0].inputs
    row.noted = 1
    for i in range(NUMBER_OF_INPUTS):
        row.inputs[i] = inputs[i]
    if table.leads:
        for i in range(prediction.noise.shape[0]):
            for j in range(prediction.noise.shape[0]):
                prediction.noise[i, j] /= max(row.target, own.least)
    return 0.0


class _Noting(LearnedNoise):
    """Notes the inputs of the network at each reading of a recording.

    Parameters
    ----------
    recording : Recording
        The run.
    leads : bool
        Whether the noise is that of the targets, or that of the datasheets.
    """

    rule = noted_noise

    def __init__(self, recording: Recording, leads: bool):
        arrays = {name: np.zeros(shape) for name, shape in shapes(NUMBER_OF_INPUTS, 1).items()}
        self.use(Network(RECIPE, VERSION, arrays))
        self.highest, self._leads, self._recording = HIGHEST, leads, recording

    def in_scope(self, kind: str) -> bool:
        return True

    def reset(self, instruments: Instruments) -> None:
        super().reset(instruments)
        parts = []
        for name in self.index:
            stream = self._recording.data.aids[name]
            rows = np.zeros(len(stream), ROW)
            rows["time"], rows["target"] = stream.time, information(self._recording, stream)
            table = filled(TABLE, leads=self._leads)
            parts.append(np.concatenate([self.memory_of(name)[1], table, rows.view(np.float64)]))
        self.rule_memory, self.rule_first = np.concatenate(parts), np.cumsum([0, *map(len, parts)])

    def sequence(self, name: str) -> Readings:
        """What was noted of an instrument."""
        rows = self.memory_of(name)[1][HIDDEN + self._units + _TABLE :].view(ROW)
        rows = rows[rows["noted"] > 0]
        kind = self.instruments[name].kind
        return Readings(kind, rows["inputs"].astype(np.float32), rows["target"].astype(np.float32))


def gather(recordings: Iterable[Recording]) -> list[list[Readings]]:
    """Run the filter over voyages; for each voyage, what was noted of its instruments."""
    found = []
    for k, recording in enumerate(recordings):
        noting = _Noting(recording, leads=k // len(FAMILIES) % 2 == 1)
        solver = KalmanEstimator(Suitable(), noting, poor_heading())
        solver.reset(recording.start, recording.instruments)
        for packet in recording.steps():
            solver.update(packet)
        noted = [noting.sequence(name) for name in noting.index]
        found.append([readings for readings in noted if len(readings.target) > 1])
    return found


def fit(
    data: Sequence[Readings], checked: Sequence[Readings], epochs: int, seed: int, units: int = HIDDEN_UNITS
) -> Fitted:
    """Train a network; needs PyTorch.

    Parameters
    ----------
    data, checked : sequence of Readings
        For training and for validation. The network of the best epoch on the validation is returned.
    epochs : int
        Passes over the data. In each, a random part of each sequence is used.
    seed : int
        Decides the first parameters, and the order.
    units : int
        Size of the memory.
    """
    import torch

    torch.set_num_threads(1)
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    layer, output = torch.nn.GRU(NUMBER_OF_INPUTS, units, batch_first=True), torch.nn.Linear(units, 1)
    with torch.no_grad():
        output.bias[:] = 2.0  # most readings are good
    parameters = [*layer.parameters(), *output.parameters()]
    steps = max(1, epochs * -(-len(data) // BATCH))
    optimizer = torch.optim.Adam(parameters, lr=RATE)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, RATE, total_steps=steps)

    def loss_of(batch: list[Readings]) -> Any:
        parts = [_part(s, rng) for s in batch]
        x, y, mask = (torch.from_numpy(a) for a in _padded(parts))
        logits = output(layer(x)[0])[..., 0]
        each = (torch.nn.functional.logsigmoid(logits) - torch.log(y)) ** 2 * mask
        return (each.sum(dim=1) / mask.sum(dim=1)).mean()

    training, validation, begin = list[float](), list[float](), time.process_time()
    best: tuple[float, dict[str, Array]] = np.inf, {}
    for _ in range(epochs):
        order, losses = rng.permutation(len(data)), []
        for at in range(0, len(data), BATCH):
            loss = loss_of([data[i] for i in order[at : at + BATCH]])
            optimizer.zero_grad()
            loss.backward()
            torch.nn.utils.clip_grad_norm_(parameters, 1.0)
            optimizer.step()
            schedule.step()
            losses.append(loss.item())
        rng, kept = np.random.default_rng(seed), rng  # the same parts in each validation
        with torch.no_grad():
            checks = [loss_of(list(checked[at : at + BATCH])).item() for at in range(0, len(checked), BATCH)]
        rng = kept
        training.append(float(np.mean(losses)))
        validation.append(float(np.mean(checks)))
        if validation[-1] < best[0]:
            best = validation[-1], _arrays(layer, output)
    seconds = (time.process_time() - begin) / max(epochs, 1)
    kinds = tuple(sorted({s.kind for s in data}))
    return Fitted(Network(RECIPE, VERSION, best[1], kinds), -(-len(data) // BATCH), training, validation, seconds)


def _arrays(layer: Any, output: Any) -> dict[str, Array]:
    """The parameters of the modules of PyTorch as `simnav.estimators.networks.recurrent` takes them."""
    own = {
        "input_weight": layer.weight_ih_l0, "input_bias": layer.bias_ih_l0, "memory_weight": layer.weight_hh_l0,
        "memory_bias": layer.bias_hh_l0, "output_weight": output.weight[0], "output_bias": output.bias,
    }  # fmt: skip
    return {name: tensor.detach().numpy().astype(np.float64) for name, tensor in own.items()}


def _part(sequence: Readings, rng: np.random.Generator) -> tuple[Any, Any]:
    """A random part of a sequence, at most `LONGEST` long; half of them from the beginning."""
    spare = len(sequence.target) - LONGEST
    begin = int(rng.integers(spare + 1)) if spare > 0 and rng.random() < 0.75 else 0
    return sequence.inputs[begin : begin + LONGEST], sequence.target[begin : begin + LONGEST]


def _padded(parts: list[tuple[Any, Any]]) -> tuple[Any, Any, Any]:
    """Inputs, targets and a mask of several parts of different lengths."""
    longest = max(len(y) for _, y in parts)
    x = np.zeros((len(parts), longest, NUMBER_OF_INPUTS), np.float32)
    y, mask = np.ones((len(parts), longest), np.float32), np.zeros((len(parts), longest), np.float32)
    for i, (inputs, target) in enumerate(parts):
        x[i, : len(target)], mask[i, : len(target)] = inputs, 1.0
        y[i, : len(target)] = np.maximum(target, HIGHEST**-2)
    return x, y, mask


def train(data: Sequence[Sequence[Readings]], checked: Sequence[Sequence[Readings]], epochs: int, seed: int) -> Fitted:
    """Train on the first voyages of `FAMILIES`, and add the record of the training.

    Parameters
    ----------
    data, checked : sequence of voyages
        From `gather`, of the splits ``train`` and ``validation``.
    epochs, seed : int
        As for `fit`.
    """
    fitted = fit([r for voyage in data for r in voyage], [r for voyage in checked for r in voyage], epochs, seed)
    return recorded(fitted, FAMILIES, len(data), seed)


RECIPE_OF_ROW = Recipe(
    "Train the network that sets the noise of each reading.", "net-ekf",
    "squared error of the logarithm of the information", FAMILIES, 1000, 14, gather, train,
)  # fmt: skip

if __name__ == "__main__":
    RECIPE_OF_ROW.command("noise_network")
