"""Commands about many runs: campaign, evaluate, leaderboard."""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from simnav.leaderboard.cli.console import FAILED, Output, UserError, absolute, mistakes, sentence
from simnav.leaderboard.ranking import tables
from simnav.leaderboard.ranking.ranking_table import ranking_table
from simnav.leaderboard.ranking.runs import group
from simnav.leaderboard.ranking.standing import standing, standing_table
from simnav.leaderboard.results.plain import plain

if TYPE_CHECKING:
    from simnav.leaderboard.campaign.campaign import Progress, Summary
    from simnav.leaderboard.campaign.request import EstimatorRequest
    from simnav.leaderboard.ranking.ranking import Ranking
    from simnav.leaderboard.results.result import Result
    from simnav.scenario import Scenario

__all__ = ["Limits", "campaign", "evaluate", "leaderboard"]


@dataclass(frozen=True)
class Limits:
    """What a campaign may take.

    Attributes
    ----------
    workers : int
        Processes.
    seconds : float or None
        One estimator, one run; None: the campaign's own limit.
    memory : int
        One estimator [MiB].
    """

    workers: int
    seconds: float | None
    memory: int


_STAGES = {"compile": "compiling kernels", "run": "running"}


def _run(
    out: Output,
    scenarios: Sequence[Scenario],
    requests: Sequence[EstimatorRequest],
    seeds: range,
    limits: Limits,
    folder: Path,
) -> Summary:
    from simnav.leaderboard.campaign.campaign import CampaignError, run_campaign
    from simnav.leaderboard.results.store import StoreError, create

    with mistakes(StoreError):
        create(folder)
    stage = ""
    with out.progress("starting") as bar:

        def told(p: Progress) -> None:
            nonlocal stage
            stage = p.stage
            bar.begin(_STAGES.get(stage, stage))
            bar(p.done, p.total, f"{p.failed} failed, {p.note}" if p.failed else p.note, p.left)

        try:
            return run_campaign(
                scenarios,
                requests,
                seeds,
                folder,
                workers=limits.workers,
                timeout=limits.seconds,
                memory=limits.memory << 20,
                progress=told,
            )
        except CampaignError as error:
            if not stage:  # nothing was run: what was asked for makes no sense
                raise UserError(sentence(error)) from error
            raise


def _load(folder: Path, *, series: bool) -> list[Result]:
    from simnav.leaderboard.results.store import StoreError, load

    with mistakes(StoreError):
        results = load(folder, series=series)
    if not results:
        raise UserError(f"there are no results in {folder}; 'simnav campaign' makes some")
    return results


def campaign(
    out: Output, scenarios: Sequence[Scenario], requests: Sequence[EstimatorRequest], seeds: range, limits: Limits,
    folder: Path,
) -> int:  # fmt: skip
    """Run a campaign and show the ranking of all that is in its folder; returns the exit code."""
    folder = absolute(folder)
    summary = _run(out, scenarios, requests, seeds, limits, folder)
    results = _load(folder, series=False)
    ranking = _rank(results)
    out.document(
        {
            "results": str(folder),
            "seconds": summary.seconds,
            "asked": summary.total,
            "computed": summary.computed,
            "runs": len(results),
            "failed": _failures(results),
            "ranking": ranking.to_dict(),
        }
    )
    out.print(ranking_table(ranking, results))
    _print_failures(out, results)
    out.print(f"results: {folder} ({summary.computed} computed, {summary.skipped} were there, "
              f"{tables.duration(summary.seconds)})",
              f"next:    simnav leaderboard {folder}")  # fmt: skip
    return 0 if any(r.status == "ok" for r in results) else FAILED


def leaderboard(out: Output, folder: Path, output: Path, workers: int, papers: Path | None = None) -> int:
    """Show the ranking and write the site; returns the exit code."""
    from simnav.leaderboard.papers.page import find
    from simnav.leaderboard.site.site import SiteError, build

    results = _load(absolute(folder), series=True)
    ranking = _rank(results)
    pages = [] if papers is None else find(papers)
    with out.progress("site") as progress, mistakes(SiteError):
        index = build(results, ranking, output, progress=progress, workers=workers, papers=pages)
    out.document({"site": str(index), "runs": len(results), "failed": _failures(results), "ranking": ranking.to_dict()})
    out.print(ranking_table(ranking, results))
    _print_failures(out, results)
    out.print(f"site: {index}")
    return 0


def evaluate(
    out: Output, mine: EstimatorRequest, against: Sequence[EstimatorRequest], scenarios: Sequence[Scenario],
    seeds: range, limits: Limits, keep: Path | None,
) -> int:  # fmt: skip
    """Run one estimator beside others on the same seeds and show where it stands; returns the exit code."""
    requests = [mine, *(r for r in against if r.label != mine.label)]
    with _folder(keep) as folder:
        _run(out, scenarios, requests, seeds, limits, folder)
        results = _load(folder, series=False)
    wanted, labels = {s.id for s in scenarios}, {r.label for r in requests}
    results = [r for r in results if r.scenario in wanted and r.estimator in labels and r.seed in seeds]
    ranking = _rank(results)
    stands = [standing(by, mine.label, s) for s, by in group(results).items()]
    out.document({"estimator": mine.label, "scenarios": [s.id for s in scenarios], "seeds": list(seeds),
                  "ranking": ranking.to_dict(), "comparisons": [plain(s) for s in stands],
                  "results": None if keep is None else str(absolute(keep))})  # fmt: skip
    out.print(ranking_table(ranking, results, [mine.label]))
    for stand in stands:
        out.print(standing_table(stand))
    _print_failures(out, results)
    own = [r for r in results if r.estimator == mine.label]
    if own and all(r.status == "unsuitable" for r in own):
        raise UserError(f"{mine.label} does not suit {', '.join(sorted(wanted))}: {own[0].reason}")
    return FAILED if any(r.tried and r.status != "ok" for r in own) else 0


@contextlib.contextmanager
def _folder(keep: Path | None) -> Iterator[Path]:
    if keep is not None:
        yield absolute(keep)
        return
    with tempfile.TemporaryDirectory(prefix="simnav-evaluate-") as name:
        yield Path(name) / "results"


# ------------------------------------------------------------------------------------------------
# Tables


def _rank(results: Sequence[Result]) -> Ranking:
    from simnav.leaderboard.ranking.ranking import rank

    return rank(results)


def _failures(results: Sequence[Result]) -> dict[str, int]:
    found: dict[str, int] = {}
    for r in results:
        if r.status not in ("ok", "unsuitable"):
            found[r.status] = found.get(r.status, 0) + 1
    return found


def _print_failures(out: Output, results: Sequence[Result]) -> None:
    """One line for each estimator, scenario and status that failed."""
    failed: dict[tuple[str, str, str], list[Result]] = {}
    for r in results:
        if r.status not in ("ok", "unsuitable"):
            failed.setdefault((r.estimator, r.scenario, r.status), []).append(r)
    if failed:
        rows = [[*key, len(found), found[0].reason] for key, found in failed.items()]
        out.print(tables.table("Failures", ["estimator", "scenario", "status", "runs", "reason of the first"], rows,
                               numeric=["runs"]))  # fmt: skip
