"""The latency-accuracy curve of a scenario: the error of the rows against the delay of their output.

Rows that ran with ``lags`` (`simnav.estimator.looking_back`) have a score for each lag. Filters and windows stand in
one chart, so that equal delays are compared.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from simnav.scoring.lagged import seconds_of

from .charts import Chart
from .dial_charts import dial
from .rounding import short

if TYPE_CHECKING:
    from simnav.leaderboard.ranking.runs import Runs

__all__ = ["latency_chart"]

_SCORE = "horizontal_rmse"
_LATE = f"{_SCORE}_lag_"


def latency_chart(rows: Sequence[str], runs: Mapping[str, Runs]) -> Chart | None:
    """Median horizontal RMSE of each row against the delay of its output; None if no row has such scores.

    Parameters
    ----------
    rows : sequence of str
        Labels of the rows, in the order of the board.
    runs : mapping of str to Runs
        Runs of each row.
    """
    curves: dict[str, dict[str, list[Any]]] = {}
    for name in rows:
        cell = runs[name]
        late = sorted({score for result in cell.good for score in result.scores if score.startswith(_LATE)},
                      key=lambda score: seconds_of(score.removeprefix(_LATE)))  # fmt: skip
        if not late:
            continue
        found = [(0.0, cell.score(_SCORE))] + [(seconds_of(s.removeprefix(_LATE)), cell.score(s)) for s in late]
        found = [(lag, error) for lag, error in found if error.value > 0.0]
        curves[name] = {
            "value": [lag for lag, _ in found],
            "middle": [short(error.value) for _, error in found],
            "low": [short(error.low) if math.isfinite(error.low) else None for _, error in found],
            "high": [short(error.high) if math.isfinite(error.high) else None for _, error in found],
            "failed": [0 for _ in found],
        }
    if not curves:
        return None
    caption = (
        "Median over the runs that ended well, with its 95 % interval where it is known. An output with a delay of 10 "
        "s is the estimate of the time 10 s before. Only rows that ran with the parameter 'lags'."
    )
    data = {"curves": {"rows": curves}, "marks": {"rows": {}}}
    return dial("latency", "Delay of the output [s]", "Horizontal RMSE [m]", data, caption, breaking=False)
