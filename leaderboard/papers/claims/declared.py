"""The headline claims of the papers, as their files declare them, each with the choices that are not printed.

The conditions under which a claim holds are sufficient ones. They do not say what the authors did.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from typing import Any

from simnav.leaderboard.papers import PAPERS
from simnav.leaderboard.papers.paper import Paper
from simnav.leaderboard.papers.paper_file import ChoiceEntry, DialEntry
from simnav.leaderboard.papers.reading import file_of, paper_of
from simnav.leaderboard.results.errors import RequestError
from simnav.spec import closest

from .claim import Choice, Claim, Dial, Setting, compared
from .dials import choice_dial, lag_dial, of_rows, with_keys

__all__ = ["claim_of", "claims", "claims_of"]

_VALUE = re.compile(r"(?:(\S+) ([*/]) )?value")


@cache
def claims() -> tuple[Claim, ...]:
    """The claims of all papers."""
    return tuple(claim for key in PAPERS for claim in claims_of(key))


def claims_of(paper: str) -> list[Claim]:
    """The claims of a paper, by its key.

    Raises
    ------
    ValueError
        If a claim names a dial that its file does not have.
    """
    about, file = paper_of(paper), file_of(paper)
    made = []
    for c in file.claims:
        for name in c.dials:
            if name not in file.dials:
                raise ValueError(f"{paper}: the claim {c.name} has no dial {name!r}{closest(name, list(file.dials))}")
        base = compared(_scenario(about, c.scenario or file.scenario), c.row, c.than, c.score, c.than_score)
        dials = tuple(_dial(about, name, file.dials[name]) for name in c.dials)
        made.append(Claim(c.name, about.key, c.sentence, c.gain, base, dials, c.derived))
    return made


def claim_of(name: str) -> Claim:
    """The claim of a name.

    Raises
    ------
    RequestError
        If there is none; one sentence.
    """
    for claim in claims():
        if claim.name == name:
            return claim
    raise RequestError(f"there is no claim {name!r}{closest(name, [c.name for c in claims()])}")


def _scenario(paper: Paper, name: str) -> Callable[[], Any]:
    return lambda: paper.scenario(name)


def _dial(paper: Paper, key: str, entry: DialEntry) -> Dial:
    name = entry.name or key
    if entry.choices:
        choices = {choice: _choice(paper, chosen) for choice, chosen in entry.choices.items()}
        return choice_dial(name, entry.title, choices, ours=None if entry.ours is None else str(entry.ours),
                           why=entry.why)  # fmt: skip
    if entry.lag is None:
        return Dial(name, entry.title, entry.unit, entry.values, _setter(name, entry), entry.ours, entry.why)
    late = lag_dial(entry.values, both=entry.lag == "both", name=name, why=entry.why, **entry.row)
    if not entry.score:
        return late

    def of_score(setting: Setting, value: Choice) -> Setting:
        return late.set(replace(setting, score=entry.score, than_score=entry.score), value)

    return replace(late, title=entry.title, set=of_score, ours=None)


def _choice(paper: Paper, chosen: ChoiceEntry) -> Callable[[Setting], Setting]:
    """Other estimators, perhaps on another scenario."""
    rows = of_rows(chosen.row, chosen.than)
    return lambda setting: rows(setting.on(paper.scenario(chosen.scenario)) if chosen.scenario else setting)


def _setter(name: str, entry: DialEntry) -> Callable[[Setting, Choice], Setting]:
    """What sets parameters of the first method, and keys of the scenarios."""

    def with_it(setting: Setting, value: Choice) -> Setting:
        parameters, keys, than_keys = (
            _put(given, name, float(value)) for given in (entry.row, entry.keys, entry.than_keys)
        )
        if parameters:
            setting = setting.with_parameters("row", **parameters)
        if keys:
            setting = setting.on(with_keys(setting.scenario, name, value if keys != entry.keys else "", keys))
        if than_keys:
            setting = replace(setting, than_scenario=with_keys(setting.than_scenario, name, value, than_keys))
        return setting

    return with_it


def _put(given: Any, name: str, value: float) -> Any:
    """A table with the dial's value in place of the texts that stand for it."""
    if isinstance(given, Mapping):
        return {key: _put(inner, name, value) for key, inner in given.items()}
    if isinstance(given, list):
        return [_put(inner, name, value) for inner in given]
    found = _VALUE.fullmatch(given) if isinstance(given, str) else None
    if found is None:
        return given
    if found[2] == "/":
        if value <= 0.0:
            raise RequestError(f"{name}={value:g}: the value should be above 0")
        return float(found[1]) / value
    return float(found[1]) * value if found[1] else value
