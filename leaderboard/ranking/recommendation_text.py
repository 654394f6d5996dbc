"""A recommendation in words: short sentences, each with at most three numbers."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from . import tables
from .recommended import Answer, Candidate
from .summary import spread
from .trouble_profile import BAD
from .troubles import troubles, within

__all__ = ["sentences"]

_NAMED = 3  # troubles that are named; of more, how many there are
_TRUE = 0.8  # coverage of a 95 % region below which the covariance is not to be trusted
_TIMES = 2.0  # from this ratio on it is written as a multiple
_WORDS = {4: "four", 5: "five", 6: "six", 7: "seven", 8: "eight", 9: "nine"}


def sentences(answer: Answer) -> list[str]:
    """The answer: which row and why, what it costs, how sure that is, where else it was run, and what is not known."""
    if answer.row is None or answer.plain is None:
        return [f"No evidence: {answer.why}.", *(_gaps(answer) if answer.groups else [])]
    row, plain = answer.row, answer.plain
    said = [_choice(answer, row, plain), *_cost(answer, row, plain), *_sure(answer, row, plain)]
    for other in answer.elsewhere:
        if math.isfinite(other.result.to_plain) and row is not plain:
            error = _beside(other.result.to_plain)
            said.append(f"Elsewhere, on the track {other.title}, its error is {error} that of the plain row.")
    for other in answer.worse:
        error = _beside(other.result.to_plain)
        said.append(f"Beware: with {within(other.title)} its error is {error} that of the plain row.")
    return [*said, *_gaps(answer)]


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


def _cost(answer: Answer, row: Candidate, plain: Candidate) -> list[str]:
    if math.isnan(row.cost):
        return ["What it costs was not measured."]
    time = f"about {tables.number(row.milliseconds, 2)} ms an epoch on the machine of the results"
    if row is plain:
        return [f"It takes {time}."]
    said = [f"It takes {tables.number(row.cost, 2)} times the processor time of `{plain.estimator}`, {time}."]
    if answer.limit is not None and plain.milliseconds > answer.limit:
        takes = tables.number(plain.milliseconds, 2)
        said.append(f"`{plain.estimator}` takes {takes} ms, more than the {answer.limit:g} ms that you allow.")
    return said


def _sure(answer: Answer, row: Candidate, plain: Candidate) -> list[str]:
    scenarios = sum(len(g.scenarios) for g in answer.groups)
    number = "1 scenario" if scenarios == 1 else f"{scenarios} scenarios"
    runs = f"{spread(g.units for g in answer.groups)} {answer.groups[0].unit}s{' each' * (scenarios != 1)}"
    most = max(row.runs // len(g.scenarios) for g in answer.groups for row in g.rows)
    if answer.groups[0].unit == "seed" and most > max(g.units for g in answer.groups):
        runs += f", and up to {most} of rows that may be the best"
    said = [f"For {_joined(answer.instruments)} the evidence is {number} with {runs}."]
    rows = f"{answer.compared} rows" if answer.limit is None else f"the rows within {answer.limit:g} ms"
    if answer.confidence != "undecided":
        said.append(f"The difference from the plain row is significant (all {answer.compared} rows tested together).")
    elif answer.why:
        said.append(f"None of {rows} is significantly better than the plain row, because {answer.why}.")
    else:
        said.append(f"Tested together, none of {rows} is significantly better than the plain row.")
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
    if row is not plain or row.result.bad:
        share = f"{tables.percent(row.result.bad)} were" if row.result.bad else "none was"
        said.append(f"Of its {row.result.runs} runs {share} lost, or beyond {BAD:g} times the plain row's error.")
    if math.isfinite(row.result.coverage):
        small = row.result.coverage < _TRUE
        begin, only = ("Do not trust its covariance: its", "only ") if small else ("Its", "")
        said.append(f"{begin} 95 % region held the truth in {only}{tables.percent(row.result.coverage)} of the epochs.")
    return said


def _gaps(answer: Answer) -> list[str]:
    """What the answer leaves out: what nobody was judged on, and what only other tracks have."""
    said = []
    if answer.on_other_tracks:
        others = _joined([f"`{name}`" for name in answer.on_other_tracks])
        them = "them" if len(answer.on_other_tracks) > 1 else "it"
        said.append(f"Other tracks judge {others}; ask for {them} with --trouble.")
    if answer.without_evidence:
        said.append(f"No evidence for these instruments with: {', '.join(_titles(answer.without_evidence))}.")
    return said


def _titles(names: Iterable[str]) -> list[str]:
    return [within(troubles()[n].title) for n in names]


def _listed(names: tuple[str, ...]) -> str:
    titles = _titles(names)
    if len(titles) > _NAMED:
        return f"{_WORDS[len(titles)]} kinds of trouble"
    return _joined(titles)


def _joined(words: Sequence[str]) -> str:
    return " and ".join(filter(None, [", ".join(words[:-1]), words[-1]]))
