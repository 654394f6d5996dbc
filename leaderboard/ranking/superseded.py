"""Whether the results of a row are of an older version of its estimator than the one that comes with simnav."""

from __future__ import annotations

from collections.abc import Iterable

from simnav.estimator import EstimatorError
from simnav.estimator.registry import registered
from simnav.leaderboard.campaign.request import comes_with_simnav
from simnav.leaderboard.results.result import Result

__all__ = ["only_version", "superseded_by", "version_of"]


def version_of(name: str) -> int | None:
    """The version of an estimator that comes with simnav; None for all others.

    Examples
    --------
    >>> version_of("nobody") is None
    True
    """
    try:
        cls = registered(name)
    except EstimatorError:
        return None
    return cls.version if comes_with_simnav(cls) else None


def superseded_by(name: str, results: Iterable[Result]) -> str:
    """In words, which version some results of an estimator are of, if simnav has a newer one; empty otherwise.

    Parameters
    ----------
    name : str
        Name of the estimator, without parameters.
    results : iterable of Result
        Its results.
    """
    today = version_of(name)
    versions = {r.estimator_version for r in results}
    older = sorted(v for v in versions if today is not None and v < today)
    if not older:
        return ""
    some = " in some scenarios" if today in versions else ""
    return f"version {' and '.join(map(str, older))}{some}; simnav has version {today}"


def only_version(results: Iterable[Result]) -> int | None:
    """The declared version of the estimator in its results; None if there are several, or no result."""
    versions = {r.estimator_version for r in results}
    return versions.pop() if len(versions) == 1 else None


def in_words(rows: Iterable[tuple[str, str]]) -> str:
    """Rows with what `superseded_by` says of them; those of the same versions together.

    >>> of_one = "version 1; simnav has version 3"
    >>> in_words([("iae", of_one), ("kf", "version 1; simnav has version 2"), ("imm", of_one)])
    'iae, imm (version 1; simnav has version 3); kf (version 1; simnav has version 2)'
    """
    found: dict[str, list[str]] = {}
    for name, versions in rows:
        found.setdefault(versions, []).append(name)
    return "; ".join(f"{', '.join(names)} ({versions})" for versions, names in found.items())
