"""Find, describe and make an estimator, by its name or by its file."""

from __future__ import annotations

import contextlib
import inspect
import re
import typing
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from simnav.estimator.contract import Estimator, EstimatorError
from simnav.estimator.files import class_in_file
from simnav.estimator.late_arrivals import LATE, manner_of
from simnav.estimator.looking_back import LAGS, LookingBack, lags_of
from simnav.estimator.parameters import (
    Parameter,
    constructors_of,
    converted,
    former_names,
    open_ended,
    parameters_of,
    under_present_names,
)
from simnav.estimator.registry import aliases_of, own_class, registered
from simnav.plugins import place_of
from simnav.spec import closest

__all__ = ["LOOSE", "Description", "describe", "find", "former_names_of", "make"]

#: The parameter of a row that makes it loosely coupled (`simnav.estimators.models.coupling`).
LOOSE = "loose"


@dataclass(frozen=True)
class Description:
    """What `describe` tells of an estimator.

    Attributes
    ----------
    name : str
        Registered name.
    aliases : tuple of str
        Other names under which it is found.
    summary : str
        First line of the docstring.
    reference, slow : bool
        As in `Estimator`: it is told the truth; it takes several milliseconds an epoch or more.
    real_time_as : str
        As in `Estimator`: what it is in real time, where it only smooths beside.
    parameters : tuple of Parameter
        Parameters of its constructor.
    cls : type
        The class itself.
    """

    name: str
    aliases: tuple[str, ...]
    summary: str
    reference: bool
    slow: bool
    real_time_as: str
    parameters: tuple[Parameter, ...]
    cls: type[Estimator] = field(repr=False)

    @cached_property
    def _place(self) -> tuple[str, int]:
        return place_of(self.cls)  # parses the whole file, so only where it is asked for

    @property
    def file(self) -> str:
        """Path of the file where the class is defined."""
        return self._place[0]

    @property
    def line(self) -> int:
        """Line of the class in this file."""
        return self._place[1]


def find(name_or_path: str) -> type[Estimator]:
    """The class of an estimator.

    Parameters
    ----------
    name_or_path : str
        A registered name or alias, ``my.py``, or ``my.py:MyFilter``. A class of a file that is
        not decorated is registered under its own name (``MyFilter``: ``my-filter``).

    Raises
    ------
    EstimatorError
        If there is none; the message names the nearest.
    """
    path = re.fullmatch(r"(.*\.py)(?::(\w+))?", name_or_path, flags=re.DOTALL)
    if path:
        return class_in_file(Path(path[1]), path[2])
    if name_or_path.endswith(".toml"):
        raise EstimatorError(f"{name_or_path!r} is a scenario and no estimator; an estimator is a name or a file my.py")
    return registered(name_or_path)


def describe(name_or_path: str) -> Description:
    """What an estimator is, where it is defined, and what parameters it takes."""
    cls = find(name_or_path)
    lines = (inspect.getdoc(cls) or "").strip().splitlines() if cls.__doc__ else []
    return Description(
        name=cls.name,
        aliases=aliases_of(cls.name),
        summary=lines[0] if lines else "",
        reference=cls.reference,
        slow=cls.slow,
        real_time_as=cls.real_time_as,
        parameters=tuple(
            Parameter(p.name, p.default, "" if p.annotation is p.empty else inspect.formatannotation(p.annotation))
            for p in parameters_of(cls)
        ),
        cls=cls,
    )


def former_names_of(name: str) -> Mapping[str, str]:
    """Former names of the parameters of an estimator that comes with simnav, and the present ones; else none."""
    cls = own_class(name)
    return {} if cls is None else former_names(cls)


def _is_loose(value: Any) -> bool:
    """The value of a parameter ``loose``."""
    loose = converted(value, bool, False, f"parameter {LOOSE!r}")
    if not isinstance(loose, bool):
        raise EstimatorError(f"parameter {LOOSE!r} is true or false, not {value!r}")
    return loose


#: Parameters of every row, which are set after it is made: what reads the value.
_OF_ROWS: Mapping[str, Callable[[Any], Any]] = {LATE: manner_of, LOOSE: _is_loose}


def make(name_or_path: str, **parameters: Any) -> Estimator:
    """Make an estimator.

    Parameters
    ----------
    name_or_path : str
        As for `find`.
    **parameters
        Of its constructor; former names are read, too (`Estimator.formerly`). A string is converted to what the
        annotation, or else the default, asks for: numbers, ``true``/``false``, ``none``, a choice, or several values
        parted by commas. Every estimator also takes ``lags`` (`simnav.estimator.looking_back`), and every row ``late``
        (`simnav.estimator.late_arrivals`) and ``loose`` (true: it uses a receiver in place of the raw observations that
        this solves, `simnav.estimators.models.coupling`).

    Raises
    ------
    EstimatorError
        On an unknown estimator or parameter, or a value that does not fit: one sentence.
    """
    cls = find(name_or_path)
    known = {p.name: p for p in parameters_of(cls)}
    if LAGS in parameters and LAGS not in known:
        lags = lags_of(parameters[LAGS])
        return LookingBack(make(name_or_path, **{k: v for k, v in parameters.items() if k != LAGS}), lags)
    for key, value_of in _OF_ROWS.items():
        if key in parameters and key not in known:
            made = make(name_or_path, **{k: v for k, v in parameters.items() if k != key})
            if not hasattr(made, key):
                raise EstimatorError(f"estimator {cls.name!r} is not composed of pieces; it has no parameter {key!r}")
            setattr(made, key, value_of(parameters[key]))
            return made
    hints: dict[str, Any] = {}
    constructors = constructors_of(cls)
    for constructor in reversed(constructors):
        with contextlib.suppress(Exception):  # an annotation that cannot be resolved: the defaults decide
            hints |= typing.get_type_hints(constructor)
    takes_any = bool(constructors) and open_ended(constructors[-1])
    values: dict[str, Any] = {}
    for key, value in under_present_names(former_names(cls), parameters, f"estimator {cls.name!r}").items():
        if key not in known and not takes_any:
            hint = closest(key, list(known)) if known else "; it takes none"
            raise EstimatorError(f"estimator {cls.name!r} has no parameter {key!r}{hint}")
        default = known[key].default if key in known else None
        values[key] = converted(value, hints.get(key), default, f"parameter {key!r} of estimator {cls.name!r}")
    missing = [p.name for p in known.values() if p.default is p.empty and p.name not in values]
    if missing:
        raise EstimatorError(f"estimator {cls.name!r} needs the parameter {missing[0]!r}, which has no default")
    try:
        return cls(**values)
    except (TypeError, ValueError) as error:
        raise EstimatorError(f"estimator {cls.name!r}: {error}") from error
