"""Which results are taken from a folder or a bundle: they may be of others, who can write anything into a file.

A result that is not admitted is set aside where it is read, with one sentence, so that nothing later meets it. Checked
are the texts that become names of scenarios, estimators and files, and who may call itself what. Whether the numbers
are those of a run is another question, which `simnav campaign verify` answers by repeating runs.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from functools import lru_cache
from typing import TYPE_CHECKING

from simnav.estimator.registry import discover_own, is_own, is_own_reference, snapshot

if TYPE_CHECKING:
    from .result import Result

__all__ = ["LONGEST_LABEL", "STATUSES", "admitted", "fault_of", "is_scenario_id", "label_fault", "look",
           "lookalikes"]  # fmt: skip

#: Characters of the label of an estimator.
LONGEST_LABEL = 200

#: How a run can end.
STATUSES = frozenset(
    {"ok", "error", "diverged", "invalid-output", "timeout", "out-of-memory", "unsuitable", "no-recording"}
)

_SCENARIO = re.compile(r"(?=.{1,200}\Z)[a-z][a-z0-9]*(-[a-z0-9]+)*-v[1-9][0-9]{0,5}")
_KEY = re.compile(r"[A-Za-z0-9][A-Za-z0-9._+-]{0,200}-[0-9]{1,19}")  # the name of a file, too
_ENDS_AS_FILE = re.compile(r"\.(py|toml)(:\w*)?\Z")
_FILE = re.compile(r"\.(py|toml)(?![A-Za-z0-9_])")
_TEXTS = {"status": 40, "reason": 4000, "note": 1000, "recording": 200, "simnav": 200, "scoring": 200_000,
          "scenario_digest": 200, "estimator_digest": 200}  # fmt: skip
_ALIKE = str.maketrans("01i|", "olll")


def is_scenario_id(text: object) -> bool:
    """Whether a text is the versioned id of a scenario, and so neither a path nor anything else.

    Examples
    --------
    >>> is_scenario_id("coastal-voyage-v1"), is_scenario_id("others/evil.toml"), is_scenario_id("evil.toml")
    (True, False, False)
    """
    return isinstance(text, str) and _SCENARIO.fullmatch(text) is not None


def label_fault(label: object) -> str:
    """Why a text cannot be the label of an estimator; empty where it can.

    Examples
    --------
    >>> label_fault("sw-fgo(window=10)")
    ''
    >>> label_fault("\\u0435kf")
    'a label consists of printable ASCII characters'
    >>> label_fault("/tmp/other.py:Mine")
    'a label is no path and no file'
    """
    if not isinstance(label, str) or not label:
        return "a label is missing"
    if len(label) > LONGEST_LABEL:
        return f"a label has at most {LONGEST_LABEL} characters"
    if not (label.isascii() and label.isprintable()):
        return "a label consists of printable ASCII characters"
    if label != " ".join(label.split()):
        return "a label has no spaces at its ends, and no two in a row"
    base = _base(label)
    if "/" in base or "\\" in base or _FILE.search(base) or _ENDS_AS_FILE.search(label):
        return "a label is no path and no file"
    if not base[:1].isalnum():
        return "a label begins with a letter or a digit"
    return ""


def look(label: str) -> str:
    """What readers see of a label: equal for two that can be taken for one another.

    Upper and lower case, ``0`` and ``o``, ``1``, ``i`` and ``l``, ``rn`` and ``m``, and all separators look alike in
    the name. In the parameters, which are numbers, only case and spaces do not count.

    Examples
    --------
    >>> look("EKF") == look("ekf"), look("sw_fgo") == look("sw-fgo"), look("my-fi1ter") == look("my-filter")
    (True, True, True)
    >>> look("ekf(gate=1)") == look("ekf(gate=l)"), look("ekf( Gate=1 )") == look("ekf(gate=1)")
    (False, True)
    """
    base = _base(label)
    rest = label[len(base) :].casefold().replace(" ", "")
    name = re.sub(r"[^a-z0-9|]+", "-", base.casefold()).strip("-").translate(_ALIKE)
    return name.replace("rn", "m").replace("vv", "w") + rest


def _base(label: str) -> str:
    return label.partition("(")[0]


@lru_cache(maxsize=1)
def _own() -> Mapping[str, str]:
    """Names and aliases of the estimators that come with simnav, by their look."""
    discover_own()
    classes, aliases = snapshot()
    return {look(name): name for name in (*aliases, *classes) if is_own(name)}


def lookalikes(labels: Iterable[str]) -> dict[str, str]:
    """Labels that can be taken for another one, and which that is.

    A name of simnav's own keeps its place, and what looks like it is found. Of two others both are found: nobody can
    say which was first.

    Parameters
    ----------
    labels : iterable of str
        Labels without a fault (`label_fault`).

    Examples
    --------
    >>> lookalikes(["ekf", "EKF", "ekf(gate=3)", "mine", "MINE"])
    {'EKF': 'ekf', 'MINE': 'mine', 'mine': 'MINE'}
    """
    own, found = _own(), dict[str, str]()
    alike: dict[str, list[str]] = {}
    for label in sorted(set(labels)):
        base = _base(label)
        known = own.get(look(base), base)
        if known != base and not _is_own(base):
            found[label] = known
        else:
            alike.setdefault(look(label), []).append(label)
    for group in alike.values():
        for label in group if len(group) > 1 else ():
            others = [other for other in group if other != label]
            if not _is_own(label):
                found[label] = next((o for o in others if _is_own(o)), others[0])
    return found


def _is_own(name: str) -> bool:
    return is_own(name)


def fault_of(result: Result) -> str:
    """Why a result is not taken, in one sentence; empty where it is."""
    if not is_scenario_id(result.scenario):
        return f"scenario = {_short(result.scenario)} is no versioned id, such as coastal-voyage-v1"
    if why := label_fault(result.estimator):
        return f"estimator = {_short(result.estimator)}: {why}"
    if type(result.seed) is not int or result.seed < 0:
        return f"seed = {_short(result.seed)} is no whole number from 0 up"
    if not isinstance(result.key, str) or not _KEY.fullmatch(result.key) or ".." in result.key:
        return f"key = {_short(result.key)} is no key"
    if result.key.rpartition("-")[2] != str(result.seed):
        return f"key = {_short(result.key)} is not that of seed {result.seed}"
    if result.status not in STATUSES:
        return f"status = {_short(result.status)} is none of {', '.join(sorted(STATUSES))}"
    for name, most in _TEXTS.items():
        value = getattr(result, name)
        if not isinstance(value, str) or len(value) > most or (name != "reason" and not value.isprintable()):
            return f"{name} = {_short(value)} is no printable text of up to {most} characters"
    for name in ("parameters", "draws", "learned"):
        if not isinstance(getattr(result, name), Mapping):
            return f"{name} is no table of values by name"
    for name in ("seconds", "time_limit", "peak_memory", "memory_limit"):
        value = getattr(result, name)
        if not isinstance(value, (int, float)) or not 0.0 <= value < math.inf:
            return f"{name} = {_short(value)} is no finite number from 0 up"
    return _fault_of_scores(result) or _fault_of_reference(result)


def _fault_of_scores(result: Result) -> str:
    why, errors = _names_of_scores(tuple(result.scores))
    below = (f"{name} = {result.scores[name]:g} is below zero" for name in errors if result.scores[name] < 0.0)
    return why or next(below, "")


@lru_cache(maxsize=256)
def _names_of_scores(names: tuple[object, ...]) -> tuple[str, tuple[str, ...]]:
    """What is wrong with the names of scores, and those that are below zero for no result; many results share them."""
    for name in names:
        if not isinstance(name, str) or len(name) > 200 or not (name.isascii() and name.isprintable()):
            return f"a score is called {_short(name)}, which is no name of a score", ()
    return "", tuple(str(name) for name in names if str(name).endswith("rmse"))


def _fault_of_reference(result: Result) -> str:
    if result.reference != _is_reference(_base(result.estimator)):
        said = "says that it was told the truth, which only simnav's own references are"
        return said if result.reference else "says that it was not told the truth, as simnav's own references are"
    return ""


@lru_cache(maxsize=4096)
def _is_reference(name: str) -> bool:
    return is_own_reference(name)


def _short(value: object) -> str:
    text = ascii(value)
    return text if len(text) <= 80 else f"{text[:60]}...{text[-10:]}"


def admitted(results: Iterable[Result]) -> tuple[list[Result], list[str]]:
    """The results that are taken, and a sentence for each reason why others are not.

    Parameters
    ----------
    results : iterable of Result
        Of one folder.

    Returns
    -------
    list of Result
        In the same order.
    list of str
        One sentence a reason, with the number of results.
    """
    taken, refused = [], dict[str, int]()
    for result in results:
        if why := fault_of(result):
            refused[why] = refused.get(why, 0) + 1
        else:
            taken.append(result)
    if alike := lookalikes(r.estimator for r in taken):
        for result in (r for r in taken if r.estimator in alike):
            why = f"estimator = {_short(result.estimator)} can be taken for {_short(alike[result.estimator])}"
            refused[why] = refused.get(why, 0) + 1
        taken = [r for r in taken if r.estimator not in alike]
    many = {why: f"{count} results are" if count > 1 else "a result is" for why, count in refused.items()}
    return taken, [f"{many[why]} set aside: {why}" for why in refused]
