"""Parameters of simnav's rows that had another name when a result was written: read, and shown under the present one.

Keys of results stay as they are.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

__all__ = ["present_label", "present_parameters", "under_present_labels"]


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


def under_present_labels(values: Mapping[str, str]) -> dict[str, str]:
    """Values by label, under the present labels; what is already under one of them comes before an older value.

    >>> under_present_labels({"rae(window=9)": "a", "rae(window=8)": "b", "rae(innovations=8)": "c"})
    {'rae(innovations=9)': 'a', 'rae(innovations=8)': 'c'}
    """
    present = {label: value for label, value in values.items() if present_label(label) == label}
    return {present_label(label): value for label, value in values.items()} | present


def _former(label: str) -> Mapping[str, str]:
    from simnav.estimator.lookup import former_names_of

    name, _, settings = label.partition("(")
    return former_names_of(name) if settings else {}
