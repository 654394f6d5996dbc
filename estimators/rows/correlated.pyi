# Of correlated.py, for type checkers and editors. Do not edit: "python -m simnav.estimators.stubs" writes it.

from simnav.estimator import register
from simnav.estimators.composition import Row
from simnav.estimators.models.correlated_fixes import CorrelatedFixes
from simnav.estimators.solvers.iterated import poor_heading
from simnav.estimators.solvers.kalman import KalmanEstimator

__all__ = ["GaussMarkovEkf"]

@register("gm-ekf", aliases=("gauss-markov-ekf",))
class GaussMarkovEkf(Row, solver=KalmanEstimator, model=CorrelatedFixes, iteration=poor_heading):
    version = 3
    def __init__(
        self,
        *,
        slow: float = 0.5,
        slow_time: float = 120.0,
        iterate_above_deg: float | None = None,
    ) -> None: ...
