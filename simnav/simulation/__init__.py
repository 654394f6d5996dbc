"""Scenario and seed to a run: in blocks (`simulator`), or many runs step by step (`steps`)."""
