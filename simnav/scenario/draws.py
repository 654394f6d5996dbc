"""Random draws in a scenario: a value in its TOML may be a distribution, from which a value is drawn for each run.

A `Template` is the table of a scenario file with distributions. `Template.drawn` makes a table without distributions
from it and a seed. It works on TOML, before units and validation, so that anything may be drawn: a number, a component
of a vector, the name of an instrument, a whole table. The forms are described in ``docs/reference/draws.md``::

    sigma_m = { log_uniform = [2, 12] }
    instruments = { choice = [["gnss"], ["dvl"]], weights = [3, 1] }
    end_s = { draw = "start", plus = { uniform = [20, 60] } }        # [draw] start = { uniform = [100, 400] }
    speed_m_s = { draw = "vessel", cases = { ship = 6, auv = { uniform = [1, 2] } } }
    present = { choice = [true, false] }

Every distribution has a random stream of its own, named after its key path, so that a further distribution does not
change the others.
"""

from __future__ import annotations

import copy
import json
import math
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from simnav.spec import SpecError, closest
from simnav.streams import stream

__all__ = ["Distribution", "Draws", "Template", "has_draws", "with_values"]

#: Key path -> drawn value, in the unit of its key.
Draws: TypeAlias = dict[str, Any]

_KINDS = ("uniform", "log_uniform", "normal", "integers", "choice")
#: A normal variate is cut off at so many sigmas, so that a scenario can be checked for all of its draws.
_CUT = 4.0
#: Whole numbers are smaller, as the generator of random numbers asks for.
_LARGEST = 10**18
#: Random draws with which a scenario is tried when it is loaded, besides the ends of each range.
_TRIES = 12


@dataclass(frozen=True)
class Distribution:
    """A distribution as a scenario file states it.

    Attributes
    ----------
    kind : str
        ``uniform``, ``log_uniform``, ``normal`` (mean and sigma, cut off at four sigmas), ``integers`` (both ends
        included) or ``choice``.
    values : tuple
        Two numbers, or the options.
    weights : tuple of float
        Weights of the options; empty if all are equally probable.
    """

    kind: str
    values: tuple[Any, ...]
    weights: tuple[float, ...] = ()

    @classmethod
    def read(cls, table: Mapping[str, Any], where: str) -> Distribution:
        """Read a table like ``{ uniform = [0, 1] }``; SpecError (without the file's name) if it is not valid."""
        kinds = [k for k in table if k in _KINDS]
        kind = kinds[0]
        allowed = {kind, "weights", "present"} if kind == "choice" else {kind}
        extra = [k for k in table if k not in allowed]
        if extra:
            raise SpecError(f"{where}: beside {kind!r} there is no key {extra[0]!r}")
        values = table[kind]
        if kind == "choice":
            return cls(kind, *_options(values, table.get("weights"), where))
        what = "[mean, sigma]" if kind == "normal" else "[lowest, highest]"
        if not isinstance(values, list) or len(values) != 2 or not all(map(_is_number, values)):
            raise SpecError(f"{where}.{kind} = {values!r} should be {what}, two finite numbers")
        a, b = values
        if kind == "normal":
            if not b > 0.0:
                raise SpecError(f"{where}.normal = {values!r}: the sigma should be greater than 0")
        elif not a < b:
            raise SpecError(f"{where}.{kind} = {values!r}: the lowest should be less than the highest")
        if kind == "log_uniform" and not a > 0.0:
            raise SpecError(f"{where}.log_uniform = {values!r}: the lowest should be greater than 0")
        if kind == "integers" and not all(isinstance(x, int) and abs(x) < _LARGEST for x in values):
            raise SpecError(f"{where}.integers = {values!r} should be two whole numbers of at most 18 digits")
        found = cls(kind, (a, b))
        if not _is_number(float(b) - float(a)) or not all(map(_is_number, found.ends())):
            raise SpecError(f"{where}.{kind} = {values!r}: the range is too wide for a floating-point number")
        return found

    def sample(self, rng: np.random.Generator) -> Any:
        """Draw a value."""
        if self.kind == "choice":
            total = float(sum(self.weights))
            p = [w / total for w in self.weights] if self.weights else None
            return self.values[int(rng.choice(len(self.values), p=p))]
        a, b = self.values
        if self.kind == "integers":
            return int(rng.integers(a, b, endpoint=True))
        if self.kind == "normal":
            return float(a + b * min(max(rng.standard_normal(), -_CUT), _CUT))
        if self.kind == "uniform":
            return float(a + (b - a) * rng.random())
        return float(math.exp(math.log(a) + (math.log(b) - math.log(a)) * rng.random()))

    def middle(self) -> Any:
        """The median; of a choice, the first option."""
        if self.kind in ("choice", "normal"):
            return self.values[0]
        a, b = self.values
        if self.kind == "integers":
            return (a + b) // 2
        return math.sqrt(a * b) if self.kind == "log_uniform" else 0.5 * (a + b)

    def ends(self) -> tuple[Any, ...]:
        """The least and the greatest value; of a choice, all options."""
        if self.kind == "normal":
            mean, sigma = self.values
            return mean - _CUT * sigma, mean + _CUT * sigma
        return self.values

    def __str__(self) -> str:
        values = f"{self.kind} {list(self.values)}"
        return f"{values} with weights {list(self.weights)}" if self.weights else values


