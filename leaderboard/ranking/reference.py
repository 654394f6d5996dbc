"""The fixed reference figures of scenarios: what their errors are divided by.

A figure is the geometric mean of the error of an oracle over many runs. It is stored with the scenario's version and a
digest of its content in ``reference.json`` beside this module, which ``simnav standard reference`` writes. So a ratio
to it does not depend on who else was run, and a changed scenario does not get the figure of the one before. Of a
recorded log nobody knows the true noise; its figure is the error of a plain filter, which is a scale and no bound.
Where nothing is stored, the oracle among the runs stands in; where none ran, the figure is 1 m.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from simnav.leaderboard.results.errors import RequestError

from .board import Reference

if TYPE_CHECKING:
    from .runs import Runs

__all__ = ["FILE", "FORMAT", "ORACLES", "PLAIN", "entry", "figure", "reference_of", "stored"]

FILE = Path(__file__).with_name("reference.json")
FORMAT = 2

#: The plain filters whose error is the figure of a recorded scenario: the first that suits it.
PLAIN = ("ekf", "ship-ekf")
#: Digits that a stored figure has.
_DIGITS = 5
#: What a stored figure says of its oracle, beside the figure itself.
_CHECKS = ("to_bound", "to_bound_error", "nees", "nees_error")

#: The oracle whose error each score is compared with.
ORACLES: Mapping[str, str] = {"horizontal_rmse": "oracle", "smoothed_horizontal_rmse": "oracle-rts"}


@lru_cache(maxsize=4)
def stored(path: Path = FILE) -> Mapping[str, Mapping[str, Reference]]:
    """All stored figures: scenario -> score -> figure.

    Raises
    ------
    RequestError
        If the file is not one of reference figures.
    """
    if not path.exists():
        return {}
    try:
        content = json.loads(path.read_bytes())
        if content["format"] != FORMAT:
            raise ValueError(f"its format is {content['format']!r}, and this version reads {FORMAT}")
        return {
            scenario: {name: _read(entry) for name, entry in scores.items()}
            for scenario, scores in content["figures"].items()
        }
    except (ValueError, KeyError, TypeError, AttributeError, OSError) as error:
        raise RequestError(f"{path} is no file of reference figures: {error}") from None


def _read(entry: Mapping[str, Any]) -> Reference:
    value, spread, runs = float(entry["value"]), float(entry["spread"]), int(entry["runs"])
    if not (0.0 < value < math.inf and 0.0 <= spread < math.inf and runs > 0):
        raise ValueError(f"value = {value}, spread = {spread}, runs = {runs}: they should be finite and above 0")
    checks = [float(entry.get(name, math.nan)) for name in _CHECKS]
    return Reference(value, str(entry["estimator"]), runs, spread, True, str(entry["content"]), *checks)


def entry(figure: Reference) -> dict[str, Any]:
    """A figure as it stands in the file."""
    found: dict[str, Any] = {
        "estimator": figure.estimator,
        "value": float(f"{figure.value:.{_DIGITS}g}"),
        "spread": float(f"{figure.spread:.3g}"),
        "runs": figure.runs,
        "content": figure.content,
    }
    checks = {name: getattr(figure, name) for name in _CHECKS}
    return {**found, **{name: float(f"{x:.4g}") for name, x in checks.items() if math.isfinite(x)}}


def reference_of(scenario: str, score: str, cells: Mapping[str, Runs], recorded: bool = False) -> Reference:
    """The figure of a scenario.

    A stored figure is refused where the results are of another content of the scenario than it was measured on.

    Parameters
    ----------
    scenario : str
        Versioned id.
    score : str
        Key of `simnav.scoring.SCORES`.
    cells : mapping of str to Runs
        The runs by estimator; an oracle among them stands in where nothing is stored.
    recorded : bool
        Whether the runs are of recorded logs: an oracle is none there, and a plain filter stands in.
    """
    found = stored().get(scenario, {}).get(score)
    contents = {r.scenario_digest for runs in cells.values() for r in runs.results if r.scenario_digest}
    if found is not None and contents <= {found.content}:
        return found
    name = ORACLES.get(score, "oracle")
    names = [n for n in sorted(cells) if cells[n].reference and "oracle" in n]
    names = [n for n in names if n == name] or names
    if recorded:
        names = [n for n in PLAIN if n in cells]
    for candidate in names:
        made = figure(cells[candidate].scores(score).tolist(), candidate)
        if made is not None:
            return made
    return Reference()


def figure(errors: Iterable[float], estimator: str, *, stored: bool = False) -> Reference | None:
    """The figure that errors of one estimator give; None where none of them is above zero.

    Examples
    --------
    >>> figure([1.0, 4.0], "oracle").value
    2.0
    """
    logs = np.log([e for e in errors if math.isfinite(e) and e > 0.0])
    if not len(logs):
        return None
    spread = float(np.std(logs, ddof=1)) if len(logs) > 1 else 0.5
    return Reference(math.exp(float(logs.mean())), estimator, len(logs), spread, stored)
