"""An estimator that was asked for: a class, a name or a file, with parameters."""

from __future__ import annotations

import inspect
import itertools
import os
import re
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeAlias

from simnav.estimator import Estimator, describe, find, make, names, register
from simnav.estimator.files import shown_name
from simnav.estimator.late_arrivals import LATE
from simnav.estimator.looking_back import LAGS
from simnav.estimator.lookup import LOOSE, former_names_of
from simnav.estimator.parameters import former_names, under_present_names
from simnav.leaderboard.results.admission import label_fault, lookalikes
from simnav.leaderboard.results.errors import RequestError, mistakes

__all__ = [
    "EstimatorLike",
    "EstimatorRequest",
    "Estimators",
    "comes_with_simnav",
    "enlist",
    "file_of",
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
        Keyword arguments of its constructor. Former names of a row of simnav or of a class become present ones.
    label : str
        Name in tables. Default: `simnav.estimator.files.shown_name`, and parameters.
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
        if self.parameters and (formerly := self._formerly()):
            with mistakes():
                parameters = under_present_names(formerly, self.parameters, f"estimator {self.name!r}")
            object.__setattr__(self, "parameters", parameters)
        if not self.label:
            settings = ",".join(f"{k}={v}" for k, v in self.parameters.items())
            plain = shown_name(self.name)
            object.__setattr__(self, "label", f"{plain}({settings})" if settings else plain)

    def _formerly(self) -> Mapping[str, str]:
        return former_names_of(self.name) if self.cls is None else former_names(self.cls)

    def make(self) -> Estimator:
        """An instance; `simnav.estimator.EstimatorError` as of `simnav.estimator.make`."""
        if self.cls is not None:
            enlist(self.cls)
        return make(self.name, **self.parameters)


#: A name, a name with parameters (``sw-fgo:window=10``), a file (``my.py``, ``my.py:MyFilter``), a class, or one of
#: these with a mapping of parameters.
EstimatorLike: TypeAlias = (
    "str | Path | type[Estimator] | EstimatorRequest | tuple[str | Path | type[Estimator], Mapping[str, Any]]"
)
#: One or several; a text may name several, separated by commas.
Estimators: TypeAlias = "EstimatorLike | Iterable[EstimatorLike] | None"


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
    >>> request("sw-fgo:window=10,spacing=1").label
    'sw-fgo(window=10,spacing=1)'
    >>> request(("sw-fgo", {"window": 10})).parameters
    {'window': 10}
    """
    if isinstance(given, tuple):
        if len(given) != 2 or not isinstance(given[1], Mapping):
            raise RequestError(f"{given!r} is no estimator; with parameters it is a pair, ('sw-fgo', {{'window': 10}})")
        given, own = given
        return request(given, {**_mapping(parameters), **own})
    if isinstance(given, EstimatorRequest):
        if not parameters:
            return given
        return replace(given, parameters={**parameters, **given.parameters}, label="")
    if isinstance(given, type):
        with mistakes():
            name = enlist(given)
        if given.__module__.startswith("simnav_file_"):  # `simnav.estimator.find` has imported it by its path
            return EstimatorRequest(f"{inspect.getfile(given)}:{given.__name__}", dict(parameters or {}))
        return EstimatorRequest(name, dict(parameters or {}), cls=given)
    if not isinstance(given, (str, Path)):
        raise _no_estimator(given)
    found = split_estimators([str(given)])
    if len(found) != 1:
        raise RequestError(f"{str(given)!r} names {len(found)} estimators where one is wanted")
    ((name, own),) = found
    return EstimatorRequest(name, {**(parameters or {}), **own})


def requests(given: Estimators, parameters: Mapping[str, Any] | None = None) -> list[EstimatorRequest]:
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
    items = [EstimatorRequest(name) for name in names()] if given is None else _items(given)
    if not items:
        raise RequestError("the list of estimators is empty; leave it out for all of them")
    common, unused = _mapping(parameters), set(_mapping(parameters))
    made: list[EstimatorRequest] = []
    for item in items:
        with mistakes():
            mine = common if len(items) == 1 or not common else _known(item, common)
            unused -= set(mine)
            found = request(item, mine)
            if not file_of(found.name) and not found.point and comes_with_simnav(found.cls or find(found.name)):
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
        If two estimators have the same label, or labels that look alike: tables could not distinguish them. Or if a
        label is none (`simnav.leaderboard.results.admission.label_fault`).
    """
    by_label: dict[str, EstimatorRequest] = {}
    for r in found:
        if why := label_fault(r.label):
            raise RequestError(f"estimator {r.label!a:.120}: {why}")
        other = by_label.setdefault(r.label, r)
        if (_source(other), other.point) != (_source(r), r.point):
            raise RequestError(
                f"{other.name} and {r.name}: the rows of both would be called {r.label!r}; give one of them another "
                "name"
            )
    for label, alike in lookalikes(by_label).items():
        raise RequestError(f"estimator {label!r} can be taken for {alike!r} in a table; give it another name")
    return list(by_label.values())


def _source(found: EstimatorRequest) -> str:
    """The name, or the file with its whole path; its label says which class is meant."""
    file = file_of(found.name)
    return os.path.realpath(file) if file else found.name


def _has_a_name_of_its_own(found: EstimatorRequest) -> None:
    """RequestError where a file is called as a row that comes with simnav: tables would show it as that row."""
    base = found.label.partition("(")[0]
    if file_of(found.name) and base in names() and comes_with_simnav(find(base)):
        raise RequestError(f"{found.name}: {base!r} is a row that comes with simnav; give it another name")


def _no_estimator(given: object) -> RequestError:
    if isinstance(given, Estimator):
        name = type(given).__name__
        return RequestError(f"an object of {name} was given; its class is wanted, with parameters as ({name}, {{...}})")
    return RequestError(f"{given!r} is no estimator; a class, a name or a file is wanted")


def _mapping(parameters: Any) -> dict[str, Any]:
    """Parameters by their names; RequestError where they are no such thing."""
    if parameters is not None and not isinstance(parameters, Mapping):
        raise RequestError(f"parameters = {parameters!r}: a mapping is wanted, like {{'window': 10}}")
    return dict(parameters or {})


def _items(given: Estimators) -> list[EstimatorLike]:
    """One by one; what is separated by commas is taken apart."""
    if isinstance(given, Mapping):
        raise RequestError("a mapping names no estimators; give a list of pairs, like [('sw-fgo', {'window': 10})]")
    single = isinstance(given, (str, Path, type, EstimatorRequest)) or (
        isinstance(given, tuple) and len(given) == 2 and isinstance(given[1], Mapping)
    )
    if not single and not isinstance(given, Iterable):
        raise _no_estimator(given)
    items: Iterable[Any] = [given] if single else given  # type: ignore[assignment]
    found: list[EstimatorLike] = []
    for texts, group in itertools.groupby(items, lambda item: isinstance(item, (str, Path))):
        if texts:
            found += [EstimatorRequest(name, values) for name, values in split_estimators(map(str, group))]
        else:
            found += group
    return found


def _known(item: EstimatorLike, parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Those of the parameters that an estimator has."""
    about = describe(request(item).name)
    known = {p.name for p in about.parameters} | set(former_names(about.cls)) | {LAGS, LATE, LOOSE}
    return {k: v for k, v in parameters.items() if k in known}


def file_of(name: str) -> str:
    """The file in which an estimator of this name is; empty for a registered name.

    >>> file_of("my.py:MyFilter"), file_of("my.pyfiles/first.py"), file_of("ekf")
    ('my.py', 'my.pyfiles/first.py', '')
    """
    found = re.fullmatch(r"(.*\.py)(:\w+)?", name, flags=re.DOTALL)
    return found[1] if found else ""


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

    >>> split_estimators(["sw-fgo:window=10,spacing=1,dead-reckoning", "my.py:Mine:gain=0.5"])
    [('sw-fgo', {'window': '10', 'spacing': '1'}), ('dead-reckoning', {}), ('my.py:Mine', {'gain': '0.5'})]

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
