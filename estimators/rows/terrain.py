"""Navigation by the bottom: soundings matched with a chart of depths."""

from simnav.estimator import register
from simnav.estimators.composition import Row
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.solvers.terrain_point_mass import TerrainPointMass

__all__ = ["TerrainPmf"]


@register("terrain-pmf")
class TerrainPmf(Row, solver=TerrainPointMass, model=InertialModel):
    """Point-mass filter over the horizontal position by soundings and a chart; the other states by the EKF.

    It needs an IMU and an altimeter or a multibeam echo sounder. ``ekf`` uses the same readings with the slope of the
    chart at its estimate, and loses itself where its position is more uncertain than the relief is long.

    Source: N. Bergman, L. Ljung and F. Gustafsson, *Terrain navigation using Bayesian statistics*, IEEE Control Systems
    Magazine 19(3), 1999; J. Dunik, M. Sotak, M. Vesely, O. Straka and W. Hawkinson, *Design of Rao-Blackwellized
    point-mass filter with application in terrain aided navigation*, IEEE Transactions on Aerospace and Electronic
    Systems 55(1), 2019.

    Versions
    --------
    2
        The lattice is refined where it is coarser than the density. Over a nearly flat bottom the density came to stand
        on one node, and the filter ended with an error.
    3
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 3
