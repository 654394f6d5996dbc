"""All intervals and tests: figures of a few runs, how sure they are, and who can be told from whom.

Intervals are of 95 % and come as `Interval`. ``docs/statistics.md`` has what was measured of them.

- `intervals`: of one row. `score` is what is ranked: a geometric mean in which failures count. `median` is what tables
  show beside it, `mean` and `mean_ratio` are compared with figures of papers, `share` is of failed runs.
- `pairs`: two rows on the same runs, `compare`.
- `separation`: all rows of a board at once, `separate`: which can be told apart, rank intervals, tiers, and the set of
  rows that may be the best.
"""

from simnav.leaderboard.ranking.statistics.intervals import (
    FAILURE,
    FEWEST,
    Interval,
    mean,
    mean_ratio,
    median,
    score,
    share,
    weighted_quantile,
)
from simnav.leaderboard.ranking.statistics.pairs import Comparison, compare
from simnav.leaderboard.ranking.statistics.separation import Separation, separate, smallest_p_value, tiers
from simnav.leaderboard.ranking.statistics.temp_ import Gain, gain, scenario_interval, unorderable

__all__ = [
    "FAILURE",
    "FEWEST",
    "Comparison",
    "Interval",
    "Separation",
    "compare",
    "mean",
    "mean_ratio",
    "median",
    "score",
    "separate",
    "share",
    "smallest_p_value",
    "tiers",
    "weighted_quantile",
]
