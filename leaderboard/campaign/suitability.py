"""Whether estimators that were asked for can run on a scenario, said before anything runs."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from simnav.estimator import Estimator, UnsuitableScenario, find, unsuitable
from simnav.estimator.looking_back import LookingBack
from simnav.estimator.needs import Needs, lacking
from simnav.leaderboard.results.errors import RequestError, mistakes

from .confinement.attempt import chosen_confinement
from .confinement.session import ServerError
from .request import comes_with_simnav, file_of
from .resolution import resolve

if TYPE_CHECKING:
    from simnav.scenario import Scenario
    from simnav.types import Instruments

    from .request import EstimatorRequest

__all__ = ["require_suitable", "suited", "with_long_windows"]


def require_suitable(scenario: Scenario, asked: Iterable[EstimatorRequest], *, lags_only: bool = False) -> None:
    """Refuse estimators that cannot run on a scenario.

    Parameters
    ----------
    scenario : Scenario
        The scenario.
    asked : iterable of EstimatorRequest
        The estimators. Of those that do not come with simnav, only what they need is looked at.
    lags_only : bool
        Whether only their lags are looked at, and not the instruments that they need.

    Raises
    ------
    RequestError
        If one needs an instrument that is not there, uses no position where there is one, or has a lag that it cannot
        answer; one sentence.
    """
    instruments = _instruments(scenario)
    for request in asked:
        if not lags_only and (lack := _lack_of(request)(instruments)):
            raise RequestError(f"{request.label} cannot run on {scenario.id}: {lack}; nothing was run")
        estimator = _of_simnav(request)
        if isinstance(estimator, LookingBack):
            try:
                estimator.require(instruments)
            except UnsuitableScenario:
                continue  # the run says so
            except ValueError as error:
                raise RequestError(f"{request.label} on {scenario.id}: {error}") from None


def suited(scenarios: Sequence[Scenario], asked: Iterable[EstimatorRequest]) -> tuple[list[Scenario], list[str]]:
    """The scenarios on which at least one of some estimators can run.

    Parameters
    ----------
    scenarios : sequence of Scenario
        The scenarios.
    asked : iterable of EstimatorRequest
        The estimators, as of `require_suitable`.

    Returns
    -------
    list of Scenario
        In the order given.
    list of str
        Sentences on those that are left out.

    Raises
    ------
    RequestError
        If one of the estimators can run on none of them; one sentence.
    """
    instruments = {s.id: _instruments(s) for s in scenarios}
    lacks: dict[str, dict[str, str]] = {}
    for request in asked:
        lack_of = _lack_of(request)
        mine = {name: lack for name, there in instruments.items() if (lack := lack_of(there))}
        if len(mine) == len(instruments):
            first = next(iter(mine.values()))
            raise RequestError(f"{request.label} cannot run on {', '.join(mine)}: {first}; nothing was run")
        lacks[request.label] = mine
    out = [s.id for s in scenarios if all(s.id in mine for mine in lacks.values())]
    said = [
        f"{label} cannot run on {name}, which is left out: {lacks[label][name]}." for name in out for label in lacks
    ]
    return [s for s in scenarios if s.id not in out], said


def _instruments(scenario: Scenario) -> Instruments:
    """Those of a scenario's first run."""
    from simnav.source import open_source

    with mistakes():
        return open_source(scenario, 0).instruments


def _of_simnav(request: EstimatorRequest) -> Estimator | None:
    """An instance of an estimator that comes with simnav; None for others, whose code runs in a process of its own."""
    with mistakes():
        if file_of(request.name) or request.point or not comes_with_simnav(request.cls or find(request.name)):
            return None
        return request.make()


def _lack_of(request: EstimatorRequest) -> Callable[[Instruments], str]:
    """What says why instruments do not suit an estimator, as `simnav.estimator.unsuitable` does."""
    if (made := _of_simnav(request)) is not None:
        return partial(unsuitable, made)
    needs: Needs = ()
    with mistakes(), contextlib.suppress(ServerError):  # the campaign says that its processes do not start
        needs = resolve(request, chosen_confinement(), ()).needs
    return partial(lacking, needs)


def with_long_windows(scenario: Scenario, asked: Iterable[EstimatorRequest]) -> list[EstimatorRequest]:
    """The same estimators of simnav, with windows that are long enough for their lags."""
    instruments = _instruments(scenario)
    made = []
    for request in asked:
        estimator = request.make()
        if isinstance(estimator, LookingBack):
            longest = estimator.lags[-1]
            if longest > estimator.inner.longest_lag(instruments):
                window = math.ceil(longest / instruments.step) + 1
                request = replace(request, parameters={**request.parameters, "window": window}, label="")
        made.append(request)
    return made
