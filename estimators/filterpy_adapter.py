"""Adapter for filters of filterpy, from `simnav.estimators.solvers.filterpy_adapter`."""

from simnav.estimators.solvers.filterpy_adapter import FilterpyEstimator

__all__ = ["FilterpyEstimator"]
