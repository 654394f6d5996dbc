# Of cooperative.py, for type checkers and editors. Do not edit: "python -m simnav.estimators.stubs" writes it.

from simnav.estimator import register
from simnav.estimators.adaptations.intersection import CovarianceIntersection
from simnav.estimators.composition import Row
from simnav.estimators.models.suitable import WithMessages
from simnav.estimators.solvers.iterated import poor_heading
from simnav.estimators.solvers.kalman import KalmanEstimator

__all__ = ["EkfCi"]

@register("ekf-ci")
class EkfCi(Row, solver=KalmanEstimator, model=WithMessages, adaptation=CovarianceIntersection, iteration=poor_heading):
    version = 2
    def __init__(
        self,
        *,
        iterate_above_deg: float | None = None,
    ) -> None: ...
