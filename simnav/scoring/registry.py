"""What a score is, and how scores become known: the decorator `register_score` and the entry points ``simnav.scores``.

A score is a function of a `ScoringInput`, beside its title, unit and direction::

    from simnav import register_score

    @register_score("horizontal_p99", title="99th percentile of the horizontal error", unit="m", better="lower")
    def horizontal_p99(given):
        return np.nanquantile(given.horizontal, 0.99)

The scores of simnav are made in the same way, in the modules of this package (`simnav.scoring.standard`). A file of
a third party is loaded by ``simnav --plugin my_scores.py`` or `simnav.load_plugin`; a package names its module in the
entry-point group ``simnav.scores``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import cached_property, update_wrapper
from typing import Any, Literal, TypeAlias, TypeVar, get_args

from simnav.plugins import PluginError, Registry
from simnav.recording import Recording
from simnav.scoring.navigation_error import errors, held_errors, horizontal, smoothed_errors
from simnav.trial import Trial
from simnav.types import Array

__all__ = ["SCORES", "Better", "Score", "ScoringInput", "register_score"]

Better: TypeAlias = Literal["lower", "higher", "one", "nominal"]

T = TypeVar("T")


class ScoringInput:
    """What a score is computed from: a trial, its recording, and the errors that follow from both.

    Parameters
    ----------
    trial : Trial
        What the estimator gave.
    recording : Recording
        The one that the trial was run on, with the truth (``recording.data.truth``) and the labels of its faults.

    Attributes
    ----------
    error : (T, 9) array
        As from `simnav.scoring.errors`; NaN at epochs without an estimate.

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
        """As ``error``, (T, 9), but at an epoch without a position that of the last position that was given."""
        return held_errors(self.trial, self.recording)

    @cached_property
    def horizontal(self) -> Array:
        """Length of the horizontal position error [m], (T,), of `held_error`; NaN where the truth is not known."""
        return horizontal(self.held_error)

    @cached_property
    def smoothed_error(self) -> Array | None:
        """Errors of the smoothed trajectory, (T, 9) like ``error``; None where the estimator does not smooth."""
        return smoothed_errors(self.trial, self.recording)

    def shared(self, function: Callable[[ScoringInput], T]) -> T:
        """What a function gives for this input; computed once, however many scores ask for it."""
        if function not in self._shared:
            self._shared[function] = function(self)
        found: T = self._shared[function]
        return found


class Score:
    """A score: a function with what tables say of it.

    Attributes
    ----------
    name : str
        In snake_case.
    title : str
        One line for tables.
    unit : str
        SI, ``%`` or ``-``.
    better : str or None
        ``lower``, ``higher``, or ``one`` and ``nominal`` where a value is best (1; 50 % or 95 %). None where a value is
        neither good nor bad.
    uses_covariance : bool
        Whether it needs the covariance of every epoch; a trial that was kept with fewer does not change it.
    """

    __qualname__: str

    def __init__(
        self, function: Callable[[ScoringInput], float], name: str, title: str, unit: str, better: Better | None,
        uses_covariance: bool,
    ):  # fmt: skip
        update_wrapper(self, function)
        self.function = function
        self.name, self.title, self.unit, self.better = name, title, unit, better
        self.uses_covariance = uses_covariance

    def __call__(self, given: ScoringInput) -> float:
        return self.function(given)

    def __reduce__(self) -> tuple[Any, ...]:
        """For another process."""
        return Score, (self.function, self.name, self.title, self.unit, self.better, self.uses_covariance)


_REGISTRY: Registry[Score] = Registry("score", "simnav.scores", "simnav.scoring.standard", term="name")


def register_score(
    name: str, *, title: str, unit: str, better: Better | None = None, uses_covariance: bool = False
) -> Callable[[Callable[[ScoringInput], float]], Score]:
    """Decorator: make a function known as a score.

    Parameters
    ----------
    name : str
        In snake_case: the key in results.
    title : str
        One line, without the unit.
    unit : str
        SI, ``%`` or ``-``.
    better, uses_covariance
        As for `Score`.

    Returns
    -------
    callable
        Takes a function of a `ScoringInput`, which gives a number, NaN where the score does not apply.

    Raises
    ------
    PluginError
        If the name is not in snake_case or is taken, or the direction is unknown.
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
    """Make a score known that was made in another process."""
    _REGISTRY.add(score.name, score)


class _Table(Mapping[str, Score]):
    """All scores that are known, by name."""

    def __getitem__(self, name: str) -> Score:
        score = _REGISTRY.get(name)
        if score is None:
            raise KeyError(name)
        return score

    def __iter__(self) -> Iterator[str]:
        return iter(_REGISTRY.items())

    def __len__(self) -> int:
        return len(_REGISTRY.items())


#: Every score, in the order in which tables show them: those of simnav, then others.
SCORES: Mapping[str, Score] = _Table()
