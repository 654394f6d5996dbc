"""Whether the simulated errors of pseudoranges are like those of a receiver that stands still: RINEX files beside us.

``python -m simnav.leaderboard.realism.codes OBSERVATIONS NAVIGATION`` compares the files of any receiver with a
simulation at the same place and time, with the same broadcast ephemerides. The error of a pseudorange is what is left
of it after range, clock of the satellite, delays by the models, and the clock of the receiver. Its mean of each
satellite over the file is left out: it is that of a few hours of orbit, clock and atmosphere, of which a file of
minutes has one draw.

The figures of a receiver that no model gives, the noise at 45 dB-Hz and its correlation time, are fitted to the file.
Then how the errors grow towards the horizon, and how they are correlated, are those of the models.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simnav.geometry.earth import relative_position
from simnav.log.formats.gps_time import leap_seconds
from simnav.log.formats.rinex import read_rinex
from simnav.log.table import LogError
from simnav.satellites.ephemeris import Ephemerides
from simnav.satellites.orbit import SPEED_OF_LIGHT
from simnav.satellites.point_solution import Ranges, solve
from simnav.satellites.rinex_navigation import read_navigation
from simnav.satellites.signal_errors import density_ratio, noise_factor, range_error
from simnav.satellites.sky import Sight, Sky
from simnav.sensors.gnss_raw import SYSTEMS, GnssRaw
from simnav.source import record

__all__ = ["Band", "CodeErrors", "by_elevation", "compared", "correlations", "fitted", "real_codes", "simulated_codes"]

Array = NDArray[np.float64]

#: Codes of the first frequency, the preferred first (RINEX 3.05, section 5.1).
_CODES = {"G": ("C1C", "C1L", "C1X"), "E": ("C1C", "C1X", "C1B"), "C": ("C2I", "C1I", "C2X")}
#: Lags of correlations [s], least elevation of what is compared, width of a band [rad], least epochs of a satellite.
LAGS = (1.0, 10.0, 60.0)
_MASK, _WIDTH, _FEWEST = np.radians(10.0), np.radians(10.0), 60
#: A station is solved so many times, with these errors of a range: noise at 45 dB-Hz, orbit and clock [m].
_SOLUTIONS, _NOISE, _ORBIT = 60, 0.3, 0.5
#: The relative error of Klobuchar's model that ``gnss_raw`` has.
_HALF: float = GnssRaw.model_fields["ionosphere_error"].default
#: Correlation times of orbit, clock and ionosphere that are fitted [s].
_SHORTEST, _LONGEST = 60.0, 86400.0


@dataclass(frozen=True, eq=False)
class CodeErrors:
    """Errors of the pseudoranges of c satellites at n epochs.

    Attributes
    ----------
    satellites : tuple of str
        Their names.
    time : (n,) array
        Epochs, evenly spaced [s].
    elevation, ratio : (n, c) array
        Elevation [rad] and C/N0 [dB-Hz].
    ionosphere : (n, c) array
        Delay by Klobuchar's model [m].
    error : (n, c) array
        Errors without the clock of the receiver [m]; NaN without a pseudorange, and below 10 degrees.
    position : (3,) array
        Latitude, longitude [rad] and height [m] of the antenna.
    epoch : datetime
        GPS time of the first.
    """

    satellites: tuple[str, ...]
    time: Array
    elevation: Array
    ratio: Array
    ionosphere: Array
    error: Array
    position: Array
    epoch: datetime

    def deviations(self) -> Array:
        """The (n, c) errors less the mean of each satellite; NaN for satellites of few epochs."""
        enough = np.isfinite(self.error).sum(axis=0) >= _FEWEST
        mean = np.array([np.nanmean(e) if many else np.nan for e, many in zip(self.error.T, enough, strict=True)])
        return np.asarray(self.error - mean)


@dataclass(frozen=True)
class Band:
    """The errors in a band of elevations: its lower edge [deg], satellites, and standard deviations [m]."""

    lowest: float
    satellites: int
    real: float
    simulated: float


def real_codes(observations: Path, navigation: Path) -> CodeErrors:
    """The errors of a receiver that stood still.

    Parameters
    ----------
    observations, navigation : Path
        RINEX files of one time and place.

    Raises
    ------
    LogError
        If the observations cannot be read, have no pseudoranges of satellites of the navigation file, or give no
        position.
    """
    table, ephemerides = read_rinex(observations), read_navigation(navigation)
    own = {name: t for (_, name), t in table.tables.items() if name in ephemerides.satellite}
    codes = {n: next((c for c in _CODES.get(n[0], ()) if c in t.columns), "") for n, t in own.items()}
    names = tuple(sorted(n for n, code in codes.items() if code))
    if not names:
        raise LogError(f"{observations}: no pseudorange of a satellite of which {navigation} has an ephemeris")
    stamps = np.unique(np.concatenate([np.asarray(own[n].columns["time"], dtype=np.float64) for n in names]))
    pseudorange, ratio = (np.full((len(stamps), len(names)), np.nan) for _ in range(2))
    for j, name in enumerate(names):
        columns = own[name].columns
        row = np.searchsorted(stamps, np.asarray(columns["time"], dtype=np.float64))
        pseudorange[row, j] = columns[codes[name]]
        ratio[row, j] = columns.get(f"S{codes[name][1:]}", np.full(len(row), np.nan))
    begin = datetime.fromtimestamp(float(stamps[0] + leap_seconds(stamps[:1])[0]), UTC).replace(tzinfo=None)
    sky, time = Sky(ephemerides, names, begin), stamps - stamps[0]
    delay = SPEED_OF_LIGHT * np.array([_group_delay(ephemerides, n) for n in names])
    position = _station(sky, time, pseudorange - delay, str(observations))
    seen = _seen(sky, time, position)
    left = pseudorange - delay - _predicted(seen) + SPEED_OF_LIGHT * seen.clock
    return CodeErrors(names, time, seen.elevation, ratio, seen.ionosphere, _without_clock(left, seen), position, begin)


def simulated_codes(
    real: CodeErrors, navigation: Path, settings: Mapping[str, Any], seeds: Sequence[int]
) -> list[CodeErrors]:
    """Simulations at the place and time of a receiver, one for each seed.

    Parameters
    ----------
    real : CodeErrors
        Of the receiver.
    navigation : Path
        The ephemerides.
    settings : mapping
        Keys of ``gnss_raw``, such as `fitted` gives.
    seeds : sequence of int
        Seeds of the runs.
    """
    from simnav.scenario import Scenario

    latitude, longitude = np.degrees(real.position[:2]).tolist()
    letters = {name[0] for name in real.satellites}
    duration = max(1.0, float(np.floor(real.time[-1])))
    place = {"latitude_deg": latitude, "longitude_deg": longitude}
    raw = {
        "navigation": str(navigation), "epoch": real.epoch.isoformat(), "span_s": duration, **place,
        "systems": [system for system, letter in SYSTEMS.items() if letter in letters],
        "sigma_range_rate_m_s": 0.05, "rate_hz": 1.0 / float(np.median(np.diff(real.time))), **settings,
    }  # fmt: skip
    scenario = Scenario.from_toml({
        "name": "station", "version": 1, "title": "a receiver that stands still", "duration_s": duration,
        "start": {**place, "height_m": float(real.position[2]), "speed_m_s": 0.0}, "vessel": {"kind": "ship"},
        "instruments": {"gnss_raw": raw},
    })  # fmt: skip
    spec = scenario.instruments["gnss_raw"]
    assert isinstance(spec, GnssRaw)
    found = []
    for seed in seeds:
        stream = record(scenario, seed).data.aids["gnss_raw"]
        time = np.unique(stream.time)
        value, ratio = (np.full((len(time), len(stream.channels)), np.nan) for _ in range(2))
        row = np.searchsorted(time, stream.time)
        value[row, stream.channel] = stream.value[:, 0]
        seen = _seen(Sky(spec.ephemerides(), stream.channels, real.epoch), time, real.position)
        ratio[row, stream.channel] = density_ratio(seen.elevation)[row, stream.channel]
        error = _without_clock(value - _predicted(seen), seen)
        found.append(
            CodeErrors(stream.channels, time, seen.elevation, ratio, seen.ionosphere, error, real.position, real.epoch)
        )
    return found


def fitted(codes: CodeErrors) -> dict[str, float]:
    """The figures of the receiver and of its hour that fit best, as keys of ``gnss_raw``.

    The noise at 45 dB-Hz is the median absolute deviation of all satellites, each in units of its noise by C/N0, that
    of Galileo apart. Its correlation time is that of an exponential through the correlation after ten seconds, less
    what is left after sixty. What is left is of errors that last: a Gauss-Markov process of a correlation time t that
    is much longer than the file of length T has the variance sigma^2 T / (3 t) about its mean.
    """
    ratio = np.where(np.isfinite(codes.ratio), codes.ratio, density_ratio(codes.elevation))
    scaled = np.abs(codes.deviations() / noise_factor(ratio))
    galileo = np.array([name[0] == SYSTEMS["galileo"] for name in codes.satellites])
    others, own = (1.4826 * _median(scaled[:, chosen]) for chosen in (~galileo, galileo))
    found = {"sigma_pseudorange_m": round(others if np.isfinite(others) else own, 3)}
    if np.isfinite(others) and np.isfinite(own):
        found["galileo_noise"] = round(own / others, 2)
    _, after, rest = correlations([codes])
    lasting = range_error(codes.elevation, _ORBIT, 1.0) ** 2 + (_HALF * codes.ionosphere) ** 2
    share = float(max(rest, 0.0)) * float(np.nanmean(codes.deviations() ** 2))
    slow = float(np.nanmean(lasting) * (codes.time[-1] - codes.time[0]) / (3.0 * max(share, 1e-9)))
    slow = min(max(slow, _SHORTEST), _LONGEST)
    kept = max((after - max(rest, 0.0)) / (1.0 - max(rest, 0.0)), 0.0)
    time = 0.0 if kept <= np.exp(-LAGS[1]) else float(-LAGS[1] / np.log(min(kept, 0.99)))
    return {**found, "noise_time_s": round(time, 1), "correlation_time_s": slow, "ionosphere_time_s": slow}


def _median(values: Array) -> float:
    return float(np.nanmedian(values)) if np.isfinite(values).any() else np.nan


def by_elevation(codes: Sequence[CodeErrors]) -> dict[float, tuple[int, float]]:
    """Satellites and standard deviation [m] of the errors in each band of ten degrees, by its lower edge [deg]."""
    found: dict[float, tuple[int, float]] = {}
    for low in np.arange(_MASK, np.pi / 2.0 - 1e-9, _WIDTH):
        values, count = [], 0
        for one in codes:
            deviations = one.deviations()
            middle = np.array([np.mean(e) for e in one.elevation.T])
            inside = (middle >= low) & (middle < low + _WIDTH) & np.isfinite(deviations).any(axis=0)
            values.append(deviations[:, inside].ravel())
            count += int(inside.sum())
        every = np.concatenate(values)
        if np.isfinite(every).any():
            found[float(np.degrees(low).round())] = count, float(np.sqrt(np.nanmean(every**2)))
    return found


def correlations(codes: Sequence[CodeErrors]) -> tuple[float, float, float]:
    """Correlation of the errors after 1, 10 and 60 s: the mean over the satellites."""
    found = []
    for lag in LAGS:
        values = []
        for one in codes:
            steps = max(1, round(lag / float(np.median(np.diff(one.time)))))
            for error in one.deviations().T:
                both = error[:-steps] * error[steps:]
                if np.isfinite(both).sum() >= _FEWEST:
                    values.append(float(np.nanmean(both) / np.nanmean(error**2)))
        found.append(float(np.mean(values)) if values else 0.0)
    return found[0], found[1], found[2]


def compared(real: CodeErrors, simulated: Sequence[CodeErrors]) -> list[Band]:
    """The bands of elevations that both have."""
    ours = by_elevation(simulated)
    return [Band(low, n, sd, ours[low][1]) for low, (n, sd) in by_elevation([real]).items() if low in ours]


def _group_delay(ephemerides: Ephemerides, satellite: str) -> float:
    return float(ephemerides.group_delay[ephemerides.satellite.index(satellite)])


def _seen(sky: Sky, time: Array, position: Array) -> Sight:
    return sky.sight(time, np.repeat(position[None], len(time), axis=0), np.zeros((len(time), 3)))


def _predicted(seen: Sight) -> Array:
    return np.asarray(seen.range + seen.ionosphere + seen.troposphere)


def _without_clock(left: Array, seen: Sight) -> Array:
    """What is left of pseudoranges above the mask, less the clock of the receiver.

    The clock is the median over the satellites, and then the mean of their deviations, weighted by their noise: a
    satellite that sets must not move it by its mean, and the noise of low satellites is not spread over the others.
    """
    up = np.where(seen.elevation >= _MASK, left, np.nan)
    heard = np.isfinite(up).any(axis=1)
    up, weight = up[heard], noise_factor(density_ratio(seen.elevation[heard])) ** -2.0
    up = up - np.nanmedian(up, axis=1)[:, None]
    for _ in range(3):
        there = np.isfinite(up)
        mean = np.sum(np.where(there, up, 0.0), axis=0) / np.maximum(there.sum(axis=0), 1)
        deviation = np.where(there, up - mean, 0.0)
        weights = np.where(there, weight, 0.0)
        up = up - (np.sum(weights * deviation, axis=1) / np.sum(weights, axis=1))[:, None]
    found = np.full(left.shape, np.nan)
    found[heard] = up
    return found


def _station(sky: Sky, time: Array, pseudorange: Array, source: str) -> Array:
    """The median of the positions that some epochs give."""
    chosen = np.unique(np.linspace(0, len(time) - 1, min(_SOLUTIONS, len(time))).astype(int))
    position: Array | None = None
    found: list[Array] = []
    for _ in range(2):  # without and with the delays of the atmosphere, which need a place
        found = []
        for k in chosen:
            place = np.zeros(3) if position is None else position
            seen = sky.sight(time[[k]], place[None], np.zeros((1, 3)))
            up = np.isfinite(pseudorange[k]) & np.isfinite(seen.range[0])
            elevation, delay = np.full(len(up), 1.0), np.zeros(len(up))
            if position is not None:
                elevation, delay = seen.elevation[0], (seen.ionosphere + seen.troposphere)[0]
                up &= elevation >= _MASK
            sigma = np.hypot(_NOISE * noise_factor(density_ratio(elevation)), range_error(elevation, _ORBIT, 1.0))
            value = pseudorange[k] + SPEED_OF_LIGHT * seen.clock[0] - delay
            ranges = Ranges(seen.position[0], seen.velocity[0], value, np.zeros(len(up)), np.diag(sigma**2), sigma)
            if (solution := solve(ranges.only(up))) is not None:
                found.append(solution.position)
        if not found:
            raise LogError(f"{source}: its pseudoranges give no position with these ephemerides")
        position = np.median(found, axis=0)
    assert position is not None
    spread = relative_position(np.array(found), position)
    if np.median(np.abs(spread[:, :2])) > 20.0:
        raise LogError(f"{source}: the receiver moved; only one that stands still is compared")
    return np.asarray(position)


def main(arguments: Sequence[str]) -> int:
    """Print the comparison of two files with twelve simulated runs."""
    if len(arguments) != 2:
        sys.stderr.write("give a RINEX observation file and a RINEX navigation file\n")
        return 2
    observations, navigation = map(Path, arguments)
    real = real_codes(observations, navigation)
    settings = fitted(real)
    simulated = simulated_codes(real, navigation, settings, range(12))
    write = sys.stdout.write
    write(f"fitted: {', '.join(f'{key} = {value:g}' for key, value in settings.items())}\n")
    write("elevation [deg]  satellites  SD real [m]  simulated [m]  ratio\n")
    for band in compared(real, simulated):
        write(f"{band.lowest:7.0f} to {band.lowest + 10.0:2.0f}  {band.satellites:10d}  {band.real:11.3f}  "
              f"{band.simulated:13.3f}  {band.simulated / band.real:5.2f}\n")  # fmt: skip
    for lag, ours, theirs in zip(LAGS, correlations([real]), correlations(simulated), strict=True):
        write(f"correlation after {lag:g} s: real {ours:.2f}, simulated {theirs:.2f}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
