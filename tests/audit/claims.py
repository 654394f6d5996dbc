"""How often a claim of a paper is judged wrongly, over all looks, and how many runs a judgement takes.

Under the null the mean of the logarithms of the ratios lies exactly on the limit of the claim, so that each decision is
wrong. The logarithms are normal, skewed, or those of the stored judgements, made equal to the limit and drawn with
replacement. Nothing is simulated.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from functools import cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simnav.leaderboard.papers.claims.declared import claims
from simnav.leaderboard.papers.claims.looks import LEVEL, deciding_interval, looks
from simnav.leaderboard.papers.claims.search import TRIES
from simnav.leaderboard.papers.claims.stored import read
from simnav.leaderboard.ranking.statistics import share

__all__ = ["judged", "parts", "rows"]

Array = NDArray[np.float64]
Draw = Callable[[np.random.Generator, int], Array]

FIRST, JUDGEMENTS = 12, 2000
_ENOUGH = 48  # runs of a stored judgement, so that its shape is known


def _normal(rng: np.random.Generator, n: int) -> Array:
    return rng.standard_normal(n)


def _skewed(rng: np.random.Generator, n: int) -> Array:
    """Skewness 1, about that of the most skewed of the stored judgements."""
    return 0.5 * (rng.gamma(4.0, size=n) - 4.0)


def _exponential(rng: np.random.Generator, n: int) -> Array:
    """Skewness 2."""
    return rng.exponential(size=n) - 1.0


def _stored(rng: np.random.Generator, n: int) -> Array:
    """The scatter of one of the stored judgements."""
    shapes = _shapes()
    return rng.choice(shapes[int(rng.integers(len(shapes)))], n)


@cache
def _shapes() -> list[Array]:
    """Logarithms of the ratios of each stored judgement with enough runs, with mean 0 and standard deviation 1."""
    found = []
    for claim in claims():
        answer = read(claim.name)
        if answer is None:
            continue
        for judged in (answer.ours, *(p for d in answer.dials for p in d.tried)):
            if len(judged.ratios) >= _ENOUGH:
                logs = np.log(judged.ratios)
                if logs.std() > 0.0:
                    found.append((logs - logs.mean()) / logs.std())
    return found


SHAPES: Mapping[str, Draw] = {
    "normal": _normal, "skewness 1": _skewed, "skewness 2": _exponential, "stored judgements": _stored
}  # fmt: skip


def judged(draw: Draw, *, gain: float, tries: int, judgements: int = JUDGEMENTS, seed: int = 0) -> dict[str, float]:
    """How judgements end: shares of those that hold and that do not hold, and the mean number of runs.

    Parameters
    ----------
    draw : callable
        Logarithms of ratios with mean 0 and standard deviation 1.
    gain : float
        By how many standard deviations of a run the mean lies below the limit; 0: on the limit.
    tries : int
        1: our settings. More: values of a dial that share its level; the first that holds ends the search.
    """
    rng = np.random.default_rng(seed)
    ends = {"holds": 0, "does not hold": 0}
    runs = 0
    for _ in range(judgements):
        for _ in range(tries):
            logs = draw(rng, looks(FIRST)[-1]) - gain
            end, count = _judged(logs, LEVEL / tries)
            runs += count
            if end:
                ends[end] += 1
            if end == "holds":
                break
    return {name: n / judgements for name, n in ends.items()} | {"runs": runs / judgements}


def _judged(logs: Array, level: float) -> tuple[str, int]:
    for count in looks(FIRST):
        found = deciding_interval(np.exp(logs[:count]).tolist(), FIRST, level)
        if found.high <= 1.0:
            return "holds", count
        if found.low > 1.0:
            return "does not hold", count
    return "", count


_GAINS = (0.125, 0.25, 0.5, 1.0, 2.0)


def parts() -> Mapping[str, Callable[[], Any]]:
    """What is measured, by name."""
    found: dict[str, Callable[[], Any]] = {}
    for name, draw in SHAPES.items():
        found[f"ours-{name}"] = partial(judged, draw, gain=0.0, tries=1)
        found[f"dial-{name}"] = partial(judged, draw, gain=0.0, tries=TRIES)
    return found | {f"gain-{g}": partial(judged, _stored, gain=g, tries=1, judgements=500) for g in _GAINS}


def rows(found: Mapping[str, Any]) -> Iterator[tuple[str, str, str, bool]]:
    """What is measured, its figure, what is promised, and whether that is kept."""
    for name in SHAPES:
        for part, title in (("ours", "our settings"), ("dial", f"a dial, {TRIES} values")):
            one = found[f"{part}-{name}"]
            wrong = share(round((one["holds"] + one["does not hold"]) * JUDGEMENTS), JUDGEMENTS)
            figure = f"{100.0 * wrong.value:.1f} % [{100.0 * wrong.low:.1f}, {100.0 * wrong.high:.1f}]"
            yield f"claim on the limit, {name}: {title}, judged wrongly", figure, "at most 5 %", wrong.low <= LEVEL
    for g in _GAINS:
        one = found[f"gain-{g}"]
        assert math.isfinite(one["runs"])
        figure = f"{100.0 * one['holds']:.0f} %, {one['runs']:.0f} runs"
        yield f"claim {g:g} standard deviations beyond the limit: found", figure, "", True
