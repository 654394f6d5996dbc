# Of dead_reckoning.py, for type checkers and editors. Do not edit: "python -m simnav.estimators.stubs" writes it.

from simnav.estimator import register
from simnav.estimators.composition import Row
from simnav.estimators.solvers.dead_reckoning import DeadReckoningEstimator

__all__ = ["DeadReckoning"]

@register("dead-reckoning", aliases=("dr",))
class DeadReckoning(Row, solver=DeadReckoningEstimator):
    def __init__(
        self,
        *,
        current: float = 0.3,
    ) -> None: ...
