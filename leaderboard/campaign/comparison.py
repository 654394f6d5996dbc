"""A stored result beside the same run, repeated: in what they differ, and what the repetition cannot decide.

All that decides a result or describes its run is compared: key, digests, status, note, draws, parameters, and every
score. Bits of scores are the same on the same processor with the same versions. Times and memory are those of another
machine, or of a busier one: only what no machine explains counts as different.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from statistics import median
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from simnav.leaderboard.results.impossible import impossible
from simnav.leaderboard.results.provenance import distinct, is_commit
from simnav.leaderboard.results.versions import is_declared
from simnav.scoring import SCORES

from .own_scores import same_code, scoring_code

if TYPE_CHECKING:
    from simnav.leaderboard.results.provenance import Provenance
    from simnav.leaderboard.results.result import Result

__all__ = [
    "CLAIMED",
    "CLOSE",
    "Claims",
    "Comparison",
    "claims",
    "compared",
    "differing",
    "listed",
    "proven",
    "too_quick",
]

#: Relative difference of a score that was computed from a trial in single precision.
CLOSE = 1e-6

#: A time below this part of the repeated one, or memory, is not that of the run.
_PART = 0.01
#: The same for the median over the runs of a row.
_PART_OF_ROW = 0.1
#: A run that ends here in this part of a limit does not exceed it elsewhere.
_LIMIT = 0.25
#: What of a provenance says where a run was made, and cannot be seen in what came out.
_NOT_REPEATED = ("commit", "dirty", "cpu", "system", "confinement")
_VERSIONS = ("simnav", "python", "numpy", "numba", "gtsam", "scipy", "filterpy")
_LATER = ("scipy", "filterpy")  # which results of older formats do not say
#: What says that a run was made by the code that repeats it: by declared versions, or by digests of code. Versions do
#: not change with a wording or a comment, so results of an older commit hold.
_VERSIONED = ("simulator_version", "estimator_version")
_BY_DIGEST = ("scenario_digest", "estimator_digest", "simnav")
#: What a repetition proves of a run, and what of a result nobody can prove who was not there.
_PROVEN = "status, note, parameters, draws and scores of the runs that were repeated, and the versions"
CLAIMED = ("commit", "dirty", "cpu", "system", "confinement", "cores", "date", "seconds", "peak_memory")
_MACHINE = ("timeout", "out-of-memory", "no-recording")


class Comparison(NamedTuple):
    """Scores that differ, each with both values in words, and those that are not known here."""

    close: list[str]
    different: list[str]
    unknown: list[str]


def compared(stored: Result, again: Result, close: float = CLOSE) -> Comparison:
    """Compare scores to the bit, wall times aside; NaN is equal to NaN.

    What was stored in single precision (`simnav.leaderboard.results.packing`) is compared with the rounded score. A
    score that came to simnav after the results, or by a plug-in, need not be in them.
    """
    found = Comparison([], [], [])
    homes = same_code(stored.scoring, scoring_code())
    for name in dict.fromkeys((*stored.scores, *again.scores)):
        if name.startswith("update_") and name in stored.scores and name in again.scores:
            continue
        if name not in stored.scores:
            if name in SCORES and SCORES[name].__module__ in homes:
                found.different.append(f"{name} is missing")
        elif name not in again.scores:
            found.unknown.append(name)
        else:
            a, b = float(stored.scores[name]), float(again.scores[name])
            if a.hex() in (b.hex(), float(np.float32(b)).hex()):
                continue
            words = f"{name} {a:.9g} is stored, {b:.9g} came out"
            (found.close if abs(a - b) <= close * max(abs(a), abs(b)) else found.different).append(words)
    return found


def differing(stored: Result, again: Result) -> tuple[list[str], list[str]]:
    """In what a result differs from its repetition, scores aside.

    Returns
    -------
    different : list of str
        What is stored is not what came out.
    undecided : list of str
        What another machine or another version may explain; the run is not confirmed.
    """
    different, undecided = list[str](), list[str]()
    for name in (*(_VERSIONED if is_declared(stored.recording) else _BY_DIGEST), "parameters", "reference"):
        _unequal(different, name, getattr(stored, name), getattr(again, name))
    if again.learned and not stored.learned:
        undecided.append(
            "the results do not say what the row learned from; they are of an older format, or were changed"
        )
    else:
        _unequal(different, "learned", _flat(stored.learned), _flat(again.learned))
    if stored.status != again.status:
        (undecided if _explained(stored, again) else different).append(
            f"{stored.status} is stored, {again.status} came out{f' ({again.reason:.200})' if again.reason else ''}"
        )
        return different, undecided
    _unequal(different, "note", stored.note, again.note)
    if stored.draws:  # in packed results they stand with one estimator of a run only
        _unequal(different, "draws", dict(stored.draws), dict(again.draws))
    if again.tried and again.seconds > 0.0:
        for name in ("seconds", "peak_memory"):
            a, b = getattr(stored, name), getattr(again, name)
            if a < _PART * b:
                different.append(f"{name} {a:.3g} is stored, {b:.3g} came out")
    for name, value in again.scores.items():
        if name.startswith("update_") and stored.scores.get(name, math.nan) < _PART * value:
            different.append(f"{name} {stored.scores[name]:.3g} s is stored, {value:.3g} s came out")
    homes = same_code(stored.scoring, scoring_code())
    for name in again.scores:
        own = name in SCORES and SCORES[name].__module__.startswith("simnav.")
        if own and name not in stored.scores and SCORES[name].__module__ not in homes:
            undecided.append(
                f"{name} is missing, and the results were scored with other code: 'simnav campaign rescore' adds it"
            )
    return different, undecided


def _unequal(found: list[str], name: str, stored: Any, again: Any) -> None:
    if stored != again:
        found.append(f"{name} {_short(stored)} is stored, {_short(again)} came out")


def _flat(value: Mapping[str, Any]) -> str:
    return json.dumps(dict(value), sort_keys=True, default=str)


def _short(value: object) -> str:
    text = str(value) if isinstance(value, (str, int, float)) else repr(value)
    return repr(text) if len(text) <= 60 else repr(f"{text[:50]}...")


def _explained(stored: Result, again: Result) -> bool:
    """Whether a status may be that of another machine: slower, or with less memory."""
    if stored.status == "timeout":
        return again.seconds >= _LIMIT * stored.time_limit > 0.0
    if stored.status == "out-of-memory":
        return again.peak_memory >= _LIMIT * stored.memory_limit > 0.0
    return stored.status != "no-recording" and again.status in _MACHINE


def too_quick(pairs: Iterable[tuple[Result, Result]]) -> list[str]:
    """Rows whose times are, in the median over the runs that were repeated, far below those that came out."""
    ratios: dict[str, list[float]] = {}
    for stored, again in pairs:
        a, b = stored.scores.get("update_median", math.nan), again.scores.get("update_median", math.nan)
        if stored.status == again.status and b > 0.0 and a >= 0.0:
            ratios.setdefault(stored.estimator, []).append(a / b)
    return [
        f"{row}: the times per epoch are {median(found):.2g} of those that came out, in the median of {len(found)} runs"
        for row, found in sorted(ratios.items())
        if median(found) < _PART_OF_ROW
    ]


class Claims(NamedTuple):
    """What results say of where they were made, beside where they were repeated.

    Attributes
    ----------
    different : list of str
        Versions that are not those of the repetition; values that cannot exist; commits that are not in the history.
    unconfirmed : list of str
        Commit, processor, system and confinement that are not those of the repetition. The address of a result says
        that the code is the same; the rest nobody can confirm elsewhere.
    fields : list of str
        Names of the fields in ``unconfirmed``, each once.
    """

    different: list[str]
    unconfirmed: list[str]
    fields: list[str]


def claims(results: Sequence[Result], here: Provenance, required: Iterable[str] = ()) -> Claims:
    """Compare the provenance of results with that of their repetition.

    Parameters
    ----------
    results : sequence of Result
        All of a folder or a bundle.
    here : Provenance
        Of the repetition.
    required : iterable of str
        What a bundle requires; a version that it excludes cannot be that of its results.
    """
    found = Claims([], [], [])
    wanted = list(required)
    for made in distinct(r.provenance for r in results):
        found.different.extend(text for text in impossible(made, wanted) if text not in found.different)
    for name in (*_VERSIONS, *_NOT_REPEATED):
        counts: dict[Any, int] = {}
        for result in results:
            value = getattr(result.provenance, name)
            if name != "confinement" or (result.tried and not result.reference):
                counts[value] = counts.get(value, 0) + 1
        mine = getattr(here, name)
        for value, count in sorted(counts.items(), key=lambda item: str(item[0])):
            words = f"{name} {_short(value)} is stored with {count} results, {_short(mine)} is here"
            if value == mine or (name == "python" and _minor(value) == _minor(mine)):
                continue
            if name == "commit" and value and here.commit and not is_commit(value):
                found.different.append(f"{words}, and no such commit is in the history here")
            elif name in _NOT_REPEATED or (name in _LATER and not value):
                found.unconfirmed.append(words)
                found.fields.extend([] if name in found.fields else [name])
            else:
                found.different.append(words)
    return found


def proven(repeated: int, fields: Sequence[str]) -> str:
    """What a repetition proves and what is only claimed, in one sentence.

    Parameters
    ----------
    repeated : int
        Runs that were repeated and hold.
    fields : sequence of str
        Fields that differ from those of the repetition.

    Examples
    --------
    >>> proven(0, [])
    'nothing is proven, for no run was repeated that holds'
    """
    if not repeated:
        return "nothing is proven, for no run was repeated that holds"
    other = f", of which {', '.join(fields)} differ from here" if fields else ""
    return f"proven: {_PROVEN}, {repeated} in all; only claimed: {', '.join(CLAIMED)}{other}"


def _minor(version: str) -> str:
    return ".".join(version.split(".")[:2])


def listed(scores: Sequence[str]) -> str:
    """The first three of them, and how many more there are."""
    more = f"; and {len(scores) - 3} more" if len(scores) > 3 else ""
    return "; ".join(scores[:3]) + more
