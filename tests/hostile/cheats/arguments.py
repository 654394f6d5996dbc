"""Looks for scenario and seed among the arguments of the campaign, and simulates the run again."""

import gc
import os
import sys

from cheating_last_fix import LastFix, truth_in

from simnav.scenario import load
from simnav.source import record


class Arguments(LastFix):
    """By the campaign's arguments and a re-simulation."""

    def look(self, measurements):
        gc.unfreeze()
        for thing in gc.get_objects():
            if type(thing).__name__ == "Unit":
                return truth_in(record(thing.scenario, thing.seed))
        words = [*sys.orig_argv, *os.environ.values(), os.getcwd()]
        files = [word for word in words if word.endswith(".toml") and os.path.isfile(word)]
        return truth_in(record(load(files[0]), 0)) if files else None
