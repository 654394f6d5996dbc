"""The reference estimators: models, solvers and adaptations, and the rows that combine them.

Importing the package registers the rows; compiled code and large libraries load when an estimator first runs.
"""

from estimators.dead_reckoning import DeadReckoning
from estimators.ekf import Ekf
from estimators.ekf_presets import Ekf9, Ekf23
from estimators.gnss_only import GnssOnly
from estimators.inertial import PureInertial
from estimators.invariant import InvariantEkf
from estimators.iterated import IteratedEkf
from estimators.kf import Kf, Kf23
from estimators.oracle import Oracle
from estimators.ship_ekf import ShipEkf

__all__ = [
    "DeadReckoning",
    "Ekf",
    "Ekf9",
    "Ekf23",
    "GnssOnly",
    "InvariantEkf",
    "IteratedEkf",
    "Kf",
    "Kf23",
    "Oracle",
    "PureInertial",
    "ShipEkf",
]
