"""Estimators in files: ``my_filter.py``, or ``my_filter.py:MyFilter`` if the file has several."""

from __future__ import annotations

import inspect
import os
import re
import types
from pathlib import Path

from simnav.estimator.contract import Estimator, EstimatorError
from simnav.estimator.registry import discover, forget, kebab, register, registered_in
from simnav.plugins import import_file

__all__ = ["class_in_file", "shown_name"]


def shown_name(name_or_path: str) -> str:
    """What tables call an estimator: its name; of a file the one that it registers, as far as its text tells.

    The file is not imported. Where it registers nothing, or several classes and none was asked for, it is called as the
    file.

    Examples
    --------
    >>> shown_name("ekf"), shown_name("filters/nobody.py"), shown_name("nobody.py:MyFilter")
    ('ekf', 'nobody', 'nobody:MyFilter')
    """
    path = re.fullmatch(r"(.*)\.py(:\w+)?", name_or_path, flags=re.DOTALL)
    if path is None:
        return os.path.basename(name_or_path)
    there, asked = registered_in(Path(f"{path[1]}.py")), path[2] or ""
    if not asked and len(there) == 1:
        return next(iter(there.values()))
    return there.get(asked[1:], os.path.basename(path[1]) + asked)


def class_in_file(path: Path, wanted: str | None) -> type[Estimator]:
    if not path.is_file():
        raise EstimatorError(f"there is no estimator file {str(path)!r}")
    path = path.resolve()
    module = _load(path)
    inside = [
        c
        for c in vars(module).values()
        if isinstance(c, type) and issubclass(c, Estimator) and c.__module__ == module.__name__
    ]
    concrete = list(dict.fromkeys(c for c in inside if not inspect.isabstract(c)))
    choices = ", ".join(f"{path.name}:{c.__name__}" for c in concrete)
    if wanted is not None:
        for c in inside:
            if c.__name__ == wanted:
                if inspect.isabstract(c):
                    lacks = ", ".join(sorted(c.__abstractmethods__))
                    raise EstimatorError(f"{path.name}:{wanted} is no complete estimator: it lacks {lacks}")
                break
        else:
            hint = f"; there are: {choices}" if choices else "; it holds no subclass of simnav.Estimator"
            raise EstimatorError(f"{path.name} has no estimator class {wanted!r}{hint}")
        chosen = c
    elif len(concrete) == 1:
        chosen = concrete[0]
    elif not concrete:
        hint = f"; {inside[0].__name__} lacks {', '.join(sorted(inside[0].__abstractmethods__))}" if inside else ""
        raise EstimatorError(f"{path.name} holds no class that is a complete subclass of simnav.Estimator{hint}")
    else:
        decorated = [c for c in concrete if "name" in vars(c)]
        if len(decorated) != 1:
            raise EstimatorError(f"{path.name} holds several estimators; ask for one of them: {choices}")
        chosen = decorated[0]
    if "name" not in vars(chosen):
        discover()  # so that a collision with an installed estimator is seen
        register(kebab(chosen.__name__))(chosen)
    return chosen


def _load(path: Path) -> types.ModuleType:
    """Import a file by its path. It can import modules of its folder, which do not replace installed modules."""
    discover()
    return import_file(path, error=EstimatorError, before=forget)
