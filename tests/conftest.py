"""Shared by all tests: where the real logs are, if they are there."""

from __future__ import annotations

import os
from pathlib import Path

_BESIDE = Path(__file__).parents[2] / "shared" / "data"

# Logs beside the project are used without being asked for; what needs them skips, visibly, where there are none.
if "SIMNAV_DATA" not in os.environ and _BESIDE.is_dir():
    os.environ["SIMNAV_DATA"] = str(_BESIDE)
