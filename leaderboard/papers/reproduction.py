"""From a paper to filled rows: find its methods, run them on the same seeds, and give each row its verdict."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from simnav.leaderboard.campaign.campaign import run_campaign
from simnav.leaderboard.campaign.request import EstimatorRequest, split_estimators
from simnav.leaderboard.ranking.statistics import mean, mean_ratio
from simnav.leaderboard.results.errors import RequestError
from simnav.leaderboard.results.frame import frame

from .comparison import Single, Verdict, as_gain, judge, judge_gain, judge_single, single_runs
from .figures import draw
from .findings import Finding, Findings
from .measures import measure, value_of
from .paper import Gain, Method, Paper, Row, kind_of

if TYPE_CHECKING:
    import matplotlib.figure

    from simnav.leaderboard.campaign.campaign import Progress
    from simnav.leaderboard.campaign.request import EstimatorRequest
    from simnav.leaderboard.results.result import Result

__all__ = ["Finding", "Reproduction", "fill", "find_method", "finding_of", "load_results", "reproduce"]

_UNEXPLAINED = "the reason is not known"


@dataclass(frozen=True, eq=False)
class Reproduction(Findings):
    """A paper's comparison, repeated with our estimators and scenarios; the attributes are those of `Findings`."""

    def count(self, verdict: str, kind: str = "") -> int:
        """Number of rows with a verdict; of one kind (`simnav.leaderboard.papers.paper.kind_of`), or of all."""
        return sum(f.verdict == verdict and kind in ("", kind_of(f.row)) for f in self.findings)

    @property
    def single_runs(self) -> tuple[int, int]:
        """Of the figures and gains that differ, or are undecided: how many lie in the range of our single runs, of how
        many with such a range."""
        known = [f for f in self.findings if f.verdict in ("differs", "undecided") and f.single_verdict]
        return sum(f.single_verdict == "inside" for f in known), len(known)

    def to_dict(self) -> dict[str, Any]:
        """The fields as values that JSON can hold."""
        return {
            "paper": self.paper.key,
            "title": self.paper.title,
            "citation": self.paper.citation,
            "doi": self.paper.doi,
            "notes": list(self.paper.notes),
            "runs": len(self.seeds),
            "seeds": list(self.seeds),
            "methods": {name: None if r is None else r.label for name, r in self.stands_for.items()},
            "rows": [_row_dict(f) for f in self.findings],
            "claims": [a.to_dict() for a in self.answers or []],
        }

    def to_frame(self) -> Any:
        """One line for each row of the paper's tables; see `simnav.leaderboard.results.frame.frame`."""
        rows = [_row_dict(f) for f in self.findings]
        texts = [{k: " / ".join(map(str, v)) if isinstance(v, list) else v for k, v in row.items()} for row in rows]
        return frame([{**row, "paper": None if row["paper"] is None else str(row["paper"])} for row in texts])

    def plot(self, number: str = "") -> matplotlib.figure.Figure:
        """One of the paper's figures from our runs.

        Parameters
        ----------
        number : str
            Number of the figure, such as ``Figure 4``; default: the first figure that can be drawn.

        Raises
        ------
        RequestError
            If it cannot be drawn; one sentence.
        """
        for entry in self.paper.figures:
            if number in ("", entry.number) and (fig := draw(self, entry)) is not None:
                return fig
        known = ", ".join(dict.fromkeys(f.number for f in self.paper.figures if f.number))
        raise RequestError(f"there is nothing to draw of {number or 'this paper'}; it has {known or 'no figures'}")


