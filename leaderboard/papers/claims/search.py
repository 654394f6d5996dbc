"""The search for conditions: each dial by itself, first on the seeds of a search, then on those of a judgement."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from simnav.leaderboard.campaign.campaign import run_campaign
from simnav.leaderboard.papers.measures import value_of
from simnav.leaderboard.results.errors import RequestError
from simnav.leaderboard.results.store import load

from .answer import Answer, DialAnswer, Point
from .claim import Choice, Claim, Dial, Setting
from .dials import lags_given

if TYPE_CHECKING:
    from simnav.leaderboard.campaign.campaign import Progress
    from simnav.leaderboard.campaign.request import EstimatorRequest
    from simnav.leaderboard.results.result import Result
    from simnav.scenario import Scenario

__all__ = ["JUDGED_FROM", "SEARCHED_FROM", "search"]

#: Seeds of the search and of the judgement begin here. The papers' tables are of seeds from 0 on.
SEARCHED_FROM, JUDGED_FROM = 1000, 2000


def search(
    claim: Claim,
    dials: Sequence[Dial],
    folder: Path,
    *,
    runs: int,
    judged: int,
    workers: int = 2,
    progress: Callable[[str, Progress], None] | None = None,
) -> Answer:
    """Find out under which conditions a claim holds.

    Each dial is varied by itself, with all other settings as ours. At each value the gain is computed on the seeds of
    the search. Then one value of each dial and our own settings are judged on other seeds. The value is the one nearest
    to ours at which the claim holds in the search with its whole interval; if there is none, the nearest one at which
    the mean gain reaches the claim; and if there is none, that with the largest gain.

    Parameters
    ----------
    claim : Claim
        The claim.
    dials : sequence of Dial
        Dials of the claim; none: only our settings are judged.
    folder : Path
        Folder of the results; runs that it has are not repeated.
    runs, judged : int
        Number of seeds of the search, and of the judgement.
    workers : int
        Number of processes.
    progress : callable, optional
        Called with what is being run and the campaign's progress.

    Raises
    ------
    RequestError
        If no method of a comparison can be run on its scenario; one sentence.
    """
    base = claim.base()
    searched, judgement = range(SEARCHED_FROM, SEARCHED_FROM + runs), range(JUDGED_FROM, JUDGED_FROM + judged)
    # One list, so that one run of an estimator gives all of its lags.
    asked = [(dial, value) for dial in dials for value in dial.values]
    every = lags_given([base, *(base if value == dial.ours else dial.set(base, value) for dial, value in asked)])
    settings: dict[tuple[str, Choice], Setting] = {
        (dial.name, value): setting for (dial, value), setting in zip(asked, every[1:], strict=True)
    }
    base = every[0]
    results = _run(settings.values(), searched, folder, workers, progress, "search")
    points = {key: _point(key[1], setting, results) for key, setting in settings.items()}
    chosen = {dial.name: value for dial in dials if (value := _nearest(claim, dial, points)) is not None}
    wanted = [base, *(settings[name, value] for name, value in chosen.items())]
    results = _run(wanted, judgement, folder, workers, progress, "judgement")
    answers = []
    for dial in dials:
        value = chosen.get(dial.name)
        found = None if value is None else _point(value, settings[dial.name, value], results)
        answers.append(
            DialAnswer(dial.name, dial.title, dial.unit, dial.ours, dial.why,
                       [points[dial.name, v] for v in dial.values], found)
        )  # fmt: skip
    return Answer(
        claim.name, claim.paper, claim.sentence, claim.gain, claim.derived, base.scenario.id, base.row.label,
        base.than.label, base.score, base.than_score, _point("", base, results), answers,
    )  # fmt: skip


def _nearest(claim: Claim, dial: Dial, points: dict[tuple[str, Choice], Point]) -> Choice | None:
    """The value to be judged; None if the only value is ours."""
    values = [v for v in dial.values if v != dial.ours]
    if not values:
        return None
    place = dial.values.index(dial.ours) if dial.ours in dial.values else 0
    holding = [v for v in values if points[dial.name, v].standing(claim.limit) == "holds"] or [
        v for v in values if points[dial.name, v].ratio.value <= claim.limit and not points[dial.name, v].failed
    ]
    if holding:
        return min(holding, key=lambda v: abs(dial.values.index(v) - place))
    known = [v for v in values if math.isfinite(points[dial.name, v].ratio.value)]
    return min(known, key=lambda v: points[dial.name, v].ratio.value) if known else values[0]


def _run(
    settings: Iterable[Setting],
    seeds: range,
    folder: Path,
    workers: int,
    progress: Callable[[str, Progress], None] | None,
    what: str,
) -> dict[tuple[str, str, int], Result]:
    """Run all methods of some comparisons; results by scenario, estimator and seed."""
    wanted: dict[str, tuple[Scenario, dict[str, EstimatorRequest]]] = {}
    for s in settings:
        for scenario, request in ((s.scenario, s.row), (s.than_scenario, s.than)):
            wanted.setdefault(scenario.id, (scenario, {}))[1][request.label] = request
    for scenario, requests in wanted.values():
        named = None if progress is None else partial(progress, f"{what}: {scenario.id}")
        run_campaign([scenario], list(requests.values()), seeds, folder, workers=workers, progress=named)
    if not len(seeds):
        return {}
    return {(r.scenario, r.estimator, r.seed): r for r in load(folder, series=False) if r.seed in seeds}


def _point(value: Choice, setting: Setting, results: dict[tuple[str, str, int], Result]) -> Point:
    """The ratio of the two scores on each seed."""
    seeds: list[int] = []
    ratios: list[float] = []
    failed = 0
    mine = {seed: r for (scenario, label, seed), r in results.items()
            if (scenario, label) == (setting.scenario.id, setting.row.label)}  # fmt: skip
    for seed, row in sorted(mine.items()):
        than = results.get((setting.than_scenario.id, setting.than.label, seed))
        if than is None:
            continue
        for r in (row, than):
            if not r.tried:
                raise RequestError(f"{r.estimator} cannot run on {r.scenario}: {r.reason}")
        if row.status != "ok" or than.status != "ok":
            failed += 1
            continue
        a, b = value_of(row, setting.score), value_of(than, setting.than_score)
        if not (a > 0.0 and b > 0.0):
            lacking, score = (row, setting.score) if not a > 0.0 else (than, setting.than_score)
            raise RequestError(
                f"{lacking.estimator} has no {score} on {lacking.scenario}; choose a score that both have"
            )
        seeds.append(seed)
        ratios.append(a / b)
    return Point(value, seeds, ratios, failed)
