"""Trained networks as plain arrays: their files, and the compiled steps by which an estimator asks them."""
