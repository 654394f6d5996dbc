"""What the recipes share: what a training gives, what the network is worth in its row, and the command of a recipe.

A command trains on the first voyages of the families, writes the network, and writes its curves as data: the losses of
each epoch for several seeds of the training, and the error of the row for several numbers of voyages.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from simnav.estimator import Estimator, make, unsuitable
from simnav.estimators.networks.file import Network
from simnav.recording import Recording
from simnav.scoring import score
from simnav.trial import run_trial

from .voyages import streams_of, versions, voyages

__all__ = ["FIRST_COMPARED", "Fitted", "Recipe", "error_over_plain", "recorded"]

#: Number, within a family, of the first validation voyage on which rows are compared. Those of the training begin at 0.
FIRST_COMPARED = 500_000
#: Ratios of errors are within these; a row that fails has the highest.
_LEAST, _MOST = 0.05, 20.0


@dataclass(frozen=True, eq=False)
class Fitted:
    """What a training gives.

    Attributes
    ----------
    network : Network
        The network of the best epoch on the validation.
    steps : int
        Steps of the optimizer in an epoch.
    training, validation : list of float
        Mean loss of each epoch.
    seconds : float
        Processor time of an epoch [s].
    """

    network: Network
    steps: int
    training: list[float]
    validation: list[float]
    seconds: float


def recorded(fitted: Fitted, families: tuple[str, ...], size: int, seed: int) -> Fitted:
    """Add the record of a training on the first ``size`` voyages of families."""
    record = {
        "families": list(families), "voyages": size, "streams": streams_of(families, "train", size),
        "seed": seed, "epochs": len(fitted.validation), "seconds_per_epoch": round(fitted.seconds, 2),
        "validation": round(min(fitted.validation), 6), "versions": versions(),
    }  # fmt: skip
    return replace(fitted, network=replace(fitted.network, trained_on=record))


def error_over_plain(rows: Mapping[str, Callable[[], Estimator]], recordings: Iterable[Recording]) -> dict[str, Any]:
    """For each row the horizontal RMSE over that of the plain row, of each recording; None where it is unsuitable.

    The plain row is ``ekf``, or ``ship-ekf`` without an IMU.
    """
    found: dict[str, Any] = {name: [] for name in rows}
    for recording in recordings:
        plain = _error(make("ship-ekf" if recording.instruments.imu is None else "ekf"), recording)
        for name, made in rows.items():
            row = made()
            ratio = None if unsuitable(row, recording.instruments) else _error(row, recording) / plain
            found[name].append(None if ratio is None else round(min(max(ratio, _LEAST), _MOST), 4))
    return found


def _error(row: Estimator, recording: Recording) -> float:
    """Horizontal RMSE [m]; infinite where the row fails."""
    trial = run_trial(row, recording, keep_covariance=False)
    if trial.status not in ("ok", "inconsistent"):
        return math.inf
    return score(trial, recording, ["horizontal_rmse"])["horizontal_rmse"]


@dataclass(frozen=True)
class Recipe:
    """A recipe as a command.

    Attributes
    ----------
    about : str
        What it trains.
    row : str
        The row that takes the network as ``file``.
    loss : str
        What is minimised.
    families : tuple of str
        Training families.
    voyages, epochs : int
        Defaults.
    gather : callable
        From recordings to what is learned from, one item a voyage.
    train : callable
        ``train(data, checked, epochs, seed)`` from such items of training and validation.
    rows : tuple of str
        Rows beside which its row is compared.
    altered : callable, optional
        What is done to the voyages on which rows are compared.
    """

    about: str
    row: str
    loss: str
    families: tuple[str, ...]
    voyages: int
    epochs: int
    gather: Callable[[Iterable[Recording]], list[Any]]
    train: Callable[[Sequence[Any], Sequence[Any], int, int], Fitted]
    rows: tuple[str, ...] = ("iae", "gnc-fgo")
    altered: Callable[[Recording], Recording] | None = None

    def command(self, name: str, arguments: Sequence[str] | None = None) -> None:
        """Train, and write the network and the curves."""
        parser = argparse.ArgumentParser(description=self.about)
        parser.add_argument("--voyages", type=int, default=self.voyages)
        parser.add_argument("--epochs", type=int, default=self.epochs)
        parser.add_argument("--seed", type=int, default=0)
        parser.add_argument("--output", type=Path, default=Path(f"{name}.npz"))
        parser.add_argument("--seeds", type=int, default=1, help="seeds of the training in the curves")
        parser.add_argument("--sizes", default="", help="fewer voyages, with commas, in the curves")
        parser.add_argument("--compared", type=int, default=0, help="voyages on which rows are compared")
        options = parser.parse_args(arguments)
        begin = time.perf_counter()
        data = self.gather(voyages(self.families, "train", range(options.voyages)))
        few = range(max(options.voyages // 10, len(self.families)))
        checked = self.gather(voyages(self.families, "validation", few))
        gathered = time.perf_counter() - begin
        sizes = [int(size) for size in options.sizes.split(",") if size]
        plan = [(size, options.seed) for size in (options.voyages, *sizes)]
        plan += [(options.voyages, options.seed + k) for k in range(1, options.seeds)]
        curves, files = list[dict[str, Any]](), dict[str, str]()
        for size, seed in plan:
            first = (size, seed) == plan[0]
            file = options.output if first else options.output.with_name(f"{options.output.stem}-{size}-{seed}.npz")
            epochs = round(options.epochs * math.sqrt(options.voyages / size))  # fewer voyages, more passes
            fitted = self.train(data[:size], checked, epochs, seed)
            fitted.network.save(file)
            files[f"{size}, seed {seed}"] = str(file)
            curves.append({
                "voyages": size, "seed": seed, "steps_per_epoch": fitted.steps, "training": _short(fitted.training),
                "validation": _short(fitted.validation), "seconds_per_epoch": round(fitted.seconds, 2),
            })  # fmt: skip
            print(
                f"{file}: {fitted.network.parameters} parameters, {size} voyages, seed {seed}, loss "
                f"{min(fitted.validation):.4f} on validation, {fitted.seconds:.1f} s per epoch, "
                f"{time.perf_counter() - begin:.0f} s so far, {gathered:.0f} s of them to gather",
                flush=True,
            )
        n = len(self.families)
        numbers = range(FIRST_COMPARED * n, FIRST_COMPARED * n + options.compared)
        rows: dict[str, Callable[[], Estimator]] = {row: partial(make, row) for row in self.rows}
        rows |= {run: partial(make, self.row, file=file) for run, file in files.items()}
        seen = voyages(self.families, "validation", numbers)
        compared = error_over_plain(rows, seen if self.altered is None else map(self.altered, seen))
        document = {
            "row": self.row, "loss": self.loss, "families": list(self.families), "curves": curves,
            "others": {row: compared[row] for row in self.rows},
            "rows": [compared[run] for run in files],
        }  # fmt: skip
        options.output.with_suffix(".json").write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
        print(f"{time.perf_counter() - begin:.0f} s in all")


def _short(values: Iterable[float]) -> list[float]:
    return [round(value, 5) for value in values]
