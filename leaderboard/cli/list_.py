"""``simnav list``: scenarios, estimators, kinds of instruments and kinds of faults."""

from __future__ import annotations

import typing
from collections.abc import Iterator
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated, Any

import typer

from simnav.leaderboard.cli.console import session
from simnav.leaderboard.cli.options import Debug, Json
from simnav.leaderboard.ranking import tables

if TYPE_CHECKING:
    from rich.table import Table

    from simnav.spec import Spec

__all__ = ["command", "estimators", "faults", "instruments", "scenarios"]


class Topic(StrEnum):
    """What is listed."""

    SCENARIOS = "scenarios"
    ESTIMATORS = "estimators"
    INSTRUMENTS = "instruments"
    FAULTS = "faults"


def command(
    topic: Annotated[Topic | None, typer.Argument(help="What to list; without it, scenarios and estimators.")] = None,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """List scenarios, estimators, kinds of instruments or kinds of faults."""
    listed = {
        Topic.SCENARIOS: scenarios, Topic.ESTIMATORS: estimators, Topic.INSTRUMENTS: instruments, Topic.FAULTS: faults
    }  # fmt: skip
    with session(json, debug) as out:
        topics = [topic] if topic else [Topic.SCENARIOS, Topic.ESTIMATORS]
        found = {t.value: listed[t]() for t in topics}
        out.document(found)
        for name, entries in found.items():
            out.print(_table(name, entries))


def scenarios() -> list[dict[str, Any]]:
    """Every scenario of every pack."""
    from simnav.catalogue import headers

    return [
        {
            "name": h.name,
            "id": h.id,
            "title": h.title,
            "duration": h.duration,
            "tags": list(h.tags),
            "gymnasium": f"simnav:{h.gym_id}",
            "file": str(h.path),
        }
        for h in headers()
    ]


def estimators() -> list[dict[str, Any]]:
    """Every registered estimator."""
    from simnav.estimator import describe, names

    found = []
    for d in map(describe, names()):
        values = {p.name: None if p.required else p.default for p in d.parameters}
        found.append(
            {
                "name": d.name,
                "aliases": list(d.aliases),
                "summary": d.summary,
                "reference": d.reference,
                "parameters": values,
                "file": d.file,
                "line": d.line,
            }
        )
    return found


def instruments() -> list[dict[str, Any]]:
    """Every kind of instrument, with its keys in a scenario file."""
    from simnav import sensors
    from simnav.types import KINDS

    found = [_kind(s, "angular rate and specific force") for s in _specs(sensors.ImuSpec)]
    for spec in _specs(sensors.InstrumentSpec):
        kind = _name(spec)
        found.append(_kind(spec, KINDS[kind].quantity if kind in KINDS else ""))
    return found


def faults() -> list[dict[str, Any]]:
    """Every kind of fault, with its keys in a scenario file."""
    from simnav import sensors

    return [_kind(spec, "") for spec in _specs(sensors.FaultSpec)]


def _specs(annotation: Any) -> Iterator[type[Spec]]:
    """The Spec classes of a (nested, annotated) union."""
    from simnav.spec import Spec

    if isinstance(annotation, type) and issubclass(annotation, Spec):
        yield annotation
    else:
        for part in typing.get_args(annotation):
            yield from _specs(part)


def _name(spec: type[Spec]) -> str:
    field = spec.model_fields.get("kind")
    return str(field.default) if field is not None else spec.__name__.removesuffix("Spec").lower()


def _kind(spec: type[Spec], fallback: str) -> dict[str, Any]:
    summary = (spec.__doc__ or fallback).strip().splitlines()[0]
    keys = {
        key: {"required": info.is_required(), "description": info.description or ""}
        for key, (name, info) in spec.toml_keys().items()
        if name != "kind"
    }
    return {"kind": _name(spec), "summary": summary, "keys": keys}


def _table(topic: str, entries: list[dict[str, Any]]) -> Table:
    """The table of one topic."""
    if topic == "scenarios":
        rows = [[e["name"], f"v{e['id'].rpartition('-v')[2]}", tables.duration(e["duration"]), e["title"],
                 ", ".join(e["tags"])] for e in entries]  # fmt: skip
        return tables.table("Scenarios", ["name", "version", "duration", "title", "tags"], rows, numeric=["duration"])
    if topic == "estimators":
        rows = [[e["name"] + (" *" if e["reference"] else ""), e["summary"], tables.parameters(e["parameters"])]
                for e in entries]  # fmt: skip
        dim = [i for i, e in enumerate(entries) if e["reference"]]
        caption = "* reference: it is told the truth, and is not ranked" if dim else None
        return tables.table("Estimators", ["name", "what it is", "parameters"], rows, dim=dim, caption=caption)
    rows = [[e["kind"], e["summary"], ", ".join(k + ("!" if v["required"] else "") for k, v in e["keys"].items())]
            for e in entries]  # fmt: skip
    return tables.table(topic.capitalize(), ["kind", "what it is", "keys in TOML (! required)"], rows)
