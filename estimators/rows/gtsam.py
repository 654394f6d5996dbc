"""GTSAM as an independent reference, over an IMU and whatever aids have a compiled measurement equation.

These rows share our mechanization of the datasheets and our measurement models, and nothing else with the windows of
`simnav.estimators.solvers.window`: preintegration, linearisation, elimination and marginalisation are GTSAM's. A node
has 15 states: biases, scale factor and misalignment of the aids count as white noise, the IMU's biases walk at random.

They use the instruments with a compiled measurement equation (`simnav.kinds.EQUATIONS`). Those that a Python function
observes, with their blocks of states, are left out without a message: raw observations of satellites, beams, ranges to
beacons, instruments of plug-ins. Where these alone give a position, the scenario is unsuitable. In the tests
``tests/cases/gtsam_channels.py`` has GTSAM's smoother over satellites.
"""

from simnav.estimator import register
from simnav.estimators.composition import Row
from simnav.estimators.solvers.gtsam_solvers import BatchEstimator, FixedLagEstimator, GncEstimator, Isam2Estimator

__all__ = ["GtsamBatch", "GtsamFixedLag", "GtsamGnc", "GtsamIsam2"]


@register("gtsam-fixed-lag")
class GtsamFixedLag(Row, solver=FixedLagEstimator):
    """GTSAM's incremental fixed-lag smoother over an IMU and whatever aids have a compiled measurement equation.

    Raw observations of satellites and other readings that a Python function predicts are left out.

    Source: F. Dellaert and others, GTSAM 4.3.

    Versions
    --------
    2
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 2


@register("gtsam-isam2")
class GtsamIsam2(Row, solver=Isam2Estimator):
    """GTSAM's ISAM2 over the whole run; smoothed: its last estimate of all nodes.

    Source: M. Kaess et al., *iSAM2: incremental smoothing and mapping using the Bayes tree*, IJRR 31(2), 2012.

    Versions
    --------
    2
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 2


@register("gtsam-batch")
class GtsamBatch(Row, solver=BatchEstimator):
    """In real time ``gtsam-fixed-lag``; smoothed: full-batch Levenberg-Marquardt over the same graph.

    Source: F. Dellaert and others, GTSAM 4.3.

    Versions
    --------
    2
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 2

    real_time_as = "gtsam-fixed-lag"


@register("gtsam-gnc")
class GtsamGnc(Row, solver=GncEstimator):
    """In real time ``gtsam-fixed-lag``; smoothed: full batch by graduated non-convexity, which leaves outliers out.

    Source: H. Yang, P. Antonante, V. Tzoumas and L. Carlone, *Graduated non-convexity for robust spatial perception*,
    IEEE Robotics and Automation Letters 5(2), 2020.

    Versions
    --------
    2
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 2

    real_time_as = "gtsam-fixed-lag"