def _lowest(distribution: Distribution) -> Any:
    return distribution.ends()[0]


def _highest(distribution: Distribution) -> Any:
    return distribution.ends()[-1]


def _is_number(value: Any) -> bool:
    """Whether it is a finite number; whole numbers end where floating-point numbers do."""
    return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) <= sys.float_info.max


def _options(values: Any, weights: Any, where: str) -> tuple[tuple[Any, ...], tuple[float, ...]]:
    if not isinstance(values, list) or not values:
        raise SpecError(f"{where}.choice = {values!r} should be an array of options")
    if weights is None:
        return tuple(values), ()
    if not isinstance(weights, list) or len(weights) != len(values) or not all(map(_is_number, weights)):
        raise SpecError(f"{where}.weights = {weights!r} should be {len(values)} numbers, one an option")
    if min(weights) < 0.0 or not sum(weights) > 0.0:
        raise SpecError(f"{where}.weights = {weights!r} should not be negative, and not all 0")
    if not _is_number(sum(map(float, weights))):
        raise SpecError(f"{where}.weights = {weights!r}: their sum should be a finite number")
    return tuple(values), tuple(map(float, weights))


def _is_distribution(value: Any) -> bool:
    return isinstance(value, dict) and not _KINDS_SET.isdisjoint(value)


def _is_reference(value: Any) -> bool:
    return isinstance(value, dict) and isinstance(value.get("draw"), str)


_KINDS_SET = frozenset(_KINDS)
#: Table of an instrument that few files have; a path may begin it.
_FACTORS = "times_datasheet"


class _Dropped:
    """What is left of a table with ``present = false``: nothing. Copies of it are the same object."""

    def __repr__(self) -> str:
        return "absent"

    def __copy__(self) -> _Dropped:
        return self


_DROPPED = _Dropped()


def _below(where: str, key: str) -> str:
    """The path of a key of a table. A key that could be taken for a longer path stands in quotes."""
    part = key if key and not set(key) & set('.[]"') else json.dumps(key)
    return f"{where}.{part}" if where else part


def has_draws(table: Mapping[str, Any]) -> bool:
    """Whether the table of a scenario file has a distribution."""

    def found(value: Any) -> bool:
        if isinstance(value, dict):
            return (
                _is_distribution(value) or _is_reference(value) or "present" in value or any(map(found, value.values()))
            )
        return isinstance(value, list) and any(map(found, value))

    return "draw" in table or found(dict(table))


