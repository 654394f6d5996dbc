"""``simnav list``: scenarios, estimators, kinds of instruments, kinds of faults, and IMUs by name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from simnav.leaderboard.ranking import tables
from simnav.scenario.catalogue import headers

from .commands import ListCommand, Topic
from .console import Output
from .own_estimators import Summary, summaries

if TYPE_CHECKING:
    from rich.table import Table

    from simnav.scenario.catalogue import Header
    from simnav.spec import Spec

__all__ = ["estimators", "faults", "imus", "instruments", "scenarios", "show"]


def show(out: Output, request: ListCommand) -> None:
    """List scenarios, estimators, kinds of instruments, kinds of faults, or IMUs by name."""
    found: dict[str, Any] = {}
    if request.topic in (None, Topic.SCENARIOS):
        found["scenarios"] = scenarios()
        out.print(_scenario_lines(found["scenarios"]))
    if request.topic in (None, Topic.ESTIMATORS):
        if out.json:
            found["estimators"] = estimators()
        else:
            out.print(_estimator_lines(summaries()))
    if request.topic in (Topic.INSTRUMENTS, Topic.FAULTS):
        found[request.topic] = instruments() if request.topic is Topic.INSTRUMENTS else faults()
        out.print(_kind_lines(request.topic.value.capitalize(), found[request.topic]))
    if request.topic is Topic.IMUS:
        found["imus"] = imus()
        out.print(_imu_table(found["imus"]))
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


@dataclass(frozen=True)
class ImuItem:
    """An IMU by name; ``stands_for_grade`` says whether ``grade`` in a scenario means this one.

    ``assumed`` are the figures that its datasheet does not state, by triad, and ``assumed_from`` says their source.
    """

    name: str
    manufacturer: str
    grade: str
    stands_for_grade: bool
    datasheet: str
    read_in: str
    gyroscope: Mapping[str, float]
    accelerometer: Mapping[str, float]
    effects: Mapping[str, float]
    assumed: Mapping[str, Mapping[str, float]]
    assumed_from: str


def scenarios() -> list[ScenarioItem]:
    """Every scenario of every pack, by track and group."""

    return [
        ScenarioItem(h.name, h.id, h.title, h.duration, h.tags, h.track, h.group, f"simnav:{h.gym_id}", str(h.path))
        for h in sorted(headers(), key=_place)
    ]


def estimators() -> list[EstimatorItem]:
    """Every registered estimator."""
    from simnav.estimator import describe, names  # as below: a plain list needs neither estimators nor instruments

    return [
        EstimatorItem(d.name, d.aliases, d.summary, d.reference,
                      {p.name: None if p.required else p.default for p in d.parameters}, d.file, d.line)
        for d in map(describe, names())
    ]  # fmt: skip


def instruments() -> list[KindItem]:
    """Every kind of instrument."""
    from simnav import sensors

    imu = _kind(sensors.ImuSpec, "angular rate and specific force")
    return [imu, *(_kind(spec, spec.definition.quantity) for spec in sensors.instrument_specs())]


def faults() -> list[KindItem]:
    """Every kind of fault."""
    from simnav import sensors

    return [_kind(spec, "") for spec in sensors.fault_specs()]


def imus() -> list[ImuItem]:
    """Every IMU that a scenario may name, with the figures of its datasheet."""
    from simnav.sensors.imu_models import ASSUMED, GRADES, IMU_MODELS

    return [
        ImuItem(m.name, m.manufacturer, m.grade, GRADES[m.grade] == m.name, m.datasheet, m.read_in, m.gyroscope,
                m.accelerometer, m.effects, m.assumed, ASSUMED[m.grade].source if any(m.assumed.values()) else "")
        for m in IMU_MODELS.values()
    ]  # fmt: skip


def _kind(spec: type[Spec], fallback: str) -> KindItem:
    field = spec.model_fields.get("kind")
    kind = str(field.default) if field is not None else spec.__name__.removesuffix("Spec").lower()
    from simnav.field_meanings import meanings

    said = meanings(spec)
    keys = {
        key: Key(info.is_required(), said[name]) for key, (name, info) in spec.toml_keys().items() if name != "kind"
    }
    return KindItem(kind, (spec.__doc__ or fallback).strip().splitlines()[0].rstrip(":"), keys)


#: Tracks and groups as they are listed; those of others follow, by name.
_TRACKS = (
    "aided-ins", "no-imu", "underwater", "long", "generalisation", "generalisation-no-imu", "robustness", "satellites",
    "recorded", "papers",
)  # fmt: skip
_GROUPS = ("clean", "degraded GNSS", "outages", "gross errors", "wrong datasheet", "wrong start", "extremes")


def _place(header: Header) -> tuple[int, str, int, str, str, int]:
    """Where a scenario stands in the list."""

    def rank(word: str, words: Sequence[str]) -> int:
        return words.index(word) if word in words else len(words)

    track, group = header.track, header.group
    return rank(track, _TRACKS), track, rank(group, _GROUPS), group, header.name, header.version


_MORE = "'simnav show NAME' has the rest."


def _scenario_lines(found: list[ScenarioItem]) -> tables.Lines:
    rows = [[e.name, e.track, tables.duration(e.duration), e.title] for e in found]
    return tables.Lines("Scenarios", ["name", "track", "duration", "title"], rows, numeric=["duration"], caption=_MORE,
                        spare=["track"])  # fmt: skip


def _estimator_lines(found: list[Summary]) -> tables.Lines:
    rows = [[e.name + (" *" if e.reference else ""), e.summary.replace("``", "")] for e in found]
    dim = [i for i, e in enumerate(found) if e.reference]
    caption = f"{_MORE} * reference: it is told the truth, and is not ranked." if dim else _MORE
    return tables.Lines("Estimators", ["name", "what it is"], rows, dim=dim, caption=caption)


def _kind_lines(title: str, found: list[KindItem]) -> tables.Lines:
    return tables.Lines(title, ["kind", "what it is"], [[e.kind, e.summary] for e in found], caption=_MORE)


def _imu_table(found: list[ImuItem]) -> Table:
    """A row an IMU, with the figures of its datasheet in their units, and those that are assumed."""

    def figures(table: Mapping[str, float], assumed: Mapping[str, float] = MappingProxyType({})) -> str:
        stated = [f"{key} = {value:.6g}" for key, value in table.items()]
        return ", ".join([*stated, *(f"{key} = {value:.6g} (assumed)" for key, value in assumed.items())])

    rows = [
        [e.name, e.manufacturer, e.grade + (" *" if e.stands_for_grade else ""),
         figures(e.gyroscope, e.assumed["gyroscope"]), figures(e.accelerometer, e.assumed["accelerometer"]),
         figures(e.effects), e.datasheet]
        for e in found
    ]  # fmt: skip
    columns = ["model", "manufacturer", "grade", "gyroscope", "accelerometer", "effects", "datasheet"]
    caption = "* this one is meant by the name of its grade; (assumed): not in the datasheet, --json has the source"
    return tables.table("IMUs by name", columns, rows, caption=caption)
