"""The estimators and scenarios of a site: what each is called, and where its page and its data are."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from typing import TYPE_CHECKING

from simnav.leaderboard.ranking import tables

from .content import EstimatorEntry, Fact, ScenarioEntry
from .facts import catalogued, estimator_facts, toml_of
from .headings import PAGES

if TYPE_CHECKING:
    from simnav.leaderboard.ranking.board import Ranking, ScenarioRanking
    from simnav.leaderboard.ranking.runs import Runs

__all__ = ["argument_of", "entries", "run_names"]

_LONG = 40  # characters of the name of a run


def entries(
    runs: Mapping[str, Mapping[str, Runs]], ranking: Ranking
) -> tuple[dict[str, EstimatorEntry], dict[str, ScenarioEntry]]:
    """Of all results: estimators by label, the best first, and scenarios by id.

    Parameters
    ----------
    runs : mapping of str to mapping
        Runs by scenario and estimator.
    ranking : Ranking
        Ranking of the same results.
    """
    references = {label for by in runs.values() for label, found in by.items() if found.results[0].reference}
    ranked = [row.estimator for track in ranking.tracks for row in track.rows]
    taken = {"index", "compare", "about", *PAGES}
    estimators = {}
    for label in dict.fromkeys([*ranked, *sorted({label for by in runs.values() for label in by})]):
        stem = _slug(label, taken)
        estimators[label] = EstimatorEntry(label, f"estimator-{stem}.html", label in references, estimator_facts(label))
    return estimators, {s: _scenario(s, by, f"{_slug(s, taken)}.html") for s, by in runs.items()}


def argument_of(identity: str) -> str:
    """A scenario as it is asked for: one that is not in the catalogue came from a file.

    Results do not say where the file is or what it is called. So the folder stands for what the reader has to fill in.
    """
    return identity if catalogued(identity) is not None else f"PATH/TO/{identity.rpartition('-v')[0]}.toml"


def _scenario(identity: str, by: Mapping[str, Runs], page: str) -> ScenarioEntry:
    """What is known of a scenario, from the catalogue where it is in there."""
    name, _, version = identity.rpartition("-v")
    seeds = tuple(sorted({r.seed for runs in by.values() for r in runs.results}))
    facts = [Fact("Version", version or "–"), Fact("Seeds", len(seeds))]
    scenario = catalogued(identity)
    if scenario is None:
        return ScenarioEntry(
            identity, name or identity, page, seeds, argument_of(identity), tuple(facts), from_file=True
        )
    facts += [Fact("Duration", tables.duration(scenario.duration)), Fact("Step", tables.duration(scenario.step))]
    if scenario.instruments:
        facts.append(Fact("Instruments", len(scenario.instruments)))
    if scenario.faults:
        facts.append(Fact("Faults", len(scenario.faults)))
    return ScenarioEntry(
        identity, name or identity, page, seeds, argument_of(identity), tuple(facts), scenario.title,
        scenario.description, scenario.source, toml_of(identity), scenario.group, duration=scenario.duration,
    )  # fmt: skip


def _slug(text: str, taken: set[str]) -> str:
    """A file name for a label: plain characters only, and none twice."""
    plain = re.sub(r"[^a-z0-9.]+", "-", text.lower()).strip("-.")[:60] or "unnamed"
    if plain in taken or plain != text:
        plain += "-" + hashlib.blake2b(text.encode(), digest_size=3).hexdigest()
    taken.add(plain)
    return plain


def run_names(ranking: ScenarioRanking) -> dict[str, str]:
    """Short names of the runs whose own one is a sentence: recordings that have no name but what is noted of them."""
    long = sorted({run for row in ranking.rows for run in row.ratios if len(run) > _LONG})
    return {run: f"recording {k + 1}" if len(long) > 1 else "recording" for k, run in enumerate(long)}
