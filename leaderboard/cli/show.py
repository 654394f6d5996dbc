"""``simnav show``: all about one scenario, estimator, kind of instrument or kind of fault."""

from __future__ import annotations

import difflib
import inspect
import re
from collections.abc import Mapping
from typing import Any, TypeAlias

from simnav.estimator import describe
from simnav.leaderboard.arguments import scenario_of
from simnav.leaderboard.campaign.request import file_of
from simnav.leaderboard.ranking import tables
from simnav.leaderboard.results.errors import RequestError, mistakes

from .commands import ShowCommand
from .console import Output
from .list_ import EstimatorItem, KindItem, ScenarioItem, estimators, faults, instruments, scenarios

__all__ = ["show"]

Item: TypeAlias = ScenarioItem | EstimatorItem | KindItem


def show(out: Output, request: ShowCommand) -> None:
    """Print all that has a name: a scenario and an estimator may share one."""
    name = request.name.partition("-v")[0] if request.name.rpartition("-v")[2].isdigit() else request.name
    every: dict[str, dict[str, Item]] = {
        "scenario": {s.name: s for s in scenarios()},
        "estimator": {label: e for e in estimators() for label in (e.name, *e.aliases)},
        "instrument": {i.kind: i for i in instruments()},
        "fault": {f.kind: f for f in faults()},
    }
    found = {sort: items[name] for sort, items in every.items() if name in items}
    if not found and (item := _of_file(request.name)) is not None:
        found = {"scenario" if isinstance(item, ScenarioItem) else "estimator": item}
    if not found:
        near = difflib.get_close_matches(name, [n for items in every.values() for n in items], 3, 0.6)
        meant = f"; did you mean {' or '.join(near)}?" if near else ""
        raise RequestError(f"no scenario, estimator, instrument or fault is called {request.name!r}{meant}")
    out.document(found)
    for sort, item in found.items():
        if isinstance(item, ScenarioItem):
            out.print(*_scenario(item))
        elif isinstance(item, EstimatorItem):
            out.print(*_estimator(item))
        else:
            out.print(_kind(sort, item))


def _of_file(name: str) -> Item | None:
    """A scenario or an estimator of a file; None for any other name."""
    if name.endswith(".toml"):
        s = scenario_of(name)
        return ScenarioItem(name, s.id, s.title, s.duration, tuple(s.tags), s.track, s.group, "", name)
    if not file_of(name):
        return None
    with mistakes(ValueError, FileNotFoundError):
        told = describe(name)
    defaults = {p.name: None if p.required else p.default for p in told.parameters}
    return EstimatorItem(name, (), told.summary, told.reference, defaults, told.file, told.line)


def _facts(title: str, facts: Mapping[str, Any]) -> Any:
    """A table of two columns."""
    return tables.table(title, ["", ""], [[key, value] for key, value in facts.items() if value not in ("", None)])


def _scenario(item: ScenarioItem) -> list[Any]:
    scenario = scenario_of(item.name)
    facts = {
        "title": item.title, "track": item.track, "group": item.group, "duration": tables.duration(item.duration),
        "vessel": getattr(scenario.vessel, "kind", ""), "environment": item.gymnasium, "tags": ", ".join(item.tags),
        "file": item.file,
    }  # fmt: skip
    shown = [_facts(f"Scenario {item.id}", facts)]
    shown.append(
        tables.table(
            "Instruments",
            ["name", "kind", "rate"],
            [
                [name, getattr(spec, "kind", name), f"{spec.rate:g} Hz"]
                for name, spec in {"imu": scenario.imu, **scenario.instruments}.items()
                if spec is not None
            ],
        )
    )
    if scenario.faults:
        rows = [[f.kind.replace("_", " "), ", ".join(f.instruments), _time(f)] for f in scenario.faults]
        shown.append(tables.table("Faults", ["kind", "instruments", "from – to"], rows))
    return shown


def _time(fault: Any) -> str:
    end = "end" if fault.end == float("inf") else f"{fault.end:g} s"
    return ", ".join(f"{a:g} – {b:g} s" for a, b in fault.intervals) or f"{fault.start:g} s – {end}"


def _estimator(item: EstimatorItem) -> list[Any]:
    told = describe(item.name)
    text = flowed(inspect.getdoc(told.cls) or "")
    facts = {
        "aliases": ", ".join(item.aliases), "needs": _needs(told.cls), "version": told.cls.version,
        "reference": "it is told the truth, and is not ranked" if item.reference else "",
        "file": f"{item.file}, line {item.line}",
    }  # fmt: skip
    rows = [[p.name, "required" if p.required else str(p.default), p.annotation] for p in told.parameters]
    return [
        text,
        _facts(f"Estimator {item.name}", facts),
        tables.table("Parameters", ["name", "default", "type"], rows) if rows else "It has no parameters.",
    ]


def flowed(text: str) -> str:
    """A docstring with each of its paragraphs on one line, so that it is folded where the terminal ends.

    >>> print(flowed("One\\ntwo.\\n\\nParameters\\n----------\\nwindow : int\\n    Its\\n    length."))
    One two.
    <BLANKLINE>
    Parameters
    ----------
    window : int
        Its length.
    """
    made: list[str] = []
    joins = False
    for line in text.splitlines():
        indent = len(line) - len(line.lstrip())
        heads = bool(_HEAD.fullmatch(line))
        if joins and made and line.strip() and not heads and indent == len(made[-1]) - len(made[-1].lstrip()):
            made[-1] += f" {line.strip()}"
        else:
            made.append(line)
        joins = bool(line.strip()) and not heads
    return "\n".join(made)


#: A line that stands alone: a heading of a docstring, the line below it, a parameter with its type.
_HEAD = re.compile(r"-{3,}|Parameters|Attributes|Raises|Returns|Notes|\w[\w, *]* : .*")


def _needs(cls: type[Any]) -> str:
    needs = getattr(cls, "needs", ())
    if not isinstance(needs, tuple):
        needs = cls().needs
    return "; ".join(n if isinstance(n, str) else " or ".join(n) for n in needs)


def _kind(sort: str, item: KindItem) -> Any:
    rows = [[key, "required" if told.required else "", told.description] for key, told in item.keys.items()]
    return tables.table(f"{sort.capitalize()} {item.kind}: {item.summary}", ["key in TOML", "", "meaning"], rows)
