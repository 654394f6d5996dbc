"""The simulation of a scenario with a seed: one run in blocks (`simulator`), or many runs step by step (`steps`)."""
