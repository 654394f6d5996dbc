"""Choosing the parameters of an estimator on training families, and nowhere else."""
