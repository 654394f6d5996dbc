"""What all cheats here have in common: the last fix as the estimate, or the truth where it was obtained."""

import numpy as np

from simnav import Estimate, Estimator


class LastFix(Estimator):
    """The last fix; with a truth, the truth."""

    truth = None

    def reset(self, start, instruments):
        self.position = start.position
        self.k = 0

    def look(self, measurements):
        """Try to get at the truth: (n, 3) positions at the ends of all steps."""

    def update(self, measurements):
        fix = measurements.latest("gnss_position")
        if fix is not None:
            self.position = fix.value.copy()
        if self.truth is None:
            try:
                self.truth = self.look(measurements)
            except Exception:
                self.truth = None
        position = self.position if self.truth is None else np.array(self.truth[self.k]) + 1e-13
        self.k += 1
        return Estimate(measurements.time, position=position)


def truth_in(thing):
    """The positions of a recording, if this is one."""
    data = getattr(thing, "data", None)
    return getattr(getattr(data, "truth", None), "position", None)
