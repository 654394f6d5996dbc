"""Figures: from arrays, recordings and trials to matplotlib, in one style."""
