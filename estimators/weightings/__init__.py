"""Weightings: the weight of each factor of a window."""
