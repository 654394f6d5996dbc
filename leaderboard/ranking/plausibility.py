"""Whether a row is better than what is possible.

An oracle knows the true noise of each measurement and which measurements a fault touched. Whoever has clearly smaller
errors has seen the truth, or the figure of the oracle is wrong. Such a row is shown and not ranked.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

if TYPE_CHECKING:
    from simnav.leaderboard.ranking.board import Reference

__all__ = ["MARGIN", "too_good"]

#: An oracle is a filter and may be this much worse than the Cramer-Rao bound.
MARGIN = 0.9
#: Probability that an honest row that is as good as possible is flagged on any scenario of a board.
_ALPHA = 0.001
#: Least spread of the log error from run to run: what a very short list of runs might hide.
_LEAST_SPREAD = 0.05


def too_good(log_ratios: ArrayLike, reference: Reference, scenarios: int = 1) -> bool:
    """Whether the errors of a row on a scenario are below the oracle's by more than chance.

    Parameters
    ----------
    log_ratios : (n,) array_like
        Logarithms of the ratios to the reference figure, of the runs that were completed.
    reference : Reference
        No bound: never too good.
    scenarios : int
        How many scenarios the row is judged on.

    Returns
    -------
    bool
        Whether the geometric mean is below `MARGIN` at a one-sided level of 0.1 % over all scenarios. The spread from
        run to run is taken as the larger one of the oracle's and the row's own.

    Examples
    --------
    >>> from simnav.leaderboard.ranking.board import Reference
    >>> oracle = Reference(1.0, "oracle", 200, 0.3)
    >>> too_good([-13.0, -13.5, -12.8], oracle), too_good([-0.2, 0.1, -0.15], oracle)
    (True, False)
    """
    x = np.asarray(log_ratios, dtype=np.float64)
    if not len(x) or not reference.bounds or reference.runs < 2:
        return False
    from scipy.special import stdtr

    own = float(x.std(ddof=1)) if len(x) > 1 else 0.0
    spread = max(reference.spread, own, _LEAST_SPREAD)
    statistic = (float(x.mean()) - math.log(MARGIN)) / (spread * math.sqrt(1.0 / len(x) + 1.0 / reference.runs))
    return float(stdtr(reference.runs - 1.0, statistic)) < _ALPHA / max(scenarios, 1)
