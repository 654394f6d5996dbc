"""A first look at a log: its streams, a scenario to begin with, and, if asked, a few rows over it."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from simnav.estimator.registry import registered
from simnav.estimator.suitability import unsuitable
from simnav.kinds import KINDS
from simnav.leaderboard.campaign.request import requests
from simnav.log.channel import list_recordings
from simnav.log.check import check_log
from simnav.log.column_guesses import guesses, left_out
from simnav.log.draft import draft
from simnav.log.draft_readings import rewritten
from simnav.log.inspection import Stream
from simnav.log.readings import probable_readings
from simnav.log.spec import TO_FILL_IN
from simnav.log.table import LogError
from simnav.scenario import parse
from simnav.source import open_source

from .ranking import tables
from .single_run import EstimatorRun, RunReport, run_once

if TYPE_CHECKING:
    from simnav.log.readings import ProbableReading
    from simnav.scenario import Scenario

__all__ = ["Inspection", "drafted", "first_run", "innovation_table"]

#: The rows of a first run, in this order; so many of those that suit.
_ROWS, _MOST = ("ekf", "ship-ekf", "gnss-only", "dead-reckoning", "inertial"), 3
#: Fewer readings say nothing of innovations.
_LEAST = 5
#: Formats whose columns are told by their names, and so many that are shown.
_TABLES, _SHOWN = ("csv", "parquet", "mat", "hdf5"), 8


@dataclass(frozen=True, eq=False)
class Inspection:
    """What the files of a log hold.

    Attributes
    ----------
    streams : tuple of simnav.log.inspection.Stream
        The streams.
    failed : tuple of str
        A sentence for each file that cannot be read.
    draft : str
        A scenario to begin with, as TOML; empty where none was asked for.
    readings : tuple of simnav.log.readings.ProbableReading
        How the streams are probably read otherwise than by names and sizes; the draft has those that are sure.
    missing : str
        One sentence that says what a person must add before the draft can be run; empty where nothing is missing.
    run : RunReport or None
        The first run, if it was asked for and nothing is missing.
    """

    streams: tuple[Stream, ...]
    failed: tuple[str, ...]
    draft: str = ""
    readings: tuple[ProbableReading, ...] = ()
    missing: str = ""
    run: RunReport | None = None

    @property
    def unknown(self) -> tuple[str, ...]:
        """A sentence for what no draft has: columns that cannot be read or are not known, and half of an IMU."""
        told, inertial = [], dict[str, str]()
        for stream in self.streams:
            spoilt = list(left_out(stream))
            told += spoilt
            guessed = [g.quantity for g in guesses(stream)]
            inertial |= {q: stream.name for q in guessed if q in ("angular_rate", "specific_force")}
            if stream.form in _TABLES and not guessed and not spoilt:
                names = ", ".join(stream.table.names[:_SHOWN])
                more = ", ..." if len(stream.table.names) > _SHOWN else ""
                told.append(
                    f"{stream.name}: what its columns are ({names}{more}) is not known by their names and sizes; if "
                    "they are of an instrument, add it to the scenario"
                )
        if len(inertial) == 1:
            ((quantity, name),) = inertial.items()
            other = "specific force" if quantity == "angular_rate" else "angular rate"
            told.append(
                f"{name}: {quantity.replace('_', ' ')}, but no stream has three axes of {other}: a draft has no IMU"
            )
        return tuple(told)


@dataclass(frozen=True, eq=False)
class _Drafted:
    """A draft, its scenario if it is one, what was rewritten in it, and what a person must add."""

    text: str
    scenario: Scenario | None
    readings: tuple[ProbableReading, ...]
    missing: str


def drafted(streams: Sequence[Stream], name: str, file: str) -> _Drafted:
    """A scenario to begin with, with the readings of its streams that are far more likely, and their probability."""
    text = draft(streams, name, file)
    if not streams or TO_FILL_IN in text:
        return _Drafted(text, None, (), (
            "no columns hold latitude and longitude, so there is no reference: add a file that has them, or fill in "
            "[log.reference.position] for positions in metres, with [log.origin]"
        ))  # fmt: skip
    try:
        scenario = parse(text, source=file)
        assert scenario.log is not None
        readings = tuple(probable_readings(scenario, list_recordings(scenario.log)[0]))
        text = rewritten(text, readings)
        return _Drafted(text, parse(text, source=file), readings, "")
    except (ValueError, OSError) as error:
        return _Drafted(text, None, (), " ".join(str(error).split()))


def first_run(scenario: Scenario, progress: Callable[..., None] | None = None) -> RunReport:
    """A few rows that suit a log, over it.

    Raises
    ------
    LogError
        If the log cannot be run, or no row suits it: one sentence.
    """
    wrong = next((f for f in check_log(scenario).findings if f.level == "error"), None)
    if wrong is not None:
        raise LogError(f"{wrong.part}: {wrong.sentence}")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # 'simnav check' tells them
        instruments = open_source(scenario, 0).instruments
        suitable = [name for name in _ROWS if not unsuitable(registered(name)(), instruments)][:_MOST]
        if not suitable:
            raise LogError(
                f"no row suits a log with {', '.join(instruments) or 'no instruments'}; add fixes, or an IMU"
            )
        return run_once(scenario, requests(suitable), 0, progress)


def innovation_table(report: RunReport) -> tables.Fitted | None:
    """Innovations beside what each row expects, without any reference: a row an estimator, a column an instrument."""
    sheets = report.recording.instruments
    found = {
        e.estimator: {n: c for n in sheets if (c := _consistency(e, n, sheets[n].kind))} for e in report.estimators
    }
    names = [n for n in sheets if any(n in of for of in found.values())]
    if not names:
        return None
    columns = ["estimator", *names]
    cells = [[label, *(of.get(n, "") for n in names)] for label, of in found.items() if of]
    return tables.Fitted(
        "Innovations: normalised squares over what the row expects", columns, cells, columns, numeric=names,
        caption="Medians, without any reference; 1 is consistent. Above it the noise figures of the draft are too "
        "small, below it too large: 'simnav log identify' fits them.",
    )  # fmt: skip


def _consistency(run: EstimatorRun, name: str, kind: str) -> str:
    from scipy.stats import chi2

    values: Any = run.trial.diagnostics.get(f"nis.{name}")
    known = np.empty(0) if values is None else np.asarray(values, dtype=np.float64)
    known = known[np.isfinite(known)]
    if len(known) < _LEAST:
        return ""
    return tables.number(float(np.median(known) / chi2.median(len(KINDS[kind].components))))
