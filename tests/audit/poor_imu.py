"""Whether an adaptive or robust row is ever much worse than its plain row because the IMU is worse than its datasheet.

On the voyages of the family `FAMILY` the IMU has up to 20 times the noise of its datasheet, gaps, disturbances or bias
steps, and no measurement of another instrument is wrong. So a plain filter or window is right to use them all. Promised
is, for every row: at most 2 % of the voyages above `WORSE` times the error of the plain row, and none above `RUINED`
times; and, in 99 % of the voyages beyond `LOST` times the plain row, that the row admits it: by its self-test, so that
the run ends as *inconsistent* (`simnav.scoring.ending`), or by its covariance. A covariance admits an error
if the normalised error squared of the horizontal position is at most `ADMITTED` by degree of freedom, in the mean over
the run. A row that cannot promise the first two says on its page when not to use it (`explained`). The figure
has the geometric mean of the ratios, too, and the voyage of the largest. Where the plain row is itself lost (its
covariance does not admit its error), a ratio to it says little; the other voyages have a line of their own.

``SIMNAV_AUDIT_POOR_IMU_RUNS`` sets the number of voyages; windows, which take longer, are run on every tenth of them.
"""

from __future__ import annotations

import os
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any, TypeAlias

import numpy as np

from simnav.estimator import find, make, names
from simnav.estimators.models.ship import ShipModel
from simnav.estimators.solvers.federated import FederatedEstimator
from simnav.estimators.solvers.imm import ImmEstimator
from simnav.estimators.solvers.solution_separation import SolutionSeparation
from simnav.estimators.solvers.window import WindowEstimator
from simnav.scenario import load
from simnav.scoring import score
from simnav.scoring.ending import ending
from simnav.source import record
from simnav.spec import SpecError
from simnav.trial import run_trial
from simnav.types import Array

__all__ = ["FAMILY", "PLAIN", "parts", "rows"]

FAMILY = "training-poor-imu"
RUNS = int(os.environ.get("SIMNAV_AUDIT_POOR_IMU_RUNS", "200"))
#: Seed of the first voyage, and voyages of a part; windows are run on the first of them only.
FIRST, _BLOCK = 70_000, 10
WORSE, RUINED, LOST, ADMITTED = 1.5, 5.0, 10.0, 10.0
_MOST, _ADMITTING = 0.02, 0.99
_SCORES = ("horizontal_rmse", "nees_horizontal")
_TOLD = ("inconsistent", "inconsistent_end")
#: Horizontal RMSE [m], NEES by degree of freedom, and whether its self-test tells that it is inconsistent.
Run: TypeAlias = tuple[float, float, bool]
#: Rows of this section that smooth are judged by their smoothed trajectory, too; a smoothed covariance has no score.
_SMOOTHED, _SMOOTHED_SCORES = " (smoothed)", ("smoothed_horizontal_rmse", "nees_horizontal")
#: Solvers that are robust without an adaptation or a weighting.
_ROBUST = (FederatedEstimator, ImmEstimator, SolutionSeparation)


def plain(name: str) -> str:
    """The plain row of the same kind; empty for a row that is neither adaptive nor robust, or is for ships."""
    row = find(name)
    recipe = getattr(row, "recipe", {})
    if row.reference or name.endswith("-paper") or "model" not in recipe or recipe["model"].make is ShipModel:
        return ""
    solver = recipe["solver"].make
    if not {"adaptation", "weighting"} & set(recipe) and not issubclass(solver, _ROBUST):
        return ""
    return "sw-fgo" if issubclass(solver, WindowEstimator) else "ekf"


#: The rows of this section, each with its plain row.
PLAIN = {name: plain(name) for name in names() if plain(name)}
PLAIN |= {name + _SMOOTHED: "ekf-rts" + _SMOOTHED for name in PLAIN if "smoother" in getattr(find(name), "recipe", {})}


def there() -> bool:
    """Whether the family is in the catalogue."""
    try:
        load(FAMILY)
    except SpecError:
        return False
    return True


def explained(name: str) -> bool:
    """Whether the page of a row says what it does beside an IMU that is poorer than its datasheet."""
    page = find(name.removesuffix(_SMOOTHED)).__doc__ or ""
    return "an IMU that is poorer than its datasheet" in " ".join(page.split())


