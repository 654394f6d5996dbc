"""Looks at the frames of all threads from a thread of its own."""

import sys
import threading

from cheating_last_fix import LastFix, truth_in


class CurrentFrames(LastFix):
    """By sys._current_frames."""

    def look(self, measurements):
        found = []

        def search():
            for frame in sys._current_frames().values():
                while frame is not None:
                    found.extend(t for v in list(frame.f_locals.values()) if (t := truth_in(v)) is not None)
                    frame = frame.f_back

        thread = threading.Thread(target=search)
        thread.start()
        thread.join()
        return found[0] if found else None
