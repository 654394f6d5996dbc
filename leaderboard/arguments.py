"""Conversion of the arguments of `simnav.leaderboard.interface`: scenarios and results."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Collection, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from simnav.leaderboard.results.errors import MOST_RUNS, RequestError, StoreError, mistakes, sentence
from simnav.scenario import Scenario

from .calls import whole_number
from .requests import ScenarioLike, Scenarios

if TYPE_CHECKING:
    from simnav.leaderboard.results.result import Result

__all__ = [
    "absolute",
    "require_folder",
    "results_of",
    "scenario_of",
    "scenarios_of",
    "seeds_of",
    "split_names",
]


def scenario_of(given: ScenarioLike) -> Scenario:
    """A scenario itself, or by name, id or path."""
    from simnav.scenario import load

    if isinstance(given, Scenario):
        return given
    if not isinstance(given, (str, os.PathLike)):
        raise RequestError(f"{given!r} is no scenario; a name or the path of a TOML file is wanted")
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

    note = note or partial(warnings.warn, stacklevel=2)
    single = isinstance(given, (str, os.PathLike, Scenario))
    if not single and given is not None and not isinstance(given, Iterable):
        raise RequestError(f"{given!r} is no scenario; a name or the path of a TOML file is wanted")
    items: list[Any] = [] if given is None else [given] if single else list(given)  # type: ignore[arg-type]
    if not items and given is not None:
        raise RequestError("the list of scenarios is empty; leave it out for all of them")
    asked: list[ScenarioLike] = []
    tracks: dict[str, list[ScenarioLike]] = {}
    for header in headers():
        tracks.setdefault(header.track, []).append(header.name)
    for item in items:
        if isinstance(item, str) and not item.strip(" ,"):
            raise RequestError(f"{item!r} names no scenario; leave it out for all of them")
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
                note(f"{chosen.name} is left out: {sentence(error)}")
                continue
        found.append(chosen)
    if not found:
        raise RequestError("there is no scenario to run")
    return found


def results_of(
    folder: str | os.PathLike[str],
    *,
    series: bool = False,
    scores: Collection[str] | None = None,
    scenarios: Collection[str] | None = None,
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
    scenarios : collection of str, optional
        Only results of these versioned ids, without series. Default: all.
    """
    from simnav.leaderboard.results.provenance import benchmark_of
    from simnav.leaderboard.results.store import load

    path = absolute(folder)
    with mistakes(StoreError):
        results = load(path, series=series, scores=scores, scenarios=scenarios)
    if not results:
        raise RequestError(f"there are no results in {path}; 'simnav campaign' makes some")
    benchmark_of(r.provenance for r in results)
    return results


def require_folder(given: str, path: str | os.PathLike[str]) -> None:
    """RequestError where the folder of a file that is to be written is missing; ``given`` is how it was asked for."""
    if not absolute(path).parent.is_dir():
        raise RequestError(f"{given}: there is no folder {Path(path).parent}")


def absolute(path: str | os.PathLike[str]) -> Path:
    """A path from the root, whatever folder it was given in."""
    if not isinstance(path, (str, os.PathLike)):
        raise RequestError(f"{path!r} is no path of a file or folder")
    if not os.fspath(path):
        raise RequestError("the path of a file or folder is empty; '.' is the folder in which you are")
    with mistakes(RuntimeError, ValueError, OSError):  # ~nobody, a zero byte, a loop of links
        return Path(path).expanduser().resolve()


def seeds_of(seed: Any, runs: Any) -> range:
    """The seeds of some runs: the first, and those that count up from it."""
    first, count = whole_number("seed", seed), whole_number("runs", runs, 1)
    if count > MOST_RUNS:
        raise RequestError(f"runs = {count}: at most {MOST_RUNS} are possible")
    return range(first, first + count)


def split_names(given: Sequence[str] | str) -> tuple[str, ...]:
    """Names, one by one; a text may hold several, separated by commas.

    >>> split_names(["ekf, ukf", "sw-fgo"])
    ('ekf', 'ukf', 'sw-fgo')
    """
    texts = [given] if isinstance(given, str) else given
    return tuple(name.strip() for text in texts for name in text.split(",") if name.strip())