def block(first: int, windows: bool) -> dict[str, list[Run | None]]:
    """What became of each row on the voyages of a part; None where it failed."""
    wanted = sorted({n for pair in PLAIN.items() if (pair[1] == "sw-fgo") is windows for n in pair})
    found: dict[str, list[Run | None]] = {name: [] for name in wanted}
    refused: Counter[str] = Counter()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for seed in range(first, first + (1 if windows else min(_BLOCK, FIRST + RUNS - first))):
            recording = record(load(FAMILY), seed)
            for name in dict.fromkeys(n.removesuffix(_SMOOTHED) for n in wanted):
                trial = run_trial(make(name), recording)
                refused[name] += trial.status == "unsuitable"
                for label, asked in ((name, _SCORES), (name + _SMOOTHED, _SMOOTHED_SCORES)):
                    if label in found:
                        scores = score(trial, recording, (*asked, *_TOLD)) if trial.status == "ok" else {}
                        error, nees = (float(scores.get(s, np.nan)) for s in asked)
                        told = ending(trial.status, scores) == "inconsistent"
                        found[label].append((error, nees, told) if np.isfinite(error) else None)
    # Rows that need what this family lacks, such as messages of another vessel, are not judged.
    return {name: values for name, values in found.items() if refused[name.removesuffix(_SMOOTHED)] < len(values)}


def parts() -> dict[str, Callable[[], Any]]:
    """What is measured, by name: blocks of voyages with filters, and with windows; nothing without the family."""
    if not there():
        return {}
    firsts = range(FIRST, FIRST + RUNS, _BLOCK)
    kinds = {"filters": False, "windows": True}
    return {f"{kind}-{first}": partial(block, first, windows) for kind, windows in kinds.items() for first in firsts}


def _judged(name: str, where: str, ratio: Array, seeds: list[int]) -> tuple[str, str, str, bool]:
    """The line on the errors of a row over those of its plain row, on the voyages of some seeds."""
    share, worst = float(np.mean(ratio > WORSE)), float(ratio.max())
    finite = ratio[np.isfinite(ratio)]
    mean = float(np.exp(np.mean(np.log(finite)))) if len(finite) else np.inf
    kept = share <= _MOST and worst <= RUINED
    return (
        f"{name}: above {WORSE:g} times {PLAIN[name]}{where}, of {len(ratio)}; largest; mean",
        f"{100.0 * share:.1f} %; {worst:.1f} ({seeds[int(ratio.argmax())]}); {mean:.2f}",
        "page says so" if explained(name) and not kept else f"at most {100.0 * _MOST:g} %; {RUINED:g}",
        kept or explained(name),
    )


def rows(found: Mapping[str, Any]) -> Iterator[tuple[str, str, str, bool]]:
    """What is measured, its figure, what is promised, and whether that is kept."""
    if not there():
        yield f"not measured: there is no family {FAMILY}", "", "", True
        return
    by_row: dict[str, list[tuple[int, Run | None, Run]]] = {}
    for label, part in found.items():
        first = int(label.split("-")[1])
        for name in part.keys() & PLAIN.keys():
            both = enumerate(zip(part[name], part[PLAIN[name]], strict=True), first)
            by_row.setdefault(name, []).extend((k, one, beside) for k, (one, beside) in both if beside is not None)
    for name, pairs in sorted(by_row.items()):
        ratio = np.array([np.inf if one is None else one[0] / beside[0] for _, one, beside in pairs])
        sound = np.array([beside[1] <= ADMITTED for _, _, beside in pairs])
        yield _judged(name, "", ratio, [seed for seed, _, _ in pairs])
        if sound.any() and not sound.all():
            seeds = [seed for (seed, _, _), own in zip(pairs, sound) if own]
            yield _judged(name, " where that is not lost", ratio[sound], seeds)
        lost = [one for (_, one, _), r in zip(pairs, ratio) if r > LOST]
        if lost:  # a row that failed has said so by its status
            admitted = float(np.mean([one is None or one[1] <= ADMITTED or one[2] for one in lost]))
            what = f"{name}: admitted, of {len(lost)} beyond {LOST:g} times {PLAIN[name]}"
            yield what, f"{100.0 * admitted:.0f} %", f"at least {100.0 * _ADMITTING:g} %", admitted >= _ADMITTING
