"""The comparison of simulated with real errors, instrument by instrument."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from simnav.kinds import Kind
from simnav.leaderboard.figures.realism_figure import Panel, realism_panels
from simnav.leaderboard.results.frame import frame
from simnav.log.channel import list_recordings
from simnav.log.source import LogSource
from simnav.scenario import Scenario
from simnav.scenario.residuals import residuals
from simnav.source import record
from simnav.spec import UNITS, SpecError, closest
from simnav.types import Array, ImuSamples

from .classifier import Verdict, judge
from .errors import ErrorSeries, comparable, simulated_errors
from .features import LAGS, Windows, feature_names, imu_windows, windows_of
from .fit import Fit, autocovariance, fitted

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["GOAL", "InstrumentRealism", "RealismReport", "realism_of"]

#: An AUC up to this passes; so do autocorrelations within this, and standard deviations within this part.
GOAL, CLOSE, PART = 0.65, 0.15, 0.20


@dataclass(frozen=True, eq=False)
class InstrumentRealism:
    """The comparison of one instrument.

    Attributes
    ----------
    name : str
        Name of the instrument.
    verdict : Verdict
        What the classifier found.
    features : list of str
        Names of the features.
    windows : (int, int)
        Number of real and of simulated windows.
    kind : Kind or None
        Properties of the instrument; None for an IMU.
    real, simulated : (m, d) arrays or None
        Autocovariance at multiples of ``1 / rate``; None for an IMU.
    rates : (float, float)
        Readings a second, real and simulated [Hz].
    series : sequence of ErrorSeries
        The real errors; empty for an IMU.
    """

    name: str
    verdict: Verdict
    features: list[str]
    windows: tuple[int, int]
    kind: Kind | None = None
    real: Array | None = None
    simulated: Array | None = None
    rates: tuple[float, float] = (1.0, 1.0)
    series: Sequence[ErrorSeries] = ()

    @cached_property
    def fit(self) -> Fit | None:
        """Processes that fit the real error; None for an IMU."""
        return fitted(self.series) if self.series else None

    def telling(self, most: int = 3) -> list[tuple[str, float]]:
        """The features by which the simulation is known best, with the area under the ROC curve of each alone."""
        order = np.argsort(-self.verdict.single, kind="stable")[:most]
        return [(self.features[k], float(self.verdict.single[k])) for k in order]

    def rows(self) -> list[dict[str, Any]]:
        """For each component: standard deviation and autocorrelations, real and simulated, and whether they agree."""
        if self.kind is None or self.real is None or self.simulated is None:
            return []
        rows = []
        for k, component in enumerate(self.kind.components):
            factor = UNITS[component.error_unit]
            row: dict[str, Any] = {"instrument": self.name, "component": component.error}
            sd = [float(np.sqrt(c[0, k])) / factor for c in (self.real, self.simulated)]
            row |= {"unit": component.error_unit, "sd": sd[0], "sd_simulated": sd[1]}
            close = abs(sd[1] / sd[0] - 1.0) <= PART if sd[0] else sd[1] == 0.0
            for lag in LAGS:
                both = zip((self.real, self.simulated), self.rates, strict=True)
                found = [_at(c[:, k], round(lag * rate)) for c, rate in both]
                row |= {f"autocorrelation_{lag:g}_s": found[0], f"autocorrelation_{lag:g}_s_simulated": found[1]}
                close = close and abs(found[0] - found[1]) <= CLOSE
            rows.append({**row, "close": close})
        return rows

    def to_dict(self) -> dict[str, Any]:
        """What the command prints with ``--json``."""
        return {
            "instrument": self.name,
            "auc": self.verdict.auc,
            "interval": list(self.verdict.interval),
            "passes": self.verdict.auc <= GOAL,
            "windows": list(self.windows),
            "parts_of_recordings": self.verdict.parts,
            "features": {
                name: {"auc": float(a), "real": float(r), "simulated": float(s)}
                for name, a, r, s in zip(
                    self.features, self.verdict.single, self.verdict.real, self.verdict.simulated, strict=True
                )
            },
            "components": self.rows(),
            "fit": None if self.fit is None or self.kind is None else self.fit.to_toml(self.name, self.kind),
        }


@dataclass(frozen=True, eq=False)
class RealismReport:
    """The comparison of all instruments.

    Attributes
    ----------
    scenario, log : str
        Ids of the simulated and of the recorded scenario.
    instruments : list of InstrumentRealism
        The instruments that both have.
    """

    scenario: str
    log: str
    instruments: list[InstrumentRealism]

    def rows(self) -> list[dict[str, Any]]:
        """A row for each component of each instrument."""
        return [row for one in self.instruments for row in one.rows()]

    def to_dict(self) -> dict[str, Any]:
        """What the command prints with ``--json``."""
        return {"scenario": self.scenario, "log": self.log, "instruments": [one.to_dict() for one in self.instruments]}

    def to_frame(self) -> Any:
        """`rows`; see `simnav.leaderboard.results.frame.frame`."""
        return frame(self.rows())

    def toml(self) -> str:
        """The processes that fit the real errors, as tables of a scenario file."""
        parts = [f"# Fitted to {self.log} by simnav log realism."]
        parts += [one.fit.to_toml(one.name, one.kind) for one in self.instruments if one.fit and one.kind]
        return "\n".join(parts)

    def plot(self) -> Figure:
        """The autocorrelation of the errors, real and simulated, and the features that tell them apart."""
        panels = []
        for one in self.instruments:
            lines: dict[str, tuple[Array, Array]] = {}
            if one.kind is not None and one.real is not None and one.simulated is not None:
                for k, component in enumerate(one.kind.errors):
                    both = [c[:, k] / (c[0, k] or 1.0) for c in (one.real, one.simulated)]
                    lines[component] = both[0], both[1]
            low, high = one.verdict.interval
            title = f"{one.name.replace('_', ' ')}: AUC {one.verdict.auc:.2f} ({low:.2f} to {high:.2f})"
            panels.append(Panel(title, one.rates, lines, one.telling(6)))
        return realism_panels(panels, GOAL, f"{self.scenario} beside {self.log}")


def _at(covariance: Array, lag: int) -> float:
    """The autocorrelation at a lag; 0 beyond the last one, and for an error of zero."""
    return float(covariance[lag] / covariance[0]) if lag < len(covariance) and covariance[0] else 0.0


def realism_of(scenario: Scenario, log: Scenario, instruments: Sequence[str], runs: int, seed: int) -> RealismReport:
    """Compare the errors of a simulated scenario with those of a recorded one.

    Parameters
    ----------
    scenario : Scenario
        The simulation.
    log : Scenario
        The recording.
    instruments : sequence of str
        Names of instruments, or pairs like ``velocity=dvl`` where the recording has another name; empty: all that both
        have under one name, but for the IMU.
    runs : int
        Number of simulated runs.
    seed : int
        First seed of the simulated runs.

    Raises
    ------
    SpecError
        If there is no instrument that both have, or there are too few readings.
    """
    both = comparable(scenario, log)
    known = {here if here == there else f"{here}={there}": (here, there) for here, there in both}
    if scenario.imu is not None and log.log is not None and log.log.imu is not None:
        known["imu"] = "imu", "imu"
    for name in instruments:
        if name not in known:
            raise SpecError(
                f"{name!r} is not measured in {log.id} and simulated in {scenario.id} with the same equation"
                f"{closest(name, list(known))}"
            )
    names = list(instruments) or [here for here, there in both if here == there]
    if not names:
        pairs = [f"--instrument {name}" for name in known if name != "imu"]
        raise SpecError(
            f"{scenario.id} simulates no instrument, by name and equation, that {log.id} measures"
            + (f"; give a pair of names: {' or '.join(pairs)}" if pairs else "")
        )
    seeds = range(seed, seed + runs)
    found = [
        _imu(scenario, log, name, seeds) if name == "imu" else _aid(scenario, log, *known[name], seeds)
        for name in names
    ]
    return RealismReport(scenario.id, log.id, found)


def _aid(scenario: Scenario, log: Scenario, name: str, measured: str, seeds: range) -> InstrumentRealism:
    real, simulated = residuals(log, measured), simulated_errors(scenario, name, seeds)
    return compared(name, log.aids[measured].definition, real, simulated)


def compared(name: str, kind: Kind, real: Sequence[ErrorSeries], simulated: Sequence[ErrorSeries]) -> InstrumentRealism:
    """The comparison of two sets of errors of an instrument."""
    ours, theirs = windows_of(real), windows_of(simulated)
    return InstrumentRealism(
        name, judge(ours, theirs), feature_names(kind.errors), (len(ours.values), len(theirs.values)), kind,
        autocovariance(real), autocovariance(simulated), (real[0].rate, simulated[0].rate), real,
    )  # fmt: skip


def _imu(scenario: Scenario, log: Scenario, name: str, seeds: range) -> InstrumentRealism:
    assert log.log is not None
    real = [_samples(LogSource(log, k)) for k in range(len(list_recordings(log.log)))]
    simulated = [_of(record(scenario, seed).data.imu) for seed in seeds]
    (ours, names), (theirs, _) = imu_windows(real), imu_windows(simulated)
    return InstrumentRealism(name, judge(ours, theirs), names, _counts(ours, theirs))


def _counts(ours: Windows, theirs: Windows) -> tuple[int, int]:
    return len(ours.values), len(theirs.values)


def _samples(source: LogSource) -> tuple[Array, float]:
    return _of(source.advance(source.duration).imu)


def _of(imu: ImuSamples | None) -> tuple[Array, float]:
    assert imu is not None
    return np.hstack([imu.angular_rate, imu.specific_force]), float(1.0 / np.median(imu.interval))
