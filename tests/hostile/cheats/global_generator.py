"""Finds the seed by the state of NumPy's global generator, and simulates the public scenario again."""

from pathlib import Path

import numpy as np
from cheating_last_fix import LastFix, truth_in

from simnav.scenario import load
from simnav.source import record


class GlobalGenerator(LastFix):
    """By NumPy's global generator."""

    def look(self, measurements):
        state = np.random.get_state()[1]  # noqa: NPY002
        for seed in range(100):
            if np.array_equal(np.random.RandomState(seed).get_state()[1], state):
                return truth_in(record(load(Path(__file__).parent / "scenario.toml"), seed))
        return None
