# Of multiple_filters.py, for type checkers and editors. Do not edit: "python -m simnav.estimators.stubs" writes it.
import typing

from simnav.estimator import register
from simnav.estimators.adaptations.variational_bayes import VariationalBayes
from simnav.estimators.composition import Row
from simnav.estimators.models.doubted_instruments import DoubtedInstruments
from simnav.estimators.models.suitable import Suitable
from simnav.estimators.solvers.heading_bank import HeadingBank
from simnav.estimators.solvers.iterated import poor_heading
from simnav.estimators.solvers.mid_value import MidValueSelection
from simnav.estimators.solvers.multiple_hypothesis import MultipleHypothesis
from simnav.estimators.solvers.solution_separation import SolutionSeparation
from simnav.estimators.weightings.fault_isolation import FaultIsolation
from simnav.estimators.weightings.graduated_non_convexity import GraduatedNonConvexity

__all__ = ["HeadingBankEkf", "MidValue", "MultipleHypothesisEkf", "SolutionSeparationEkf"]

@register("heading-bank")
class HeadingBankEkf(Row, solver=HeadingBank, model=Suitable):
    version = 2
    def __init__(
        self,
        *,
        above_deg: float = 15.0,
        spacing_deg: float = 20.0,
    ) -> None: ...

@register("solution-separation")
class SolutionSeparationEkf(Row, solver=SolutionSeparation, model=Suitable):
    version = 5
    advised_against = True
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

@register("mid-value")
class MidValue(
    Row,
    solver=MidValueSelection,
    model=Suitable,
    adaptation=VariationalBayes,
    weighting=GraduatedNonConvexity,
    isolation=FaultIsolation,
    iteration=poor_heading,
):
    version = 7
    def __init__(
        self,
        *,
        forgetting: float = 0.902,
        prior: float = 4.63,
        adaptation__iterations: int = 2,
        lowest: float = 1.0,
        highest: float = 63.1,
        scope: typing.Literal["fixes", "all"] = "all",
        cost: typing.Literal["tls", "gm"] = "tls",
        growth: float = 3.0,
        efficiency: float = 0.95,
        smallest: float = 0.001,
        together: int = 3,
        recent: float = 5.0,
        sound: float = 0.999,
        iterate_above_deg: float | None = None,
        window: int = 20,
        tolerance: float = 0.05,
        solver__iterations: int = 15,
        spacing: float = 0.5,
    ) -> None: ...

@register("mh-ekf")
class MultipleHypothesisEkf(Row, solver=MultipleHypothesis, model=DoubtedInstruments):
    version = 6
    def __init__(
        self,
        *,
        period: float = 5.0,
        onset: float = 2000.0,
        end: float = 100.0,
        filters: int = 6,
    ) -> None: ...
