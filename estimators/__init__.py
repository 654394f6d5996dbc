"""The reference estimators: models, solvers and adaptations, and the rows that combine them.

Importing the package registers the rows; compiled code and large libraries load when an estimator first runs.
"""

from estimators.ekf import Ekf
from estimators.inertial import PureInertial
from estimators.ship_ekf import ShipEkf

__all__ = ["Ekf", "PureInertial", "ShipEkf"]
