"""Linear algebra that models and solvers share."""
