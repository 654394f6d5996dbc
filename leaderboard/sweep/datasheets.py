"""Wrong datasheets: the error of estimators when the figures of one instrument are so many times the true ones.

The true errors of the instruments stay the same, bit for bit but for rounding: the datasheet is multiplied by the
factor, and ``times_datasheet`` by its inverse. So the sweep shows what an estimator makes of a wrong figure, and
nothing else. Each estimator is compared with the plain row, which is told the same.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from copy import deepcopy
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from simnav.leaderboard.figures.style import Style
from simnav.leaderboard.ranking import tables
from simnav.leaderboard.ranking.plain_row import plain_row
from simnav.leaderboard.ranking.statistics import FAILURE
from simnav.leaderboard.ranking.stored_robustness import Profile, ProfilePoint
from simnav.leaderboard.results.errors import RequestError
from simnav.leaderboard.results.frame import frame
from simnav.leaderboard.results.shown import Shown
from simnav.scenario import Scenario
from simnav.sensors.imu import TriadSpec
from simnav.sensors.instrument import AidSpec, figures_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.table import Table

    from simnav.leaderboard.campaign.campaign import Summary
    from simnav.leaderboard.results.result import Result

__all__ = ["FACTORS", "SCORE", "DatasheetSetting", "Robustness", "bases", "checked_factors", "profiles", "settings"]

#: What the figures of a datasheet are multiplied by, if nothing else was asked for; the true datasheet is added.
FACTORS = (1.0 / 3.0, 3.0, 10.0)
#: The score that is compared.
SCORE = "horizontal_rmse"

_FILES = ("with-imu.toml", "without-imu.toml")
_IMU = "imu"
_RANGE = 1000.0  # largest factor, and its inverse the smallest


@dataclass(frozen=True, eq=False)
class DatasheetSetting:
    """A scenario in which one datasheet is wrong.

    Attributes
    ----------
    base : str
        Versioned id of the scenario with true datasheets.
    instrument : str
        Name of the instrument; empty if all datasheets are true.
    factor : float
        The figures of its datasheet are so many times the true ones.
    scenario : Scenario
        Scenario with this datasheet, under its own name.
    """

    base: str
    instrument: str
    factor: float
    scenario: Scenario


@dataclass(frozen=True, eq=False, repr=False)
class Robustness(Shown):
    """Robustness profiles.

    Attributes
    ----------
    rows : tuple of Profile
        One for each estimator and each plain row that suits a scenario which suits the estimator.
    unsuitable : tuple of str
        Labels of estimators without a profile: no scenario suits them.
    summary : Summary
        Summary of the campaign.
    file : str
        File that the profiles were written to; empty if they were not.
    """

    rows: tuple[Profile, ...]
    unsuitable: tuple[str, ...]
    summary: Summary
    file: str = ""

    def headline(self) -> str:
        """Whose profiles."""
        names = ", ".join(dict.fromkeys(row.estimator for row in self.rows)) or "none"
        return f"robustness profiles of {names}"

    def shown(self) -> Sequence[Table]:
        """A row an estimator and plain row: the ratio with true datasheets, and the worst for each instrument."""
        names = list(dict.fromkeys(p.instrument for row in self.rows for p in row.points))
        rows = []
        for row in self.rows:
            true = next((p.ratio for p in row.points if p.factor == 1.0), None)
            cells = []
            for name in names:
                wrong = [p for p in row.points if p.instrument == name and p.factor != 1.0]
                worst = max(wrong, key=lambda p: p.ratio, default=None)
                cells.append("" if worst is None else f"{tables.number(worst.ratio)} at {worst.factor:.3g}")
            failed = sum(p.failed for p in row.points if p.factor != 1.0)
            rows.append([row.estimator, row.plain, tables.number(true), *cells, str(failed) if failed else ""])
        return [tables.table(
            "Error over that of the plain row; for each instrument the worst ratio, and datasheet over truth there",
            ["estimator", "plain row", "true datasheets", *names, "failed"],
            rows,
            numeric=("true datasheets", *names, "failed"),
            caption="Geometric mean over the seeds. The plain row is told the same wrong datasheet.",
        )]  # fmt: skip

    def to_dict(self) -> dict[str, Any]:
        """What ``simnav robustness --json`` prints."""
        return {
            "rows": [asdict(row) | {"worst": asdict(row.worst)} for row in self.rows],
            "unsuitable": list(self.unsuitable),
            "results": str(self.summary.folder),
            "file": self.file,
        }

    def to_frame(self) -> Any:
        """A row an estimator, instrument and factor; see `simnav.leaderboard.results.frame.frame`."""
        return frame([
            {"estimator": row.estimator, "plain": row.plain, "scenario": row.scenario, **asdict(point)}
            for row in self.rows for point in row.points
        ])  # fmt: skip

    def plot(self) -> Figure:
        """Ratio to the plain row against the factor, one panel an instrument."""
        from matplotlib.figure import Figure

        names = list(dict.fromkeys(p.instrument for row in self.rows for p in row.points))
        figure = Figure(figsize=(3.2 * len(names), 3.2), layout="constrained")
        panels = figure.subplots(1, len(names), sharey=True, squeeze=False)[0]
        style = Style([f"{row.estimator} / {row.plain}" for row in self.rows])
        for panel, name in zip(panels, names, strict=True):
            panel.axhline(1.0, color="0.7", linewidth=0.8)
            for row in self.rows:
                label = f"{row.estimator} / {row.plain}"
                points = sorted((p.factor, p.ratio) for p in row.points if p.instrument == name)
                if points:
                    panel.plot(*zip(*points, strict=True), marker="o", label=label, color=style.colour(label))
            panel.set(xscale="log", yscale="log", title=name, xlabel="datasheet over truth")
        panels[0].set_ylabel("error over that of the plain row")
        panels[0].legend(fontsize="small")
        return figure


def checked_factors(given: Sequence[float]) -> tuple[float, ...]:
    """Factors, ascending and without 1.

    Raises
    ------
    RequestError
        If one of them is not a number between 1/1000 and 1000, or there is none but 1.
    """
    for value in given:
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not 1.0 / _RANGE <= value <= _RANGE:
            raise RequestError(f"factors: {value!r} should be a number between {1.0 / _RANGE:g} and {_RANGE:g}")
    found = tuple(sorted({float(v) for v in given} - {1.0}))
    if not found:
        raise RequestError("factors: name one or several other than 1, like 0.33,3,10")
    return found


def bases() -> list[dict[str, Any]]:
    """The scenarios whose datasheets are varied, as TOML tables: of a ship with an IMU, and of one without."""
    folder = Path(__file__).parent
    return [tomllib.loads((folder / name).read_text(encoding="utf-8")) for name in _FILES]


def settings(table: Mapping[str, Any], factors: Sequence[float]) -> list[DatasheetSetting]:
    """The scenario with true datasheets, and with each datasheet wrong by each factor.

    Parameters
    ----------
    table : mapping
        TOML of the scenario. The figures of its instruments must be numbers, not distributions.
    factors : sequence of float
        As from `checked_factors`.

    Raises
    ------
    RequestError
        If a figure is drawn.
    """
    truth = Scenario.from_toml(deepcopy(dict(table)), source=str(table["name"]))
    found = [DatasheetSetting(truth.id, "", 1.0, truth)]
    for instrument in table["instruments"]:
        for factor in factors:
            wrong = deepcopy(dict(table))
            _multiply(wrong["instruments"][instrument], _specs(truth, instrument), factor)
            slug = f"{factor:.3g}".replace(".", "p")
            wrong["name"] = f"{table['name']}-{instrument.replace('_', '-')}-times-{slug}"
            scenario = Scenario.from_toml(wrong, source=wrong["name"])
            found.append(DatasheetSetting(truth.id, instrument, factor, scenario))
    return found


def _specs(scenario: Scenario, instrument: str) -> dict[str, AidSpec | TriadSpec]:
    """The specifications with figures of an instrument, by the key of their table ("" is that of the instrument)."""
    if instrument != _IMU:
        return {"": scenario.aids[instrument]}
    assert scenario.imu is not None
    return {"gyroscope": scenario.imu.gyroscope, "accelerometer": scenario.imu.accelerometer}


def _multiply(table: dict[str, Any], specs: Mapping[str, AidSpec | TriadSpec], factor: float) -> None:
    """Multiply the figures of a table in place, and keep the true ones."""
    for name, spec in specs.items():
        part = table[name] if name else table
        keys = {key: field for key, (field, _) in type(spec).toml_keys().items()}
        valid = figures_of(type(spec), spec.errors)
        actual = dict(part.get("times_datasheet", {}))
        for key in [k for k in part if keys[k] in valid]:
            value = part[key]
            numbers = value if isinstance(value, list) else [value]
            if not all(isinstance(v, (int, float)) for v in numbers):
                raise RequestError(f"{key} = {value!r:.60} is drawn; the sweep of datasheets wants a number")
            part[key] = [factor * v for v in numbers] if isinstance(value, list) else factor * value
            actual[keys[key]] = actual.get(keys[key], 1.0) / factor
        part["times_datasheet"] = actual


def profiles(found: Sequence[DatasheetSetting], results: Iterable[Result], labels: Sequence[str]) -> list[Profile]:
    """The profiles of estimators from the results of all settings.

    Parameters
    ----------
    found : sequence of DatasheetSetting
        The settings, those of one scenario after those of another.
    results : iterable of Result
        Of all estimators and plain rows.
    labels : sequence of str
        Estimators whose profiles are wanted.

    Returns
    -------
    list of Profile
        None for an estimator that the scenario does not suit.
    """
    runs: dict[tuple[str, str], dict[int, Result]] = {}
    for r in results:
        if r.tried:
            runs.setdefault((r.scenario, r.estimator), {})[r.seed] = r
    made = []
    for base in dict.fromkeys(s.base for s in found):
        mine = [s for s in found if s.base == base]
        there = {label for s in mine for scenario, label in runs if scenario == s.scenario.id}
        plain = plain_row(SCORE, there)
        for label in labels:
            if label in there and plain:
                made.append(_profile(mine, runs, label, plain))
    return [p for p in made if p is not None]


def _profile(
    mine: Sequence[DatasheetSetting], runs: Mapping[tuple[str, str], Mapping[int, Result]], label: str, plain: str
) -> Profile | None:
    points, versions, count = [], (1, 1), 0
    names = list(dict.fromkeys(s.instrument for s in mine if s.instrument))
    for s in mine:
        of, beside = runs.get((s.scenario.id, label), {}), runs.get((s.scenario.id, plain), {})
        seeds = sorted(of.keys() & beside.keys())
        if not seeds:
            return None
        ratios = [_ratio(of[k], beside[k]) for k in seeds]
        ratio = math.exp(sum(map(math.log, ratios)) / len(ratios))
        failed = sum(of[k].status != "ok" for k in seeds)
        versions, count = (of[seeds[0]].estimator_version, beside[seeds[0]].estimator_version), len(seeds)
        points += [ProfilePoint(name, s.factor, ratio, failed) for name in ([s.instrument] if s.instrument else names)]
    points.sort(key=lambda p: (names.index(p.instrument), p.factor))
    return Profile(label, versions[0], plain, versions[1], mine[0].base, count, tuple(points))


def _ratio(of: Result, beside: Result) -> float:
    """Error over error, between 1/1000 and 1000; a failed run counts as the worst."""
    a, b = (float(r.scores.get(SCORE, math.nan)) if r.status == "ok" else math.nan for r in (of, beside))
    if not (math.isfinite(a) and a > 0.0):
        return FAILURE
    if not (math.isfinite(b) and b > 0.0):
        return 1.0 / FAILURE
    return min(max(a / b, 1.0 / FAILURE), FAILURE)
