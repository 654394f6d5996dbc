"""Adaptations: pieces that choose the noise of each measurement, for any solver."""
