"""Kinds of instruments that do not come with simnav: where they come from, and known in another process, too."""

from __future__ import annotations

import importlib
import pickle
import sys
from collections.abc import Iterable
from typing import TYPE_CHECKING

from simnav.kinds import INSTRUMENTS
from simnav.leaderboard.campaign.session_class import is_session, pickle_class
from simnav.plugins import is_file_module, load_plugin

if TYPE_CHECKING:
    from simnav.types import Instruments

__all__ = ["Home", "homes_of_kinds", "load_kinds"]

#: Name of the kind, module that registers it, its file where it is a single one, the class where none can be imported.
Home = tuple[str, str, str, bytes]


def homes_of_kinds(instruments: Instruments) -> list[Home]:
    """What to import for the kinds of these instruments that do not come with simnav."""
    found = []
    for kind in dict.fromkeys(sheet.kind for sheet in instruments.values()):
        cls = INSTRUMENTS.get(kind)
        module = getattr(cls, "__module__", "")
        if cls is None or module.startswith("simnav."):
            continue
        if is_file_module(module):
            found.append((kind, module, str(sys.modules[module].__file__), b""))
        else:
            found.append((kind, module, "", pickle_class(cls) if is_session(module) else b""))
    return found


def load_kinds(homes: Iterable[Home]) -> None:
    """Import what registers the kinds: modules, files of plug-ins, classes of a session."""
    for kind, module, file, code in homes:
        if code:
            INSTRUMENTS.add(kind, pickle.loads(code))
        elif file:
            load_plugin(file)
        else:
            importlib.import_module(module)
