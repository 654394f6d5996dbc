"""The forms of an estimator in a test: a class, a function that makes one, a name or a file, with parameters."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

from simnav.estimator import Estimator, make
from simnav.estimator.files import shown_name

__all__ = ["EstimatorLike", "Factory", "factories", "factory_of", "label_of", "listed"]

Factory: TypeAlias = Callable[[], Estimator]
#: A class or function, a registered name, a path (``my.py``, ``my.py:MyFilter``), or one of these with parameters.
EstimatorLike: TypeAlias = (
    "Callable[..., Estimator] | str | Path | tuple[Callable[..., Estimator] | str | Path, Mapping[str, Any]]"
)


def factories(estimators: EstimatorLike | Iterable[EstimatorLike]) -> dict[str, Factory]:
    """Functions that make each estimator, by label.

    Parameters
    ----------
    estimators : estimator or iterable of them
        One or several estimators in any form of `EstimatorLike`. Nothing is imported or constructed here.

    Returns
    -------
    dict of str to callable
        A function for each estimator, in the given order. If labels are equal, the later ones get a number.

    Raises
    ------
    TypeError
        If one of them is not an estimator.

    Examples
    --------
    >>> list(factories(["ekf", ("ekf", {"calibrate": False}), "ekf"]))
    ['ekf', 'ekf(calibrate=False)', 'ekf-2']
    """
    items = listed(estimators)
    if not items:
        raise TypeError("no estimator was given; a class, a function, a name or a file is wanted")
    found: dict[str, Factory] = {}
    for item in items:
        base = label = label_of(item)
        count = 1
        while label in found:
            count += 1
            label = f"{base}-{count}"
        found[label] = factory_of(item)
    return found


def factory_of(estimator: EstimatorLike) -> Factory:
    """A function without arguments that makes the estimator.

    Raises
    ------
    TypeError
        If it is not an estimator.
    """
    what, parameters = _parts(estimator)
    if callable(what):
        return partial(what, **parameters)
    return partial(make, str(what), **parameters)


def label_of(estimator: EstimatorLike) -> str:
    """Name and parameters of an estimator, for ids and tables.

    Raises
    ------
    TypeError
        If it is no estimator.

    Examples
    --------
    >>> label_of("filters/my_filter.py"), label_of(("ekf", {"calibrate": False}))
    ('my_filter', 'ekf(calibrate=False)')
    """
    what, parameters = _parts(estimator)
    if callable(what):
        name = getattr(what, "name", "") or getattr(what, "__name__", "") or type(what).__name__
    else:
        name = shown_name(str(what))
    settings = ",".join(f"{key}={value}" for key, value in parameters.items())
    return f"{name}({settings})" if settings else str(name)


def listed(estimators: EstimatorLike | Iterable[EstimatorLike]) -> list[Any]:
    """The estimators as a list; a single one gives a list with one element."""
    single = isinstance(estimators, (str, Path)) or callable(estimators) or _is_pair(estimators)
    return [estimators] if single or not isinstance(estimators, Iterable) else list(estimators)


def _is_pair(item: object) -> bool:
    return isinstance(item, tuple) and len(item) == 2 and isinstance(item[1], Mapping)


def _parts(item: Any) -> tuple[Any, dict[str, Any]]:
    """The class, function, name or path, and the parameters."""
    what, parameters = item if _is_pair(item) else (item, {})
    called = issubclass(what, Estimator) if isinstance(what, type) else callable(what)
    if not (called or isinstance(what, (str, Path))):
        raise TypeError(
            f"{item!r} is no estimator; a class of Estimator, a function, a name, a file, or a pair of one of these "
            "and a mapping of parameters is wanted"
        )
    return what, dict(parameters)