def _row_dict(f: Finding) -> dict[str, Any]:
    m = measure(f.row.score)
    gain = isinstance(f.row, Gain)
    paper: Any = f.row.paper
    ours = as_gain(f.ours) if gain and f.ours is not None else f.ours
    single = as_gain(f.single) if gain and f.single is not None else f.single
    return {
        "table": f.table,
        "scenario": f.row.scenario,
        "method": f.row.method,
        "than": f.row.than if isinstance(f.row, Gain) else None,
        "estimators": list(f.estimators),
        "score": f.row.score,
        "title": m.title,
        "unit": "gain" if gain else m.unit,
        "paper": list(paper) if isinstance(paper, tuple) else paper,
        "rule": "gain" if isinstance(f.row, Gain) else f.row.rule,
        "kind": kind_of(f.row),
        "derived": f.row.derived,
        "ours": None if ours is None else ours.value,
        "low": None if ours is None else ours.low,
        "high": None if ours is None else ours.high,
        "runs": 0 if ours is None else ours.runs,
        "failed": f.failed,
        "single_low": None if single is None else single.low,
        "single_high": None if single is None else single.high,
        "single_verdict": f.single_verdict,
        "verdict": f.verdict,
        "why": f.why,
    }


def find_method(method: Method) -> EstimatorRequest | None:
    """The registered estimator that stands for a method; None if there is none."""
    from simnav.estimator import EstimatorError, make, names

    known = set(names())
    for text in method.rows:
        name, parameters = split_estimators([text])[0]
        if name not in known and ".py" not in name:
            continue
        try:
            make(name, **parameters)
        except EstimatorError:  # it has no such parameter: the next will do
            continue
        return EstimatorRequest(name, parameters)
    return None


def reproduce(
    paper: Paper,
    runs: int,
    folder: Path,
    *,
    workers: int = 2,
    progress: Callable[[str, Progress], None] | None = None,
) -> Reproduction:
    """Run a paper's comparison with the same number of runs for all methods.

    Parameters
    ----------
    paper : Paper
        The paper.
    runs : int
        Number of runs of each scenario, with seeds from 0 on.
    folder : Path
        Folder of the results. Runs whose results are there already are not repeated.
    workers : int
        Number of processes.
    progress : callable, optional
        Called with the name of the scenario and the campaign's progress.

    Returns
    -------
    Reproduction

    Raises
    ------
    simnav.leaderboard.campaign.campaign.CampaignError, simnav.leaderboard.results.store.StoreError
        As `simnav.leaderboard.campaign.campaign.run_campaign`.
    """
    stands_for = {m.name: find_method(m) for m in paper.methods}
    for name, methods in paper.participants().items():
        run(paper, name, methods, stands_for, range(runs), folder, workers=workers, progress=progress)
    return fill(paper, stands_for, load_results(paper, stands_for, folder, range(runs)), range(runs))


def run(
    paper: Paper,
    scenario: str,
    methods: Sequence[str],
    stands_for: Mapping[str, EstimatorRequest | None],
    seeds: range,
    folder: Path,
    *,
    workers: int,
    progress: Callable[[str, Progress], None] | None,
) -> None:
    """Run some methods of a paper on one of its scenarios; results that are in the folder are kept."""
    requests = {r.label: r for m in methods if (r := stands_for[m]) is not None}
    if requests:
        named = None if progress is None else lambda p: progress(scenario, p)
        run_campaign([paper.scenario(scenario)], list(requests.values()), seeds, folder, workers=workers,
                     progress=named)  # fmt: skip


def load_results(
    paper: Paper, stands_for: Mapping[str, EstimatorRequest | None], folder: Path, seeds: range
) -> list[Result]:
    """The results of a folder that belong to a paper's comparison, for these seeds."""
    from simnav.leaderboard.results.store import load

    wanted = {
        (paper.scenario(scenario).id, request.label)
        for scenario, methods in paper.participants().items()
        for m in methods
        if (request := stands_for[m]) is not None
    }
    found = load(folder, series=bool(paper.figures)) if wanted else []
    return [r for r in found if (r.scenario, r.estimator) in wanted and r.seed in seeds]


