"""The first view of the board as its page shows it: the picture is a table of coloured cells."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from simnav.leaderboard.figures.ratio_map import ENDS
from simnav.leaderboard.ranking import tables

if TYPE_CHECKING:
    from simnav.leaderboard.ranking.first_view import FirstView
    from simnav.leaderboard.ranking.trouble_profile import GroupRow

    from .content import EstimatorEntry

__all__ = ["picture"]

_FULL = 62.0  # per cent of the colour in the darkest cell: the number in it is still read
_EQUAL = 0.005  # ratios this near to 1 are written as 1 and have no colour


def picture(view: FirstView, estimators: Mapping[str, EstimatorEntry]) -> dict[str, Any]:
    """Columns, lines and cells of the picture, and what to take with its links.

    Parameters
    ----------
    view : FirstView
        The first view.
    estimators : mapping
        Estimators by label.
    """
    lines = [
        {"title": group.title, "cells": [_in_group(r.groups[k], view.plain) for r in view.rows]}
        for k, group in enumerate(view.groups)
    ]
    return {
        "sentence": view.sentence,
        "title": view.title,
        "plain": view.plain,
        "silence": view.silence,
        "rows": [{"name": r.estimator, "page": estimators[r.estimator].page} for r in view.rows],
        "lines": lines,
        "all": [_cell(r.to_plain, f"{r.estimator}: rank {r.ranks or 'unknown'} on the track {view.title}")
                for r in view.rows],
        "time": [tables.number(r.cost, 2) for r in view.rows],
        "honest": [_percent(r.coverage) for r in view.rows],
        "advice": [
            {"what": a.what, "name": a.estimator, "page": estimators[a.estimator].page, "reason": a.reason}
            for a in view.advice
        ],
    }  # fmt: skip


def _percent(share: float) -> str:
    return f"{100.0 * share:.0f}" if math.isfinite(share) else tables.MISSING


def _in_group(row: GroupRow, plain: str) -> dict[str, Any]:
    told = "better: " if plain in row.better_than else "worse: " if plain in row.worse_than else "not told apart: "
    interval = tables.interval(row.to_plain, row.to_plain_low, row.to_plain_high)
    told = "" if row.estimator == plain else f"{told}{interval} times the error of {plain}"
    return _cell(row.to_plain, told) | {"told": plain in row.better_than or plain in row.worse_than}


def _cell(ratio: float, words: str) -> dict[str, Any]:
    """A number with its colour: blue below one, orange above."""
    depth = min(abs(math.log(ratio)) / math.log(ENDS), 1.0) if ratio > 0.0 else 0.0
    side = "" if abs(ratio - 1.0) < _EQUAL else "less" if ratio < 1.0 else "more"
    return {"text": f"{ratio:.2f}", "side": side, "part": round(_FULL * depth), "help": words, "told": False}
