"""Random clean voyages on which estimators of the same states must agree: the draws, a command, a sample as a test."""