def fill(
    paper: Paper, stands_for: dict[str, EstimatorRequest | None], results: list[Result], seeds: Sequence[int]
) -> Reproduction:
    """Fill all rows of a paper from results."""
    by: dict[tuple[str, str], list[Result]] = {}
    for result in results:
        by.setdefault((result.scenario, result.estimator), []).append(result)
    labels = {name: r.label for name, r in stands_for.items() if r is not None}
    ids = {name: paper.scenario(name).id for name in {row.scenario for row in paper.rows()}}
    findings = [
        finding_of(table.title, row, ids[row.scenario], labels, by) for table in paper.tables for row in table.rows
    ]
    return Reproduction(paper, seeds, findings, stands_for, results)


def finding_of(
    table: str,
    row: Row,
    scenario: str,
    labels: Mapping[str, str],
    results: Mapping[tuple[str, str], Sequence[Result]],
) -> Finding:
    """Fill one row.

    Parameters
    ----------
    table : str
        Title of the row's table.
    row : Row
        The paper's row.
    scenario : str
        Versioned id of the row's scenario.
    labels : mapping of str to str
        Method -> label of the estimator that stands for it; methods without one are left out.
    results : mapping of (scenario, estimator) to results
        All results of the comparison.
    """
    methods = [row.method, *([row.than] if isinstance(row, Gain) else [])]
    missing = [m for m in methods if m not in labels]
    if missing:
        return Finding(table, row, None, "absent", f"not registered: {', '.join(missing)}")
    names = tuple(labels[m] for m in methods)
    all_runs = [results.get((scenario, name), ()) for name in names]
    for name, runs in zip(names, all_runs, strict=True):
        if not any(r.status == "ok" for r in runs):
            reasons = [f"{name}: {r.why}" for r in runs] or [f"{name}: no run"]
            unsuitable = bool(runs) and not any(r.tried for r in runs)
            return Finding(table, row, None, "unsuitable" if unsuitable else "failed", reasons[0], names, len(runs))
    failures = [sum(r.status != "ok" for r in runs) for runs in all_runs]
    failed = sum(failures)
    scores = [row.score, (row.than_score or row.score) if isinstance(row, Gain) else row.score]
    values = [
        {r.seed: value_of(r, score) for r in runs if r.status == "ok"}
        for runs, score in zip(all_runs, scores, strict=False)
    ]
    if isinstance(row, Gain):
        ours = mean_ratio(values[0], values[1])
        if row.paper is None:
            return Finding(table, row, ours, "ours", "", names, failed)
        verdict = judge_gain(ours, 1.0 - row.paper)
        single = single_runs(a / values[1][s] for s, a in values[0].items() if values[1].get(s, 0.0) > 0.0)
        # A ratio below the range is a gain above it.
        found = judge_single(single, 1.0 - row.paper)
        of_gain: dict[Single, Single] = {"below": "above", "above": "below"}
        word = of_gain.get(found, found)
        # The side is that of the ratio: a higher ratio is a smaller gain.
        why = {-1: row.higher, 1: row.lower}
    else:
        ours = mean(values[0].values())
        if math.isnan(ours.value):
            return Finding(table, row, None, "unsuitable", f"{names[0]} does not give it", names, failed)
        if row.paper is None or row.rule == "beside":
            return Finding(table, row, ours, "ours", "", names, failed)
        verdict = judge(ours, row.paper, row.rule)
        why = {-1: row.lower, 1: row.higher}
        single, word = None, ""
        if kind_of(row) == "figure":
            single = single_runs(values[0].values())
            word = judge_single(single, row.paper)
    if failures[0] or (failed and isinstance(row, Gain)):  # a run that failed is worse than any figure
        verdict = Verdict("differs", 1 if failures[0] else -1)
    sentence = ""
    if verdict.word == "differs":
        sentence = why[verdict.side] or _UNEXPLAINED
    return Finding(table, row, ours, verdict.word, sentence, names, failed, single, word)
