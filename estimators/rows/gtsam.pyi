# Of gtsam.py, for type checkers and editors. Do not edit: "python -m simnav.estimators.stubs" writes it.
import typing

from simnav.estimator import register
from simnav.estimators.composition import Row
from simnav.estimators.solvers.gtsam_solvers import BatchEstimator, FixedLagEstimator, GncEstimator, Isam2Estimator

__all__ = ["GtsamBatch", "GtsamFixedLag", "GtsamGnc", "GtsamIsam2"]

@register("gtsam-fixed-lag")
class GtsamFixedLag(Row, solver=FixedLagEstimator):
    version = 2
    def __init__(
        self,
        *,
        window: int = 20,
        threshold: float = 1.0,
        iterations: int = 5,
    ) -> None: ...

@register("gtsam-isam2")
class GtsamIsam2(Row, solver=Isam2Estimator):
    version = 2
    def __init__(
        self,
        *,
        threshold: float = 1.0,
        iterations: int = 5,
    ) -> None: ...

@register("gtsam-batch")
class GtsamBatch(Row, solver=BatchEstimator):
    version = 2
    real_time_as = "gtsam-fixed-lag"
    def __init__(
        self,
        *,
        window: int = 20,
        threshold: float = 1.0,
        iterations: int = 5,
        most: int = 50,
    ) -> None: ...

@register("gtsam-gnc")
class GtsamGnc(Row, solver=GncEstimator):
    version = 2
    real_time_as = "gtsam-fixed-lag"
    def __init__(
        self,
        *,
        window: int = 20,
        threshold: float = 1.0,
        iterations: int = 5,
        most: int = 50,
        loss: typing.Literal["tls", "gm"] = "tls",
        probability: float = 0.99,
    ) -> None: ...
