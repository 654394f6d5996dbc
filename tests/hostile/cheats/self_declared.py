"""Declares itself a reference, as an instance, and is told all."""

from cheating_last_fix import LastFix, truth_in


class SelfDeclared(LastFix):
    """By an instance that declares itself a reference."""

    told = None

    def __init__(self):
        self.reference = True

    def reveal(self, recording):
        self.told = truth_in(recording)

    def look(self, measurements):
        return self.told
