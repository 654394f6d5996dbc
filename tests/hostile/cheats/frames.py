"""Walks up the frames of its callers, and takes the recording that one of them holds."""

import sys

from cheating_last_fix import LastFix, truth_in


class Frames(LastFix):
    """By the caller's frames."""

    def look(self, measurements):
        frame = sys._getframe()
        while frame is not None:
            for value in list(frame.f_locals.values()):
                found = truth_in(value)
                if found is not None:
                    return found
            frame = frame.f_back
        return None
