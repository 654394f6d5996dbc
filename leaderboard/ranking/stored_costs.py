"""What estimators cost, as multiples of the plain row: the table that comes with simnav, and how boards show it.

The wall clock of a campaign's runs depends on what else the machine did. So boards show processor time as a multiple of
that of the plain row, measured in turns (`simnav.testing.paired_time`). The multiples of all rows that come with simnav
are in ``costs.json`` beside this module, which ``simnav bench --all --output FILE`` writes. A board joins them to its
rows when it is shown; the ranking does not use them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from simnav.leaderboard.results.provenance import Provenance
from simnav.leaderboard.results.result import EXTERNAL

from .measured_file import checked_names, read_measured, save_measured, short_number
from .plain_row import plain_rows

__all__ = ["FILE", "NOT_MEASURED", "CostMultiple", "Costs", "cost_of", "not_measured", "read", "save", "stored"]

FILE = Path(__file__).with_name("costs.json")
NOT_MEASURED = "not measured"

_WANTED = "'simnav bench --all --output FILE' writes such a file"


@dataclass(frozen=True)
class CostMultiple:
    """Processor time of an estimator as a multiple of that of a plain row.

    Attributes
    ----------
    estimator, plain : str
        Labels of both. Beside ``ekf`` and ``ship-ekf`` the time is that of ``update``; beside a smoother it is that of
        all epochs and of ``smooth``.
    scenario : str
        Versioned id of the scenario that both ran.
    value, low, high : float
        The multiple, with its 95 % interval over the rounds.
    rounds : int
        Number of rounds.
    """

    estimator: str
    plain: str
    scenario: str
    value: float
    low: float
    high: float
    rounds: int


@dataclass(frozen=True)
class Costs:
    """A table of costs.

    Attributes
    ----------
    measured : Provenance
        Machine, versions and day.
    rows : tuple of CostMultiple
        In the order of the file.
    """

    measured: Provenance
    rows: tuple[CostMultiple, ...]

    def multiple_of(self, estimator: str, plains: Iterable[str]) -> CostMultiple | None:
        """The multiple of an estimator beside the first of the plain rows beside which it was measured."""
        mine = {r.plain: r for r in self.rows if r.estimator == estimator}
        return next((mine[p] for p in plains if p in mine), None)


def save(rows: Iterable[CostMultiple], path: Path, measured: Provenance | None = None) -> Path:
    """Write multiples; an older file is replaced.

    Parameters
    ----------
    rows : iterable of CostMultiple
        The multiples.
    path : Path
        The file.
    measured : Provenance, optional
        Machine, versions and day of the measurement; default: those of now.

    Raises
    ------
    OSError
        If writing fails.
    """
    lines = ({k: short_number(v) if isinstance(v, float) else v for k, v in asdict(row).items()} for row in rows)
    return save_measured(lines, path, measured)


def read(path: Path) -> Costs:
    """Read a table of costs.

    Raises
    ------
    RequestError
        If the file is missing or is no table of costs: one sentence with the file, the field and the value.
    """
    return Costs(*read_measured(path, _row, what="table of costs", rows="multiples", wanted=_WANTED))


def _row(where: str, entry: Any) -> CostMultiple:
    """A row of the file; ValueError with the field that is wrong."""
    entry = checked_names(where, entry)
    for name in ("value", "low", "high", "rounds"):
        x = entry.get(name)
        if isinstance(x, bool) or not isinstance(x, (int, float)) or not 0.0 < x < math.inf:
            raise ValueError(f"{where}.{name} is {x!r}, and should be a finite number above 0")
    if not entry["low"] <= entry["value"] <= entry["high"]:
        raise ValueError(f"{where}.value is {entry['value']!r}, and should be between low and high")
    return CostMultiple(
        entry["estimator"], entry["plain"], entry["scenario"], float(entry["value"]), float(entry["low"]),
        float(entry["high"]), int(entry["rounds"]),
    )  # fmt: skip


@lru_cache(maxsize=4)
def stored(path: Path = FILE) -> Costs:
    """The table that comes with simnav; see `read`."""
    return read(path)


def cost_of(estimator: str, plain: str, score: str) -> CostMultiple | None:
    """What a board shows of a row: the stored multiple, or None where it was not measured.

    Parameters
    ----------
    estimator : str
        Label of the row.
    plain : str
        The plain row of the board; of several, as ``ekf or ship-ekf``, the first that the row was measured beside;
        without one (empty), those of the score.
    score : str
        Key of `simnav.scoring.SCORES` that the board ranks.
    """
    return stored().multiple_of(estimator, plain.split(" or ") if plain else plain_rows(score))


def not_measured(estimators: Iterable[str]) -> str:
    """The sentence on rows whose cost was not measured; empty where there is none."""
    named = list(estimators)
    here = ", ".join(n for n in named if not n.endswith(EXTERNAL))
    elsewhere = ", ".join(n for n in named if n.endswith(EXTERNAL))
    said = [f"Cost not measured: {here}; 'simnav bench NAME' measures it."] if here else []
    if elsewhere:
        said.append(f"Cost not known, for the estimates were made elsewhere: {elsewhere}.")
    return " ".join(said)
