"""The identification of a log: estimates, remarks, innovations before and after, and the scenario to use."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from simnav.leaderboard.figures.innovation_figure import InnovationPanel, innovation_figure
from simnav.leaderboard.ranking import tables
from simnav.leaderboard.results.shown import Shown
from simnav.log.table import LogError
from simnav.recording import Recording
from simnav.scenario import Scenario
from simnav.scenario.writing import toml_text

from .assumption import Assumption
from .estimates import CONSTANTS, PLACES, Estimated, enlarged, estimates, replaced, without
from .innovations import Innovations, Likelihood, neighbours
from .prediction import AWAY, Judged, Predictions, widened
from .remarks import remarks
from .scoring import log_likelihood
from .search import Fitted, search

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.table import Table

__all__ = ["Identification", "identify"]

#: Fewer readings of all instruments together say nothing. A longer log is used up to this time [s].
_LEAST, _LONGEST = 60, 1200.0
#: Figures are left out where predictions are more likely without them, by so much in the logarithm.
_BETTER = 2.0


@dataclass(frozen=True, eq=False, repr=False)
class Identification(Shown):
    """The error model of a log.

    Attributes
    ----------
    scenario : str
        Id of the scenario.
    seconds : float
        How much of the log was used [s].
    estimates : list of Estimated
        The figures with intervals.
    remarks : list of str
        What the log does not tell.
    before, after : mapping of str to Stream
        Innovations of the plain filter by instrument, with the scenario's datasheets and with those to use.
    changes : mapping
        The figures of the scenario to replace, by path of the table and key.
    table : mapping
        The whole scenario with these figures.
    """

    scenario: str
    seconds: float
    estimates: list[Estimated]
    remarks: list[str]
    before: Innovations
    after: Innovations
    changes: Mapping[str, Mapping[str, Any]]
    table: Mapping[str, Any]

    @property
    def gain(self) -> float:
        """By how much the logarithm of the likelihood is larger with the figures to use."""
        return log_likelihood(self.after) - log_likelihood(self.before)

    @property
    def toml(self) -> str:
        """The changed tables of the scenario file."""
        parts = []
        for path, table in self.changes.items():
            lines = toml_text(table).strip()
            parts.append(f"[{path}]\n{lines}\n")
        return "\n".join(parts)

    def save(self, path: Path) -> None:
        """Write the whole scenario with the figures to use."""
        path.write_text(toml_text(self.table), encoding="utf-8")

    def headline(self) -> str:
        """See `Shown.headline`."""
        return f"{self.scenario}: error model of {len(self.before)} instruments from {self.seconds:.0f} s"

    def shown(self) -> Iterator[Table]:
        """See `Shown.shown`."""
        columns = ["figure", "estimate", "95 % interval", "scenario", "told by the log"]
        for title, constant, now in (
            ("sizes of random errors", False, "scenario"),
            ("constant errors of this log", True, "scenario (sigma)"),
        ):
            columns[3] = now
            rows = [
                [e.label, f"{e.value:.3g}", f"{e.low:.3g} to {e.high:.3g}", f"{e.now:.3g}", "yes" if e.told else "no"]
                for e in self.estimates
                if e.constant == constant
            ]
            yield tables.table(f"{title}, {self.scenario}", columns, rows)
        rows = [
            [
                name,
                str(len(self.before[name].nis)),
                *(f"{float(np.mean(s[name].nis)) / s[name].value.shape[1]:.2f}" for s in (self.before, self.after)),
                *(f"{neighbours(s[name].white):.2f}" for s in (self.before, self.after)),
            ]
            for name in self.before
            if name in self.after
        ]
        yield tables.table(
            "innovations: NIS over its expectation, correlation of neighbours",
            ["instrument", "readings", "NIS before", "after", "correlation before", "after"],
            rows,
        )

    def to_dict(self) -> dict[str, Any]:
        """What the command prints with ``--json``."""
        return {
            "scenario": self.scenario,
            "seconds": self.seconds,
            "gain": self.gain,
            "estimates": [asdict(e) for e in self.estimates],
            "remarks": self.remarks,
            "toml": self.toml,
        }

    def plot(self) -> Figure:
        """Autocorrelation and NIS of the innovations before and after."""
        panels = [
            InnovationPanel(name, s.value.shape[1], s.white, self.after[name].white)
            for name, s in self.before.items()
            if name in self.after
        ]
        return innovation_figure(panels, f"{self.scenario}: innovations before and after")


def identify(
    scenario: Scenario, recording: Recording, until: float | None = None, reference: bool | None = None
) -> Identification:
    """Fit the error model of a log.

    Parameters
    ----------
    scenario : Scenario
        With a ``[log]``, or simulated; with its values drawn (`Scenario.drawn`).
    recording : Recording
        One of the scenario.
    until : float, optional
        Readings after this time are not used [s]. Default: 1200 s.
    reference : bool, optional
        Whether positions are compared with the recording's truth (`Predictions`). Default: of a log.

    Raises
    ------
    LogError
        If the log has too few readings, or the plain filter cannot run on it.
    """
    seconds = min(recording.duration, _LONGEST if until is None else until)
    likelihood, given = Likelihood(recording, seconds), Assumption(recording.instruments)
    before = likelihood.innovations(given, heading=False)
    readings = sum(len(s.time) for s in before.values())
    if readings < _LEAST:
        raise LogError(
            f"{scenario.id}: the filter used {readings} readings in {seconds:g} s; {_LEAST} or more are needed"
        )
    fitted = search(scenario, likelihood, given)
    found, changes = estimates(scenario, fitted), replaced(scenario, fitted)
    reference = scenario.log is not None if reference is None else reference
    used = _used(scenario, Predictions(recording, seconds, reference), fitted, changes)
    changes, to_use, given = used.changes, _to_use(scenario, used.changes), used.given
    after = likelihood.innovations(given, heading=False)
    said = remarks(scenario, fitted, found)
    if used.left_out:
        said.append(
            f"{used.left_out}: left out, because without them positions after {AWAY:g} s without fixes are nearer"
        )
    said += [
        f"{name}: its in-run bias is larger than the innovations say, because the position after {AWAY:g} s without "
        "fixes is further off than predicted"
        for name in used.wider
    ]
    if seconds < recording.duration and until is None:
        said.append(f"of {recording.duration:g} s the first {seconds:g} s were used; --until takes another length")
    return Identification(scenario.id, seconds, found, said, before, after, changes, to_use.to_toml())


@dataclass(frozen=True, eq=False)
class _Used:
    """What is used of a fit: the figures, what was left out and enlarged, and what a filter then assumes."""

    changes: dict[str, dict[str, Any]]
    left_out: str
    wider: list[str]
    given: Assumption
    judged: Judged


def _used(scenario: Scenario, predictions: Predictions, fitted: Fitted, changes: dict[str, dict[str, Any]]) -> _Used:
    """The figures with which positions after a time without fixes are the most likely: all, or without some of them."""
    tries: list[_Used] = []
    for left_out, some in (
        ("", changes),
        ("lever arms and delays", without(changes, PLACES)),
        ("constant errors", without(changes, CONSTANTS)),
        ("all figures", {}),
    ):
        if tries and some == changes:
            continue
        given = _assumed(scenario, some, fitted)
        wider = widened(_to_use(scenario, some), predictions, given)
        names, last = [name for name, _ in wider], wider[-1][1] if wider else given
        found = {path: dict(figures) for path, figures in some.items()}
        for path, figures in enlarged(scenario, last.instruments, names).items():
            found.setdefault(path, {}).update(figures)
        tries.append(_Used(found, left_out, names, last, predictions.judged(last)))
    best: _Used = max(tries, key=lambda t: t.judged.log_likelihood)
    return best if best.judged.log_likelihood > tries[0].judged.log_likelihood + _BETTER else tries[0]


def _assumed(scenario: Scenario, changes: Mapping[str, Mapping[str, Any]], fitted: Fitted) -> Assumption:
    """What a filter assumes with some changes."""
    delays = fitted.maximum.assumed.delays
    late = {n: d for n, d in delays.items() if "offset_s" in changes.get(f"log.instruments.{n}", {})}
    return Assumption(_to_use(scenario, changes).instruments_sheet(), late)


def _to_use(scenario: Scenario, changes: Mapping[str, Mapping[str, Any]]) -> Scenario:
    return Scenario.from_toml(_with(scenario.to_toml(), changes, scenario), source=f"the identified {scenario.id}")


def _with(table: dict[str, Any], changes: Mapping[str, Mapping[str, Any]], scenario: Scenario) -> dict[str, Any]:
    """A scenario's table with other figures; a coloured error takes the place of processes by name."""
    for path, figures in changes.items():
        place = table
        for key in path.split("."):
            place = place.setdefault(key, {})
        if path.startswith("instruments.") and path.split(".")[1] in scenario.aids:
            place.pop("error", None)
        place.update(figures)
    return table