class Template:
    """The table of a scenario file in which some values are distributions.

    Parameters
    ----------
    table : mapping
        Table as `tomllib` returns it.
    source : str
        Name of the file, for error messages.

    Attributes
    ----------
    table : mapping
        The table with its distributions.
    distributions : mapping of str to Distribution
        The distributions by key path, including those inside options and cases.

    Raises
    ------
    SpecError
        If a distribution is not valid, or a reference names a draw that does not exist.
    """

    def __init__(self, table: Mapping[str, Any], source: str):
        self.table, self.source = table, source
        named = table.get("draw", {})
        if not isinstance(named, Mapping):
            raise SpecError(f"{source}: draw = {named!r} should be a table of named draws ([draw])")
        for key in table:
            if key in _KINDS_SET or key == "present":
                raise SpecError(
                    f"{source}: {key} = {table[key]!r}: a whole file is not drawn; this belongs into a table"
                )
        self._named: Mapping[str, Any] = named
        self._body = {key: value for key, value in table.items() if key != "draw"}
        self.distributions: dict[str, Distribution] = {}
        try:
            for name, value in named.items():
                self._collect(value, _below("draw", name))
            self._collect(self._body, "")
        except SpecError as error:
            raise SpecError(f"{source}: {error}") from None

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Template) and self.table == other.table

    __hash__ = None  # type: ignore[assignment]

    def _collect(self, value: Any, where: str) -> None:
        """Find and read all distributions, and check all references."""
        if _is_distribution(value):
            found = self.distributions[where] = Distribution.read(value, where)
            for i, option in enumerate(found.values if found.kind == "choice" else ()):
                self._collect(option, f"{where}.choice[{i}]")
            self._collect(value.get("present", True), f"{where}.present")
        elif _is_reference(value):
            _check_reference(value, where, self._named)
            for key in ("times", "plus"):
                self._collect(value.get(key), f"{where}.{key}")
            for case, inner in value.get("cases", {}).items():
                self._collect(inner, _below(f"{where}.cases", case))
        elif isinstance(value, dict):
            for key, inner in value.items():
                self._collect(inner, _below(where, key))
        elif isinstance(value, list):
            for i, inner in enumerate(value):
                self._collect(inner, f"{where}[{i}]")

    def drawn(self, seed: int) -> tuple[dict[str, Any], Draws]:
        """Draw the values of a run.

        Parameters
        ----------
        seed : int
            Seed of the run.

        Returns
        -------
        table : dict
            The table of the scenario file with values in place of distributions.
        draws : dict of str to object
            The drawn values by key path, in the unit of the key. If an option is a table, its number from 0.
        """
        return self._resolve(lambda path, d: d.sample(stream(seed, "draw", path)))

    def middle(self) -> dict[str, Any]:
        """The table with each distribution at its median, or its first option."""
        return self._resolve(lambda path, d: d.middle())[0]

    def extremes(self) -> Iterator[tuple[dict[str, Any], Draws]]:
        """Tables at the ends of the ranges.

        All low, all high; each draw at each of its ends and the others in the middle; each option with all others low,
        and with all others high; and a few at random.
        """
        yield self._at(_lowest)
        yield self._at(_highest)
        for path, distribution in self.distributions.items():
            for end in distribution.ends():
                for rest in (Distribution.middle, _lowest, _highest)[: 3 if distribution.kind == "choice" else 1]:
                    found = self._at(rest, path, end)
                    if path in found[1]:
                        yield found
        for k in range(_TRIES):
            yield self._trial(k)

    def _at(self, rest: Callable[[Distribution], Any], path: str = "", end: Any = None) -> tuple[dict[str, Any], Draws]:
        """One draw as given, the others by a rule."""

        def pick(here: str, distribution: Distribution) -> Any:
            return end if here == path else rest(distribution)

        return self._resolve(pick)

    def _trial(self, number: int) -> tuple[dict[str, Any], Draws]:
        def pick(here: str, distribution: Distribution) -> Any:
            return distribution.sample(stream(number, "trial draw", here))

        return self._resolve(pick)

    def _resolve(self, pick: Callable[[str, Distribution], Any]) -> tuple[dict[str, Any], Draws]:
        try:
            return _Resolution(self._named, self.distributions, pick).table(self._body)
        except SpecError as error:
            raise SpecError(f"{self.source}: {error}") from None


def _check_reference(value: Mapping[str, Any], where: str, named: Mapping[str, Any]) -> None:
    name = value["draw"]
    if name not in named:
        raise SpecError(f"{where}.draw = {name!r}: there is no such draw in [draw]{closest(name, list(named))}")
    extra = [k for k in value if k not in ("draw", "times", "plus", "cases")]
    if extra:
        raise SpecError(f"{where}: beside 'draw' there is no key {extra[0]!r}; valid here: cases, plus, times")
    if "cases" in value and len(value) > 2:
        raise SpecError(f"{where}: 'cases' goes without 'times' and 'plus'")
    if "cases" in value and not isinstance(value["cases"], Mapping):
        raise SpecError(f"{where}.cases = {value['cases']!r} should be a table, a value for each case")


