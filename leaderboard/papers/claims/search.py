"""The search for conditions: each dial by itself, first on the seeds of a search, then on those of a judgement.

A condition that a search finds is one of many that were tried, so its gain is chosen and not only measured. It is
computed again on seeds that the search did not use, and the interval of those decides.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from simnav.leaderboard.campaign.campaign import run_campaign
from simnav.leaderboard.campaign.suitability import require_suitable
from simnav.leaderboard.papers.measures import value_of
from simnav.leaderboard.results.errors import RequestError
from simnav.leaderboard.results.store import load

from .answer import Answer
from .claim import Choice, Claim, Dial, Setting
from .dials import lags_given
from .looks import LEVEL, looks
from .points import DialAnswer, Judgement, Point

if TYPE_CHECKING:
    from simnav.leaderboard.campaign.campaign import Progress
    from simnav.leaderboard.campaign.request import EstimatorRequest
    from simnav.leaderboard.results.result import Result
    from simnav.scenario import Scenario

__all__ = ["JUDGED_FROM", "SEARCHED_FROM", "TRIES", "search"]

#: Seeds of the search and of the judgement begin here. The papers' tables are of seeds from 0 on. Seeds from 2000 to
#: 5000 were looked at while claims and dials of the papers were chosen, so nothing is judged on them.
SEARCHED_FROM, JUDGED_FROM = 1000, 10000
#: Values of a dial that are judged at most, one after the other, and the distance of their seeds.
TRIES, APART = 3, 1000


def search(
    claim: Claim,
    dials: Sequence[Dial],
    folder: Path,
    *,
    runs: int,
    judged: int,
    workers: int = 2,
    judged_from: int = JUDGED_FROM,
    progress: Callable[[str, Progress], None] | None = None,
) -> Answer:
    """Find out under which conditions a claim holds.

    Each dial is varied by itself, with all other settings as ours. At each value the gain is computed on the seeds of
    the search. Then one value of each dial and our own settings are judged on other seeds. The value is the one nearest
    to ours at which the claim holds in the search with its whole interval; if there is none, the nearest one at which
    the mean gain reaches the claim; and if there is none, that with the largest gain. If the claim does not hold there,
    the next value away from ours that reached it in the search is judged, on seeds that nothing was judged on before.
    A judgement that is undecided gets twice as many seeds, up to the last of `simnav.leaderboard.papers.claims.looks`.
    Our settings are judged wrongly in at most 5 %, and so is each dial: its 5 % are divided among the values that may
    be judged.

    Parameters
    ----------
    claim : Claim
        The claim.
    dials : sequence of Dial
        Dials of the claim; none: only our settings are judged.
    folder : Path
        Folder of the results; runs that it has are not repeated.
    runs, judged : int
        Number of seeds of the search, and the first number of seeds of the judgement.
    workers : int
        Number of processes.
    judged_from : int
        First seed of the judgement, after those of the search.
    progress : callable, optional
        Called with what is being run and the campaign's progress.

    Raises
    ------
    RequestError
        If seeds of the search would be judged on, or a method of a comparison cannot run on its scenario: one sentence,
        before anything is run. If it has not the score: after the first seed.
    """
    if judged_from < SEARCHED_FROM + runs:
        raise RequestError(
            f"judged_from = {judged_from}: the seeds of the search are from {SEARCHED_FROM} to "
            f"{SEARCHED_FROM + runs - 1}, and the judgement needs later ones"
        )
    if looks(judged)[-1] > APART:
        raise RequestError(
            f"judged = {judged}: it is doubled up to {looks(judged)[-1]} seeds, and the next value is judged on seeds "
            f"{APART} later; at most {APART // looks(1)[-1]} are possible"
        )
    base = claim.base()
    # One list, so that one run of an estimator gives all of its lags.
    asked = [(dial, value) for dial in dials for value in dial.values]
    every = lags_given([base, *(base if value == dial.ours else dial.set(base, value) for dial, value in asked)])
    settings: dict[tuple[str, Choice], Setting] = {
        (dial.name, value): setting for (dial, value), setting in zip(asked, every[1:], strict=True)
    }
    base = every[0]
    for scenario, requests in _methods(every):
        require_suitable(scenario, requests)
    run = partial(_run, folder=folder, workers=workers, progress=progress)
    points: dict[tuple[str, Choice], Point] = {}
    for count in sorted({min(runs, 1), runs}) if settings else ():  # what a method lacks shows on the first seed
        results = run(settings.values(), range(SEARCHED_FROM, SEARCHED_FROM + count), what="search")
        points = {key: _point(key[1], setting, results) for key, setting in settings.items()}

    def judge(value: Choice, setting: Setting, begin: int, level: float, counts: Sequence[int]) -> Judgement:
        """The gain at a value on seeds from one on, with more seeds while it is undecided."""
        for count in counts:
            point = _point(value, setting, run([setting], range(begin, begin + count), what="judgement"))
            found = Judgement(value, point.seeds, point.ratios, point.failed, judged, level)
            if found.standing(claim.limit) != "undecided":
                break
        return found

    planned = looks(judged)
    ours = judge("", base, judged_from, LEVEL, planned)
    known_to_hold = ours.standing(claim.limit) == "holds"
    answers = []
    for dial in dials:
        tried: list[Judgement] = []
        for k, value in enumerate(_to_be_judged(claim, dial, points)):
            counts = planned[:1] if known_to_hold else planned
            tried.append(judge(value, settings[dial.name, value], judged_from + APART * k, LEVEL / TRIES, counts))
            if known_to_hold or tried[-1].standing(claim.limit) == "holds":
                break
        answers.append(
            DialAnswer(dial.name, dial.title, dial.unit, dial.ours, dial.why,
                       [points[dial.name, v] for v in dial.values], tried)
        )  # fmt: skip
    return Answer(
        claim.name, claim.paper, claim.sentence, claim.gain, claim.derived, base.scenario.id, base.row.label,
        base.than.label, base.score, base.than_score, ours, answers,
    )  # fmt: skip


def _to_be_judged(claim: Claim, dial: Dial, points: dict[tuple[str, Choice], Point]) -> list[Choice]:
    """The values to be judged, in turn; none if the only value is ours."""
    values = [v for v in dial.values if v != dial.ours]
    place = dial.values.index(dial.ours) if dial.ours in dial.values else 0
    away = sorted(values, key=lambda v: abs(dial.values.index(v) - place))
    reaching = [v for v in away
                if points[dial.name, v].ratio.value <= claim.limit and not points[dial.name, v].failed]  # fmt: skip
    if reaching:
        whole = [v for v in reaching if points[dial.name, v].standing(claim.limit) == "holds"]
        return reaching[reaching.index(whole[0] if whole else reaching[0]) :][:TRIES]
    known = [v for v in values if math.isfinite(points[dial.name, v].ratio.value)]
    return [min(known, key=lambda v: points[dial.name, v].ratio.value)] if known else values[:1]


def _run(
    settings: Iterable[Setting],
    seeds: range,
    *,
    what: str,
    folder: Path,
    workers: int,
    progress: Callable[[str, Progress], None] | None,
) -> dict[tuple[str, str, int], Result]:
    """Run all methods of some comparisons; results by scenario, estimator and seed."""
    for scenario, requests in _methods(settings):
        named = None if progress is None else partial(progress, f"{what}: {scenario.id}")
        run_campaign([scenario], requests, seeds, folder, workers=workers, progress=named)
    if not len(seeds):
        return {}
    return {(r.scenario, r.estimator, r.seed): r for r in load(folder, series=False) if r.seed in seeds}


def _methods(settings: Iterable[Setting]) -> list[tuple[Scenario, list[EstimatorRequest]]]:
    """The methods of some comparisons, each once on each scenario."""
    wanted: dict[str, tuple[Scenario, dict[str, EstimatorRequest]]] = {}
    for s in settings:
        for scenario, request in ((s.scenario, s.row), (s.than_scenario, s.than)):
            wanted.setdefault(scenario.id, (scenario, {}))[1][request.label] = request
    return [(scenario, list(requests.values())) for scenario, requests in wanted.values()]


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
            if r.status == "error" and " lag " in r.reason:  # not a failure of the method
                raise RequestError(f"{r.estimator} on {r.scenario}: {r.reason}")
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
