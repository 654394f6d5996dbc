"""Carlson's federated filter over the inertial model."""

from simnav.estimator import register
from simnav.estimators.composition import Row, piece
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.solvers.federated import FederatedEstimator

__all__ = ["Federated", "FederatedNoReset"]


@register("federated")
class Federated(Row, solver=piece(FederatedEstimator, reset_locals=True), model=InertialModel):
    """Federated Kalman filter: a local filter for each aiding sensor, fused and reset when the slowest has delivered.

    Every measurement is used, at its own time, in its local filter.

    Do not use it from a poorly known heading. All local filters are linearised about one reference, which is corrected
    at fusions only, and no measurement is linearised again. On ``poor-heading`` it has 2.0 times the error of ``ekf``
    in the geometric mean of 8 runs, and 30 times at most, with the status ok (``simnav evaluate federated --scenario
    poor-heading --runs 8 --seed 20 --against ekf``); ``iekf`` and ``heading-bank`` are for such starts.

    Do not use it beside an IMU that is poorer than its datasheet, either: between two fusions a wrong reference is not
    corrected. On 9 of 44 voyages of ``training-poor-imu`` (from seed 87000 on) it had more than 1.5 times the error
    of ``ekf``, 4.9 times at most, 9 times on voyage 85006, and 2.0 times on
    ``uuv-surface``, whose accelerometers are disturbed (``simnav evaluate federated --scenario uuv-surface --runs 1
    --seed 5000 --against ekf``).

    Source: N. A. Carlson, *Federated square root filter for decentralized parallel processes*, IEEE Trans. Aerospace
    and Electronic Systems 26(3), 1990.

    Versions
    --------
    2
        It is inconsistent, too, while fixes that it sets aside contradict it (`FixTest`).
    3
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 3


@register("federated-no-reset")
class FederatedNoReset(Row, solver=piece(FederatedEstimator, reset_locals=False), model=InertialModel):
    """Federated Kalman filter whose local filters are never told what the others saw.

    It does not notice that it is lost from a poorly known heading (``python -m tests.audit silence`` counts such runs).

    Its covariance is an upper bound, not the error's: conservative where the sensors differ. Source: N. A. Carlson,
    *Federated square root filter for decentralized parallel processes*, IEEE Trans. Aerospace and Electronic Systems
    26(3), 1990.

    Do not use it beside an IMU that is poorer than its datasheet: 39 of 198 voyages (``training-poor-imu``, seeds
    70000 to 70199) had more than 1.5 times the error of ``ekf``, 15.5 times at most (70021), or ended early (2).

    Versions
    --------
    2
        It is inconsistent, too, while fixes that it sets aside contradict it (`FixTest`).
    3
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 3