class _Resolution:
    """The values of all distributions of a template in one draw; each is drawn once."""

    def __init__(
        self,
        named: Mapping[str, Any],
        distributions: Mapping[str, Distribution],
        pick: Callable[[str, Distribution], Any],
    ):
        self._named, self._distributions, self._pick = named, distributions, pick
        self._values: dict[str, Any] = {}
        self._pending: list[str] = []
        self.draws: Draws = {}

    def table(self, body: Mapping[str, Any]) -> tuple[dict[str, Any], Draws]:
        for name in self._named:
            self._of(name)
        return self._value(body, ""), self.draws

    def _of(self, name: str) -> Any:
        """The value of a named draw."""
        if name not in self._values:
            if name in self._pending:
                raise SpecError(f"draw.{name} refers to itself, by way of {' and '.join(self._pending)}")
            self._pending.append(name)
            self._values[name] = self._value(self._named[name], _below("draw", name))
            self._pending.pop()
        return self._values[name]

    def _value(self, value: Any, where: str) -> Any:
        if isinstance(value, dict) and "present" in value and not self._present(value["present"], where):
            return _DROPPED
        if _is_distribution(value):
            return self._drawn(self._distributions[where], where)
        if _is_reference(value):
            return self._reference(value, where)
        if isinstance(value, dict):
            inner = {key: self._value(v, _below(where, key)) for key, v in value.items() if key != "present"}
            return {key: v for key, v in inner.items() if v is not _DROPPED}
        if isinstance(value, list):
            items = [self._value(v, f"{where}[{i}]") for i, v in enumerate(value)]
            return [v for v in items if v is not _DROPPED]
        return copy.copy(value)

    def _drawn(self, distribution: Distribution, where: str) -> Any:
        value = self._pick(where, distribution)
        if isinstance(value, dict) or (isinstance(value, list) and any(isinstance(v, (Mapping, list)) for v in value)):
            number = next(i for i, option in enumerate(distribution.values) if option is value)
            self.draws[where] = number
            return self._value(value, f"{where}.choice[{number}]")
        self.draws[where] = value
        return copy.copy(value)

    def _present(self, value: Any, where: str) -> bool:
        present = self._value(value, f"{where}.present")
        if not isinstance(present, bool):
            raise SpecError(f"{where}.present = {present!r} should be true or false")
        return present

    def _reference(self, value: Mapping[str, Any], where: str) -> Any:
        drawn = self._of(value["draw"])
        if "cases" in value:
            case = str(drawn).lower() if isinstance(drawn, bool) else str(drawn)
            if case not in value["cases"]:
                raise SpecError(
                    f"{where}.cases: there is none for {value['draw']} = {case!r}{closest(case, list(value['cases']))}"
                )
            return self._value(value["cases"][case], _below(f"{where}.cases", case))
        if len(value) == 1:
            return copy.copy(drawn)
        times, plus = (self._value(value.get(k, d), f"{where}.{k}") for k, d in (("times", 1.0), ("plus", 0.0)))
        for key, number in ((f"draw.{value['draw']}", drawn), (f"{where}.times", times), (f"{where}.plus", plus)):
            if not _is_number(number):
                raise SpecError(f"{key} = {number!r} should be a number")
        result = times * drawn + plus
        if not _is_number(result):
            raise SpecError(f"{where} = {times!r} * {drawn!r} + {plus!r} should be a finite number")
        return result


def with_values(table: Mapping[str, Any], values: Mapping[str, Any], source: str = "<toml>") -> dict[str, Any]:
    """A copy of the table of a scenario file with other values at some key paths.

    Parameters
    ----------
    table : mapping
        Table as `tomllib` returns it; it may have distributions.
    values : mapping
        The new values in the units of their keys, by key path, like ``fault[0].sigma_m`` or ``draw.length``. The last
        part of a path may be a new key; the parts before it must exist, except ``times_datasheet``.
    source : str
        Name of the file, for error messages.

    Raises
    ------
    SpecError
        If a part of a path does not exist.

    Examples
    --------
    >>> with_values({"fault": [{"sigma_m": {"uniform": [1, 2]}}]}, {"fault[0].sigma_m": 4})
    {'fault': [{'sigma_m': 4}]}
    """
    result: dict[str, Any] = copy.deepcopy(dict(table))
    for path, value in values.items():
        place: Any = result
        parts = [p for p in path.replace("]", "").replace("[", ".").split(".") if p]
        for i, part in enumerate(parts):
            last = i == len(parts) - 1
            if isinstance(place, list) and part.isdigit() and int(part) < len(place):
                if last:
                    place[int(part)] = value
                else:
                    place = place[int(part)]
            elif isinstance(place, dict) and not part.isdigit() and (last or part in place or part == _FACTORS):
                if last:
                    place[part] = value
                else:
                    place = place.setdefault(part, {})
            else:
                near = closest(part, [str(k) for k in place]) if isinstance(place, dict) else ""
                raise SpecError(f"{source}: there is no key {path!r}, for there is no {part!r} in it{near}")
        if not parts:
            raise SpecError(f"{source}: an empty key names nothing")
    return result
