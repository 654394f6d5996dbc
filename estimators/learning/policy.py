"""A trained policy as a file of plain arrays: a network, the form of its input, and a record of its training.

The file is an ``.npz`` without pickle: ``meta`` (JSON), ``mean`` and ``deviation`` of the observation, and
``weight_0``, ``bias_0``, ``weight_1``, ... of the layers. Between the layers is a hyperbolic tangent, and the last is
clipped to the bounds of the action. So networks of any library fit, and none of them is needed to use one.
"""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from simnav.environment.seeds import FIRST_TRAINING_SEED, require_disjoint, training_seed
from simnav.scenario import Scenario, load
from simnav.types import Array

from .features import GUIDANCE, Numbers, observation_size
from .tasks import CORRECTIONS, TASKS

__all__ = ["FORMAT", "Policy", "PolicyError", "record_of_training"]

#: Of the files; raised when they change.
FORMAT = 2
#: Numbers of an action, for k instruments of at most K measurements a step.
_ACTIONS: dict[str, Callable[[int, int], int]] = {
    "Tuning": lambda k, most: k + 1,
    "Detection": lambda k, most: k * most,
    "Correction": lambda k, most: len(CORRECTIONS),
    "Guidance": lambda k, most: 2,
}


def record_of_training(scenario: Scenario | str, voyages: int, **more: Any) -> dict[str, Any]:
    """The record of a training on the training voyages 0, 1, ... of a scenario.

    Parameters
    ----------
    scenario : Scenario or str
        Scenario of the training voyages, or its name.
    voyages : int
        Number of training voyages.
    **more
        Further information as plain values: ``algorithm``, ``steps``, ``seed``, ``versions``.

    Returns
    -------
    dict
        The arguments, ``first_seed`` of the voyages, and ``streams``: first and last of the numbers from which their
        random streams start (`simnav.scenario.Scenario.root`).
    """
    found = load(scenario) if isinstance(scenario, str) else scenario
    streams = [found.root(training_seed(0)), found.root(training_seed(voyages - 1))]
    return {"scenario": found.id, "voyages": voyages, "first_seed": FIRST_TRAINING_SEED, "streams": streams, **more}


class PolicyError(ValueError):
    """A file is not a policy, or the policy does not fit. The message is one sentence that names the file."""


