"""Folders of results as a stranger would change them: any field of any row, in valid files."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pyarrow as pa

from simnav.leaderboard.results import store
from simnav.leaderboard.results.result import Result, to_table, write_tables

__all__ = ["EVIL_SCENARIO", "evil_scenario", "fields", "forge", "renamed"]

EVIL_SCENARIO = """
name = "evil"
version = 1
title = "a scenario that brings code"
duration_s = 20.0
plugins = ["evil_plugin.py"]
"""


def evil_scenario(folder: Path) -> tuple[Path, Path]:
    """A scenario whose plug-in leaves a witness when it is imported; returns the scenario and the witness."""
    folder.mkdir(parents=True, exist_ok=True)
    witness = folder / "witness"
    (folder / "evil_plugin.py").write_text(f"from pathlib import Path\nPath({str(witness)!r}).write_text('ran')\n")
    (folder / "evil.toml").write_text(EVIL_SCENARIO)
    return folder / "evil.toml", witness


def forge(folder: Path, change: Callable[[Result], Result], *, current: bool = True) -> None:
    """Write every result of a folder again after a change, in one file, and say that the new ones are current."""
    found = [change(r) for r in store.load(folder, series=False)]
    for part in ("results", "compacted"):
        for file in (folder / part).glob("*.parquet"):
            file.unlink()
    with open(folder / "compacted" / "part-forged.parquet", "wb") as file:
        write_tables(file, iter([pa.concat_tables([to_table(r) for r in found]).combine_chunks()]))
    for r in found:
        store.keep_provenance(folder, r.provenance)
    if current:
        by: dict[str, tuple[str, dict[str, str]]] = {}
        for r in found:
            by.setdefault(r.scenario, (r.recording, {}))[1][r.estimator] = r.variant
        store.select(folder, by)


def fields(**changes: Any) -> Callable[[Result], Result]:
    """A change of some fields; those of the provenance begin with ``made_``, scores with ``score_``."""

    def change(r: Result) -> Result:
        made = {k.removeprefix("made_"): v for k, v in changes.items() if k.startswith("made_")}
        scores = {k.removeprefix("score_"): v for k, v in changes.items() if k.startswith("score_")}
        own = {k: v for k, v in changes.items() if not k.startswith(("made_", "score_"))}
        merged = {k: v for k, v in {**r.scores, **scores}.items() if v is not None}
        return replace(r, provenance=replace(r.provenance, **made), **{"scores": merged, **own})

    return change


def renamed(label: str) -> Callable[[Result], Result]:
    """The same results under another label."""
    return fields(estimator=label)
