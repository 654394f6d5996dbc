"""The recipe of `simnav.estimators.networks.velocity`: a recurrent network that predicts the velocity without a DVL.

1. Training voyages with an IMU and a DVL are read as an estimator reads them. The DVL is silenced twice in each, at
   random times and for 5 to 120 s, beside the outages that the voyages have. The target is the true velocity at the
   DVL in each second without readings, minus that of the last readings, in speeds of the vessel.
2. PyTorch trains a layer of gated units by the likelihood of the target under a normal distribution, of which the
   network gives mean and sigma. Each voyage has the same weight.

Run it; it takes less than half an hour on one core::

    pip install '.[learn]'
    python -m simnav.estimators.training.velocity_network --voyages 600 --seed 0 --output velocity_network.npz
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from simnav.estimators.networks.file import Network
from simnav.estimators.networks.velocity import (
    HIGHEST,
    INPUTS,
    LOWEST,
    RECIPE,
    VERSION,
    VelocityNetwork,
    VelocitySeconds,
)
from simnav.geometry.rotation import dcm_from_rpy
from simnav.recording import Recording
from simnav.types import Array, Measurements, TapStates

from .recipe import Fitted, Recipe, recorded

__all__ = ["FAMILIES", "Silenced", "fit", "gather", "lost", "silenced", "silent_times", "train"]

#: Whole voyages with faults, poor and MEMS IMUs, clean voyages, and receivers that are silent.
FAMILIES = ("training-voyages", "training-poor-imu-faults", "training-mems", "training-clean", "training-outages")
#: Units of the network; sequences in a batch; rate of learning; longest time that the DVL is silenced for [s].
UNITS, BATCH, RATE, LONGEST = 24, 16, 5e-3, 120.0
#: How often a voyage is read, each time with other outages.
_TIMES = 2


@dataclass(frozen=True, eq=False)
class Silenced:
    """A voyage whose DVL was silenced, by seconds.

    Attributes
    ----------
    inputs : (k, n) float32 array
        Inputs of the network.
    target : (k, 3) float32 array
        The velocity minus that of the last readings, in speeds.
    missing : (k,) float32 array
        1 where readings are missing, so that the target counts.
    speed : (k,) float32 array
        The speed [m/s].
    """

    inputs: Any
    target: Any
    missing: Any
    speed: Any


def silent_times(duration: float, rng: np.random.Generator) -> list[tuple[float, float]]:
    """Beginning and end of two times at which the DVL is silenced [s]."""
    begins = rng.uniform([0.1 * duration, 0.5 * duration], [0.45 * duration, 0.9 * duration])
    return [(float(b), float(b + np.exp(rng.uniform(np.log(5.0), np.log(LONGEST))))) for b in begins]


def silenced(packet: Measurements, name: str, times: Sequence[tuple[float, float]]) -> Measurements:
    """A packet without the readings of an instrument at some times."""
    kept = [m for m in packet if m.instrument != name or not any(a <= m.time < b for a, b in times)]
    return replace(packet, aids=kept)


def lost(recording: Recording) -> Recording:
    """A voyage whose DVL is silenced (`silent_times`), and with it all that gives a position; itself without a DVL."""
    sheet, aids = VelocityNetwork.dvl_of(recording.instruments), dict(recording.data.aids)
    if sheet is None:
        return recording
    times = silent_times(recording.duration, np.random.default_rng([recording.seed, _TIMES]))
    for name, stream in aids.items():
        if name == sheet.name or recording.instruments[name].gives_position:
            heard = np.ones(len(stream), np.bool_)
            for begin, end in times:
                heard &= (stream.time < begin) | (stream.time >= end)
            aids[name] = stream.rows(np.flatnonzero(heard))
    return replace(recording, data=replace(recording.data, aids=aids))


def gather(recordings: Iterable[Recording]) -> list[list[Silenced]]:
    """Read voyages, each with different outages; none of a voyage without an IMU or a DVL."""
    return [
        [_read(recording, np.random.default_rng([recording.seed, time])) for time in range(_TIMES)]
        if recording.instruments.imu is not None and VelocityNetwork.dvl_of(recording.instruments) is not None
        else []
        for recording in recordings
    ]


def _read(recording: Recording, rng: np.random.Generator) -> Silenced:
    sheet, truth = VelocityNetwork.dvl_of(recording.instruments), recording.data.truth
    assert sheet is not None
    assert isinstance(truth, TapStates), "the truth of a simulated voyage has the angular rate"
    times, seconds = silent_times(recording.duration, rng), VelocitySeconds(sheet, recording.start)
    true = np.einsum("kji,kj->ki", dcm_from_rpy(truth.attitude), truth.velocity)
    true += np.cross(truth.angular_rate, sheet.lever_arm)
    noted = []
    for k, packet in enumerate(recording.steps()):
        inputs = seconds.take(silenced(packet, sheet.name, times))
        if inputs is not None:
            target = (true[k] - seconds.held) / seconds.speed
            noted.append((inputs, target, float(seconds.is_missing), seconds.speed))
    return Silenced(*(np.array(column, np.float32) for column in zip(*noted, strict=True)))


def fit(data: Sequence[Silenced], checked: Sequence[Silenced], epochs: int, seed: int, units: int = UNITS) -> Fitted:
    """Train a network; needs PyTorch. The network of the best epoch on the validation is returned."""
    import torch

    torch.set_num_threads(1)
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    layer, output = torch.nn.GRU(len(INPUTS), units, batch_first=True), torch.nn.Linear(units, 6)
    with torch.no_grad():
        output.weight *= 0.1
        output.bias[:] = torch.tensor([0.0, 0.0, 0.0, -1.0, -1.0, -1.0])
    parameters = [*layer.parameters(), *output.parameters()]
    data, checked = ([s for s in part if s.missing.any()] for part in (data, checked))
    steps = -(-len(data) // BATCH)
    optimizer = torch.optim.Adam(parameters, lr=RATE)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, RATE, total_steps=max(1, epochs * steps))

    def loss_of(batch: Sequence[Silenced]) -> Any:
        longest = max(len(s.missing) for s in batch)
        x, y, mask = (
            torch.from_numpy(np.stack([_padded(getattr(s, name), longest) for s in batch]))
            for name in ("inputs", "target", "missing")
        )
        found = output(layer(x)[0])
        logarithm = found[..., 3:].clamp(LOWEST, HIGHEST)
        each = (0.5 * ((y - found[..., :3]) * torch.exp(-logarithm)).clamp(-10.0, 10.0) ** 2 + logarithm).mean(dim=-1)
        return ((each * mask).sum(dim=1) / mask.sum(dim=1)).mean()

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
        with torch.no_grad():
            checks = [loss_of(checked[at : at + BATCH]).item() for at in range(0, len(checked), BATCH)]
        training.append(float(np.mean(losses)))
        validation.append(float(np.mean(checks)))
        if validation[-1] < best[0]:
            best = validation[-1], _arrays(layer, output)
    seconds = (time.process_time() - begin) / max(epochs, 1)
    return Fitted(Network(RECIPE, VERSION, best[1], ("dvl",)), steps, training, validation, seconds)


def _arrays(layer: Any, output: Any) -> dict[str, Array]:
    """The parameters of the modules of PyTorch as `VelocityNetwork` takes them."""
    own = {
        "input_weight": layer.weight_ih_l0, "input_bias": layer.bias_ih_l0, "memory_weight": layer.weight_hh_l0,
        "memory_bias": layer.bias_hh_l0, "output_weight": output.weight, "output_bias": output.bias,
    }  # fmt: skip
    return {name: tensor.detach().numpy().astype(np.float64) for name, tensor in own.items()}


def _padded(array: Any, longest: int) -> Any:
    """An array with zeros behind it."""
    wide = np.zeros((longest, *array.shape[1:]), np.float32)
    wide[: len(array)] = array
    return wide


def train(data: Sequence[Sequence[Silenced]], checked: Sequence[Sequence[Silenced]], epochs: int, seed: int) -> Fitted:
    """Train on the first voyages of `FAMILIES`, and add the record of the training."""
    fitted = fit([s for voyage in data for s in voyage], [s for voyage in checked for s in voyage], epochs, seed)
    return recorded(fitted, FAMILIES, len(data), seed)


RECIPE_OF_ROW = Recipe(
    "Train the network that predicts the velocity without a DVL.", "beams-ekf", "negative log likelihood", FAMILIES,
    600, 20, gather, train, altered=lost,
)  # fmt: skip

if __name__ == "__main__":
    RECIPE_OF_ROW.command("velocity_network")
