"""Profiles: small files that say which rows run on which scenarios, with how many seeds.

``simnav campaign --profile quick`` runs ``quick.toml`` of this folder; a path names a profile of one's own. A profile
has a title and one or more parts::

    title = "quick: about five minutes"

    [[part]]
    scenarios = ["open-sea"]          # or tracks = ["aided-ins"]
    estimators = ["ekf", "sw-fgo"]    # left out: all that are not slow
    runs = 10                         # seeds a scenario, from 0 on

A part that names tracks may bound the length of its scenarios by ``shortest_s`` (exclusive) and ``longest_s``. Rows
that several parts share are named once: ``[groups]`` with ``chosen = ["ekf", "sw-fgo"]``, and
``estimators = "chosen"``. What an earlier part has run is not run again.
"""

from __future__ import annotations

import math
import os
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from simnav.estimator import describe, names
from simnav.leaderboard.ranking.statistics import FIRST, STAGES
from simnav.leaderboard.results.errors import MOST_RUNS, RequestError
from simnav.scenario.catalogue import headers
from simnav.spec import closest

__all__ = ["KEYS", "Part", "Profile", "profiles", "read_profile"]

_FOLDER = Path(__file__).parent
#: Numbers of seeds that ``more`` may be.
LATER = tuple(stage.seeds for stage in STAGES[1:])

#: The keys of a part, and what they mean.
KEYS: Mapping[str, str] = {
    "scenarios": "names of scenarios; this or `tracks`",
    "tracks": "names of tracks, which stand for their scenarios",
    "estimators": "names of estimators, or the name of a group; default: all that are not slow",
    "without": "names of estimators that are left out",
    "runs": "required: seeds of each scenario, from 0 on",
    "more": "100 or 300: up to so many seeds of rows that may be the best of a trouble or the track; `runs` is 30",
    "shortest_s": "with `tracks`: only scenarios that take longer than this",
    "longest_s": "with `tracks`: only scenarios that take no longer than this",
}


@dataclass(frozen=True)
class Part:
    """Scenarios that are run with the same rows and seeds.

    Attributes
    ----------
    scenarios, estimators : tuple of str
        Names.
    runs : int
        Seeds a scenario.
    more : int
        Up to how many seeds the rows that may be the best have (`simnav.leaderboard.ranking.next_runs`); 0: as all.
    """

    scenarios: tuple[str, ...]
    estimators: tuple[str, ...]
    runs: int
    more: int = 0


@dataclass(frozen=True)
class Profile:
    """What a campaign runs.

    Attributes
    ----------
    name, title : str
        Name of its file, and one line for tables.
    parts : tuple of Part
        In the order in which they are run.
    """

    name: str
    title: str
    parts: tuple[Part, ...]

    @property
    def results(self) -> int:
        """How many results it makes."""
        return sum(len(p.scenarios) * len(p.estimators) * p.runs for p in self.parts)


def profiles() -> list[str]:
    """The names of the profiles that come with simnav."""
    return sorted(p.stem for p in _FOLDER.glob("*.toml"))


def read_profile(profile: str | os.PathLike[str]) -> Profile:
    """A profile by its name, or by the path of its file.

    Raises
    ------
    RequestError
        If there is none, or the file does not say what it should.

    Examples
    --------
    >>> read_profile("smoke").parts[0].runs
    2
    """
    path = Path(profile)
    if path.suffix != ".toml":
        path = _FOLDER / f"{profile}.toml"
        if not path.is_file():
            raise RequestError(f"there is no profile {str(profile)!r}{closest(str(profile), profiles())}")
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise RequestError(f"{path}: {error}") from None
    parts = table.get("part")
    if not isinstance(parts, list) or not parts or not all(isinstance(p, dict) for p in parts):
        raise RequestError(f"{path}: a profile has one or more tables [[part]]")
    groups = table.get("groups", {})
    if not isinstance(groups, dict):
        raise RequestError(f"{path}: groups = {groups!r:.80} should be a table of lists of names")
    groups = {name: list(_texts(f"{path}: groups", groups, name)) for name in groups}
    found = tuple(_part(f"{path}: part {k + 1}", part, groups) for k, part in enumerate(parts))
    return Profile(path.stem, str(table.get("title", path.stem)), found)


def _part(where: str, table: dict[str, Any], groups: dict[str, list[str]]) -> Part:
    for key in table:
        if key not in KEYS:
            raise RequestError(f"{where}: {key!r} is no key of a part{closest(key, list(KEYS))}")
    runs = table.get("runs")
    if not isinstance(runs, int) or isinstance(runs, bool) or not 1 <= runs <= MOST_RUNS:
        raise RequestError(f"{where}: runs = {runs!r:.40} should be a number of seeds, from 1 to {MOST_RUNS}")
    more = table.get("more", 0)
    if more not in (0, *LATER) or isinstance(more, bool) or (more and runs != FIRST):
        raise RequestError(f"{where}: more = {more!r:.40} should be one of {LATER}, and only with runs = {FIRST}")
    if ("scenarios" in table) == ("tracks" in table):
        raise RequestError(f"{where}: it should name scenarios or tracks")
    if "scenarios" in table:
        scenarios = _texts(where, table, "scenarios")
    else:
        tracks = _texts(where, table, "tracks")
        low, high = _seconds(where, table, "shortest_s", 0.0), _seconds(where, table, "longest_s", math.inf)
        scenarios = tuple(h.name for h in headers() if h.track in tracks and low < h.duration <= high)
    asked = table.get("estimators")
    if isinstance(asked, str):
        if asked not in groups:
            raise RequestError(f"{where}: there is no group {asked!r} of estimators{closest(asked, list(groups))}")
        table = table | {"estimators": groups[asked]}
    everyone = tuple(n for n in names() if not describe(n).slow)
    rows = _texts(where, table, "estimators") if "estimators" in table else everyone
    left_out = _texts(where, table, "without") if "without" in table else ()
    return Part(scenarios, tuple(n for n in rows if n not in left_out), runs, more)


def _seconds(where: str, table: dict[str, Any], key: str, default: float) -> float:
    value = table.get(key, default)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not value >= 0.0:
        raise RequestError(f"{where}: {key} = {value!r:.40} should be a number of seconds, 0 or more")
    return float(min(value, math.inf))


def _texts(where: str, table: dict[str, Any], key: str) -> tuple[str, ...]:
    value = table[key]
    if not isinstance(value, list) or not value or not all(isinstance(v, str) for v in value):
        raise RequestError(f"{where}: {key} = {value!r:.80} should be a list of names")
    return tuple(value)
