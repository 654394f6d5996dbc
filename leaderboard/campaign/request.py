"""An estimator that was asked for: its name or file, with parameters."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

__all__ = ["EstimatorRequest", "split_estimators"]


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
        What tables call it; default: name and parameters.
    """

    name: str
    parameters: Mapping[str, Any] = field(default_factory=dict)
    label: str = ""

    def __post_init__(self) -> None:
        if not self.label:
            settings = ",".join(f"{k}={v}" for k, v in self.parameters.items())
            plain = re.sub(r"\.py(?=$|:\w+$)", "", os.path.basename(self.name))
            object.__setattr__(self, "label", f"{plain}({settings})" if settings else plain)


def split_estimators(given: Iterable[str] | None) -> list[tuple[str, dict[str, str]]]:
    """Names or files with their parameters: ``name:key=value,key=value``, separated by commas.

    >>> split_estimators(["ekf:gate=3,tau=10,dead-reckoning", "my.py:Mine:gain=0.5"])
    [('ekf', {'gate': '3', 'tau': '10'}), ('dead-reckoning', {}), ('my.py:Mine', {'gain': '0.5'})]

    Raises
    ------
    ValueError
        Where a parameter follows no name.
    """
    found: list[tuple[str, dict[str, str]]] = []
    for text in given or ():
        open_for_more = False  # the item before has parameters, so that "key=value" is one more of them
        for part in filter(None, (p.strip() for p in text.split(","))):
            whole = re.fullmatch(r"(?P<name>.+?):(?P<key>\w+)=(?P<value>.*)", part)
            more = re.fullmatch(r"(?P<key>\w+)=(?P<value>.*)", part)
            if whole:
                found.append((whole["name"], {whole["key"]: whole["value"]}))
            elif more and open_for_more:
                found[-1][1][more["key"]] = more["value"]
            elif more:
                raise ValueError(f"{part!r} is no estimator; parameters follow a name: 'ekf:{part}'")
            else:
                found.append((part, {}))
            open_for_more = bool(found[-1][1])
    return found
