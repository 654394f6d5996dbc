"""Solvers: the estimation algorithms, over any model."""
