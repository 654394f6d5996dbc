"""The registry of scores: the decorator `register_score` and the entry points ``simnav.scores``.

A score is a function of a `ScoringInput` with a title, a unit and a direction::

    from simnav import register_score

    @register_score("horizontal_p99", title="99th percentile of the horizontal error", unit="m", better="lower")
    def horizontal_p99(scored):
        return np.nanquantile(scored.horizontal, 0.99)

The scores of simnav are defined in the same way, in the modules of this package (`simnav.scoring.standard`). A file of
a third party is loaded by ``simnav --plugin my_scores.py`` or `simnav.load_plugin`. A package names its module in the
entry-point group ``simnav.scores``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cached_property, update_wrapper
from typing import Any, Literal, Protocol, TypeAlias, TypeVar, get_args

from simnav.plugins import PluginError, Registry
from simnav.recording import Recording
from simnav.scoring.navigation_error import errors, held_errors, horizontal, smoothed_errors
from simnav.trial import Trial
from simnav.types import Array

__all__ = [
    "SCORES",
    "Better",
    "Score",
    "ScoreFamily",
    "ScoringInput",
    "names_of_families",
    "register_family",
    "register_score",
]

Better: TypeAlias = Literal["lower", "higher", "one", "nominal"]

T = TypeVar("T")


class ScoringInput:
    """The input of a score: a trial, its recording, and the errors.

    Parameters
    ----------
    trial : Trial
        Estimates, covariances, diagnostics, flags and times of the estimator.
    recording : Recording
        The recording of the trial, with the truth (``recording.data.truth``) and the labels of its faults.

    Attributes
    ----------
    error : (T, 9) array
        Errors of `simnav.scoring.errors`; NaN at epochs without an estimate.

    Raises
    ------
    ValueError
        If the trial was not run on this recording.
    """

    def __init__(self, trial: Trial, recording: Recording):
        self.trial, self.recording = trial, recording
        self.error: Array = errors(trial, recording)
        self._shared: dict[Any, Any] = {}

    @cached_property
    def held_error(self) -> Array:
        """The (T, 9) ``error``; but at an epoch without a position, that of the last position before it."""
        return held_errors(self.trial, self.recording)

    @cached_property
    def horizontal(self) -> Array:
        """Length of the horizontal position error [m], (T,), of `held_error`; NaN where the truth is not known."""
        return horizontal(self.held_error)

    @cached_property
    def smoothed_error(self) -> Array | None:
        """Errors of the smoothed trajectory, (T, 9) like ``error``; None if the estimator does not smooth."""
        return smoothed_errors(self.trial, self.recording)

    def shared(self, function: Callable[[ScoringInput], T]) -> T:
        """The result of a function of this input. It is computed once and shared by all scores."""
        if function not in self._shared:
            self._shared[function] = function(self)
        found: T = self._shared[function]
        return found


class Score:
    """A score: a function with its name, title, unit and direction.

    Attributes
    ----------
    name : str
        Name in snake_case; the key in results.
    title : str
        One line for tables.
    unit : str
        Unit of the values: SI, ``%`` or ``-``.
    better : str or None
        Which values are better: ``lower``, ``higher``, ``one`` (the nearer to 1) or ``nominal`` (the nearer to a
        nominal value, 50 % or 95 %). None: a value is neither good nor bad.
    uses_covariance : bool
        Whether the score needs the covariance of every epoch. A kept trial with fewer covariances does not change it.
    """

    __qualname__: str

    def __init__(
        self,
        function: Callable[[ScoringInput], float],
        name: str,
        title: str,
        unit: str,
        better: Better | None,
        uses_covariance: bool,
    ):
        update_wrapper(self, function)
        self.function = function
        self.name, self.title, self.unit, self.better = name, title, unit, better
        self.uses_covariance = uses_covariance

    def __call__(self, scored: ScoringInput) -> float:
        return self.function(scored)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the score for another process."""
        return Score, (self.function, self.name, self.title, self.unit, self.better, self.uses_covariance)


_REGISTRY: Registry[Score] = Registry("score", "simnav.scores", "simnav.scoring.standard", term="name")


def register_score(
    name: str, *, title: str, unit: str, better: Better | None = None, uses_covariance: bool = False
) -> Callable[[Callable[[ScoringInput], float]], Score]:
    """Register a function as a score (decorator).

    Parameters
    ----------
    name : str
        Name in snake_case; the key in results.
    title : str
        One line for tables, without the unit.
    unit : str
        Unit of the values: SI, ``%`` or ``-``.
    better, uses_covariance
        Direction, and need of all covariances; see `Score`.

    Returns
    -------
    callable
        Decorator for a function of a `ScoringInput` that returns a number, or NaN if the score does not apply.

    Raises
    ------
    PluginError
        If the name is not in snake_case or another score has it, or if the direction is unknown.
    """
    for what, text in (("title", title), ("unit", unit)):
        if not isinstance(text, str) or not text.strip():
            raise PluginError(f"score {name!r}: {what} = {text!r} should be a text, like 'Horizontal RMSE' or 'm'")
    if better is not None and better not in get_args(Better):
        raise PluginError(
            f"score {name!r}: better = {better!r} should be one of {', '.join(get_args(Better))}, or None"
        )

    def wrap(function: Callable[[ScoringInput], float]) -> Score:
        score = Score(function, name, title, unit, better, uses_covariance)
        add(score)
        return score

    return wrap


def add(score: Score) -> None:
    """Register a score that was defined in another process."""
    _REGISTRY.add(score.name, score)


class ScoreFamily(Protocol):
    """Scores that are made when they are named, such as those of any lag (`simnav.scoring.lagged`)."""

    def score(self, name: str) -> Score | None:
        """The score of a name; None if the family has none of this name."""
        ...

    def names(self, trial: Trial) -> Iterable[str]:
        """The names of those that a trial has."""
        ...


_FAMILIES: list[ScoreFamily] = []


def register_family(family: type[ScoreFamily]) -> type[ScoreFamily]:
    """Register a family of scores (decorator of a class whose constructor takes nothing)."""
    _FAMILIES.append(family())
    return family


def names_of_families(trial: Trial) -> list[str]:
    """The scores of families that a trial has; they are not in the iteration over `SCORES`."""
    return [name for family in _FAMILIES for name in family.names(trial)]


class _Table(Mapping[str, Score]):
    """All registered scores, by name; those of families are found, too, but not listed."""

    def __getitem__(self, name: str) -> Score:
        score = _REGISTRY.get(name)
        if score is not None:
            return score
        for family in _FAMILIES:
            score = family.score(name)
            if score is not None:
                return score
        raise KeyError(name)

    def __iter__(self) -> Iterator[str]:
        return iter(_REGISTRY.items())

    def __len__(self) -> int:
        return len(_REGISTRY.items())


#: Every registered score, in the order of tables: first the scores of simnav, then others.
SCORES: Mapping[str, Score] = _Table()
