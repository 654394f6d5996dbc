"""Models: states, error dynamics and measurement equations."""
