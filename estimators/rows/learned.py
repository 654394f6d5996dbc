"""Learned rows: a network as one piece of a filter or a window.

Each is ``ekf`` (``ship-ekf`` without an IMU) or the window of the robust rows, but for its network.
"""

from simnav.estimator import register
from simnav.estimators.adaptations.learned_noise import LearnedNoise
from simnav.estimators.composition import Row, piece
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.models.suitable import Suitable
from simnav.estimators.solvers.iterated import poor_heading
from simnav.estimators.solvers.kalman import KalmanEstimator
from simnav.estimators.solvers.missing_velocity import MissingVelocityEstimator, PredictedVelocity
from simnav.estimators.solvers.window import WindowEstimator
from simnav.estimators.weightings.fault_isolation import FaultIsolation
from simnav.estimators.weightings.learned_weights import LearnedWeights

__all__ = ["BeamsEkf", "BeamsEkf20000", "NetEkf", "NetEkf20000", "NetFgo", "NetFgo20000"]


@register("net-ekf")
class NetEkf(Row, solver=KalmanEstimator, model=Suitable, iteration=poor_heading, adaptation=LearnedNoise):
    """EKF whose measurement noise a recurrent network sets, from the innovations of all instruments.

    The network learned from 1000 voyages of six training families. In the standard result it has 0.69 times the error
    of ``ekf`` where fixes are noisy or jump, and 0.65 times with several faults at once on families that it never saw.
    Do not use it on ships without an IMU: it has 1.4 times the error of ``ship-ekf`` on ``random-ships``, and does not
    notice that it is lost. It also loses with a wrong start (``wrong-start``: 1.6 times the error of ``ekf``) and on a
    recorded drive (``car-kitti``: 1.2). Where nothing is wrong it costs up to 2 %.

    Source: ours (``estimators/training/noise_network.py``), in the manner of G. Revach, N. Shlezinger, X. Ni et al.,
    *KalmanNet: neural network aided Kalman filtering for partially known dynamics*, IEEE Trans. Signal Processing 70,
    2022, and of N. Cohen and I. Klein, *Adaptive Kalman-informed transformer*, 2025.

    Versions
    --------
    2
        The network learned anew: before, its target counted a noise step twice.
    3
        Innovations of a log that persist are taken as a wrong prediction, whatever its witnesses say, if they grew
        little by little: an instrument that begins to be wrong is wrong at once (`simnav.estimators.onset`).
    4
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 4


@register("net-fgo")
class NetFgo(
    Row,
    solver=piece(WindowEstimator, defaults={"tolerance": 0.05}, every_sample=False),
    model=Suitable,
    weighting=LearnedWeights,
    isolation=FaultIsolation,
):
    """Sliding window whose measurements a network weighs, from the residuals of the whole window.

    The network learned from 300 voyages of five training families. In the standard result it has 0.35 times the error
    of ``ekf`` where fixes lie slowly, 0.63 times with a wrong IMU, and 0.41 times with several faults at once on
    families that it never saw. It takes good measurements that contradict the window for faulty ones, and does not
    notice that it is lost: it has 2.7 times the error of ``ekf`` on ``wrong-start``, and 1.7 to 1.8 times that of
    ``ship-ekf`` on ships without an IMU (``fishing-vessel``, ``several-faults-ships``).

    Source: ours (``estimators/training/factor_network.py``).

    Versions
    --------
    2
        As version 4 of ``huber-fgo``.
        The network learned anew: before, its target counted a noise step twice.
    3
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 3


@register("beams-ekf")
class BeamsEkf(
    Row,
    solver=MissingVelocityEstimator,
    model=InertialModel,
    velocity=PredictedVelocity,
    iteration=poor_heading,
):
    """EKF that is told a velocity by a recurrent network while its DVL gives none.

    The network learned from 600 voyages of five training families, whose DVL was silenced for 5 to 120 s. Where the DVL
    and all fixes are silent it has 0.36 times the error of ``ekf`` with MEMS, and 0.88 to 0.98 times with other IMUs
    (``python -m tests.audit beams``). Most of that it would also have with the velocity held from the last readings:
    the network knows the velocity at most 13 % better, and 11 % worse where the IMU is noisier than its datasheet.
    Where fixes go on it gains nothing, and with a DVL that is heard it is ``ekf``. On one run of ``lawnmower-beams``,
    where some beams are left, it had 1.8 times the error of ``ekf``.

    Source: ours (``estimators/training/velocity_network.py``), in the manner of N. Cohen and I. Klein, *BeamsNet: a
    data-driven approach enhancing Doppler velocity log measurements for autonomous underwater vehicle navigation*,
    Engineering Applications of Artificial Intelligence 114, 2022.

    Versions
    --------
    2
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 2


@register("net-ekf-20000")
class NetEkf20000(NetEkf, adaptation=piece(LearnedNoise, budget=20_000)):
    """EKF whose measurement noise a recurrent network sets, which learned from 20 000 voyages.

    It is ``net-ekf`` with 20 times the training. In the standard result it has 0.32 times the error of ``ekf`` where
    fixes lie slowly (``net-ekf``: 0.59), and 0.55 with several faults at once (0.71). Do not use it outside the
    families of its training: it has 2.0 times the error of ``ekf`` on a recorded drive (``car-kitti``), 1.12 times on a
    recorded ship (``ship-nbp1406``), 1.8 times that of ``ship-ekf`` on ``coaster-compass``, and does not notice that it
    is lost.

    Source: as ``net-ekf``.

    Versions
    --------
    2
        As of ``iae``.
    3
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 3


@register("net-fgo-20000")
class NetFgo20000(NetFgo, weighting=piece(LearnedWeights, budget=20_000)):
    """Sliding window whose measurements a network weighs, which learned from 5000 voyages.

    It is ``net-fgo`` with 17 times the training. In the standard result it has 0.51 times the error of ``ekf`` with a
    wrong IMU (``net-fgo``: 0.63), and 0.31 where fixes lie slowly (0.35). Outside the families of its training it is
    the worse one: 0.40 on ``two-faults`` (0.13), 1.3 on ``harbour-multipath`` (0.47), 1.25 with a wrong datasheet
    (1.07). It does not notice that it is lost, as on ``wrong-start`` (2.1 times the error of ``ekf``).

    Source: as ``net-fgo``.

    Versions
    --------
    2
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 2


@register("beams-ekf-20000")
class BeamsEkf20000(BeamsEkf, velocity=piece(PredictedVelocity, budget=20_000)):
    """EKF that a recurrent network, which learned from 10 000 voyages, tells a velocity while its DVL gives none.

    It is ``beams-ekf`` with 17 times the training. Where the DVL and all fixes are silent it has 0.77 times the error
    of ``ekf``, as with 600 voyages (0.76) and with 60 (0.77); on 2 of 42 such voyages it has three to four times that
    of ``ekf``.

    Source: as ``beams-ekf``.

    Versions
    --------
    2
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 2
