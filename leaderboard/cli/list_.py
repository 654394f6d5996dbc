"""``simnav list``: scenarios, estimators, kinds of instruments and kinds of faults."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from simnav import sensors
from simnav.estimator import describe, names
from simnav.leaderboard.ranking import tables
from simnav.scenario.catalogue import headers

from .commands import ListCommand, Topic
from .console import Output

if TYPE_CHECKING:
    from rich.table import Table

    from simnav.scenario.catalogue import Header
    from simnav.spec import Spec

__all__ = ["estimators", "faults", "instruments", "scenarios", "show"]


def show(out: Output, request: ListCommand) -> None:
    """List scenarios, estimators, kinds of instruments or kinds of faults."""
    found: dict[str, Any] = {}
    if request.topic in (None, Topic.SCENARIOS):
        found["scenarios"] = scenarios()
        out.print(_scenario_table(found["scenarios"]))
    if request.topic in (None, Topic.ESTIMATORS):
        found["estimators"] = estimators(places=out.json)
        out.print(_estimator_table(found["estimators"]))
    if request.topic in (Topic.INSTRUMENTS, Topic.FAULTS):
        found[request.topic] = instruments() if request.topic is Topic.INSTRUMENTS else faults()
        out.print(_kind_table(request.topic.value.capitalize(), found[request.topic]))
    out.document(found)


@dataclass(frozen=True)
class ScenarioItem:
    """A scenario; the fields are the keys of the JSON document."""

    name: str
    id: str
    title: str
    duration: float
    tags: tuple[str, ...]
    track: str
    group: str
    gymnasium: str
    file: str


@dataclass(frozen=True)
class EstimatorItem:
    """An estimator; ``parameters`` maps a name to its default."""

    name: str
    aliases: tuple[str, ...]
    summary: str
    reference: bool
    parameters: Mapping[str, object]
    file: str
    line: int


@dataclass(frozen=True)
class Key:
    """A key of a scenario file."""

    required: bool
    description: str


@dataclass(frozen=True)
class KindItem:
    """A kind of instrument or fault, with its keys in a scenario file."""

    kind: str
    summary: str
    keys: Mapping[str, Key]


def scenarios() -> list[ScenarioItem]:
    """Every scenario of every pack, by track and group."""

    return [
        ScenarioItem(h.name, h.id, h.title, h.duration, h.tags, h.track, h.group, f"simnav:{h.gym_id}", str(h.path))
        for h in sorted(headers(), key=_place)
    ]


def estimators(*, places: bool = True) -> list[EstimatorItem]:
    """Every registered estimator; without ``places``, which take a tenth of the time, no file and line."""

    return [
        EstimatorItem(d.name, d.aliases, d.summary, d.reference,
                      {p.name: None if p.required else p.default for p in d.parameters},
                      *((d.file, d.line) if places else ("", 0)))
        for d in map(describe, names())
    ]  # fmt: skip


def instruments() -> list[KindItem]:
    """Every kind of instrument."""

    imu = _kind(sensors.ImuSpec, "angular rate and specific force")
    return [imu, *(_kind(spec, spec.definition.quantity) for spec in sensors.instrument_specs())]


def faults() -> list[KindItem]:
    """Every kind of fault."""

    return [_kind(spec, "") for spec in sensors.fault_specs()]


def _kind(spec: type[Spec], fallback: str) -> KindItem:
    field = spec.model_fields.get("kind")
    kind = str(field.default) if field is not None else spec.__name__.removesuffix("Spec").lower()
    keys = {
        key: Key(info.is_required(), info.description or "")
        for key, (name, info) in spec.toml_keys().items()
        if name != "kind"
    }
    return KindItem(kind, (spec.__doc__ or fallback).strip().splitlines()[0], keys)


#: Tracks and groups as they are listed; those of others follow, by name.
_TRACKS = (
    "aided-ins", "no-imu", "underwater", "long", "generalisation", "generalisation-no-imu", "robustness", "recorded",
    "papers",
)  # fmt: skip
_GROUPS = ("clean", "degraded GNSS", "outages", "gross errors", "wrong datasheet", "wrong start", "extremes")


def _place(header: Header) -> tuple[int, str, int, str, str, int]:
    """Where a scenario stands in the list."""

    def rank(word: str, words: Sequence[str]) -> int:
        return words.index(word) if word in words else len(words)

    track, group = header.track, header.group
    return rank(track, _TRACKS), track, rank(group, _GROUPS), group, header.name, header.version


def _scenario_table(found: list[ScenarioItem]) -> Table:
    """A row a scenario; a track and a group are named where they begin."""
    rows, before = [], ("", "")
    for e in found:
        track = e.track if e.track != before[0] else ""
        group = e.group if track or e.group != before[1] else ""
        version = f"v{e.id.rpartition('-v')[2]}"
        rows.append([track, group, e.name, version, tables.duration(e.duration), e.title, ", ".join(e.tags)])
        before = e.track, e.group
    columns = ["track", "group", "name", "version", "duration", "title", "tags"]
    return tables.table("Scenarios", columns, rows, numeric=["duration"])


def _estimator_table(found: list[EstimatorItem]) -> Table:
    rows = [[e.name + (" *" if e.reference else ""), e.summary, tables.parameters(e.parameters)] for e in found]
    dim = [i for i, e in enumerate(found) if e.reference]
    caption = "* reference: it is told the truth, and is not ranked" if dim else None
    return tables.table("Estimators", ["name", "what it is", "parameters"], rows, dim=dim, caption=caption)


def _kind_table(title: str, found: list[KindItem]) -> Table:
    rows = [[e.kind, e.summary, ", ".join(k + ("!" if v.required else "") for k, v in e.keys.items())] for e in found]
    return tables.table(title, ["kind", "what it is", "keys in TOML (! required)"], rows)
