"""A door for filters of filterpy; it is in `simnav.estimators.solvers.filterpy_adapter`."""

from simnav.estimators.solvers.filterpy_adapter import FilterpyEstimator

__all__ = ["FilterpyEstimator"]
