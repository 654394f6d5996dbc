"""All intervals and tests: figures of a few runs, how sure they are, and who can be told from whom.

Intervals are of 95 % and come as `Interval`. ``docs/statistics.md`` has what was measured of them.

- `intervals`: of one row. `score` is what is ranked: a geometric mean in which failures count. `median` is what tables
  show beside it, `mean` and `mean_ratio` are compared with figures of papers, `share` is of failed runs.
- `pairs`: two rows on the same runs, `compare`.
- `separation`: all rows of a board at once, `separate`: which can be told apart, rank intervals, and the set of rows
  that may be the best.
- `stages`: the same in up to three looks, with more seeds for the rows that may be the best, `separate_in_stages`.
- `gains`: a row beside the plain row, `gain`, with intervals over seeds and over scenarios.
- `reliability`: whether the rows can be ordered at all, `unorderable`.
"""

from .gains import Gain, gain, scenario_interval
from .intervals import (
    FAILURE,
    FEWEST,
    FEWEST_SEEDS,
    Interval,
    mean,
    mean_ratio,
    median,
    score,
    share,
    weighted_quantile,
)
from .pairs import Comparison, compare
from .reliability import reliability, unorderable
from .separation import Separation, separate, smallest_p_value, unlucky_excess
from .stages import FIRST, STAGES, Stage, Staged, separate_in_stages

__all__ = [
    "FAILURE",
    "FEWEST",
    "FEWEST_SEEDS",
    "FIRST",
    "STAGES",
    "Comparison",
    "Gain",
    "Interval",
    "Separation",
    "Stage",
    "Staged",
    "compare",
    "gain",
    "mean",
    "mean_ratio",
    "median",
    "reliability",
    "scenario_interval",
    "score",
    "separate",
    "separate_in_stages",
    "share",
    "smallest_p_value",
    "unlucky_excess",
    "unorderable",
    "weighted_quantile",
]
