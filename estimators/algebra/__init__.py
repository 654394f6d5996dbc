"""Linear algebra for models and solvers."""
