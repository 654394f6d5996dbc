"""The scores of simnav: importing this module registers them, in the order in which tables show them."""

from __future__ import annotations

# isort: off
from simnav.scoring import accuracy
from simnav.scoring import outages
from simnav.scoring import consistency
from simnav.scoring import ending
from simnav.scoring import integrity
from simnav.scoring import detection
from simnav.scoring import noise_estimation
from simnav.scoring import beyond_reference
from simnav.scoring import smoothed
from simnav.scoring import cost
from simnav.scoring import lagged

# isort: on

__all__ = [
    "accuracy",
    "beyond_reference",
    "consistency",
    "cost",
    "detection",
    "ending",
    "integrity",
    "lagged",
    "noise_estimation",
    "outages",
    "smoothed",
]
