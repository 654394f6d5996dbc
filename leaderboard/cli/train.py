"""``simnav paper train-anfis``: trains the parameters of an estimator."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from simnav.estimators.training.anfis_training import (
    FIRST_TRAINING_SEED,
    FIRST_VALIDATION_SEED,
    gather,
    scenarios,
    train,
)
from simnav.leaderboard.arguments import require_folder
from simnav.leaderboard.campaign.fingerprint import simulator_version
from simnav.leaderboard.figures import training as training_figures
from simnav.leaderboard.ranking import tables
from simnav.leaderboard.results.errors import RequestError, mistakes

from .commands import TrainAnfisCommand
from .console import Output
from .options import absolute

if TYPE_CHECKING:
    from simnav.estimators.adaptations.anfis_file import Parameters
    from simnav.estimators.training.hybrid_learning import Learned

__all__ = ["show"]

#: Passes that the table shows.
_ROWS = 12
#: Seeds of the validation: half as many as of the training, at least this.
_LEAST_VALIDATION = 2


def show(out: Output, request: TrainAnfisCommand) -> None:
    """Simulate the training data, train, and write the parameter file and two figures."""
    features, seeds, passes, output = request.features.value, request.seeds, request.passes, request.output
    path = absolute(output or Path(f"anfis_{features}.json"))
    if path.suffix != ".json":
        raise RequestError(f"--output {path}: the file should end in .json")
    require_folder(f"--output {path}", path)
    first = {"training": FIRST_TRAINING_SEED, "validation": FIRST_VALIDATION_SEED}
    count = {"training": seeds, "validation": max(seeds // 2, _LEAST_VALIDATION)}
    data = {}
    with out.progress("gathering") as progress:
        for kind, start in first.items():
            progress.begin(f"{kind} voyages")
            total = count[kind] * len(scenarios())
            data[kind] = gather(range(start, start + count[kind]), partial(progress, total=total))
        progress.begin("learning")
        parameters, learned = train(
            features, data["training"], data["validation"], passes,
            lambda k, error, check: progress(k + 1, passes, f"RMSE {error:.4f}, validation {check:.4f}"),
        )  # fmt: skip
    command = f"simnav paper train-anfis --features {features} --seeds {seeds}" + (
        f" --passes {passes}" if passes != 200 else ""
    )
    parameters.record.update({
        "command": command,
        "simulator": simulator_version(),
        **{f"{kind}_seeds": [start, start + count[kind] - 1] for kind, start in first.items()},
        "fixes": len(data["training"].outputs),
        "scenario": "three ships, five conditions of GNSS",
        "voyages": seeds * len(scenarios()),
        "streams": [[scenarios()[0].root(seed) for seed in (FIRST_TRAINING_SEED, FIRST_TRAINING_SEED + seeds - 1)]],
    })  # fmt: skip
    with mistakes(OSError):
        parameters.save(path)
        figures = training_figures.write(parameters, learned, path)
    _show(out, parameters, learned, path, figures)


def _show(out: Output, parameters: Parameters, learned: Learned, path: Path, figures: list[Path]) -> None:
    record = parameters.record
    out.document(
        {
            **record,
            "features": parameters.features,
            "training": learned.training,
            "validation": learned.validation,
            "file": str(path),
            "figures": [str(p) for p in figures],
        }
    )
    last = len(learned.training) - 1
    shown = {learned.best, *np.unique(np.linspace(0, last, min(_ROWS, last + 1)).astype(int)).tolist()}
    out.print(
        tables.table(
            f"ANFIS (reconstruction of Jiang et al. 2026), features {parameters.features!r}: "
            "RMSE of ln(variance / datasheet's)",
            ["pass", "training", "validation", ""],
            [
                [str(k + 1), f"{learned.training[k]:.4f}", f"{learned.validation[k]:.4f}",
                 "kept" if k == learned.best else ""]
                for k in sorted(shown)
            ],
            numeric=("pass", "training", "validation"),
        )
    )  # fmt: skip
    out.print(
        f"{record['fixes']} fixes; a constant has {record['validation_of_constant']:.4f} in validation",
        f"seeds: training {record['training_seeds']}, validation {record['validation_seeds']}; none is ever scored",
        f"parameters: {path}",
        *(f"figure:     {p}" for p in figures),
        f"use:        anfis-fgo:features={parameters.features},file={path}",
    )
