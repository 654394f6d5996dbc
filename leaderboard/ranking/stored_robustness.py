"""How estimators do when a datasheet is wrong: the profiles that come with simnav, and how boards show them.

The error of an estimator is compared with that of the plain row, which is told the same wrong datasheet, on the same
seeds. The profiles of rows that come with simnav are in ``robustness.json`` beside the standard result, which
``simnav robustness --output FILE`` writes. A board joins them to its rows when it is shown; the ranking does not
use them. A profile names the version of its row, and is not shown beside results of another version.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, fields
from functools import lru_cache
from pathlib import Path
from typing import Any

from simnav.leaderboard.results.provenance import Provenance

from .measured_file import checked_names, read_measured, save_measured, short_number
from .plain_row import plain_rows

__all__ = ["FILE", "Profile", "ProfilePoint", "Profiles", "WorstRatio"]
__all__ += ["profile_of", "profiles_of", "read", "save", "stored", "worst_of"]

FILE = Path(__file__).parents[1] / "standard" / "robustness.json"

_WANTED = "'simnav robustness --output FILE' writes such a file"


@dataclass(frozen=True)
class ProfilePoint:
    """One wrong datasheet.

    Attributes
    ----------
    instrument : str
        Name of the instrument whose datasheet is wrong.
    factor : float
        All figures of its datasheet are so many times the true ones.
    ratio : float
        Geometric mean over the seeds of the error over that of the plain row with the same datasheet. A failed run
        counts as `simnav.leaderboard.ranking.statistics.FAILURE`.
    failed : int
        Number of failed runs.
    """

    instrument: str
    factor: float
    ratio: float
    failed: int


@dataclass(frozen=True)
class Profile:
    """The robustness profile of an estimator on one scenario.

    Attributes
    ----------
    estimator, plain : str
        Labels of the estimator and of the plain row.
    version, plain_version : int
        Declared versions of both.
    scenario : str
        Versioned id of the scenario.
    runs : int
        Number of seeds of each point.
    points : tuple of ProfilePoint
        For each instrument one for each factor; those of the factor 1 are the same run.
    """

    estimator: str
    version: int
    plain: str
    plain_version: int
    scenario: str
    runs: int
    points: tuple[ProfilePoint, ...]

    @property
    def worst(self) -> ProfilePoint:
        """The point with the largest ratio under a wrong datasheet."""
        return max((p for p in self.points if p.factor != 1.0), key=lambda p: p.ratio)


@dataclass(frozen=True)
class Profiles:
    """Profiles of several estimators.

    Attributes
    ----------
    measured : Provenance
        Machine, versions and day.
    rows : tuple of Profile
        In the order of the file.
    """

    measured: Provenance
    rows: tuple[Profile, ...]


def save(rows: Iterable[Profile], path: Path, measured: Provenance | None = None) -> Path:
    """Write profiles; an older file is replaced.

    Parameters
    ----------
    rows : iterable of Profile
        The profiles.
    path : Path
        The file.
    measured : Provenance, optional
        Machine, versions and day of the measurement; default: those of now.

    Raises
    ------
    OSError
        If writing fails.
    """
    return save_measured(map(_entry, rows), path, measured)


def _entry(row: Profile) -> dict[str, Any]:
    """A profile as JSON holds it."""
    head = {f.name: getattr(row, f.name) for f in fields(row) if f.name != "points"}
    return head | {
        "points": [[p.instrument, short_number(p.factor), short_number(p.ratio), p.failed] for p in row.points]
    }


def read(path: Path) -> Profiles:
    """Read a file of profiles.

    Raises
    ------
    RequestError
        If the file is missing or is no file of profiles: one sentence with the file, the field and the value.
    """
    return Profiles(*read_measured(path, _profile, what="file of robustness profiles", rows="profiles", wanted=_WANTED))


def _profile(where: str, entry: Any) -> Profile:
    """A profile of the file; ValueError with the field that is wrong."""
    entry = checked_names(where, entry)
    for name in ("version", "plain_version", "runs"):
        x = entry.get(name)
        if isinstance(x, bool) or not isinstance(x, int) or x < 1:
            raise ValueError(f"{where}.{name} is {x!r}, and should be a whole number from 1")
    points = entry.get("points")
    if not isinstance(points, list):
        raise ValueError(f"{where}.points is {points!r:.40}, and should be a list")
    made = tuple(_point(f"{where}.points[{k}]", p) for k, p in enumerate(points))
    if not any(p.factor != 1.0 for p in made):
        raise ValueError(f"{where}.points has no wrong datasheet, a factor other than 1")
    names = ("estimator", "version", "plain", "plain_version", "scenario", "runs")
    return Profile(**{name: entry[name] for name in names}, points=made)


def _point(where: str, entry: Any) -> ProfilePoint:
    """A point of the file; ValueError with what is wrong."""
    if not isinstance(entry, list) or len(entry) != 4 or not isinstance(entry[0], str) or not entry[0]:
        raise ValueError(f"{where} is {entry!r:.80}, and should be [instrument, factor, ratio, failed runs]")
    for name, x in zip(("factor", "ratio"), entry[1:3], strict=True):
        if isinstance(x, bool) or not isinstance(x, (int, float)) or not 0.0 < x < math.inf:
            raise ValueError(f"{where}: the {name} is {x!r}, and should be a finite number above 0")
    failed = entry[3]
    if isinstance(failed, bool) or not isinstance(failed, int) or failed < 0:
        raise ValueError(f"{where}: the number of failed runs is {failed!r}, and should be 0 or more")
    return ProfilePoint(entry[0], float(entry[1]), float(entry[2]), failed)


@lru_cache(maxsize=4)
def stored(path: Path = FILE) -> tuple[Profile, ...]:
    """The profiles that come with simnav; none if there is no such file. See `read`."""
    return read(path).rows if path.is_file() else ()


def profiles_of(estimator: str, version: int | None) -> list[Profile]:
    """The stored profiles of a row, one for each plain row; none if they are of another version of the row."""
    return [p for p in stored() if p.estimator == estimator and p.version == version]


def profile_of(estimator: str, version: int | None, plain: str, score: str) -> Profile | None:
    """What a board shows of a row: the stored profile, or None.

    Parameters
    ----------
    estimator : str
        Label of the row.
    version : int or None
        Declared version of the row whose results the board shows.
    plain : str
        The plain row of the board; of several, as ``ekf or ship-ekf``, the first that the row was compared with;
        without one (empty), those of the score.
    score : str
        Key of `simnav.scoring.SCORES` that the board ranks.
    """
    mine = {p.plain: p for p in profiles_of(estimator, version)}
    return next((mine[p] for p in (plain.split(" or ") if plain else plain_rows(score)) if p in mine), None)


@dataclass(frozen=True)
class WorstRatio:
    """The largest ratio of a stored profile under a wrong datasheet, as exports name it.

    Attributes
    ----------
    plain, scenario : str
        Label of the plain row, and versioned id of the scenario.
    runs : int
        Number of seeds.
    instrument : str
        Name of the instrument whose datasheet is wrong.
    factor, ratio : float
        Its figures over the true ones, and the error over that of the plain row, which is told the same.
    """

    plain: str
    scenario: str
    runs: int
    instrument: str
    factor: float
    ratio: float


def worst_of(estimator: str, version: int | None, plain: str, score: str) -> WorstRatio | None:
    """What a board shows of a row in one figure; None for a plain row, and without a stored profile.

    Parameters
    ----------
    estimator, version, plain, score
        As for `profile_of`.
    """
    found = profile_of(estimator, version, plain, score)
    if found is None or found.plain == estimator:
        return None
    point = found.worst
    return WorstRatio(found.plain, found.scenario, found.runs, point.instrument, point.factor, point.ratio)
