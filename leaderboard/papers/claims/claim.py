"""A claim: one method is better than another, and the unprinted choices over which it may hold."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from simnav.leaderboard.campaign.request import EstimatorRequest
from simnav.leaderboard.campaign.request import request as estimator_request
from simnav.leaderboard.papers.comparison import GAIN
from simnav.leaderboard.results.errors import RequestError
from simnav.scenario import Scenario

__all__ = ["Choice", "Claim", "Dial", "Setting"]

#: A value of a dial: a number, or the name of a choice.
Choice = float | str


@dataclass(frozen=True, eq=False)
class Setting:
    """One comparison that can be run.

    Attributes
    ----------
    scenario, than_scenario : Scenario
        Scenario of each of the two methods. They are the same, unless the two are told different datasheets.
    row, than : EstimatorRequest
        The method that is claimed to be better, and the other one.
    score, than_score : str
        Their measures (`simnav.leaderboard.papers.measures`).
    """

    scenario: Scenario
    than_scenario: Scenario
    row: EstimatorRequest
    than: EstimatorRequest
    score: str
    than_score: str

    def on(self, scenario: Scenario) -> Setting:
        """The same comparison on another scenario."""
        return replace(self, scenario=scenario, than_scenario=scenario)

    def with_parameters(self, whose: str, **values: object) -> Setting:
        """With parameters of ``row``, ``than`` or ``both`` set; those that are set already get the new value."""

        def changed(request: EstimatorRequest) -> EstimatorRequest:
            return replace(request, parameters={**request.parameters, **values}, label="")

        row = changed(self.row) if whose in ("row", "both") else self.row
        than = changed(self.than) if whose in ("than", "both") else self.than
        return replace(self, row=row, than=than)


@dataclass(frozen=True, eq=False)
class Dial:
    """A choice that a paper does not print, with the values over which it is varied.

    Attributes
    ----------
    name : str
        On the command line.
    title : str
        What is varied, for a sentence: ``the delay of the output``.
    unit : str
        Unit of the values; empty for a factor or a choice.
    values : tuple of float or of str
        In order: numbers ascending, or names of choices.
    set : callable
        From a setting and a value to the setting with this value.
    ours : float, str or None
        The value that our comparison has; None if it is none of them.
    why : str
        What the paper prints of it, in one sentence.
    """

    name: str
    title: str
    unit: str
    values: tuple[Choice, ...]
    set: Callable[[Setting, Choice], Setting]
    ours: Choice | None = None
    why: str = ""

    @property
    def numeric(self) -> bool:
        """Whether its values are numbers."""
        return all(isinstance(v, float) for v in self.values)

    def text(self, value: Choice) -> str:
        """A value with its unit."""
        return value if isinstance(value, str) else f"{value:g} {self.unit}".rstrip()

    def over(self, values: Sequence[str]) -> Dial:
        """The dial over other values, as they are typed.

        Raises
        ------
        RequestError
            If they do not suit it; one sentence.
        """
        if self.numeric:
            try:
                numbers = sorted({float(v) for v in values})
                found: tuple[Choice, ...] = tuple(numbers)
                if not all(map(math.isfinite, numbers)):
                    raise ValueError
            except ValueError:
                raise RequestError(
                    f"--holds-if {self.name}={','.join(values)}: the values should be numbers, like {self.name}="
                    + ",".join(f"{v:g}" for v in self.values if isinstance(v, float))
                ) from None
        else:
            unknown = [v for v in values if v not in self.values]
            if unknown:
                known = ", ".join(map(str, self.values))
                raise RequestError(f"--holds-if {self.name}: there is no choice {unknown[0]!r}; there are {known}")
            found = tuple(v for v in self.values if v in values)
        ours = self.ours if self.ours in found else None
        return replace(self, values=found, ours=ours)


@dataclass(frozen=True, eq=False)
class Claim:
    """One method is better than another by so much.

    Attributes
    ----------
    name : str
        On the command line.
    paper : str
        Key of the paper; empty for a claim of the reader.
    sentence : str
        The claim in a sentence.
    gain : float
        The fraction by which the score of the one is below that of the other, as printed.
    base : callable
        Gives the comparison with our settings; it is called when it is needed, for it loads a scenario.
    dials : tuple of Dial
        The choices that are varied.
    derived : bool
        Whether the gain follows from other printed figures, and is not printed itself.
    """

    name: str
    paper: str
    sentence: str
    gain: float
    base: Callable[[], Setting]
    dials: tuple[Dial, ...]
    derived: bool = False

    @property
    def limit(self) -> float:
        """The ratio of the two scores up to which the claim holds: the gain, within the tolerance of all gains
        (`simnav.leaderboard.papers.comparison.GAIN`); a larger gain holds, too."""
        return float((1.0 - self.gain) ** (1.0 / GAIN))

    def dial(self, name: str) -> Dial:
        """The dial of a name; RequestError if it has none."""
        for dial in self.dials:
            if dial.name == name:
                return dial
        known = ", ".join(d.name for d in self.dials)
        raise RequestError(f"the claim {self.name} has no condition {name!r}; it has {known}")


def compared(
    scenario: Callable[[], Scenario], row: str, than: str, score: str, than_score: str = ""
) -> Callable[[], Setting]:
    """The ``base`` of a claim: two estimators, as they are typed, on one scenario."""

    def base() -> Setting:
        found = scenario()
        return Setting(
            found, found, estimator_request(row), estimator_request(than), score, than_score or score
        )  # fmt: skip

    return base
