"""Results: what one estimator did in one run, the folder that keeps them, and files for other programs."""
