"""Shared by the tests of the library: the plug-in files of a third party, and a registry that forgets them."""

from __future__ import annotations

#: Plug-ins are loaded by those who test them: an import by the collector would register them for everybody.
collect_ignore = ["plugins"]
