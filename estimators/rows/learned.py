"""Learned rows: a network as one piece of a filter or a window.

Each is ``ekf`` (``ship-ekf`` without an IMU) or the window of the robust rows, but for its network.
"""

from simnav.estimator import register
from simnav.estimators.adaptations.learned_noise import LearnedNoise
from simnav.estimators.composition import piece
from simnav.estimators.models.suitable import Suitable
from simnav.estimators.solvers.iterated import poor_heading
from simnav.estimators.solvers.kalman import KalmanEstimator
from simnav.estimators.solvers.window import WindowEstimator
from simnav.estimators.weightings.fault_isolation import FaultIsolation
from simnav.estimators.weightings.learned_weights import LearnedWeights

from .network_row import NetworkRow

__all__ = ["NetEkf", "NetFgo"]


@register("net-ekf")
class NetEkf(NetworkRow, solver=KalmanEstimator, model=Suitable, iteration=poor_heading, adaptation=LearnedNoise):
    """EKF whose measurement noise a recurrent network sets, from the innovations of all instruments.

    Source: ours (``estimators/training/noise_network.py``), in the manner of G. Revach, N. Shlezinger, X. Ni et al.,
    *KalmanNet: neural network aided Kalman filtering for partially known dynamics*, IEEE Trans. Signal Processing 70,
    2022, and of N. Cohen and I. Klein, *Adaptive Kalman-informed transformer*, 2025.
    """


@register("net-fgo")
class NetFgo(
    NetworkRow,
    solver=piece(WindowEstimator, defaults={"tolerance": 0.05}, every_sample=False),
    model=Suitable,
    weighting=LearnedWeights,
    isolation=FaultIsolation,
):
    """Sliding window whose measurements a network weighs, from the residuals of the whole window.

    Source: ours (``estimators/training/factor_network.py``).
    """
