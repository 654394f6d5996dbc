"""The Allan deviation of an IMU, simulated or recorded, beside what its datasheet says; see `simnav.allan`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from simnav.sensors.allan import AXES, AllanCurve, imu_allan
from simnav.spec import UNITS, SpecError
from simnav.types import Array, ImuDatasheet, ImuSamples, TriadDatasheet

from .figures.allan_figure import Panel, allan_panels
from .ranking import tables
from .results.frame import frame
from .results.shown import Shown

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.table import Table

    from simnav.scenario import Scenario

__all__ = ["AllanReport", "allan_of_file", "allan_of_scenario"]

#: Gravity of an IMU at rest [m/s^2], along the body axes: the specific force points up.
_AT_REST = (0.0, 0.0, -9.80665)
#: Memory of a simulated sample [bytes].
_SAMPLE = 400.0
#: Of a triad: its name in labels, and the units of level, white noise and random walk of the output.
_TRIADS = (
    ("gyroscope", "deg_h", "deg_sqrt_h", "deg_h_sqrt_h"),
    ("accelerometer", "ug", "ug_sqrt_hz", "ug_sqrt_s"),
)
#: How a unit is written.
_WRITTEN = {
    "deg_h": "deg/h",
    "deg_sqrt_h": "deg/√h",
    "deg_h_sqrt_h": "deg/h/√h",
    "ug": "µg",
    "ug_sqrt_hz": "µg/√Hz",
    "ug_sqrt_s": "µg/√s",
}


def markov_variance(sheet: TriadDatasheet, time: Array) -> Array:
    """The Allan variance that a datasheet predicts, in SI units.

    White noise, quantization and random walks as in `simnav.sensors.allan.NoiseCoefficients`; the in-run bias is a
    first-order Gauss-Markov process (IEEE Std 952-1997, annex C, eq. C.12).
    """
    variance = sheet.random_walk**2 / time + sheet.rate_random_walk**2 * time / 3.0
    variance = variance + 3.0 * (sheet.quantization**2 / 12.0) / time**2
    if sheet.bias_instability > 0.0 and np.isinf(sheet.correlation_time):
        variance = variance + sheet.bias_instability**2 * time / 3.0
    elif sheet.bias_instability > 0.0:
        x = time / sheet.correlation_time
        shape = 1.0 - (3.0 - 4.0 * np.exp(-x) + np.exp(-2.0 * x)) / (2.0 * x)
        # For short times the terms above cancel; the first term of the series is x / 3.
        shape = np.where(x < 1e-3, x / 3.0, shape)
        variance = variance + 2.0 * sheet.bias_instability**2 / x * np.where(x < 1e-3, x * x / 3.0, shape)
    return np.asarray(variance)


@dataclass(frozen=True, eq=False, repr=False)
class AllanReport(Shown):
    """The Allan deviation of the six axes of an IMU.

    Attributes
    ----------
    title : str
        The scenario or the file.
    origin : str
        ``simulated at rest`` or what is read.
    rate, duration : float
        Sample rate [Hz] and length of the samples [s].
    curve : AllanCurve
        The Allan deviation.
    datasheet : ImuDatasheet or None
        What an estimator is told.
    """

    title: str
    origin: str
    rate: float
    duration: float
    curve: AllanCurve
    datasheet: ImuDatasheet | None

    def headline(self) -> str:
        """Of what, and how long."""
        length = f"{self.duration / 3600.0:.3g} h at {self.rate:.4g} Hz"
        return f"{self.title}: Allan deviation, {self.origin}, {length}"

    def shown(self) -> Sequence[Table]:
        """A row for each axis."""
        rows = []
        for row in self.rows():
            cells = [row["axis"].replace("_", " ")]
            for name in ("random_walk", "lowest"):
                told = row[f"{name}_datasheet"]
                beside = "" if told is None else f" ({tables.number(told)})"
                at = f" at {tables.number(row['lowest_at_s'])} s" if name == "lowest" else ""
                cells.append(f"{tables.number(row[name])}{beside} {row[f'{name}_unit']}{at}")
            cells.append(f"{tables.number(row['bias_instability'])} {row['lowest_unit']}")
            cells.append(f"{tables.number(row['rate_random_walk'])} {row['rate_random_walk_unit']}")
            rows.append(cells)
        columns = ["axis", "white noise", "lowest", "bias instability", "random walk"]
        return [tables.table(self.headline(), columns, rows)]

    def rows(self) -> list[dict[str, Any]]:
        """A row for each axis, in the units of datasheets: coefficients, lowest deviation, and the datasheet."""
        rows = []
        for i, (axis, found) in enumerate(zip(AXES, self.curve.coefficients(), strict=True)):
            _, level, white, walk = _TRIADS[i // 3]
            sheet = self._sheet(i // 3)
            rows.append(
                {
                    "axis": axis,
                    "random_walk": found.random_walk / UNITS[white],
                    "random_walk_unit": _WRITTEN[white],
                    "random_walk_datasheet": None if sheet is None else sheet.random_walk / UNITS[white],
                    "lowest": found.lowest / UNITS[level],
                    "lowest_unit": _WRITTEN[level],
                    "lowest_at_s": found.at,
                    "lowest_datasheet": None if sheet is None else self._lowest(sheet) / UNITS[level],
                    "bias_instability": found.bias_instability / UNITS[level],
                    "rate_random_walk": found.rate_random_walk / UNITS[walk],
                    "rate_random_walk_unit": _WRITTEN[walk],
                }
            )
        return rows

    def to_dict(self) -> dict[str, Any]:
        """What the command prints with ``--json``."""
        return {
            "title": self.title,
            "origin": self.origin,
            "rate": self.rate,
            "duration": self.duration,
            "axes": self.rows(),
            "time": self.curve.time,
            "deviation": dict(zip(AXES, self.curve.deviation.T, strict=True)),
        }

    def columns(self) -> Mapping[str, Array]:
        """Averaging times [s] and deviations [rad/s, m/s^2], by name."""
        units = ["rad_s"] * 3 + ["m_s2"] * 3
        named = {f"{axis}_{unit}": d for axis, unit, d in zip(AXES, units, self.curve.deviation.T, strict=True)}
        return {"averaging_time_s": self.curve.time, **named}

    def to_frame(self) -> Any:
        """`rows`; see `simnav.leaderboard.results.frame.frame`."""
        return frame(self.rows())

    def plot(self) -> Figure:
        """The Allan deviation of gyroscopes and accelerometers, with that of the datasheet."""
        panels = []
        for k, (name, level, _, _) in enumerate(_TRIADS):
            sheet = self._sheet(k)
            told = None if sheet is None else np.sqrt(markov_variance(sheet, self.curve.time)) / UNITS[level]
            lines = {axis: self.curve.deviation[:, 3 * k + j] / UNITS[level] for j, axis in enumerate("xyz")}
            panels.append(Panel(f"Allan deviation, {name}s [{_WRITTEN[level]}]", lines, told))
        return allan_panels(self.curve.time, panels, f"{self.title}: {self.origin}, {self.duration / 3600.0:.3g} h")

    def _sheet(self, triad: int) -> TriadDatasheet | None:
        if self.datasheet is None:
            return None
        return (self.datasheet.gyroscope, self.datasheet.accelerometer)[triad]

    def _lowest(self, sheet: TriadDatasheet) -> float:
        return float(np.sqrt(markov_variance(sheet, self.curve.time)).min())


def allan_of_scenario(scenario: Scenario, seed: int, duration: float, start: float, end: float | None) -> AllanReport:
    """The Allan deviation of the IMU of a scenario: simulated at rest, or of the recording.

    Parameters
    ----------
    scenario : Scenario
        A simulated or a recorded scenario.
    seed : int
        Seed of the errors; or which recording.
    duration : float
        Length of the simulation [s].
    start, end : float
        The part of a recording that is taken [s]; None: to its end.

    Raises
    ------
    SpecError
        If the scenario has no IMU, or too few samples.
    """
    if scenario.imu is None:
        raise SpecError(f"{scenario.id}: there is no IMU in it")
    scenario = scenario.drawn(seed)
    imu = scenario.imu
    assert imu is not None
    if scenario.log is not None:
        return _of_log(scenario, seed, start, end)
    from simnav.source import free_memory

    n = round(duration * imu.rate)
    if n < 20:
        raise SpecError(f"{scenario.id}: duration = {duration:g} s is {n} samples of the IMU; at least 20 are wanted")
    if n * _SAMPLE > free_memory():
        raise SpecError(
            f"{scenario.id}: duration = {duration:g} s at {imu.rate:g} Hz takes about {n * _SAMPLE / 2**30:.3g} GiB of "
            "memory, which is not free"
        )
    actual = scenario.actual().imu
    assert actual is not None
    time = np.arange(1, n + 1) / imu.rate
    still = ImuSamples(time, np.full(n, 1.0 / imu.rate), np.zeros((n, 3)), np.tile(_AT_REST, (n, 1)))
    samples = actual.build(scenario.root(seed)).sense(still, overwrite=True)
    curve = imu_allan(samples, imu.rate)
    return AllanReport(scenario.id, "simulated at rest", imu.rate, n / imu.rate, curve, imu.datasheet())


def _of_log(scenario: Scenario, seed: int, start: float, end: float | None) -> AllanReport:
    from simnav.log.channel import list_recordings
    from simnav.log.imu_series import read_imu

    assert scenario.log is not None
    assert scenario.log.imu is not None  # `simnav.scenario.consistency`
    assert scenario.imu is not None
    names = list_recordings(scenario.log)
    name = names[seed % len(names)]
    series = read_imu(scenario.log, scenario.log.imu, name)
    origin = f"recording {name!r}" if name else "recording"
    time = series.edge[1:] - series.edge[0]
    return _part(scenario.id, origin, time, series.mean, start, end, scenario.imu.datasheet())


def allan_of_file(path: Path, start: float, end: float | None) -> AllanReport:
    """The Allan deviation of the IMU of a recording that ``simnav simulate`` wrote.

    Raises
    ------
    SpecError
        If there is no such file, it is no recording, or there is no IMU in it.
    """
    from simnav.recording import Recording, RecordingError

    try:
        recording = Recording.load(path)
    except FileNotFoundError:
        raise SpecError(f"{path}: there is no such file") from None
    except RecordingError as error:
        raise SpecError(str(error)) from None
    imu = recording.data.imu
    if imu is None:
        raise SpecError(f"{path}: there is no IMU in it")
    values = np.hstack([imu.angular_rate, imu.specific_force])
    return _part(path.name, "recorded", imu.time, values, start, end, recording.instruments.imu)


def _part(
    title: str, origin: str, time: Array, values: Array, start: float, end: float | None, sheet: ImuDatasheet | None
) -> AllanReport:
    """The report of a part of a recording."""
    chosen = (time > start) & (time <= (np.inf if end is None else end))
    time, values = time[chosen], values[chosen]
    if len(time) < 20:
        raise SpecError(
            f"{title}: {len(time)} samples of the IMU are from start = {start:g} s to "
            f"{'the end' if end is None else f'end = {end:g} s'}; at least 20 are wanted"
        )
    interval = float(np.median(np.diff(time)))
    rate = 1.0 / interval
    samples = ImuSamples(time, np.full(len(time), interval), values[:, :3], values[:, 3:])
    return AllanReport(title, origin, rate, len(time) * interval, imu_allan(samples, rate), sheet)
