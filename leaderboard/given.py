"""Conversion of the arguments of `simnav.leaderboard.interface`: scenarios and results."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Collection, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from simnav.leaderboard.results.errors import RequestError, mistakes, sentence
from simnav.scenario import Scenario

if TYPE_CHECKING:
    from simnav.leaderboard.results.result import Result

__all__ = ["ScenarioLike", "Scenarios", "absolute", "results_of", "scenario_of", "scenarios_of"]

ScenarioLike: TypeAlias = "str | Path | Scenario"
Scenarios: TypeAlias = "ScenarioLike | Iterable[ScenarioLike] | None"


def scenario_of(given: ScenarioLike) -> Scenario:
    """A scenario itself, or by name, id or path."""
    from simnav.scenario import load

    if isinstance(given, Scenario):
        return given
    with mistakes():
        return load(given)


def scenarios_of(
    given: Scenarios, *, note: Callable[[str], None] | None = None, optional: bool = False
) -> list[Scenario]:
    """The requested scenarios; without a request, those of the catalogue.

    Of the catalogue, families for training are left out, and logs whose files are not here.

    Parameters
    ----------
    given : scenarios
        A text may name several, separated by commas. The name of a track stands for its scenarios.
    note : callable, optional
        Called with a sentence on what is left out; default: a warning.
    optional : bool
        Leave out logs whose files are not here also where they were asked for.
    """
    from simnav.scenario import headers, names

    items = [] if given is None else [given] if isinstance(given, (str, Path, Scenario)) else list(given)
    asked: list[ScenarioLike] = []
    tracks: dict[str, list[ScenarioLike]] = {}
    for header in headers():
        tracks.setdefault(header.track, []).append(header.name)
    for item in items:
        for part in [p.strip() for p in item.split(",") if p.strip()] if isinstance(item, str) else [item]:
            asked += tracks.get(part, [part]) if isinstance(part, str) else [part]
    found = []
    for item in dict.fromkeys(asked or names()) if all(isinstance(i, str) for i in asked) else asked:
        chosen = scenario_of(item)
        if not asked and chosen.training:
            continue
        if chosen.log is not None:
            from simnav.source import open_source

            try:
                open_source(chosen, 0)
            except (ValueError, OSError) as error:
                if asked and not optional:
                    raise RequestError(sentence(error)) from error
                _note(note, f"{chosen.name} is left out: {sentence(error)}")
                continue
        found.append(chosen)
    if not found:
        raise RequestError("there is no scenario to run")
    return found


def results_of(
    folder: str | os.PathLike[str], *, series: bool = False, scores: Collection[str] | None = None
) -> list[Result]:
    """The current results of a folder, all of one version of the benchmark.

    Parameters
    ----------
    folder : path
        Folder that a campaign wrote.
    series : bool
        Whether to include the series that charts need; they stay on disk until they are read.
    scores : collection of str, optional
        Only these scores. Default: all.
    """
    from simnav.leaderboard.results.provenance import benchmark_of
    from simnav.leaderboard.results.store import StoreError, load

    path = absolute(folder)
    with mistakes(StoreError):
        results = load(path, series=series, scores=scores)
    if not results:
        raise RequestError(f"there are no results in {path}; 'simnav campaign' makes some")
    benchmark_of(r.provenance for r in results)
    return results


def _note(note: Callable[[str], None] | None, text: str) -> None:
    if note is not None:
        note(text)
    else:
        warnings.warn(text, stacklevel=3)


def absolute(path: str | os.PathLike[str]) -> Path:
    """A path from the root, whatever folder it was given in."""
    return Path(path).expanduser().resolve()
