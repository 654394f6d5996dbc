"""What the pages say of an estimator and of a scenario, from the code and the catalogue of this installation."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from simnav.estimator import describe
from simnav.estimator.registry import registered
from simnav.leaderboard.ranking import tables
from simnav.leaderboard.results.catalogued import catalogued_scenario
from simnav.scenario.catalogue import headers
from simnav.spec import UNITS

from .charts import columns

if TYPE_CHECKING:
    from simnav.recording import Recording
    from simnav.scenario import Scenario

__all__ = ["EVENT", "EstimatorFacts", "catalogued", "datasheets", "estimator_facts", "events", "name_of"]

_NAME_OF_LABEL = re.compile(r"[(\[ ]")  # a label is a name, and its parameters in brackets

#: What `events` gives of each, as columns.
EVENT = ("group", "name", "start", "end", "words")

#: Titles of the families, by the module that declares the row.
_FAMILIES = {
    "kalman": "Kalman filter",
    "sigma_point": "Sigma points",
    "adaptive": "Adaptive filter",
    "heavy_tails": "Robust filter",
    "correlated": "Kalman filter",
    "multiple_filters": "Filter bank",
    "federated": "Federated filter",
    "windows": "Factor graph",
    "robust_windows": "Robust factor graph",
    "gtsam": "GTSAM",
    "loosely_coupled": "Loosely coupled",
    "cooperative": "Kalman filter",
    "terrain": "Point-mass filter",
    "smoothers": "Smoother",
    "anfis": "Learned",
    "learned": "Learned",
    "policy": "Learned",
    "dead_reckoning": "Dead reckoning",
    "oracles": "Oracle",
}


def name_of(label: str) -> str:
    """The registered name, or the file, of a label."""
    return _NAME_OF_LABEL.split(label, maxsplit=1)[0]


@dataclass(frozen=True)
class EstimatorFacts:
    """What is known of an estimator; empty for one that is not installed here.

    Attributes
    ----------
    family, summary, text, source : str
        Kind of method; first sentence; the rest of the description; paper.
    file : str
        File with the line, relative to the project.
    code : str
        Its declaration.
    parameters : tuple of (name, default, annotation, meaning)
        Parameters of the constructor, as text; the meaning is that of its documentation, with the unit.
    """

    family: str = "Other"
    summary: str = ""
    text: str = ""
    source: str = ""
    file: str = ""
    code: str = ""
    parameters: tuple[tuple[str, str, str, str], ...] = field(default_factory=tuple)


def estimator_facts(label: str) -> EstimatorFacts:
    """What the registered class says of itself."""
    name = name_of(label)
    try:
        cls = registered(name)  # a label of others never names a file that is imported
        found = describe(cls.name)
    except (ValueError, ImportError):
        return EstimatorFacts()
    documentation = inspect.getdoc(cls) or ""
    text = re.split(r"\n\S[^\n]*\n-{3,}\n", documentation)[0]  # what stands before the first section
    meant = meanings(documentation)
    body = " ".join(text.strip().partition("\n\n")[2].split())
    body, _, source = body.partition("Source: ")
    path = Path(found.file)
    parts = path.parts
    place = "/".join(parts[parts.index("estimators") :]) if "estimators" in parts else path.name
    return EstimatorFacts(
        family=_FAMILIES.get(path.stem, "Other") if "estimators" in parts else "Other",
        summary=found.summary,
        text=body.strip(),
        source=source.strip(),
        file=f"{place}, line {found.line}",
        code=_code(cls),
        parameters=tuple(
            (
                p.name,
                "" if p.required else "none" if p.default is None else str(p.default),
                p.annotation.strip("'"),
                meant.get(p.name, ""),
            )
            for p in found.parameters
        ),
    )


def meanings(documentation: str) -> dict[str, str]:
    """What numpydoc says of each parameter, by name.

    >>> meanings("Title.\\n\\nParameters\\n----------\\ngain, bias : float\\n    Of the filter [m].\\n    Small.")
    {'gain': 'Of the filter [m]. Small.', 'bias': 'Of the filter [m]. Small.'}
    """
    section = re.search(r"(?:^|\n)Parameters\n-+\n(.*?)(?=\n\S[^\n]*\n-{3,}\n|\Z)", documentation, re.DOTALL)
    found: dict[str, str] = {}
    for heading, text in re.findall(
        r"^(\S[^\n]*)\n((?:[ \t]+[^\n]*\n?|\n)*)", section[1] if section else "", re.MULTILINE
    ):
        names = heading.partition(" : ")[0]
        found |= dict.fromkeys(map(str.strip, names.split(",")), " ".join(text.split()))
    return found


def _code(cls: type) -> str:
    try:
        return inspect.getsource(cls)
    except (OSError, TypeError):
        return ""


@lru_cache(maxsize=256)
def catalogued(identity: str) -> Scenario | None:
    """The scenario of the catalogue with this id, or None: results may come from a file that is elsewhere.

    It is read once a build, which begins with ``catalogued.cache_clear()``.
    """
    try:
        return catalogued_scenario(identity)
    except (ValueError, LookupError, OSError):
        return None


def toml_of(identity: str) -> str:
    """The file of a scenario of the catalogue; empty where there is none."""
    path = next((h.path for h in headers() if h.id == identity), None)
    try:
        return "" if path is None else path.read_text(encoding="utf-8")
    except OSError:
        return ""


def datasheets(scenario: Scenario, recording: Recording) -> list[dict[str, str]]:
    """The instruments of a run: what each measures, how often, and how well, in the units of scenario files."""
    specs = scenario.instruments
    found = []
    imu = recording.instruments.imu
    sheets: list[tuple[str, str, Any]] = [
        *([] if imu is None else [(imu.name, "imu", imu)]),
        *((a.name, a.kind, a) for a in recording.instruments.values()),
    ]
    for name, kind, sheet in sheets:
        table = (
            specs[name].to_toml()
            if name in specs
            else {k: v for k, v in asdict(sheet).items() if k not in ("details", "blocks")}
        )
        text = _table(table, skip=("kind", "name", "rate", "rate_hz", "phase", "phase_s"))
        found.append(
            {"name": name, "kind": kind.replace("_", " "), "rate": f"{tables.number(sheet.rate)} Hz", "text": text}
        )
    return found


def events(scenario: Scenario | None, recording: Recording) -> dict[str, list[Any]]:
    """What happens in a run and when: its faults, and the manoeuvres whose length is known."""
    rows: list[tuple[str, str, float, float, str]] = []
    time = 0.0
    for manoeuvre in scenario.manoeuvres if scenario is not None and scenario.log is None else ():
        duration = getattr(manoeuvre, "duration", None)
        if duration is None:
            break  # its length depends on the vessel, and so does the start of all that follow
        end = min(time + duration, recording.duration)
        words = _table(manoeuvre.to_toml(), skip=("kind", "duration_s"))
        rows.append(("manoeuvres", manoeuvre.kind.replace("_", " "), time, end, words))
        time = end
    specs = {(f.kind, tuple(f.instruments), f.channels): f for f in (scenario.faults if scenario is not None else ())}
    for label in recording.faults:
        start, end = max(label.start, 0.0), min(label.end, recording.duration)
        if start < end:
            spec = specs.get((label.kind, tuple(label.instruments), label.channels))
            known = {} if spec is None else spec.to_toml()
            words = _table(known, skip=("kind", "instruments", "start_s", "end_s", "intervals_s"))
            name = label.kind.replace("_", " ")
            rows.append((f"{name}: {label.where or 'all'}", name, start, end, words))
    return columns(EVENT, rows)


def _table(values: Mapping[str, Any], skip: Iterable[str] = ()) -> str:
    """A table of a scenario file on one line; what is zero or not given is left out."""
    found = []
    for key, value in values.items():
        if key in skip or value is None or (isinstance(value, str) and not value) or not np.any(value):
            continue
        name, unit = worded(key)
        if isinstance(value, Mapping):
            if inner := _table(value):
                found.append(f"{name} ({inner})")
        elif isinstance(value, (list, tuple, np.ndarray)):
            found.append(f"{name} {', '.join(map(_entry, value))}{unit}")
        else:
            found.append(f"{name} {_entry(value)}{unit}")
    return "; ".join(found)


def _entry(value: Any) -> str:
    """A number, a word, or a table in a list, such as a process of an error."""
    if isinstance(value, Mapping):
        return f"({_table(value)})"
    return value if isinstance(value, str) else tables.number(value)


_SIGNS = {"deg": "°", "percent": "%", "ug": "µg", "hz": "Hz", "k": "K", "1": "1", "per": "1"}


def worded(key: str) -> tuple[str, str]:
    """A key of a scenario file as it is read: its name in words, and its unit with a space before it.

    >>> worded("sigma_m"), worded("angle_random_walk_deg_sqrt_h"), worded("max_speed_m_s"), worded("kind")
    (('sigma', ' m'), ('angle random walk', ' °/√h'), ('max speed', ' m/s'), ('kind', ''))
    """
    parts = key.split("_")
    for k in range(1, len(parts)):
        if "_".join(parts[k:]) in UNITS:
            return " ".join(parts[:k]), f" {_unit_in_signs(parts[k:])}"
    return " ".join(parts), ""


def _unit_in_signs(parts: Sequence[str]) -> str:
    found = _SIGNS.get(parts[0], parts[0])
    below = " ".join(parts[1:]).replace("sqrt ", "√").split()
    powers = [re.sub(r"(?<=[a-zA-Z])2$", "²", _SIGNS.get(p, p.replace("√hz", "√Hz"))) for p in below]
    return "/".join([found, *powers])
