"""Training of adaptations from recordings."""
