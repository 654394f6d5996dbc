"""Measure what estimators cost, as multiples of the plain row, each on scenarios that suit it."""

from __future__ import annotations

import copy
import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

from simnav.estimator import Estimator, UnsuitableScenario, lacking, make
from simnav.leaderboard.campaign.request import EstimatorRequest
from simnav.recording import Recording
from simnav.testing.cost import started
from simnav.testing.paired_time import multiple

from .plain_row import plain_rows
from .stored_costs import CostMultiple
from .tracks import SMOOTHED

__all__ = ["SCENARIOS", "Unmeasured", "multiples_of"]

#: Where costs are measured, if no scenario was asked for. An estimator runs on the first that suits it of those with
#: the same plain row: a ship with an IMU, GNSS and DVL; one without an IMU; an AUV whose positions are terrain fixes; a
#: ship with a receiver and its raw observations; an AUV with messages of a ship; an AUV with soundings and a chart.
SCENARIOS = ("open-sea", "fishing-vessel", "auv-soft-mud", "satellites-open-sea", "auv-and-ship", "terrain-rough")

_TRIED = 3  # epochs after which an estimator is asked whether it smooths


@dataclass(frozen=True)
class Unmeasured:
    """An estimator without a multiple, and why.

    Attributes
    ----------
    estimator : str
        Label.
    status : str
        ``unsuitable`` (it needs other instruments) or ``error``.
    reason : str
        One sentence.
    """

    estimator: str
    status: str
    reason: str


def multiples_of(
    estimators: Sequence[EstimatorRequest],
    seas: Sequence[tuple[str, Recording]],
    *,
    epochs: int = 120,
    rounds: int = 21,
    progress: Callable[..., None] | None = None,
) -> tuple[list[CostMultiple], list[Unmeasured]]:
    """Measure the multiples of estimators.

    Parameters
    ----------
    estimators : sequence of EstimatorRequest
        The estimators.
    seas : sequence of pairs
        Versioned id of a scenario, and a recording of it.
    epochs, rounds
        As for `simnav.testing.paired_time.multiple`.
    progress : callable, optional
        Called with the number of finished estimators, the number of all, and the label of the next one as ``note=``.

    Returns
    -------
    multiples : list of CostMultiple
        Of each estimator one for each plain row that suits a scenario which suits the estimator: ``ekf`` with an IMU,
        ``ship-ekf`` without; of one that smooths, also one for each plain smoother.
    unmeasured : list of Unmeasured
        The estimators that fail, or that no scenario suits.

    Raises
    ------
    ValueError
        If there are too few epochs or rounds.
    """
    if epochs < 2:
        raise ValueError(f"epochs: {epochs} are too few; at least 2 are wanted")
    if rounds < 1:
        raise ValueError(f"rounds: {rounds} is too few; at least 1 is wanted")
    found: list[CostMultiple] = []
    failed: list[Unmeasured] = []
    for k, request in enumerate(estimators):
        if progress:
            progress(k, len(estimators), note=request.label)
        try:
            mine = list(_multiples(request, seas, epochs, rounds))
        except UnsuitableScenario as error:
            failed.append(Unmeasured(request.label, "unsuitable", str(error)))
        except Exception as error:
            failed.append(Unmeasured(request.label, "error", f"{type(error).__name__}: {error}"))
        else:
            found += mine
    if progress:
        progress(len(estimators), len(estimators))
    return found, failed


def _multiples(
    request: EstimatorRequest, seas: Sequence[tuple[str, Recording]], epochs: int, rounds: int
) -> Iterator[CostMultiple]:
    """The multiples of one estimator.

    Raises
    ------
    UnsuitableScenario
        If no scenario suits it.
    """
    lacks = {name: lacking(request.make().needs, sea.instruments) for name, sea in seas}
    suitable = [(name, sea) for name, sea in seas if not lacks[name]]
    if not suitable:
        raise UnsuitableScenario("; ".join(f"{name}: {why}" for name, why in lacks.items()))
    done = set[str]()
    for name, sea in suitable:
        for smooth in (False, True):
            plain = _plain_row_for(sea, smooth)
            if not plain or plain in done or (smooth and not _smooths(request.make(), sea)):
                continue
            done.add(plain)
            m = multiple(request.make, partial(make, plain), sea, epochs=epochs, rounds=rounds, smooth=smooth)
            yield CostMultiple(request.label, plain, name, m.value, m.low, m.high, m.rounds)


def _plain_row_for(sea: Recording, smooth: bool) -> str:
    """The plain row that suits a recording; empty if none does."""
    rows = plain_rows(SMOOTHED if smooth else "")
    return next((name for name in rows if not lacking(make(name).needs, sea.instruments)), "")


def _smooths(estimator: Estimator, sea: Recording) -> bool:
    """Whether it gives a smoothed trajectory."""
    running = started(estimator, sea)
    for packet in itertools.islice(sea.steps(), _TRIED):
        running.update(copy.deepcopy(packet))
    return running.smooth() is not None
