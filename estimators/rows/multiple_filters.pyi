# Of multiple_filters.py, for type checkers and editors. Do not edit: "python -m simnav.estimators.stubs" writes it.

from simnav.estimator import register
from simnav.estimators.composition import Row
from simnav.estimators.models.suitable import Suitable
from simnav.estimators.solvers.heading_bank import HeadingBank
from simnav.estimators.solvers.solution_separation import SolutionSeparation

__all__ = ["HeadingBankEkf", "SolutionSeparationEkf"]

@register("heading-bank")
class HeadingBankEkf(Row, solver=HeadingBank, model=Suitable):
    def __init__(
        self,
        *,
        above_deg: float = 15.0,
        spacing_deg: float = 20.0,
    ) -> None: ...

@register("solution-separation")
class SolutionSeparationEkf(Row, solver=SolutionSeparation, model=Suitable):
    version = 2
    def __init__(
        self,
        *,
        false_alarm: float = 1e-06,
        horizon: float = 300.0,
        horizon_without_imu: float = 60.0,
        recovery: float = 30.0,
        risk: float = 1e-05,
        fault_probability: float = 0.01,
    ) -> None: ...
