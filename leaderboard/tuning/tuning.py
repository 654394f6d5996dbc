"""Choosing parameters: the search, what came out of it, and the file that keeps it.

The search is scipy's differential evolution or its Nelder-Mead, begun at the present values, over as many evaluations
as were asked for. What it finds is compared with the present values on unseen voyages of the same families. The file
says what was chosen, and on what; a row that was tuned ships with it (``estimators/tuned/ROW.json``), and a test holds
the row's defaults to it.

Source: R. Storn and K. Price, *Differential evolution: a simple and efficient heuristic for global optimization over
continuous spaces*, J. Global Optimization 11, 1997; J. A. Nelder and R. Mead, *A simplex method for function
minimization*, The Computer Journal 7(4), 1965.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np

from simnav.estimator.lookup import former_names_of
from simnav.leaderboard.campaign.request import EstimatorRequest
from simnav.leaderboard.figures.training import objective_curve
from simnav.leaderboard.results.errors import RequestError
from simnav.leaderboard.results.frame import frame
from simnav.leaderboard.results.provenance import here
from simnav.scenario import Scenario

from .objective import CLEAN, LARGEST, PRICE, Figures, Voyages, only_training
from .space import Range, space_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from simnav.types import Array

__all__ = ["TUNED", "Evaluation", "Method", "Tuning", "ranges_of", "read", "search", "tune_row"]

Method: TypeAlias = Literal["differential-evolution", "nelder-mead"]
#: Where the files of simnav's own rows are.
TUNED = Path(__file__).resolve().parents[2] / "estimators" / "tuned"


@dataclass(frozen=True)
class Evaluation:
    """One point of the search: the parameters and the objective."""

    parameters: Mapping[str, float]
    objective: float


@dataclass(frozen=True, eq=False)
class Tuning:
    """What a search found.

    Attributes
    ----------
    estimator : str
        Label of the row.
    ranges : tuple of Range
        Parameters that were varied, with their bounds.
    families : mapping of str to str
        Versioned id of each family, and the digest of its content.
    seeds, unseen_seeds : (int, int)
        First and last seed of the voyages for the search, and of those for the comparison.
    method : str
        How it was searched.
    search_seed : int
        Seed of the search's own random numbers.
    present, chosen : mapping of str to number
        Parameters before and after.
    before, after : Figures
        On the voyages of the search.
    unseen_before, unseen_after : Figures
        On voyages that the search did not see.
    evaluations : tuple of Evaluation
        In the order of the search.
    commit, day : str
        Commit of the code, and day of the search.
    """

    estimator: str
    ranges: tuple[Range, ...]
    families: Mapping[str, str]
    seeds: tuple[int, int]
    unseen_seeds: tuple[int, int]
    method: Method
    search_seed: int
    present: Mapping[str, float]
    chosen: Mapping[str, float]
    before: Figures
    after: Figures
    unseen_before: Figures
    unseen_after: Figures
    evaluations: tuple[Evaluation, ...]
    commit: str
    day: str

    @property
    def holds(self) -> bool:
        """Whether what was chosen is better on the unseen voyages, too; what is not is not to be adopted."""
        return self.unseen_after.objective < self.unseen_before.objective

    def to_dict(self) -> dict[str, Any]:
        """What the file holds, and ``simnav tune --json`` prints."""
        return {
            "estimator": self.estimator,
            "chosen": dict(self.chosen),
            "present": dict(self.present),
            "ranges": [asdict(r) for r in self.ranges],
            "objective": {
                "what": "mean log ratio of horizontal RMSE to the plain filter's",
                "largest_ratio": LARGEST, "clean_ratio": CLEAN, "clean_price": PRICE,
            },
            "families": dict(self.families),
            "seeds": list(self.seeds),
            "unseen_seeds": list(self.unseen_seeds),
            "method": self.method,
            "search_seed": self.search_seed,
            "before": self.before.to_dict(),
            "after": self.after.to_dict(),
            "unseen_before": self.unseen_before.to_dict(),
            "unseen_after": self.unseen_after.to_dict(),
            "evaluations": [[*e.parameters.values(), e.objective] for e in self.evaluations],
            "commit": self.commit,
            "day": self.day,
        }  # fmt: skip

    def to_frame(self) -> Any:
        """A row an evaluation; see `simnav.leaderboard.results.frame.frame`."""
        return frame([{**e.parameters, "objective": e.objective} for e in self.evaluations])

    def plot(self) -> Figure:
        """The best objective so far, by evaluation."""
        return objective_curve([e.objective for e in self.evaluations], self.before.objective, self.estimator)

    def write(self, path: Path) -> Path:
        """Write the file."""
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(self.to_dict(), indent=1) + "\n")
        return path


def read(path: Path) -> dict[str, Any]:
    """A file of a tuning, as written by `Tuning.write`, with the present names of the parameters.

    Raises
    ------
    RequestError
        If it cannot be read, or holds something else.
    """
    try:
        found = json.loads(path.read_text())
    except (OSError, ValueError) as error:
        raise RequestError(f"{path}: it cannot be read: {error}") from None
    if not isinstance(found, dict) or not {"estimator", "chosen", "ranges", "families", "seeds"} <= set(found):
        raise RequestError(f"{path}: it is not the file of a tuning, as 'simnav tune' writes it")
    names = former_names_of(str(found["estimator"]).partition("(")[0])
    if names:
        for part in ("chosen", "present"):
            found[part] = {names.get(name, name): value for name, value in found.get(part, {}).items()}
        found["ranges"] = [{**r, "name": names.get(r["name"], r["name"])} for r in found["ranges"]]
    return found


class _SpentError(Exception):
    """All evaluations that were asked for are done."""


def search(
    objective: Callable[[Mapping[str, float]], float],
    space: Sequence[Range],
    present: Mapping[str, float],
    evaluations: int,
    method: Method = "differential-evolution",
    seed: int = 0,
    progress: Callable[..., None] | None = None,
) -> tuple[Evaluation, ...]:
    """Minimise a function of named parameters.

    Parameters
    ----------
    objective : callable
        Function of the parameters, by name, to minimise.
    space : sequence of Range
        Parameters, with their bounds.
    present : mapping of str to number
        Start of the search; it is evaluated first.
    evaluations : int
        Most calls of ``objective``; the same parameters are not evaluated twice.
    method : str
        Method of SciPy.
    seed : int
        Seed of the random numbers of the search.
    progress : callable, optional
        Called with how many of how many evaluations are done, and ``note=`` the best so far.

    Returns
    -------
    tuple of Evaluation
        In the order of the search.
    """
    from scipy.optimize import differential_evolution, minimize

    if evaluations < 2:
        raise RequestError(f"evaluations = {evaluations}: it should be 2 or more")
    report = progress or (lambda *_, **__: None)
    known: dict[tuple[float, ...], float] = {}
    found: list[Evaluation] = []

    def at(x: Array) -> float:
        values = {r.name: r.value(float(v)) for r, v in zip(space, x, strict=True)}
        key = tuple(values.values())
        if key not in known:
            if len(found) >= evaluations:
                raise _SpentError
            known[key] = objective(values)
            found.append(Evaluation(values, known[key]))
            best = min(e.objective for e in found)
            report(len(found), evaluations, note=f"best {best:.4f}, with {_short(values)}: {known[key]:.4f}")
        return known[key]

    first = np.array([r.position(present[r.name]) for r in space])
    bounds = [r.bounds for r in space]
    try:
        at(first)
        if method == "nelder-mead":
            minimize(at, first, method="Nelder-Mead", bounds=bounds, options={"maxfev": 100 * evaluations})
        else:
            members = max(5, min(5 * len(space), evaluations // 4))
            rng = np.random.default_rng(seed)
            cells = np.argsort(rng.random((len(space), members)), axis=1) + rng.random((len(space), members))
            low, high = np.array(bounds).T
            begin = low + (high - low) * (cells / members).T  # a Latin hypercube
            begin[0] = first
            differential_evolution(
                at, bounds, init=begin, maxiter=100 * evaluations, polish=False, rng=rng, tol=1e-4, updating="immediate"
            )  # fmt: skip
    except _SpentError:
        pass
    return tuple(found)


def _short(values: Mapping[str, float]) -> str:
    return ", ".join(f"{name}={value:g}" for name, value in values.items())


def tune_row(
    request: EstimatorRequest,
    families: Sequence[Scenario],
    vary: Sequence[str | Range],
    *,
    runs: int = 20,
    unseen: int = 20,
    seed: int = 0,
    evaluations: int = 40,
    method: Method = "differential-evolution",
    search_seed: int = 0,
    progress: Callable[..., None] | None = None,
) -> Tuning:
    """Choose parameters of a row; see `simnav.leaderboard.interface.tune`."""
    for family in families:
        only_training(family)
    space, present = space_of(request, vary)
    seeds, later = range(seed, seed + runs), range(seed + runs, seed + runs + unseen)
    voyages = Voyages(families, seeds, progress)
    objective = partial(_objective, request, voyages)
    found = search(objective, space, present, evaluations, method, search_seed, progress)
    chosen = min(found, key=lambda e: e.objective).parameters
    before, after = voyages.figures(request, present), voyages.figures(request, chosen)
    if not after.objective < before.objective:
        chosen, after = present, before
    del objective, voyages  # they take much memory, and so will the next ones
    fresh = Voyages(families, later, progress)
    return Tuning(
        request.label, space, {f.id: f.content_hash() for f in families}, (seeds[0], seeds[-1]), (later[0], later[-1]),
        method, search_seed, present, dict(chosen), before, after, fresh.figures(request, present),
        fresh.figures(request, chosen), found, here().commit, here().date,
    )  # fmt: skip


def _objective(request: EstimatorRequest, voyages: Voyages, values: Mapping[str, float]) -> float:
    return voyages.figures(request, values).objective


def ranges_of(document: Mapping[str, Any]) -> tuple[Range, ...]:
    """The ranges of a file."""
    return tuple(Range(**r) for r in document["ranges"])
