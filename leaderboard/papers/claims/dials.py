"""Dials of common kinds: the delay of an output, a parameter, a choice of settings, a value of a scenario."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from simnav.estimator.looking_back import lag_text
from simnav.leaderboard.campaign.request import request
from simnav.leaderboard.results.errors import mistakes
from simnav.scenario import Scenario

from .claim import Choice, Dial, Setting

__all__ = ["choice_dial", "lag_dial", "lags_given", "of_rows", "parameter_dial", "scenario_dial", "with_keys"]


def lag_dial(
    values: Sequence[float], *, both: bool = False, name: str = "lag", why: str = "", **parameters: object
) -> Dial:
    """The delay of the output of ``row``, or of both: the score at this lag (`simnav.scoring.lagged`).

    Parameters
    ----------
    values : sequence of float
        Lags [s]; 0 is the newest state.
    both : bool
        False: the other method gives its newest state.
    name, why : str
        As of `Dial`.
    **parameters
        Of the method whose output is late, such as the length of a window that reaches back so far.
    """

    def late(setting: Setting, value: Choice) -> Setting:
        assert isinstance(value, float)
        whose = "both" if both else "row"
        made = setting.with_parameters(whose, **parameters) if parameters else setting
        if value == 0.0:
            return made
        made = made.with_parameters(whose, lags=lag_text(value).replace("p", "."))
        end = f"_lag_{lag_text(value)}"
        return replace(made, score=made.score + end, than_score=made.than_score + end if both else made.than_score)

    title = "the delay of the output of both methods" if both else "the delay of the output, of the first method only,"
    return Dial(name, title, "s", tuple(float(v) for v in values), late, 0.0, why)


def lags_given(settings: Sequence[Setting]) -> list[Setting]:
    """The same comparisons, with the lags of equal estimators joined, so that one run gives all of them."""
    joined: dict[tuple[str, str], set[str]] = {}

    def key(setting: Setting, whose: str) -> tuple[str, str]:
        request = getattr(setting, whose)
        rest = {k: v for k, v in request.parameters.items() if k != "lags"}
        scenario = setting.scenario if whose == "row" else setting.than_scenario
        return scenario.id, replace(request, parameters=rest, label="").label

    both = ("row", "than")
    for setting in settings:
        for whose in both:
            given = getattr(setting, whose).parameters.get("lags")
            if given is not None:
                joined.setdefault(key(setting, whose), set()).update(str(given).split("/"))
    made = []
    for setting in settings:
        for whose in both:
            if getattr(setting, whose).parameters.get("lags") is not None:
                lags = sorted(joined[key(setting, whose)], key=float)
                setting = setting.with_parameters(whose, lags="/".join(lags))
        made.append(setting)
    return made


def parameter_dial(
    name: str,
    title: str,
    whose: str,
    parameter: str,
    values: Sequence[float],
    *,
    unit: str = "",
    ours: float | None = None,
    why: str = "",
) -> Dial:
    """A parameter of ``row``, of ``than`` or of ``both``."""

    def with_it(setting: Setting, value: Choice) -> Setting:
        assert isinstance(value, float)
        return setting.with_parameters(whose, **{parameter: int(value) if value.is_integer() else value})

    return Dial(name, title, unit, tuple(float(v) for v in values), with_it, ours, why)


def choice_dial(
    name: str,
    title: str,
    choices: Mapping[str, Callable[[Setting], Setting]],
    *,
    ours: str | None = None,
    why: str = "",
) -> Dial:
    """Settings that have a name and no number."""
    return Dial(name, title, "", tuple(choices), lambda setting, value: choices[str(value)](setting), ours, why)


def of_rows(row: str = "", than: str = "") -> Callable[[Setting], Setting]:
    """A choice of `choice_dial`: other estimators, as they are typed; an empty name leaves the one that is there."""

    def with_them(setting: Setting) -> Setting:
        chosen = request(row) if row else setting.row
        return replace(setting, row=chosen, than=request(than) if than else setting.than)

    return with_them


def scenario_dial(
    name: str,
    title: str,
    unit: str,
    values: Sequence[float],
    keys: Callable[[float], Mapping[str, object]],
    *,
    whose: str = "both",
    ours: float | None = None,
    why: str = "",
) -> Dial:
    """Values in the file of the scenario.

    Parameters
    ----------
    name, title, unit, values, ours, why
        As of `Dial`.
    keys : callable
        From a value to the keys of the file that it sets, with their values.
    whose : str
        ``both``: the scenario of both methods. ``than``: only that of the other method, which is told another
        datasheet; the true errors must be the same.
    """

    def with_it(setting: Setting, value: Choice) -> Setting:
        assert isinstance(value, float)
        if whose == "than":
            return replace(setting, than_scenario=with_keys(setting.than_scenario, name, value, keys(value)))
        return setting.on(with_keys(setting.scenario, name, value, keys(value)))

    return Dial(name, title, unit, tuple(float(v) for v in values), with_it, ours, why)


def with_keys(scenario: Scenario, name: str, value: Choice, keys: Mapping[str, object]) -> Scenario:
    """A scenario with other values at some keys, under a name that says so.

    Raises
    ------
    RequestError
        If it is not valid with them; one sentence.
    """
    text = value if isinstance(value, str) else f"{value:.12g}".replace("-", "m").replace(".", "p")
    slug = re.sub(r"[^a-z0-9]+", "-", f"{scenario.name}-at-{name}-{text}".lower()).strip("-")
    with mistakes(ValueError):
        return scenario.with_values({"name": slug, **keys})
