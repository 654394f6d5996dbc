"""The settings of a paper's comparison: for each, whether the paper prints it, or shows it in a figure, or it is ours.

A setting of a scenario names its key, and the value is read from the scenario's file. So the table of a page cannot say
another value than the one that was run.
"""

from __future__ import annotations

import tomllib
from importlib import resources
from typing import Any, Literal

from simnav.spec import Spec

__all__ = ["SOURCES", "PaperSetting", "Source", "value_of_key"]

#: Where a setting comes from: the paper's text or tables, one of its figures, or our choice.
Source = Literal["printed", "read from a figure", "ours"]
SOURCES: tuple[Source, ...] = ("printed", "read from a figure", "ours")


class PaperSetting(Spec):
    """One setting.

    Attributes
    ----------
    what : str
        What is set, with its unit.
    source : str
        As of `Source`.
    printed : str
        What the paper says, in its units; empty if it says nothing.
    scenario, key : str
        Scenario of the catalogue and key of its file, like ``instruments.gnss.rate_hz``; a part of a list of faults is
        ``fault[2].probability``. Both empty for a setting of a method or a variant.
    ours : str
        Our value, where there is no key; behind the value of the key, what has to be said of it.
    """

    what: str
    source: Source
    printed: str = ""
    scenario: str = ""
    key: str = ""
    ours: str = ""

    @property
    def value(self) -> str:
        """Our value, as text."""
        if not self.key:
            return self.ours
        found = value_of_key(self.scenario, self.key)
        text = ", ".join(f"{v:g}" for v in found) if isinstance(found, list) else f"{found:g}"
        return f"{text} {self.ours}".rstrip()


def value_of_key(scenario: str, key: str) -> Any:
    """The value at a key of a scenario's file.

    Raises
    ------
    KeyError
        If the file has no such key.

    Examples
    --------
    >>> value_of_key("coastal-voyage", "fault[2].probability")
    0.1
    """
    text = resources.files("simnav.scenarios").joinpath(f"{scenario}.toml").read_text(encoding="utf-8")
    found: Any = tomllib.loads(text)
    for part in key.split("."):
        name, bracket, index = part.partition("[")
        found = found[name]
        if bracket:
            found = found[int(index.rstrip("]"))]
    return found
