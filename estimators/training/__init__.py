"""Training of what an adaptation learns from recordings."""
