"""Shared by all tests: where the real logs are, if they are there."""

from __future__ import annotations

import os
from pathlib import Path

_BESIDE = Path(__file__).parents[2] / "shared" / "data"

# Logs beside the project are used without being asked for; what needs them skips, visibly, where there are none.
if "SIMNAV_DATA" not in os.environ and _BESIDE.is_dir():
    os.environ["SIMNAV_DATA"] = str(_BESIDE)

# Tables are compared as they are where there is no terminal; a worker of pytest-xdist is told of a narrow one.
os.environ.pop("COLUMNS", None)
