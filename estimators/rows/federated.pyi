# Of federated.py, for type checkers and editors. Do not edit: "python -m simnav.estimators.stubs" writes it.

from simnav.estimator import register
from simnav.estimators.composition import Row, piece
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.solvers.federated import FederatedEstimator

__all__ = ["Federated", "FederatedNoReset"]

@register("federated")
class Federated(Row, solver=piece(FederatedEstimator, reset_locals=True), model=InertialModel):
    version = 3
    def __init__(
        self,
        *,
        calibrate: bool = True,
        fusion_period: float | None = None,
        master_share: float = 0.0,
        shares: tuple[float, ...] = (),
    ) -> None: ...

@register("federated-no-reset")
class FederatedNoReset(Row, solver=piece(FederatedEstimator, reset_locals=False), model=InertialModel):
    version = 3
    def __init__(
        self,
        *,
        calibrate: bool = True,
        fusion_period: float | None = None,
        master_share: float = 0.0,
        shares: tuple[float, ...] = (),
    ) -> None: ...
