"""Dials and their values: what was asked for, and the scenario at each setting."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from simnav.leaderboard.ranking.ranking import require_lower
from simnav.leaderboard.results.errors import RequestError, mistakes
from simnav.scenario import Dial, Scenario
from simnav.spec import closest

__all__ = ["DEFAULT_VALUES", "Setting", "checked_score", "chosen_dials", "clean_value", "parse_dial",
           "parse_dials", "settings"]  # fmt: skip

#: Values of a dial where none are given.
DEFAULT_VALUES = 7
#: Highest over lowest value of a range from where on values are spaced by their logarithm.
_DECADE = 10.0


@dataclass(frozen=True, eq=False)
class Setting:
    """A scenario with its dials set.

    Attributes
    ----------
    values : tuple of float
        One a dial, in the units of the dials.
    scenario : Scenario
        Scenario with these values, under its own name.
    """

    values: tuple[float, ...]
    scenario: Scenario


def parse_dial(text: str) -> tuple[str, list[float]]:
    """The name of a dial and its values, as they are typed.

    >>> parse_dial("multipath=0,1,2.5")
    ('multipath', [0.0, 1.0, 2.5])
    >>> parse_dial("multipath")
    ('multipath', [])
    """
    name, equals, values = text.partition("=")
    try:
        numbers = [float(v) for v in values.split(",")] if equals else []
    except ValueError:
        raise RequestError(f"--dial {text}: the values should be numbers, like --dial {name.strip()}=1,2,4") from None
    return name.strip(), numbers


def parse_dials(given: Mapping[str, Sequence[float]] | Sequence[str] | str) -> dict[str, Sequence[float]]:
    """Dials in any form that `simnav.sweep` takes."""
    if isinstance(given, Mapping):
        return dict(given)
    texts = [given] if isinstance(given, str) else list(given) if isinstance(given, Iterable) else [given]
    if not all(isinstance(text, str) for text in texts):
        raise RequestError(f"dials = {given!r}: a mapping is wanted, like {{'multipath': [0, 1, 2]}}")
    return dict(map(parse_dial, texts))


def checked_score(score: str, limit: float | None = None) -> None:
    """Refuse a score that cannot be swept or ranked, or a limit that is none.

    Raises
    ------
    RequestError
    """
    require_lower(score, "an error is wanted, like horizontal_rmse")
    if limit is not None and not limit > 0.0:
        raise RequestError(f"limit = {limit:g} should be greater than 0")


def chosen_dials(scenario: Scenario, asked: Mapping[str, Sequence[float]]) -> list[tuple[Dial, list[float]]]:
    """The dials that were asked for, with their values, ascending; the clean value is always among them.

    Parameters
    ----------
    scenario : Scenario
        The scenario that is swept.
    asked : mapping of str to sequence of float
        Name of a dial of the scenario, or key path in its TOML, to values. Without values: `DEFAULT_VALUES` over the
        range of the dial.

    Raises
    ------
    RequestError
        On a dial that is not there, a value beyond its range, or none or more than two dials.
    """
    if not 1 <= len(asked) <= 2:
        raise RequestError(f"{len(asked)} dials were asked for; a sweep turns one, or two for a map")
    return [_chosen(scenario, name, _numbers(name, values)) for name, values in asked.items()]


def _numbers(name: str, values: Sequence[float]) -> list[float]:
    try:
        return [float(v) for v in values]
    except (TypeError, ValueError):
        raise RequestError(f"dial {name!r}: its values should be a list of numbers, not {values!r}") from None


def _chosen(scenario: Scenario, name: str, values: list[float]) -> tuple[Dial, list[float]]:
    if not all(map(math.isfinite, values)):
        raise RequestError(f"dial {name!r}: its values should be finite numbers, not {values}")
    known = {dial.name: dial for dial in scenario.dials}
    if name in known:
        dial = known[name]
        low, high = dial.range
        for value in values:
            if not low <= value <= high:
                raise RequestError(
                    f"dial {name!r} of {scenario.id} = {value:g}: it goes from {low:g} to {high:g} {dial.unit}".rstrip()
                    + f"; name its key to go beyond: {dial.key}"
                )
        values = values or _spread(low, high)
    elif re.search(r"[._\[]", name):
        if len(set(values)) < 2:
            raise RequestError(f"--dial {name}: give it two values or more, like --dial {name}=1,2,4")
        dial = Dial(name="value", key=name, range=(min(values), max(values)), title=name)
    else:
        there = closest(name, list(known)) if known else "; it has none, but a key of its file does as well"
        raise RequestError(f"there is no dial {name!r} in {scenario.id}{there}")
    return dial, sorted({*values, clean_value(dial)})


def clean_value(dial: Dial) -> float:
    """The value at which a dial disturbs nothing: the lowest one, unless the dial says which."""
    return dial.range[0] if dial.clean is None else dial.clean


def _spread(low: float, high: float) -> list[float]:
    n = DEFAULT_VALUES
    if low > 0.0 and high / low >= _DECADE:
        return [float(f"{v:.3g}") for v in np.geomspace(low, high, n)]
    return [float(f"{v:.3g}") for v in np.linspace(low, high, n)]


def settings(scenario: Scenario, dials: Sequence[tuple[Dial, Sequence[float]]]) -> list[Setting]:
    """The scenario at every combination of values.

    Raises
    ------
    RequestError
        If it is not valid at one of them.
    """
    found = []
    for values in itertools.product(*(v for _, v in dials)):
        parts = [f"{dial.name}-{_slug(v)}" for (dial, _), v in zip(dials, values, strict=True)]
        if any(dial.name == "value" for dial, _ in dials):  # a key path: its name is no part of a scenario's
            parts = [f"{_slug_of_key(dial.key)}-{_slug(v)}" for (dial, _), v in zip(dials, values, strict=True)]
        changes: dict[str, object] = {"name": "-".join([scenario.name, "at", *parts])}
        changes |= {dial.key: _integral(v) for (dial, _), v in zip(dials, values, strict=True)}
        with mistakes(ValueError):
            found.append(Setting(tuple(values), scenario.with_values(changes)))
    return found


def _slug(value: float) -> str:
    return f"{value:.12g}".replace("-", "m").replace("+", "").replace(".", "p")


def _slug_of_key(key: str) -> str:
    return re.sub(r"[^a-z0-9]+", "-", key.lower()).strip("-")


def _integral(value: float) -> float | int:
    """A number as a person would type it: some keys take whole numbers only."""
    return int(value) if value.is_integer() else value
