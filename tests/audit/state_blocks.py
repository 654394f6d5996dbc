"""Rows with states that instruments bring along: are they right about themselves, and do they agree? On 20 runs each.

The tests take fewer runs (`tests/estimators/test_state_blocks.py`).
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from simnav.scoring import nees_band
from simnav.source import record
from tests.cases.block_consistency import DURATION, LEVEL, ROWS, WITHIN, consistency
from tests.cases.fjord import CASES, CHANNEL_CASES, fjord

__all__ = ["rows"]

RUNS = 20

_PLUGINS = Path(__file__).parents[1] / "simnav" / "plugins"


def rows() -> Iterator[tuple[str, str, str, bool]]:
    """What is measured, its figure, what is promised, and whether that is kept."""
    (low, high), (least, most) = (nees_band(degrees, RUNS, LEVEL) for degrees in (3, 1))
    for case in (*CASES, *CHANNEL_CASES):
        scenario = fjord(_PLUGINS, case, duration=DURATION)
        recordings = [record(scenario, seed) for seed in range(RUNS)]
        found = {row: consistency(row, scenario, recordings) for row in ROWS}
        plain = found[ROWS[0]].rmse
        for row, f in found.items():
            figure = f"{f.motion.min():.2f}-{f.motion.max():.2f}"
            yield f"{case}, {row}: NEES of the motion", figure, f"{low:.2f}-{high:.2f}", f.motion_kept
            figure = f"{f.blocks.min():.2f}-{f.blocks.max():.2f}"
            yield f"{case}, {row}: NEES of the blocks", figure, f"{least:.2f}-{most:.2f}", f.blocks_kept
            if row in WITHIN:
                apart, allowed = f.rmse / plain - 1.0, WITHIN[row]
                yield f"{case}, {row}: error over {ROWS[0]}'s", f"{apart:+.3f}", f"{allowed:g}", abs(apart) <= allowed
