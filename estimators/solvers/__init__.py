"""How it is estimated: filters over any model."""