class Policy:
    """A network from an observation to an action.

    Parameters
    ----------
    layers : sequence of (weight, bias)
        ``(m, n)`` and ``(m,)`` arrays; the first takes the observation, the last gives the action.
    task : str
        Name of the task, one of `simnav.estimators.learning.tasks.TASKS`, or ``"Guidance"``.
    kinds : sequence of str
        Kinds of the instruments for which the agent decides, in order; empty for Guidance.
    most : int
        Largest number of measurements of an instrument in a step of the observation.
    instruments : str
        ``"all"`` or ``"fixes"``, see `simnav.estimators.learning.environment.TaskOptions`.
    trained_on : mapping
        Record of the training, see `record_of_training`.
    mean, deviation : (o,) array, optional
        The input of the network is the observation minus the mean, divided by the deviation; by default the observation
        itself.
    version : int, optional
        Version of the task; by default the present one.

    Raises
    ------
    PolicyError
        If the layers do not fit each other or the task.
    """

    def __init__(
        self,
        layers: Sequence[tuple[Array, Array]],
        *,
        task: str,
        kinds: Sequence[str],
        most: int,
        instruments: str,
        trained_on: Mapping[str, Any],
        mean: Array | None = None,
        deviation: Array | None = None,
        version: int | None = None,
        source: str = "the policy",
    ):
        if task not in _ACTIONS:
            raise PolicyError(f"{source}: it is for the task {task!r}; there are: {', '.join(_ACTIONS)}")
        now = TASKS[task].version if task in TASKS else 1
        self.version = now if version is None else version
        if self.version != now:
            raise PolicyError(
                f"{source}: it was trained on version {self.version} of {task}, but this is version {now}; "
                "train it again"
            )
        self.layers = [(np.array(w, dtype=np.float64), np.array(b, dtype=np.float64)) for w, b in layers]
        self.task, self.kinds, self.most, self.instruments = task, list(kinds), int(most), instruments
        self.trained_on, self.source = dict(trained_on), source
        self.learned_from = _learned_from(self.trained_on, source)
        if not self.layers:
            raise PolicyError(f"{source}: it has no layers")
        size = self.layers[0][0].shape[1] if self.layers[0][0].ndim == 2 else -1
        self.mean = np.zeros(size) if mean is None else np.array(mean, dtype=np.float64)
        self.deviation = np.ones(size) if deviation is None else np.array(deviation, dtype=np.float64)
        for i, (w, b) in enumerate(self.layers):
            if w.ndim != 2 or b.shape != w.shape[:1] or w.shape[1] != size:
                raise PolicyError(
                    f"{source}: layer {i} has a weight of shape {w.shape} and a bias of shape {b.shape}; it should "
                    f"take {size} numbers"
                )
            size = w.shape[0]
        wanted = len(GUIDANCE) if task == "Guidance" else observation_size(len(self.kinds), self.most)
        actions = _ACTIONS[task](len(self.kinds), self.most)
        shape = self.layers[0][0].shape[1], size
        if shape != (wanted, actions):
            setting = f"{task} with {', '.join(self.kinds)}" if self.kinds else task
            raise PolicyError(
                f"{source}: it takes {shape[0]} numbers and gives {shape[1]}; {setting} has {wanted} and {actions}"
            )
        arrays = [self.mean, self.deviation, *(a for layer in self.layers for a in layer)]
        if self.mean.shape != self.deviation.shape or self.mean.shape != (self.layers[0][0].shape[1],):
            raise PolicyError(f"{source}: mean and deviation should be of the observation's length")
        if not all(np.isfinite(a).all() for a in arrays) or not (self.deviation > 0.0).all():
            raise PolicyError(f"{source}: its numbers should be finite, and the deviations positive")

    def __call__(self, observation: Numbers) -> Numbers:
        """The action for one observation, or for several in rows."""
        x = (np.asarray(observation, dtype=np.float64) - self.mean) / self.deviation
        for i, (weight, bias) in enumerate(self.layers):
            x = x @ weight.T + bias
            if i < len(self.layers) - 1:
                x = np.tanh(x)
        if self.task == "Detection":
            return np.asarray(x > 0.0, dtype=np.int8)
        return np.clip(x, -1.0, 1.0)

    def require_unseen(self, seeds: Sequence[int]) -> None:
        """Refuse to be scored on the seeds of the voyages that it learned from: ValueError."""
        first, count = self.trained_on["first_seed"], self.trained_on["voyages"]
        require_disjoint(range(first, first + count), seeds)

    def save(self, path: str | Path) -> None:
        """Write the file."""
        meta = {
            "format": FORMAT, "task": self.task, "version": self.version, "kinds": self.kinds, "most": self.most,
            "instruments": self.instruments, "trained_on": self.trained_on,
        }  # fmt: skip
        arrays: dict[str, Any] = {"meta": np.array(json.dumps(meta)), "mean": self.mean, "deviation": self.deviation}
        for i, (weight, bias) in enumerate(self.layers):
            arrays[f"weight_{i}"], arrays[f"bias_{i}"] = weight, bias
        with open(path, "wb") as file:
            np.savez_compressed(file, allow_pickle=False, **arrays)

    @classmethod
    def load(cls, path: str | Path) -> Policy:
        """Read a file.

        Raises
        ------
        PolicyError
            If it is no policy, is damaged, or is one of another version or shape.
        FileNotFoundError
        """
        try:
            with np.load(path, allow_pickle=False) as file:
                arrays = {name: file[name] for name in file.files}
            meta = json.loads(str(arrays["meta"]))
            form = meta["format"]
            if form != FORMAT:
                raise PolicyError(f"{path}: written in format {form!r} of policies; this version reads {FORMAT}")
            count = sum(name.startswith("weight_") for name in arrays)
            layers = [(arrays[f"weight_{i}"], arrays[f"bias_{i}"]) for i in range(count)]
            return cls(
                layers, task=meta["task"], kinds=meta["kinds"], most=meta["most"], instruments=meta["instruments"],
                trained_on=meta["trained_on"], mean=arrays["mean"], deviation=arrays["deviation"],
                version=meta["version"], source=str(path),
            )  # fmt: skip
        except PolicyError:
            raise
        except (ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile) as error:
            raise PolicyError(f"{path}: not a policy of simnav, or damaged ({error})") from None


def _learned_from(record: Mapping[str, Any], source: str) -> list[tuple[int, int]]:
    """First and last number of the runs that were learned from; PolicyError where the record does not say."""
    streams = record.get("streams")
    numbers = [record.get("first_seed"), record.get("voyages"), *(streams if isinstance(streams, list) else [])]
    if len(numbers) != 4 or not all(type(n) is int and n >= 0 for n in numbers) or numbers[2] > numbers[3]:
        raise PolicyError(
            f"{source}: trained_on should state first_seed, voyages and streams (first and last) of the voyages that "
            f"it learned from, as record_of_training gives them; it is {dict(record)!r}"
        )
    return [(numbers[2], numbers[3])]
