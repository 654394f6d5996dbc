"""Calls that measure what an estimator costs: the time and memory of an epoch, and the multiple of the plain row."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from simnav.leaderboard.campaign.request import EstimatorRequest, Estimators, requests, together
from simnav.leaderboard.given import ScenarioLike, absolute, scenario_of, whole
from simnav.leaderboard.results.errors import RequestError, mistakes

if TYPE_CHECKING:
    from simnav.leaderboard.ranking.costs import CostReport, MultipleReport
    from simnav.recording import Recording

__all__ = ["bench", "costs"]


def bench(
    estimators: Estimators,
    *,
    against: Estimators = None,
    scenario: ScenarioLike | None = None,
    seed: int = 0,
    epochs: int = 120,
    rounds: int = 21,
    parameters: Mapping[str, Any] | None = None,
    progress: Callable[..., None] | None = None,
) -> CostReport:
    """Measure time and memory of an epoch, in this process, together with estimators that come with simnav.

    The multiples of the plain row are those of `costs`. Then all estimators run in turn on one scenario, so that other
    work of the machine slows all of them alike; see `simnav.testing.cost`.

    Parameters
    ----------
    estimators : estimators
        The estimators under test.
    against : estimators, optional
        Rows for comparison; default: one of each family.
    scenario : str, Path or Scenario, optional
        Scenario of the recording. Default: the first of `simnav.leaderboard.ranking.cost_measurement.SCENARIOS` that
        suits all of the estimators.
    seed : int
        Seed of the recording.
    epochs : int
        Number of epochs that are run, from the start; fewer if the scenario has fewer.
    rounds : int
        Number of runs over the epochs; the smallest time of an epoch counts, and of the multiples the median.
    parameters : mapping, optional
        Parameters of the estimators under test; each estimator gets the parameters that it has.
    progress : callable, optional
        Called with the number of finished parts, the number of all parts, and the next part as ``note=``.

    Returns
    -------
    CostReport
        Figures, or a reason for each estimator that fails or does not suit the scenario.

    Raises
    ------
    ValueError
        If an estimator, parameter or scenario is unknown, or there are too few epochs.
    """
    from simnav.estimator import lacking
    from simnav.leaderboard.ranking.costs import BESIDE, costs_of

    if not estimators:
        raise RequestError("no estimator was asked for; name those that should be measured")
    mine = requests(estimators, parameters)
    beside = together([*mine, *requests(list(BESIDE) if against is None else against)])[len(mine) :]
    counts = whole("epochs", epochs), whole("rounds", rounds, 1)
    multiples, seas = _multiples(mine, scenario, seed, *counts, progress)
    suited = (s for s in seas if not any(lacking(r.make().needs, s[1].instruments) for r in mine))
    name, recording = next(suited, seas[0])
    return costs_of(mine, beside, name, recording, *counts, multiples, progress)


def costs(
    estimators: Estimators = None,
    *,
    scenario: ScenarioLike | None = None,
    seed: int = 0,
    epochs: int = 120,
    rounds: int = 21,
    parameters: Mapping[str, Any] | None = None,
    output: str | os.PathLike[str] | None = None,
    progress: Callable[..., None] | None = None,
) -> MultipleReport:
    """Measure processor times as multiples of those of the plain row, in this process, each beside the plain row.

    Parameters
    ----------
    estimators : estimators, optional
        The estimators under test; default: all that come with simnav.
    scenario : str, Path or Scenario, optional
        Scenario of the recording. Default: those of `simnav.leaderboard.ranking.cost_measurement.SCENARIOS`; each
        estimator runs on those that suit it.
    seed, epochs, parameters
        As for `bench`. A third of the epochs is run before those that are timed.
    rounds : int
        Number of ratios of which the median counts; fewer for an estimator that needs more than some seconds.
    output : path, optional
        File that the multiples are written to, with machine, versions and day. The one that boards show is
        ``leaderboard/ranking/costs.json``.
    progress : callable, optional
        Called with the number of finished estimators, the number of all, and the label of the next one as ``note=``.

    Returns
    -------
    MultipleReport

    Raises
    ------
    ValueError
        If an estimator, parameter or scenario is unknown, there are too few epochs, or the file cannot be written.
    """
    from dataclasses import replace

    from simnav.estimator import find, names
    from simnav.leaderboard.campaign.request import comes_with_simnav
    from simnav.leaderboard.ranking.stored_costs import save
    from simnav.leaderboard.results.provenance import here

    if estimators is None:
        estimators = [name for name in names() if comes_with_simnav(find(name))]
    if output is not None and not absolute(output).parent.is_dir():
        raise RequestError(f"output = {os.fspath(output)!r}: there is no folder {absolute(output).parent}")
    counts = whole("epochs", epochs), whole("rounds", rounds, 1)
    measured = here()  # before, for the code may be edited meanwhile
    found, _ = _multiples(requests(estimators, parameters), scenario, seed, *counts, progress)
    if output is None:
        return found
    with mistakes(OSError):
        return replace(found, file=str(save(found.rows, absolute(output), measured)))


def _multiples(
    mine: Sequence[EstimatorRequest], scenario: ScenarioLike | None, seed: int, epochs: int, rounds: int,
    progress: Callable[..., None] | None,
) -> tuple[MultipleReport, list[tuple[str, Recording]]]:  # fmt: skip
    """The multiples of estimators, and the recordings of the scenarios, by versioned id."""
    from simnav.leaderboard.ranking.cost_measurement import SCENARIOS, multiples_of
    from simnav.leaderboard.ranking.costs import MultipleReport
    from simnav.source import record

    with mistakes():
        for r in mine:
            r.make()  # a mistake in a file's name or in a parameter is no result
    chosen = [scenario_of(s) for s in (SCENARIOS if scenario is None else (scenario,))]
    seas = [(s.id, record(s, seed)) for s in chosen]
    with mistakes(ValueError):
        rows, unmeasured = multiples_of(mine, seas, epochs=epochs, rounds=rounds, progress=progress)
    return MultipleReport(tuple(rows), tuple(unmeasured)), seas
