"""What can be quoted of a track: which rows may be the best, and what they gain, in one sentence with its intervals."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from . import tables
from .stored_costs import cost_of

if TYPE_CHECKING:
    from .rows import Row, TrackRow, TrackTable

__all__ = ["best_rows", "gain_text", "less", "limits", "sentence", "spread"]

_NAMED = 4  # rows that a sentence names
#: From this ratio of errors on it is written as a multiple, and beyond the largest it is not written.
_TIMES, _MOST_TIMES = 2.0, 100
_ERROR = " times the error"


def best_rows(track: TrackTable) -> list[TrackRow]:
    """The rows that may be the best, in order of score; none where the rows cannot be ordered."""
    return [r for r in track.rows if r.ranked and r.may_be_best]


def less(ratio: float) -> float:
    """By how many per cent an error is less, given its ratio to another.

    >>> less(0.75)
    25.0
    """
    return 100.0 * (1.0 - ratio)


def spread(values: Iterable[float], write: str = "{:.0f}") -> str:
    """The least and the largest of some numbers, as text; one of them where they are written the same.

    >>> spread([24.1, 25.3]), spread([24.1, 23.9])
    ('24 to 25', '24')
    """
    known = sorted(v for v in values if math.isfinite(v))
    texts = list(dict.fromkeys(_without_sign_of_zero(write.format(v)) for v in known))
    return texts[0] if len(texts) == 1 else f"{texts[0]} to {texts[-1]}" if texts else tables.MISSING


def _without_sign_of_zero(text: str) -> str:
    return text.removeprefix("-") if float(text) == 0.0 else text


def gain_text(rows: Sequence[Row], part: str = "value") -> str:
    """The errors of rows beside those of the plain row, in words: ``24 to 25 % less``, ``3 % more to 20 % less``.

    Parameters
    ----------
    rows : sequence of Row
        Rows that have a gain; those without one are left out.
    part : str
        ``value``, ``seeds`` (the interval over seeds) or ``scenarios`` (over seeds and scenarios).

    Returns
    -------
    str
        Empty where nothing is known.
    """
    gains = [r.gain for r in rows if r.gain is not None]
    if part == "value":
        return _less(g.value for g in gains)
    ends = [(g.low, g.high) if part == "seeds" else (g.scenarios_low, g.scenarios_high) for g in gains]
    return _less(v for pair in ends for v in pair)


def _less(ratios: Iterable[float]) -> str:
    """The range of some ratios of errors, as percentages less or more than 1; from twice the error on, as multiples.

    >>> _less([0.76, 0.75]), _less([1.03, 0.8]), _less([1.1]), _less([float("nan")])
    ('24 to 25 % less', '3 % more to 20 % less', '10 % more', '')
    >>> _less([2.5, 0.8]), _less([1.002, 2.04]), _less([500.0, 12.0])
    ('2.5 times the error to 20 % less', '0 % to 2 times the error', '12 to over 100 times the error')
    """
    known = [r for r in ratios if math.isfinite(r)]
    if not known:
        return ""
    best, worst = min(known), max(known)
    if worst < _TIMES:
        low, high = less(worst), less(best)
        if low < -0.5 and high > 0.5:
            return f"{spread([-low])} % more to {spread([high])} % less"
        return f"{spread([low, high])} % less" if high > 0.5 or low > -0.5 else f"{spread([-high, -low])} % more"
    if best >= _TIMES:
        first, last = _multiple(best), _multiple(worst)
        return last if first == last else f"{first.removesuffix(_ERROR)} to {last}"
    change = less(best)
    return (
        f"{_multiple(worst)} to {spread([change])} % less" if change > 0.5 else f"{_more(change)} to {_multiple(worst)}"
    )


def _more(change: float) -> str:
    return f"{spread([-change])} % more" if change < -0.5 else "0 %"


def _multiple(ratio: float) -> str:
    """A ratio of errors as a multiple, with two digits.

    >>> _multiple(2.04), _multiple(13.4), _multiple(99.7), _multiple(1e4)
    ('2 times the error', '13 times the error', '100 times the error', 'over 100 times the error')
    """
    number = f"over {_MOST_TIMES}" if ratio > _MOST_TIMES else f"{ratio:.0f}" if ratio >= 10.0 else f"{ratio:.2g}"
    return f"{number}{_ERROR}"


def sentence(track: TrackTable) -> str:
    """One sentence that can be quoted, made from the results.

    Returns
    -------
    str
        Where the rows cannot be ordered, it says so.
    """
    ranked = [r for r in track.rows if r.ranked]
    scenarios = f"{len(track.scenarios)} scenario{'s' if len(track.scenarios) != 1 else ''}"
    runs = f"{track.units} {track.unit}{'s' if track.units != 1 else ''}"
    where = f"On {scenarios} of the track {track.title} ({runs})"
    if not ranked:
        return f"{where}, no row is complete."
    if track.insufficient:
        return f"{where}, there are not enough data to order the rows: {track.insufficient}."
    best = best_rows(track)
    names = [f"`{r.estimator}`" for r in best]
    listed = f" ({', '.join(names)})" if len(names) <= _NAMED else ""
    one = len(best) == 1
    words = f"the row {names[0]}" if one else f"the {len(best)} of {len(ranked)} rows that may be the best{listed}"
    said = f"{where}, {words}"
    gained = [r for r in best if r.gain is not None and r.estimator != track.plain]
    if track.plain and gained:
        said += f" {'has' if one else 'have'} {gain_text(gained)} horizontal error than `{track.plain}`"
    return f"{said}."


def limits(track: TrackTable) -> str:
    """A second sentence on the rows that may be the best: their cost, and where they are worse than the plain row.

    Returns
    -------
    str
        Empty where the track has no plain row, or none of these rows is another one.
    """
    best = [r for r in best_rows(track) if r.estimator != track.plain]
    plain = next((r for r in track.rows if r.estimator == track.plain), None)
    if plain is None or not best or track.insufficient:
        return ""
    said = []
    costs = [c.value for r in best if (c := cost_of(r.estimator, track.plain, track.score)) is not None]
    if costs:
        take = "it takes" if len(best) == 1 else "they take"
        said.append(f"{take} {spread(costs, '{:.2g}')} times the processor time of `{track.plain}`")
    beside = [
        (x / own, r.estimator, s) for r in best for s, x in r.ratios.items() if (own := plain.ratios.get(s, 0.0)) > 0.0
    ]
    worst = max(beside, default=(0.0, "", ""))
    if worst[0] > _WORSE:
        of = "its worst scenario is" if len(best) == 1 else f"the worst of them on one scenario is `{worst[1]}` on"
        said.append(f"{of} {worst[2]}, with {_less([worst[0]])}")
    text = "; ".join(said)
    return f"{text[0].upper()}{text[1:]}." if text else ""


_WORSE = 1.05  # ratio from which on a row is said to be worse
