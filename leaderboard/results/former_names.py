"""Parameters of simnav's rows that had another name when a result was written: read, and shown under the present one.

Keys of results stay as they are.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

__all__ = ["present_label", "present_parameters"]


def present_label(label: str) -> str:
    """A label with the present names of the parameters.

    >>> present_label("student-t-rts(smoothed_dof=4)"), present_label("my-filter(smoothed_dof=4)")
    ('student-t-rts(smoother__dof=4)', 'my-filter(smoothed_dof=4)')
    """
    for old, new in _former(label).items():
        label = re.sub(rf"(?<=[(,]){re.escape(old)}(?==)", new, label)
    return label


def present_parameters(label: str, parameters: Mapping[str, Any]) -> Mapping[str, Any]:
    """Parameters of a row, by its label, under their present names.

    >>> present_parameters("rae(window=9)", {"window": "9"})
    {'innovations': '9'}
    """
    names = _former(label)
    return {names.get(name, name): value for name, value in parameters.items()} if names else parameters


def _former(label: str) -> Mapping[str, str]:
    from simnav.estimator.lookup import former_names_of

    name, _, settings = label.partition("(")
    return former_names_of(name) if settings else {}
