"""An estimator that was asked for: a class, a name or a file, with parameters."""

from __future__ import annotations

import inspect
import os
import re
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from simnav.estimator import Estimator, find, make, names, register
from simnav.leaderboard.results.errors import RequestError, mistakes

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = [
    "EstimatorLike",
    "EstimatorRequest",
    "comes_with_simnav",
    "enlist",
    "kebab",
    "request",
    "requests",
    "split_estimators",
    "together",
]


@dataclass(frozen=True)
class EstimatorRequest:
    """An estimator that takes part.

    Attributes
    ----------
    name : str
        Registered name, ``my.py`` or ``my.py:MyFilter``.
    parameters : mapping
        Keyword arguments of its constructor.
    label : str
        Name in tables. Default: name and parameters.
    cls : type or None
        The class itself, where it was given as such: workers are sent it, for they may not find it by its name.
    point : str
        Entry point of a package that this process must not import, such as that of a submission. Only the estimator's
        own process loads it.
    search : tuple of str
        Folders in which that process looks for packages first.
    """

    name: str
    parameters: Mapping[str, Any] = field(default_factory=dict)
    label: str = ""
    cls: type[Estimator] | None = None
    point: str = ""
    search: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not self.label:
            settings = ",".join(f"{k}={v}" for k, v in self.parameters.items())
            plain = re.sub(r"\.py(?=$|:\w+$)", "", os.path.basename(self.name))
            object.__setattr__(self, "label", f"{plain}({settings})" if settings else plain)

    def make(self) -> Estimator:
        """An instance; `simnav.estimator.EstimatorError` as of `simnav.estimator.make`."""
        if self.cls is not None:
            enlist(self.cls)
        return make(self.name, **self.parameters)


#: A name, a name with parameters (``ekf:gate=3``), a file (``my.py``, ``my.py:MyFilter``), a class, or one of these
#: with a mapping of parameters.
EstimatorLike: TypeAlias = (
    "str | Path | type[Estimator] | EstimatorRequest | tuple[str | Path | type[Estimator], Mapping[str, Any]]"
)


def request(given: EstimatorLike, parameters: Mapping[str, Any] | None = None) -> EstimatorRequest:
    """What was given, as a request.

    Parameters
    ----------
    given : str, Path, type, EstimatorRequest or pair
        The estimator: a name, a file, a class, a request, or one of these with parameters.
    parameters : mapping, optional
        Parameters that are added, unless they are given already.

    Raises
    ------
    RequestError
        If it is no estimator, or several; one sentence.

    Examples
    --------
    >>> request("ekf:gate=3,tau=10").label
    'ekf(gate=3,tau=10)'
    >>> request(("ekf", {"gate": 3.0})).parameters
    {'gate': 3.0}
    """
    if isinstance(given, tuple):
        given, own = given
        return request(given, {**(parameters or {}), **own})
    if isinstance(given, EstimatorRequest):
        if not parameters:
            return given
        return EstimatorRequest(given.name, {**parameters, **given.parameters}, cls=given.cls, point=given.point,
                                search=given.search)  # fmt: skip
    if isinstance(given, type):
        with mistakes():
            name = enlist(given)
        if given.__module__.startswith("simnav_file_"):  # `simnav.estimator.find` has imported it by its path
            return EstimatorRequest(f"{inspect.getfile(given)}:{given.__name__}", dict(parameters or {}))
        return EstimatorRequest(name, dict(parameters or {}), cls=given)
    if not isinstance(given, (str, Path)):
        raise RequestError(f"{given!r} is no estimator; a class, a name or a file is wanted")
    found = split_estimators([str(given)])
    if len(found) != 1:
        raise RequestError(f"{str(given)!r} names {len(found)} estimators where one is wanted")
    ((name, own),) = found
    return EstimatorRequest(name, {**(parameters or {}), **own})


def requests(
    given: EstimatorLike | Iterable[EstimatorLike] | None, parameters: Mapping[str, Any] | None = None
) -> list[EstimatorRequest]:
    """All that were asked for, each label once; all registered ones where none was.

    Parameters
    ----------
    given : estimators
        A text may name several, separated by commas.
    parameters : mapping, optional
        Parameters to set. Each estimator gets the parameters that its constructor has.

    Raises
    ------
    RequestError
        On an unknown estimator or parameter, or a value that does not fit. Files are not imported here: whoever runs
        them does so, in a process of its own.
    """
    items = _items(given)
    if not items:
        items = [EstimatorRequest(name) for name in names()]
    common, unused = dict(parameters or {}), set(parameters or ())
    made: list[EstimatorRequest] = []
    for item in items:
        with mistakes():
            mine = common if len(items) == 1 or not common else _known(item, common)
            unused -= set(mine)
            found = request(item, mine)
            if ".py" not in found.name and not found.point and comes_with_simnav(found.cls or find(found.name)):
                found.make()  # so that a mistake shows now; the code of others runs in a process of its own
            _has_a_name_of_its_own(found)
        made.append(found)
    if unused:
        raise RequestError(f"{min(unused)}: none of the estimators has this parameter; 'simnav list estimators' shows "
                           "what they have")  # fmt: skip
    return together(made)


