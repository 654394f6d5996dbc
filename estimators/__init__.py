"""The reference estimators: models, solvers, adaptations and weightings, and the rows that combine them.

Importing the package registers the rows; compiled code and large libraries load when an estimator first runs.
"""

from . import rows

__all__ = ["rows"]
