"""What is estimated: state, error dynamics, measurement models."""
