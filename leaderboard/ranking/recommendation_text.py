"""A recommendation in words: short sentences, each with at most three numbers."""

from __future__ import annotations

import math
from collections.abc import Iterable

from . import tables
from .recommended import Answer, Candidate
from .summary import spread
from .trouble_profile import BAD
from .troubles import troubles, within

__all__ = ["sentences"]

_NAMED = 3  # troubles that are named; of more, how many there are
_TIMES = 2.0  # from this ratio on it is written as a multiple
_WORDS = {4: "four", 5: "five", 6: "six", 7: "seven", 8: "eight", 9: "nine"}


def sentences(answer: Answer) -> list[str]:
    """The answer: which row and why, what it costs, how sure that is, where else it was run, and what is not known."""
    gaps = [_gap(answer)] if answer.without_evidence else []
    if answer.row is None or answer.plain is None:
        return [f"No evidence: {answer.why}.", *(gaps if answer.groups else [])]
    said = [_choice(answer, answer.row, answer.plain), *_cost(answer.row, answer.plain), *_sure(answer, answer.row)]
    for other in answer.elsewhere:
        if math.isfinite(other.result.to_plain) and answer.row is not answer.plain:
            error = _beside(other.result.to_plain)
            said.append(f"Elsewhere, on the track {other.title}, its error is {error} that of the plain row.")
    for other in answer.worse:
        error = _beside(other.result.to_plain)
        said.append(f"Beware: with {within(other.title)} its error is {error} that of the plain row.")
    return [*said, *gaps]


def _choice(answer: Answer, row: Candidate, plain: Candidate) -> str:
    where = f"With {_listed(answer.troubles)}"
    if row is plain:
        return f"{where}, take `{row.estimator}`, the plain row: no row is shown to be better."
    error = _beside(row.result.to_plain)
    return f"{where}, take `{row.estimator}`: its error is {error} that of the plain row, `{plain.estimator}`."


def _beside(ratio: float) -> str:
    """A ratio of errors, before the words "that of".

    >>> _beside(0.69), _beside(1.12), _beside(0.999), _beside(3.14)
    ('31 % below', '12 % above', 'equal to', '3.1 times')
    """
    percent = round(100.0 * abs(ratio - 1.0)) if math.isfinite(ratio) else 0
    if ratio >= _TIMES:
        return f"{tables.number(ratio, 2)} times"
    return "equal to" if not percent else f"{percent} % {'below' if ratio < 1.0 else 'above'}"


def _cost(row: Candidate, plain: Candidate) -> list[str]:
    if math.isnan(row.cost):
        return ["What it costs was not measured."]
    time = f"about {tables.number(row.milliseconds, 2)} ms an epoch on the machine of the results"
    if row is plain:
        return [f"It takes {time}."]
    return [f"It takes {tables.number(row.cost, 2)} times the processor time of `{plain.estimator}`, {time}."]


def _sure(answer: Answer, row: Candidate) -> list[str]:
    scenarios = sum(len(g.scenarios) for g in answer.groups)
    runs = f"{spread(g.units for g in answer.groups)} {answer.groups[0].unit}s"
    said = [f"The evidence is {scenarios} scenario{'s' * (scenarios != 1)} with {runs} each."]
    if answer.confidence == "undecided":
        why = f"they cannot be ordered, for {answer.why}" if answer.why else "that is what a test of all at once says"
        rows = f"{answer.compared} rows" if answer.limit is None else f"the rows within {answer.limit:g} ms"
        said.append(f"None of {rows} is significantly better than the plain row: {why}.")
    else:
        said.append(f"The difference from the plain row is significant (all {answer.compared} rows tested together).")
    low, high = row.result.scenarios_low, row.result.scenarios_high
    if answer.confidence != "undecided":
        if math.isnan(high):
            said.append("What it gains in other scenarios of the kind is not known: there are too few.")
        else:
            said.append(f"In other scenarios of the kind it may be from {_beside(low)} to {_beside(high)} (95 %).")
        if answer.as_good:
            cheap = answer.as_good[0]
            dearer = math.isnan(cheap.cost) or cheap.cost >= row.cost
            more = "" if dearer else f"; the cheapest is `{cheap.estimator}`, at {tables.number(cheap.cost, 2)} times"
            others = f"{len(answer.as_good)} row{'s' * (len(answer.as_good) != 1)}"
            said.append(f"It shares the place with {others} that may be as good{more}.")
        share = f"{tables.percent(row.result.bad)} were" if row.result.bad else "none was"
        said.append(f"Of its {row.result.runs} runs {share} lost, or beyond {BAD:g} times the plain row's error.")
    if math.isfinite(row.result.coverage):
        said.append(f"Its 95 % region held the truth in {tables.percent(row.result.coverage)} of the epochs.")
    return said


def _gap(answer: Answer) -> str:
    return f"No evidence for these instruments with: {', '.join(_titles(answer.without_evidence))}."


def _titles(names: Iterable[str]) -> list[str]:
    return [within(troubles()[n].title) for n in names]


def _listed(names: tuple[str, ...]) -> str:
    titles = _titles(names)
    if len(titles) > _NAMED:
        return f"{_WORDS[len(titles)]} kinds of trouble"
    return " and ".join(filter(None, [", ".join(titles[:-1]), titles[-1]]))
