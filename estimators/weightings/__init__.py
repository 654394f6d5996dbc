"""How much each factor of a window counts."""
