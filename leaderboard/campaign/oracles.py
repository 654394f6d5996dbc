"""The oracles that a campaign runs beside the estimators that it was asked for."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from simnav.estimator import Estimator, EstimatorError, find

from .request import EstimatorRequest, file_of

if TYPE_CHECKING:
    from simnav.scenario import Scenario

__all__ = ["ORACLE", "SMOOTHED_ORACLE", "beside_oracles"]

#: What a board compares errors with, in real time and smoothed.
ORACLE, SMOOTHED_ORACLE = "oracle", "oracle-rts"


def beside_oracles(
    scenarios: Sequence[Scenario], everyone: Sequence[EstimatorRequest]
) -> Iterator[tuple[list[Scenario], list[EstimatorRequest]]]:
    """Simulated scenarios with the oracles added, then recorded ones without: nobody knows the noise of a real log.

    The oracle of smoothed trajectories is added where any of the estimators smooths.

    Parameters
    ----------
    scenarios : sequence of Scenario
        Scenarios of the campaign.
    everyone : sequence of EstimatorRequest
        The estimators of the campaign.

    Yields
    ------
    tuple
        Scenarios, and the estimators that are run on them; no part is empty.
    """
    labels = {r.label for r in everyone}
    wanted = [ORACLE, SMOOTHED_ORACLE] if any(map(_smooths, everyone)) else [ORACLE]
    added = [EstimatorRequest(name) for name in wanted if name not in labels]
    simulated, recorded = [s for s in scenarios if s.log is None], [s for s in scenarios if s.log is not None]
    if simulated:
        yield simulated, [*everyone, *added]
    if recorded:
        yield recorded, list(everyone)


def _smooths(request: EstimatorRequest) -> bool:
    """Whether a registered estimator gives a smoothed trajectory; one of a file is not imported for this."""
    if file_of(request.name):
        return False
    try:
        cls = request.cls or find(request.name)
    except EstimatorError:
        return False  # the campaign says what is wrong
    recipe = getattr(cls, "recipe", {})
    if not recipe or "smoother" in recipe:
        return cls.smooth is not Estimator.smooth
    solver = recipe["solver"].make
    return "smoother" not in getattr(solver, "pieces", ()) and solver.smooth is not Estimator.smooth
