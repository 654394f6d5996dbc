"""The call `claim`: under which conditions does a claim hold?"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from simnav.leaderboard.results.errors import RequestError, mistakes, sentence
from simnav.scoring import SCORES
from simnav.scoring.lagged import seconds_of

from .arguments import absolute, scenario_of
from .calls import call, require_unused, whole_number
from .claim_requests import ClaimRequest

if TYPE_CHECKING:
    from simnav.leaderboard.papers.claims.answer import Answer
    from simnav.leaderboard.papers.claims.claim import Claim, Dial

__all__ = ["claim"]


@call(ClaimRequest)
def claim(request: ClaimRequest) -> Answer:
    """Find out under which conditions a claim holds.

    Returns
    -------
    simnav.leaderboard.papers.claims.answer.Answer
        The gain at all values with intervals, the verdict, and a figure (``plot()``).

    Raises
    ------
    RequestError
        If there is no such claim, condition or estimator, or values do not suit; one sentence.

    Examples
    --------
    >>> claim("mao-sigma-east").claim
    'mao-sigma-east'
    """
    from simnav.leaderboard.papers.claims import stored
    from simnav.leaderboard.papers.claims.declared import claim_of, claims
    from simnav.leaderboard.papers.claims.search import search

    if not request.claim:
        raise RequestError("no claim was named; 'simnav paper claim' lists those of the papers")
    known = request.claim in {c.name for c in claims()}
    mine = (request.than, request.scenario, request.gain)
    if known and mine != (None, None, None):
        raise RequestError(f"{request.claim} is a paper's claim; 'than', 'scenario' and 'gain' are for one of your own")
    if not known and mine == (None, None, None):
        claim_of(request.claim)  # says what there is
    if known:
        require_unused(request, ["score"], f"the claim {request.claim} has a score of its own")
    if known and not request.holds_if:
        require_unused(
            request, ["runs", "judged", "judged_from", "output", "workers"],
            f"the stored answer to {request.claim} is shown, and nothing is run; add --holds-if all",
        )  # fmt: skip
        with mistakes(ValueError):
            answer = stored.read(request.claim)
        if answer is None:
            raise RequestError(f"there is no stored answer to {request.claim}; run it with --holds-if all")
        return answer
    chosen = claim_of(request.claim) if known else _own(request)
    if not request.holds_if:
        require_unused(request, ["runs"], "a claim without a condition is judged as it stands, without a search")
    return search(
        chosen, _dials(chosen, request.holds_if), absolute(request.output or Path("results") / "claims"),
        runs=whole_number("runs", request.runs, 1), judged=whole_number("judged", request.judged, 1),
        workers=whole_number("workers", request.workers, 1), progress=request.progress,
        judged_from=whole_number("judged_from", request.judged_from),
    )  # fmt: skip


def _own(request: ClaimRequest) -> Claim:
    """A claim of the user; its dials are those that were asked for."""
    from simnav.leaderboard.campaign.request import requests
    from simnav.leaderboard.papers.claims.claim import Claim, Setting
    from simnav.leaderboard.ranking.ranking import require_lower

    for name, value in (("than", request.than), ("scenario", request.scenario), ("gain", request.gain)):
        if value is None:
            raise RequestError(
                f"{request.claim} is no claim of a paper, and for a claim of your own {name!r} is missing"
            )
    assert request.than is not None
    assert request.scenario is not None
    assert request.gain is not None
    if not 0.0 < request.gain < 100.0:
        raise RequestError(f"gain = {request.gain:g} should be a percentage between 0 and 100")
    require_lower(request.score, "an error is wanted, like horizontal_rmse")
    scenario, found = scenario_of(request.scenario), requests([request.claim, request.than])
    if len(found) != 2:
        raise RequestError("a claim compares one estimator with one other")
    row, than = found
    setting = Setting(scenario, scenario, row, than, request.score, request.score)
    lag = _lag_of(request.score)
    if lag:  # the score needs estimates of earlier times of both
        setting = setting.with_parameters("both", lags=lag)
    sentence = f"{request.score} of {row.label} is {request.gain:g} % below that of {than.label} on {scenario.name}"
    made = Claim("own", "", sentence, request.gain / 100.0, lambda: setting, ())
    dials = [_own_dial(made, text) for text in _texts(request.holds_if)]
    return replace(made, dials=tuple(dials))


def _own_dial(claim: Claim, text: str) -> Dial:
    """A condition of a user's claim, as it is typed."""
    from simnav.leaderboard.papers.claims.dials import lag_dial, parameter_dial, scenario_dial
    from simnav.leaderboard.sweep.settings import chosen_dials

    name, values = _typed(text)
    if not values:
        raise RequestError(f"--holds-if {text}: a condition of your own claim has values, like {name}=1,2,4")
    try:
        numbers = sorted({float(v) for v in values})
        if not all(map(math.isfinite, numbers)):
            raise ValueError
    except ValueError:
        raise RequestError(f"--holds-if {text}: the values should be numbers, like {name}=1,2,4") from None
    whose, dot, parameter = name.partition(".")
    if name == "lag":
        if not all(lag >= 0.0 for lag in numbers):
            raise RequestError(f"--holds-if {text}: a lag is a time of 0 s or more")
        score = claim.base().score
        if f"{score}_lag_1" not in SCORES:
            raise RequestError(f"--holds-if {text}: {score} is no score of a late output; horizontal_rmse has one")
        return lag_dial(numbers)
    if dot and whose in ("row", "than", "both"):
        made = parameter_dial(name, f"{parameter} of {whose}", whose, parameter, numbers)
        for number in numbers:
            checked = made.set(claim.base(), number)
            for request in (checked.row, checked.than):
                try:
                    request.make()
                except (ValueError, TypeError, LookupError) as error:
                    raise RequestError(f"--holds-if {text}: {sentence(error)}") from None
        return made
    (dial, _), *_ = chosen_dials(claim.base().scenario, {name: numbers})
    return scenario_dial(name, dial.title, dial.unit, numbers, lambda x: {dial.key: int(x) if x.is_integer() else x})


def _lag_of(score: str) -> str:
    """The lag of a score of late outputs as the parameter ``lags`` has it; empty for another score.

    >>> _lag_of("horizontal_rmse_lag_0p5"), _lag_of("horizontal_rmse")
    ('0.5', '')
    """
    _, between, lag = score.rpartition("_lag_")
    return f"{seconds_of(lag):g}" if between else ""


def _dials(claim: Claim, asked: Sequence[str]) -> list[Dial]:
    """The dials of a claim that were asked for, with the values that were given."""
    if not claim.paper:
        return list(claim.dials)
    found: list[Dial] = []
    for text in _texts(asked):
        name, values = _typed(text)
        if name == "all":
            found += claim.dials
            continue
        dial = claim.dial(name)
        found.append(dial.over(values) if values else dial)
    return found


def _texts(asked: Sequence[str] | str) -> list[str]:
    return [asked] if isinstance(asked, str) else list(asked)


def _typed(text: str) -> tuple[str, list[str]]:
    """Name and values of a condition."""
    name, equals, values = text.partition("=")
    parts = [v.strip() for v in values.split(",") if v.strip()]
    if not name.strip() or (equals and not parts):
        raise RequestError(f"--holds-if {text}: it should be a name, or a name with values, like lag=0,10,20")
    return name.strip(), parts
