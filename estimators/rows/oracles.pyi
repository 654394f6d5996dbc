# Of oracles.py, for type checkers and editors. Do not edit: "python -m simnav.estimators.stubs" writes it.

from simnav.estimator import register
from simnav.estimators.adaptations.truth import FaultTimes, MixtureNoise, NominalNoise, TrueNoise
from simnav.estimators.composition import Row, piece
from simnav.estimators.solvers.oracle import OracleEstimator
from simnav.estimators.solvers.smoother import Smoother

__all__ = ["Oracle", "OracleClairvoyant", "OracleMixture", "OracleRts", "OracleTimes"]

@register("oracle")
class Oracle(Row, solver=piece(OracleEstimator, restore=False), adaptation=TrueNoise):
    version = 3
    def __init__(self) -> None: ...

@register("oracle-clairvoyant")
class OracleClairvoyant(Row, solver=piece(OracleEstimator, restore=True), adaptation=NominalNoise):
    version = 3
    def __init__(self) -> None: ...

@register("oracle-rts")
class OracleRts(Oracle, smoother=Smoother):
    version = 3
    def __init__(self) -> None: ...

@register("oracle-mixture")
class OracleMixture(Oracle, adaptation=MixtureNoise):
    version = 3
    def __init__(self) -> None: ...

@register("oracle-times")
class OracleTimes(Oracle, adaptation=FaultTimes):
    version = 3
    def __init__(self) -> None: ...
