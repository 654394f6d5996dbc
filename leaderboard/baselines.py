"""The few rows that an estimator is compared with where none are named."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from simnav.estimator.registry import registered
from simnav.estimator.suitability import unsuitable
from simnav.leaderboard.campaign.request import EstimatorRequest, Estimators, requests

if TYPE_CHECKING:
    from simnav.scenario import Scenario

__all__ = ["ALL", "BASELINES", "MOST", "baselines", "baselines_or"]

#: What stands for all registered estimators.
ALL = "all"

#: The plain filters, what is simplest, and the plain window, with and without weights; the first that suit are taken.
BASELINES = ("ekf", "gnss-only", "dead-reckoning", "sw-fgo", "huber-fgo", "ukf", "ship-ekf", "ship-fgo", "inertial")

#: So many of them for each scenario.
MOST = 5


def baselines(scenarios: Iterable[Scenario]) -> list[str]:
    """The baselines of scenarios: for each the first `MOST` of `BASELINES` that suit its instruments.

    Parameters
    ----------
    scenarios : iterable of Scenario
        A scenario whose log is not here has no baselines of its own.

    Examples
    --------
    >>> from simnav.scenario import load
    >>> baselines([load("ship-straight")])
    ['gnss-only', 'dead-reckoning', 'huber-fgo', 'ship-ekf', 'ship-fgo']
    """
    from simnav.source import open_source

    found: dict[str, None] = {}
    for scenario in scenarios:
        instruments = open_source(scenario, 0).instruments
        suitable = [name for name in BASELINES if not unsuitable(registered(name)(), instruments)]
        found |= dict.fromkeys(suitable[:MOST])
    return sorted(found, key=BASELINES.index)


def baselines_or(
    given: Estimators, scenarios: Iterable[Scenario], parameters: Mapping[str, Any] | None = None
) -> list[EstimatorRequest]:
    """What was asked for; without a request the baselines of scenarios; all registered estimators for `ALL`.

    Parameters
    ----------
    given : estimators
        What was asked for.
    scenarios : iterable of Scenario
        Scenarios that are run.
    parameters : mapping, optional
        Parameters to set, as for `simnav.leaderboard.campaign.request.requests`.
    """
    if given is None:
        return requests(baselines(scenarios), parameters)
    if isinstance(given, str) and given.strip() == ALL:
        return requests(None, parameters)
    return requests(given, parameters)
