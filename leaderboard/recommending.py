"""The call `recommend`: which row to take, for some instruments and troubles."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING

from simnav.leaderboard.results.errors import RequestError
from simnav.spec import closest

from .arguments import absolute, results_of, scenario_of
from .calls import call, finite_number
from .recommend_requests import RecommendRequest

if TYPE_CHECKING:
    from simnav.leaderboard.ranking.recommendation import Recommendation

    from .requests import ScenarioLike

__all__ = ["recommend"]

#: What sailors call a kind of instrument.
_CALLED = {"gnss": "gnss_position", "gps": "gnss_position", "compass": "magnetic_compass", "log": "speed_log"}


@call(RecommendRequest)
def recommend(request: RecommendRequest) -> Recommendation:
    """Choose an estimator for some instruments and troubles.

    Returns
    -------
    simnav.leaderboard.ranking.recommendation.Recommendation
        The row with its cost, its errors by kind of trouble, and how sure it is; ``sentences`` says it in words.

    Raises
    ------
    RequestError
        If an instrument, a scenario or a kind of trouble is unknown, or there are no results; one sentence.
    """
    from simnav.leaderboard.ranking.ranking import RANKED_SCORES
    from simnav.leaderboard.ranking.recommendation import recommendation
    from simnav.leaderboard.ranking.similar_scenarios import carried, speaks_for
    from simnav.leaderboard.ranking.track_runs import runs_of_tracks
    from simnav.leaderboard.ranking.tracks import catalogued
    from simnav.leaderboard.ranking.troubles import trouble_of

    from . import standard

    mine, asked = _kinds(request.instruments), _troubles(request.troubles)
    limit = None if request.milliseconds is None else finite_number("milliseconds", request.milliseconds)
    headers = {name: h for name, h in catalogued().items() if trouble_of(name)}
    fitting = {name for name, h in headers.items() if speaks_for(carried(h), mine)}
    folder = standard.RESULTS if request.results is None else absolute(request.results)
    if not fitting:
        return recommendation([], mine, fitting.__contains__, asked, limit)
    results = results_of(folder, scores=RANKED_SCORES, scenarios=fitting)
    runs = list(runs_of_tracks(results, "horizontal_rmse"))
    return recommendation(runs, mine, fitting.__contains__, asked, limit)


def _kinds(given: ScenarioLike | Sequence[str]) -> tuple[str, ...]:
    """The kinds of instruments that were named, or those of a scenario; sorted."""
    from simnav.scenario.catalogue import headers

    words = [given] if isinstance(given, (str, os.PathLike)) or not isinstance(given, Sequence) else list(given)
    if len(words) == 1 and isinstance(words[0], str) and "," in words[0]:
        words = words[0].split(",")
    names = [word.strip() if isinstance(word, str) else word for word in words]
    if not names:
        raise RequestError("no instrument was named; like imu, gnss, dvl and gyrocompass, or a scenario")
    valid = _valid()
    names = [n.lower() if isinstance(n, str) and n.lower() in valid else n for n in names]
    if len(names) == 1 and names[0] not in valid:
        instruments = scenario_of(names[0]).instruments
        return tuple(sorted({getattr(spec, "kind", name) for name, spec in instruments.items()}))
    found = []
    for name in names:
        if name not in valid:
            if isinstance(name, str) and name in {h.name for h in headers()}:
                raise RequestError(f"{name!r} is a scenario, which has its instruments: name it alone")
            known = [n for n in valid if "_" not in n]  # each once
            raise RequestError(f"{name!r} is no kind of instrument{closest(str(name), known)}")
        found.append(valid[name])
    return tuple(sorted(set(found)))


def _valid() -> dict[str, str]:
    """What an instrument may be called, and its kind."""
    from simnav.kinds import KINDS
    from simnav.leaderboard.ranking.similar_scenarios import IMU

    kinds = [IMU, *KINDS]
    return {**{k.replace("_", "-"): k for k in kinds}, **_CALLED, **{k: k for k in kinds}}


def _troubles(given: Sequence[str] | str) -> tuple[str, ...]:
    from simnav.leaderboard.ranking.troubles import troubles

    words = given.split(",") if isinstance(given, str) else [w for part in given for w in part.split(",")]
    names = [word.strip().lower() for word in words]
    for name in names:
        if name not in troubles():
            raise RequestError(f"{name!r} is no kind of trouble{closest(name, list(troubles()))}")
    return tuple(dict.fromkeys(names))