def together(found: Iterable[EstimatorRequest]) -> list[EstimatorRequest]:
    """Each request once, in the order given.

    Raises
    ------
    RequestError
        If two estimators have the same label: tables could not distinguish them.
    """
    by_label: dict[str, EstimatorRequest] = {}
    for r in found:
        other = by_label.setdefault(r.label, r)
        if (_source(other), other.point) != (_source(r), r.point):
            raise RequestError(
                f"{other.name} and {r.name}: the rows of both would be called {r.label!r}; give one file another name"
            )
    return list(by_label.values())


def _source(found: EstimatorRequest) -> str:
    """The name, or the file with its whole path."""
    return os.path.realpath(found.name) if ".py" in found.name else found.name


def _has_a_name_of_its_own(found: EstimatorRequest) -> None:
    """RequestError where a file is called as a row that comes with simnav: tables would show it as that row."""
    stem = re.fullmatch(r"(.*)\.py", os.path.basename(found.name))
    if stem and stem[1] in names() and comes_with_simnav(find(stem[1])):
        raise RequestError(f"{found.name}: {stem[1]!r} is a row that comes with simnav; give the file another name")


def _items(given: EstimatorLike | Iterable[EstimatorLike] | None) -> list[EstimatorLike]:
    """One by one; what is separated by commas is taken apart."""
    if given is None:
        return []
    single = isinstance(given, (str, Path, type, EstimatorRequest)) or (
        isinstance(given, tuple) and len(given) == 2 and isinstance(given[1], Mapping)
    )
    items: Sequence[Any] = [given] if single else list(given)  # type: ignore[arg-type]
    found: list[EstimatorLike] = []
    texts: list[str] = []
    for item in items:
        if isinstance(item, (str, Path)):
            texts.append(str(item))
        else:
            found += _split(texts)
            found.append(item)
            texts = []
    return found + _split(texts)


def _split(texts: list[str]) -> list[EstimatorLike]:
    return [EstimatorRequest(name, values) for name, values in split_estimators(texts)]


def _known(item: EstimatorLike, parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Those of the parameters that an estimator has."""
    from simnav.estimator import describe

    known = {p.name for p in describe(request(item).name).parameters}
    return {k: v for k, v in parameters.items() if k in known}


def comes_with_simnav(cls: type) -> bool:
    """Whether a class is one of simnav's own estimators."""
    module = sys.modules.get(cls.__module__)
    return cls.__module__.startswith("simnav.estimators.") and getattr(module, cls.__qualname__, None) is cls


def enlist(cls: type[Estimator]) -> str:
    """Register a class that was given as such, under its own name where it has none; returns the name.

    Raises
    ------
    simnav.estimator.EstimatorError
        If it is no estimator or its name is taken by another.
    """
    if not issubclass(cls, Estimator):
        raise RequestError(f"{cls.__name__} is no estimator: it does not derive from simnav.Estimator")
    if inspect.isabstract(cls):
        lacks = ", ".join(sorted(cls.__abstractmethods__))
        raise RequestError(f"{cls.__name__} is no complete estimator: it lacks {lacks}")
    return register(vars(cls).get("name") or kebab(cls.__name__))(cls).name


def kebab(name: str) -> str:
    """A name in lower case with hyphens.

    >>> kebab("SlowFilter2")
    'slow-filter2'
    """
    return re.sub(r"[^a-z0-9]+", "-", re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "-", name).lower()).strip("-")


def split_estimators(given: Iterable[str] | None) -> list[tuple[str, dict[str, str]]]:
    """Names or files with their parameters: ``name:key=value,key=value``, separated by commas.

    >>> split_estimators(["ekf:gate=3,tau=10,dead-reckoning", "my.py:Mine:gain=0.5"])
    [('ekf', {'gate': '3', 'tau': '10'}), ('dead-reckoning', {}), ('my.py:Mine', {'gain': '0.5'})]

    Raises
    ------
    RequestError
        Where a parameter follows no name.
    """
    found: list[tuple[str, dict[str, str]]] = []
    for text in given or ():
        if not text.strip(" ,"):
            raise RequestError(f"{text!r} names no estimator; leave the option out for all of them")
        open_for_more = False  # the item before has parameters, so that "key=value" is one more of them
        for part in filter(None, (p.strip() for p in text.split(","))):
            whole = re.fullmatch(r"(?P<name>.+?):(?P<key>\w+)=(?P<value>.*)", part)
            more = re.fullmatch(r"(?P<key>\w+)=(?P<value>.*)", part)
            if whole:
                found.append((whole["name"], {whole["key"]: whole["value"]}))
            elif more and open_for_more:
                found[-1][1][more["key"]] = more["value"]
            elif more:
                raise RequestError(f"{part!r} is no estimator; parameters follow a name: 'ekf:{part}'")
            else:
                found.append((part, {}))
            open_for_more = bool(found[-1][1])
    return found
