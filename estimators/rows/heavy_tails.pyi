# Of heavy_tails.py, for type checkers and editors. Do not edit: "python -m simnav.estimators.stubs" writes it.

from simnav.estimator import register
from simnav.estimators.adaptations.student_t import StudentT
from simnav.estimators.composition import Row
from simnav.estimators.models.suitable import Suitable
from simnav.estimators.solvers.iterated import poor_heading
from simnav.estimators.solvers.kalman import KalmanEstimator
from simnav.estimators.solvers.student_t_smoother import StudentTSmoother

__all__ = ["StudentTKf", "StudentTRts"]
_FORMERLY = {"dof": "adaptation__dof", "smoothed_dof": "smoother__dof"}

@register("student-t")
class StudentTKf(Row, solver=KalmanEstimator, model=Suitable, adaptation=StudentT, iteration=poor_heading):
    version = 6
    def __init__(
        self,
        *,
        dof: float = 8.0,
        turns: int = 5,
        iterate_above_deg: float | None = None,
    ) -> None: ...

@register("student-t-rts")
class StudentTRts(StudentTKf, smoother=StudentTSmoother):
    version = 6
    formerly = _FORMERLY
    def __init__(
        self,
        *,
        adaptation__dof: float = 8.0,
        turns: int = 5,
        iterate_above_deg: float | None = None,
        smoother__dof: float = 6.0,
        passes: int = 20,
    ) -> None: ...
