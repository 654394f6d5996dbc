"""Whether estimators that were asked for can run on a scenario, said before anything runs."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING

from simnav.estimator import UnsuitableScenario, find, unsuitable
from simnav.estimator.looking_back import LookingBack
from simnav.leaderboard.results.errors import RequestError, mistakes

from .request import comes_with_simnav, file_of

if TYPE_CHECKING:
    from simnav.scenario import Scenario

    from .request import EstimatorRequest

__all__ = ["require_suitable", "with_long_windows"]


def require_suitable(scenario: Scenario, asked: Iterable[EstimatorRequest], *, lags_only: bool = False) -> None:
    """Refuse estimators that cannot run on a scenario.

    Parameters
    ----------
    scenario : Scenario
        The scenario.
    asked : iterable of EstimatorRequest
        The estimators. Those that do not come with simnav are not looked at, for their code runs in a process of its
        own.
    lags_only : bool
        Whether only their lags are looked at, and not the instruments that they need.

    Raises
    ------
    RequestError
        If one needs an instrument that is not there, uses no position where there is one, or has a lag that it cannot
        answer; one sentence.
    """
    from simnav.source import open_source

    with mistakes():
        instruments = open_source(scenario, 0).instruments
    for request in asked:
        with mistakes():
            if file_of(request.name) or request.point or not comes_with_simnav(request.cls or find(request.name)):
                continue
            estimator = request.make()
            lack = unsuitable(estimator, instruments)
        if lack and not lags_only:
            raise RequestError(f"{request.label} cannot run on {scenario.id}: {lack}")
        if isinstance(estimator, LookingBack):
            try:
                estimator.require(instruments)
            except UnsuitableScenario:
                continue  # the run says so
            except ValueError as error:
                raise RequestError(f"{request.label} on {scenario.id}: {error}") from None


def with_long_windows(scenario: Scenario, asked: Iterable[EstimatorRequest]) -> list[EstimatorRequest]:
    """The same estimators of simnav, with windows that are long enough for their lags."""
    from simnav.source import open_source

    instruments = open_source(scenario, 0).instruments
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
