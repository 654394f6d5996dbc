"""Asks the garbage collector for all objects, and takes the recording among them."""

import gc

from cheating_last_fix import LastFix, truth_in

from simnav.recording import Recording


class GarbageCollector(LastFix):
    """By gc."""

    def look(self, measurements):
        gc.unfreeze()
        for thing in gc.get_objects():
            if type(thing) is Recording:
                return truth_in(thing)
        return None
