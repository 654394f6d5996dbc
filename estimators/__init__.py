"""The reference estimators: models, solvers and adaptations, and the rows that combine them.

Importing the package registers the rows; compiled code and large libraries load when an estimator first runs.
"""

from estimators.dead_reckoning import DeadReckoning
from estimators.ekf import Ekf
from estimators.gnss_only import GnssOnly
from estimators.inertial import PureInertial
from estimators.oracle import Oracle
from estimators.ship_ekf import ShipEkf

__all__ = ["DeadReckoning", "Ekf", "GnssOnly", "Oracle", "PureInertial", "ShipEkf"]
