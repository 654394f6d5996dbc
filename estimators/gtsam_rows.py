"""The rows ``gtsam-fixed-lag``, ``gtsam-isam2``, ``gtsam-batch`` and ``gtsam-gnc``: GTSAM as an independent reference.

They share our mechanization of the datasheets and our measurement models, and nothing else with the windows of
`simnav.estimators.solvers.window`: preintegration, linearisation, elimination and marginalisation are GTSAM's.
"""

from __future__ import annotations

from typing import Literal

from simnav.estimator import register
from simnav.estimators.solvers.gtsam_solvers import BatchEstimator, FixedLagEstimator, GncEstimator, Isam2Estimator

__all__ = ["GtsamBatch", "GtsamFixedLag", "GtsamGnc", "GtsamIsam2"]


@register("gtsam-fixed-lag")
class GtsamFixedLag(FixedLagEstimator):
    """GTSAM's incremental fixed-lag smoother over an IMU and whatever aids there are.

    15 states a node: biases, scale factor and misalignment of the aids count as white noise, the IMU's biases walk at
    random.

    Parameters
    ----------
    window : int
        Epochs (steps with measurements) that are kept; what is older is marginalised.
    threshold : float
        Scale of the updates at which a variable is linearised again; 1 is 5 mrad, 10 m, 0.05 m/s; 0: always.
    iterations : int
        Most updates of the solver in a step.
    """

    slow = True

    def __init__(self, window: int = 20, threshold: float = 1.0, iterations: int = 5):
        super().__init__(window, threshold, iterations)


@register("gtsam-isam2")
class GtsamIsam2(Isam2Estimator):
    """GTSAM's ISAM2 over the whole run; smoothed: its last estimate of all nodes.

    Parameters
    ----------
    threshold : float
        As for ``gtsam-fixed-lag``.
    iterations : int
        Most updates of the solver in a step.
    """

    slow = True

    def __init__(self, threshold: float = 1.0, iterations: int = 5):
        super().__init__(threshold, iterations)


@register("gtsam-batch")
class GtsamBatch(BatchEstimator):
    """In real time ``gtsam-fixed-lag``; smoothed: full-batch Levenberg-Marquardt over the same graph.

    Parameters
    ----------
    window, threshold, iterations
        As for ``gtsam-fixed-lag``.
    most : int
        Most iterations of the batch.
    """

    slow = True

    def __init__(self, window: int = 20, threshold: float = 1.0, iterations: int = 5, most: int = 50):
        super().__init__(window, threshold, iterations, most)


@register("gtsam-gnc")
class GtsamGnc(GncEstimator):
    """In real time ``gtsam-fixed-lag``; smoothed: full batch by graduated non-convexity, which leaves outliers out.

    Parameters
    ----------
    window, threshold, iterations, most
        As for ``gtsam-batch``.
    loss : {"tls", "gm"}
        Truncated least squares, or Geman and McClure.
    probability : float
        Of a good measurement to be taken for good.
    """

    slow = True

    def __init__(
        self,
        window: int = 20,
        threshold: float = 1.0,
        iterations: int = 5,
        most: int = 50,
        loss: Literal["tls", "gm"] = "tls",
        probability: float = 0.99,
    ):
        super().__init__(window, threshold, iterations, most, loss, probability)
