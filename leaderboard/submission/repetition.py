"""Runs of a submission, repeated: ``python -m simnav.leaderboard.submission.repetition`` in any environment.

The request is one line of JSON on standard input. On standard output come lines that begin with ``P`` (progress) and
one that begins with ``R`` (the answer, in JSON). The estimators run confined; this process imports nothing of them.
"""

from __future__ import annotations

import json
import sys
import warnings
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from simnav.leaderboard.campaign.campaign import Progress, run_campaign
from simnav.leaderboard.campaign.request import EstimatorRequest
from simnav.leaderboard.campaign.seal import PUBLIC, Seal
from simnav.leaderboard.results import store
from simnav.leaderboard.results.catalogued import catalogued_scenario
from simnav.leaderboard.results.errors import sentence
from simnav.leaderboard.results.provenance import here
from simnav.leaderboard.results.result import Result

__all__ = ["Again", "Asked", "Wanted", "answer"]


#: What is compared of a run beside its status and scores.
_FACTS = ("key", "recording", "parameters", "reference", "learned", "note", "draws", "seconds", "peak_memory", "simnav",
          "time_limit", "memory_limit", "scoring", "scenario_digest", "estimator_digest", "simulator_version",
          "estimator_version")  # fmt: skip


@dataclass(frozen=True)
class Wanted:
    """Runs of one estimator on one scenario.

    Attributes
    ----------
    scenario, label : str
        Versioned id of the scenario, label of the estimator.
    seeds : list of int
        Numbers of the runs, where they are sealed.
    sealed : bool
        Whether the seeds follow from a key.
    """

    scenario: str
    label: str
    seeds: list[int]
    sealed: bool = False


@dataclass(frozen=True)
class Asked:
    """A request to repeat runs.

    Attributes
    ----------
    folder : str
        New folder for the results.
    estimators : list of EstimatorRequest
        The estimators that are run.
    runs : list of Wanted
        Runs of these estimators.
    key : str
        Key of the sealed seeds, in hexadecimal.
    confinement : str
        As in `simnav.leaderboard.interface.campaign`.
    by_version : bool
        Whether the results are known by declared versions; those of bundles of old are known by digests of code.
    """

    folder: str
    estimators: list[EstimatorRequest]
    runs: list[Wanted]
    key: str = ""
    confinement: str = "auto"
    by_version: bool = False

    def text(self) -> str:
        """Write the request as one line of JSON."""
        rows = [{**vars(e), "cls": None} for e in self.estimators]
        return json.dumps({**vars(self), "estimators": rows, "runs": [asdict(w) for w in self.runs]})

    @classmethod
    def read(cls, text: str) -> Asked:
        """Read a request that `text` wrote."""
        facts: dict[str, Any] = json.loads(text)
        rows = [EstimatorRequest(**{**row, "search": tuple(row["search"])}) for row in facts.pop("estimators")]
        return cls(estimators=rows, runs=[Wanted(**w) for w in facts.pop("runs")], **facts)


@dataclass(frozen=True)
class Again:
    """A run that was repeated.

    Attributes
    ----------
    scenario, label, seed, sealed
        Scenario, estimator, seed and seal of the repeated run.
    status, reason : str
        As in `simnav.leaderboard.results.result.Result`; ``not-run`` where it could not be tried.
    scores : mapping of str to float
        All bits of each score, and NaN, are kept in JSON.
    facts : mapping
        All else that is compared, as in `simnav.leaderboard.results.result.Result`.
    confinement : str
        What kept the estimator from the truth.
    """

    scenario: str
    label: str
    seed: int
    sealed: bool
    status: str
    reason: str
    scores: Mapping[str, float] = field(default_factory=dict)
    facts: Mapping[str, Any] = field(default_factory=dict)
    confinement: str = ""

    @property
    def result(self) -> Result:
        """The run as a result."""
        return Result(
            self.scenario, self.seed, self.label, status=self.status, reason=self.reason, scores=self.scores,
            **{"parameters": {}, "reference": False, **self.facts},
        )  # fmt: skip


def answer(asked: Asked, progress: Callable[..., None]) -> dict[str, Any]:
    """Repeat the runs; returns them, and the provenance of this environment."""
    requests = {e.label: e for e in asked.estimators}
    seal = Seal(bytes.fromhex(asked.key))
    found: dict[tuple[bool, str, str, int], Again] = {}
    total, done = sum(len(w.seeds) for w in asked.runs), 0
    for sealed in (False, True):
        for wanted in (w for w in asked.runs if w.sealed == sealed):
            what = f"{wanted.label} on {wanted.scenario}"
            progress(done, total, what)
            try:
                run_campaign(
                    [catalogued_scenario(wanted.scenario)], [requests[wanted.label]], wanted.seeds,
                    f"{asked.folder}-sealed" if sealed else asked.folder, by_version=asked.by_version and not sealed,
                    workers=1, confinement=asked.confinement, seal=seal if sealed else PUBLIC,
                    progress=partial(_noted, progress, done, total, what),
                )  # fmt: skip
            except Exception as error:
                for seed in wanted.seeds:
                    key = sealed, wanted.scenario, wanted.label, seed
                    found[key] = Again(wanted.scenario, wanted.label, seed, sealed, "not-run", sentence(error))
            done += len(wanted.seeds)
            progress(done, total, wanted.scenario)
        made = Path(f"{asked.folder}-sealed" if sealed else asked.folder)
        for r in store.load(made, series=False) if made.is_dir() else ():
            if bool(r.provenance.seal) == sealed:
                found[sealed, r.scenario, r.estimator, r.seed] = Again(
                    r.scenario, r.estimator, r.seed, sealed, r.status, r.reason, dict(r.scores),
                    {name: getattr(r, name) for name in _FACTS}, r.provenance.confinement,
                )  # fmt: skip
    return {"runs": [asdict(a) for a in found.values()], "provenance": here().to_dict()}


def _noted(progress: Callable[..., None], done: int, total: int, what: str, now: Progress) -> None:
    """Say how far the kernels are, which a new environment has to compile."""
    if now.stage == "compile" and now.done < now.total:
        progress(done, total, f"{what}: compiling kernels, {now.done} of {now.total}")


def main() -> None:
    """Answer the request on standard input."""
    out, sys.stdout = sys.stdout, sys.stderr
    warnings.simplefilter("ignore")

    def progress(done: int, total: int, note: str) -> None:
        out.write(f"P {json.dumps([done, total, note])}\n")
        out.flush()

    facts = answer(Asked.read(sys.stdin.readline()), progress)
    out.write(f"R {json.dumps(facts)}\n")
    out.flush()


if __name__ == "__main__":
    main()
