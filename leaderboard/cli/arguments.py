"""What is typed on the command line, made into scenarios and requested estimators."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from simnav.leaderboard.cli.console import Output, UserError, mistakes, sentence

if TYPE_CHECKING:
    from simnav.leaderboard.campaign.request import EstimatorRequest
    from simnav.scenario import Scenario

__all__ = ["requests", "scenario", "scenarios", "split_names"]


def split_names(given: Iterable[str] | None) -> list[str]:
    """Names separated by commas, over any number of options.

    >>> split_names(["open-sea, uuv", "mine.toml"])
    ['open-sea', 'uuv', 'mine.toml']
    """
    return [part.strip() for text in given or () for part in text.split(",") if part.strip()]


def _settings(given: Iterable[str]) -> dict[str, str]:
    values = {}
    for text in given:
        name, equals, value = text.partition("=")
        if not equals or not name.strip().isidentifier():
            raise UserError(f"--set {text}: it should be name=value, like --set gate=3")
        values[name.strip()] = value.strip()
    return values


def requests(
    given: Iterable[str] | None, settings: Sequence[str] | None = None, *, quick: Output | None = None
) -> list[EstimatorRequest]:
    """The estimators that were asked for, all registered ones where none was.

    Files are not imported here: whoever runs them does so, in a process of its own where it can.

    Parameters
    ----------
    given : iterable of str or None
        As for `simnav.leaderboard.campaign.request.split_estimators`.
    settings : sequence of str or None
        ``name=value``; of several estimators each gets those that it has a parameter for.
    quick : Output or None
        Where it is given, and none was asked for, the slow ones are left out, and it is told.

    Raises
    ------
    UserError
        On an unknown estimator or parameter, or a value that does not fit.
    """
    from simnav.estimator import describe, make, names
    from simnav.leaderboard.campaign.request import EstimatorRequest, split_estimators

    with mistakes():
        asked = split_estimators(given)
    if not asked:
        slow = [name for name in names() if describe(name).slow] if quick is not None else []
        if quick is not None and slow:
            quick.note(f"simnav: left out of a quick campaign, for their cost: {', '.join(slow)} (-e names them)")
        asked = [(name, {}) for name in names() if name not in slow]
    common = _settings(settings or ())
    unused = set(common)
    made: dict[str, EstimatorRequest] = {}
    for name, values in asked:
        with mistakes():
            mine = common
            if len(asked) > 1 and common:
                known = {p.name for p in describe(name).parameters}
                mine = {k: v for k, v in common.items() if k in known}
            unused -= set(mine)
            request = EstimatorRequest(name, {**mine, **values})
            if ".py" not in name:
                make(name, **request.parameters)  # so that a mistake shows now, not in a worker
        made.setdefault(request.label, request)
    if unused:
        raise UserError(
            f"--set {min(unused)}: none of the estimators has it; 'simnav list estimators' shows what they have"
        )
    return list(made.values())


def scenario(name: str) -> Scenario:
    """One scenario by name, id or path."""
    from simnav.scenario import load

    with mistakes():
        return load(name)


def scenarios(given: Iterable[str] | None, out: Output, *, quick: bool = False) -> list[Scenario]:
    """The scenarios that were asked for; where none was, all of the catalogue but logs whose files are not here.

    ``quick`` leaves out those of the catalogue that are tagged ``long``.
    """
    from simnav.scenario import names

    asked = split_names(given)
    found = []
    for name in dict.fromkeys(asked or names()):
        chosen = scenario(name)
        if quick and not asked and "long" in chosen.tags:
            continue
        if chosen.log is not None:
            from simnav.source import open_source

            try:
                open_source(chosen, 0)
            except (ValueError, OSError) as error:
                if asked:
                    raise UserError(sentence(error)) from error
                out.note(f"simnav: {name} is left out: {sentence(error)}")
                continue
        found.append(chosen)
    if not found:
        raise UserError("there is no scenario to run")
    return found
