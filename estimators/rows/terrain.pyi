# Of terrain.py, for type checkers and editors. Do not edit: "python -m simnav.estimators.stubs" writes it.

from simnav.estimator import register
from simnav.estimators.composition import Row
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.solvers.terrain_point_mass import TerrainPointMass

__all__ = ["TerrainPmf"]

@register("terrain-pmf")
class TerrainPmf(Row, solver=TerrainPointMass, model=InertialModel):
    version = 3
    def __init__(
        self,
        *,
        calibrate: bool = True,
        nodes: int = 20000,
        outliers: float = 0.001,
    ) -> None: ...
