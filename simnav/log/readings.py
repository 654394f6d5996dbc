"""How the streams of a log are probably read: axes, signs, units, frames and clocks, compared by likelihood.

A reading of a stream (which axis is which, which sign, which unit, how late) is a hypothesis. The likelihood of each is
that of all comparisons in which the stream takes part (`simnav.log.comparisons`), over that of the reading which the
scenario has. The reading as it is has the prior probability one half; all others of the stream share the rest. The most
likely reading of all streams is taken, the streams are read with it, and the search begins anew, until no other reading
is far more likely: so two mistakes are found as well as one, if one of them is found beside the other.
"""

from __future__ import annotations

import itertools
import json
import warnings
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from simnav.geometry.rotation import dcm_from_rpy, wrap_angle
from simnav.kinds import BODY_VELOCITY, DEPTH, HEADING, VELOCITY
from simnav.log.attitude_readings import of_attitude
from simnav.log.channel import Series, read_channel, skip_of
from simnav.log.comparisons import COURSE_FROM, Streams, comparisons
from simnav.log.hypotheses import FLIPS, Reading, flip, shown, with_series, written
from simnav.log.imu_series import read_imu
from simnav.log.inertial import Inertial
from simnav.log.likelihood import Fit, Residual, fit, log_ratios
from simnav.log.position_readings import ABOVE, of_positions
from simnav.log.units import DIMENSIONS, factor
from simnav.spec import SpecError
from simnav.types import KINDS, Array

if TYPE_CHECKING:
    from simnav.log.spec import ChannelSpec, LogInstrumentSpec, RecordedSpec
    from simnav.scenario import Scenario

__all__ = ["ProbableReading", "probable_readings"]

#: Another reading is far more likely from this log likelihood ratio on, if it also leaves at most the first part of the
#: product of the mean squares of all components with a log likelihood ratio above the last figure, and the second part
#: of one of them: of many samples a slight difference is significant, too, but may be one of the models.
_FAR, _PART, _PART_OF_ONE, _TELLING = 12.0, 0.5, 0.56, 3.0
#: A mean square below this part of the square of its usual size says nothing.
_FLOOR = 0.1
#: What speaks so much against a reading is not made good by other comparisons, which are left out.
_AGAINST = -40.0
#: Delays that are tried [s], up to this part of a log: of a shorter one too little would be left to compare.
#: `simnav.log.alignment` finds shorter delays. UTC is 18 s behind GPS, and 37 s behind TAI.
_DELAYS, _PART_OF_LOG = np.array([*np.arange(0.5, 5.01, 0.5), 18.0, 37.0]), 0.1
#: Readings whose log likelihoods differ by less are told apart by the number of changes.
_SAME = 1.0
#: So many of the likeliest readings of a stream are also tried with each delay, and those with usual axes.
_WITH_DELAYS = 3
#: Part of the prior probability that each further mistake leaves.
_TWO = 0.1
#: Mistakes that are looked for, one after the other.
_ROUNDS = 4
#: The mean specific force of a vessel points up by at least this [m/s^2].
_UPRIGHT = 4.0
#: Axes that are usual besides forward, starboard, down: forward, port, up; starboard, forward, up; and turned about the
#: vertical by a half or a quarter.
_USUAL = tuple(
    tuple(map(tuple, axes))
    for axes in (
        np.diag([1.0, -1.0, -1.0]),
        np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]),
        np.diag([-1.0, -1.0, 1.0]),
        np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
        np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
    )
)
#: The 48 matrices that permute axes and change signs.
_AXES = tuple(
    np.eye(3)[list(order)] * np.array(signs)[:, None]
    for order in itertools.permutations(range(3))
    for signs in itertools.product(FLIPS, repeat=3)
)


@dataclass(frozen=True)
class ProbableReading:
    """Another reading of a stream than the scenario's, which is far more likely.

    Attributes
    ----------
    stream : str
        ``imu``, ``gyroscope``, ``accelerometer``, the name of an instrument, or ``reference.position`` and the like.
    changes : tuple of (str, str, str)
        What to write: table, key and value, as TOML.
    what : str
        What it is, in words.
    log_ratio : float
        Logarithm of its likelihood over that of the reading as it is.
    probability : float
        Of this reading and those that are alike, among all readings of the stream that were tried.
    present : float
        The probability of the reading as it is.
    alike : tuple of str
        The other readings that are as likely, because the motion does not tell them apart: what they are, in words.
    """

    stream: str
    changes: tuple[tuple[str, str, str], ...]
    what: str
    log_ratio: float
    probability: float
    present: float
    alike: tuple[str, ...] = ()

    @property
    def shown(self) -> str:
        """The probability as text; no model is surer than 0.9999."""
        return f"{min(self.probability, 0.9999):.{2 if self.probability < 0.995 else 4}g}"

    def sentence(self) -> str:
        """As text, with the line to write."""
        lines = "; ".join(f"{key} = {value} of [{table}]" for table, key, value in self.changes)
        right = f"write {lines}" if lines else f"take [log.instruments.{self.stream}] out, or name another column"
        told = f"{self.what}: the other streams say so"
        if self.alike:
            first, more = self.alike[0], len(self.alike) - 1
            told = f"{self.what}, or {first}" + (f", or one of {more} others" if more else "")
            told += ": the motion does not tell them apart, and the other streams say so"
        return f"{told} with probability {self.shown}; as it is read now it has {self.present:.1g}; {right}"


@dataclass(frozen=True, eq=False)
class _Tried:
    """A reading beside the present one.

    Attributes
    ----------
    reading : Reading
        The reading.
    ratio : float
        Logarithm of its likelihood over that of the present one.
    worst : float
        The least of its parts, of one component; 0 for a reading in another unit, in which the noise is another.
    left, least : float
        Logarithm of the part that it leaves of the product of the mean squares, and of that of one component.
    unit : float
        How much less improbable the parameters are with its unit; 0 for a reading in the same unit.
    """

    reading: Reading
    ratio: float
    worst: float
    left: float
    least: float
    unit: float


def probable_readings(scenario: Scenario, recording: str) -> list[ProbableReading]:
    """Readings that are far more likely than those of a scenario.

    Parameters
    ----------
    scenario : Scenario
        With a ``[log]``, whose channels can be read.
    recording : str
        Name of the recording.

    Returns
    -------
    list of ProbableReading
        Empty where the scenario reads its streams rightly, or the motion says nothing.

    Raises
    ------
    LogError
        If a channel cannot be read.
    """
    log = scenario.log
    assert log is not None
    found: list[ProbableReading] = []
    unfit: set[str] = set()  # streams that are no such instrument
    for _ in range(_ROUNDS):
        streams = _read(scenario, log, recording, unfit)
        best = _best(log, streams)
        if best is None:
            break
        reading, told = best
        if not reading.changes:
            unfit.add(reading.stream)
        try:
            log = written(log, reading.changes)
            _read(scenario, log, recording, unfit)
        except (SpecError, ValueError):
            break
        found.append(told)
    return found


def _read(scenario: Scenario, log: RecordedSpec, recording: str, unfit: Collection[str]) -> Streams:
    """All streams of a recording, but those that were found to be no such instruments."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        reference = {
            n: None if c is None else read_channel(log, c, n, recording)
            for n in ("position", "velocity", "attitude")
            if (c := getattr(log.reference, n)) is not None or n != "position"
        }
        imu = None if log.imu is None else Inertial(read_imu(log, log.imu, recording))
        sheets = scenario.instruments_sheet()
        instruments, field = {}, {}
        for name, spec in scenario.aids.items():
            where = log.instruments.get(name)
            if where is None or where.source != "file" or name in unfit:
                continue
            series = read_channel(log, where.channel(), spec.kind, recording)
            instruments[name] = spec.kind, series, np.asarray(sheets[name].lever_arm, dtype=np.float64)
            if "field" in sheets[name].details:
                field[name] = np.asarray(sheets[name].details["field"], dtype=np.float64)
    position = reference["position"]
    assert position is not None
    begin = max(float(position.time[0]), -np.inf if imu is None else float(imu.series.edge[0]))
    return Streams(position, reference["velocity"], reference["attitude"], imu, instruments, field,
                   begin + skip_of(log, recording))  # fmt: skip


def _best(log: RecordedSpec, streams: Streams) -> tuple[Reading, ProbableReading] | None:
    """The reading that is most likely by far, if there is one."""
    compared = comparisons(streams)
    present = {
        parts: fit(residual) for parts, compare in compared.items() if (residual := compare(streams)) is not None
    }
    readings: dict[str, list[_Tried]] = {}
    longest = _PART_OF_LOG * float(np.ptp(streams.position.time))
    for reading in _readings(log, streams):
        if abs(reading.delay) > longest:
            continue
        if (one := _tried(reading, streams, compared, present)) is not None:
            readings.setdefault(reading.stream, []).append(one)
    likeliest: tuple[Reading, ProbableReading] | None = None
    for stream, tried in readings.items():
        delays = [t.reading for t in tried if t.reading.delay]
        others = sorted((t for t in tried if not t.reading.delay), key=lambda t: -t.ratio)
        others = [t for k, t in enumerate(others) if k < _WITH_DELAYS or t.reading.usual]
        for other, delay in itertools.product(others, delays):
            one = _tried(other.reading.late(delay), streams, compared, present)
            if one is not None and one.ratio > other.ratio + _FAR and one.left < other.left + np.log(_PART):
                tried.append(one)
        told = _told(stream, tried)
        if told is not None and (likeliest is None or told[1].log_ratio > likeliest[1].log_ratio + _SAME):
            likeliest = told
    return likeliest


def _tried(
    reading: Reading,
    streams: Streams,
    compared: Mapping[tuple[str, ...], Callable[[Streams], Residual | None]],
    present: Mapping[tuple[str, ...], Fit],
) -> _Tried | None:
    """A reading beside the present one; None where nothing is compared with its stream, or no longer.

    A smaller unit makes the noise of the stream smaller, which is no merit: residuals are then compared in the present
    unit. A larger unit makes it larger, which is no fault: it is taken as large as in the present unit.
    """
    involved = [p for p in present if set(p) & set(reading.parts) and reading.apart not in p]
    if not involved:
        return None
    other = reading.alter(streams)
    square = reading.times**2
    noise = _noise(other.series(reading.stream).value) / square if square > 1.0 else 0.0
    ratio, worst, left, least, relief = 0.0, 0.0, 0.0, 0.0, 0.0
    for parts in involved:
        if ratio <= _AGAINST:
            continue
        residual = compared[parts](other)
        if residual is None:  # what speaks against it would be lost
            return None
        fitted = fit(residual)
        own = np.minimum(noise, np.minimum(present[parts].mean_square, fitted.mean_square / square))
        mean_square = fitted.mean_square / square if square < 1.0 else fitted.mean_square - own * (square - 1.0)
        fitted = replace(fitted, mean_square=mean_square)
        each = log_ratios(fitted, present[parts])
        worst = min(worst, float(each.min()))
        relief += present[parts].penalty - fitted.penalty
        ratio += float(each.sum()) - fitted.penalty + present[parts].penalty
        before, after = (f.mean_square + _FLOOR * f.size**2 for f in (present[parts], fitted))
        parts_left = np.log(after / before)[np.abs(each) > _TELLING]
        left += float(np.sum(parts_left))
        least = min(least, *parts_left.tolist(), 0.0)
    own_unit = reading.times == 1.0
    return _Tried(
        reading, ratio=ratio, worst=worst if own_unit else 0.0, left=left, least=least,
        unit=0.0 if own_unit else relief,
    )  # fmt: skip


def _noise(value: Array) -> float:
    """Variance of the noise of readings, from their second differences: of the component that has most of it."""
    second = np.diff(value, 2, axis=0)
    second = second[np.isfinite(second).all(axis=1)]
    return float(np.median(np.abs(second), axis=0).max() ** 2 * 1.4826**2 / 6.0) if len(second) else 0.0


def _explains(tried: _Tried) -> bool:
    """Whether a reading leaves little of what the present one does not explain, and makes no component far worse."""
    if tried.unit > _FAR:  # a current of 7 m/s is a wrong unit
        return True
    return bool(tried.left < np.log(_PART) and tried.least < np.log(_PART_OF_ONE) and tried.worst > -_FAR)


def _told(stream: str, tried: list[_Tried]) -> tuple[Reading, ProbableReading] | None:
    """The likeliest reading of one stream, with its probability, if it is far more likely than the present one."""
    smaller = [t for t in tried if t.ratio >= _FAR and _explains(t)]
    if not smaller:
        return None
    delays = len({t.reading.delay for t in tried}) - 1  # all together are one reading
    prior = np.array([(1.0 / delays if t.reading.delay else 1.0) * _TWO ** (t.reading.mistakes - 1) for t in smaller])
    posterior = np.array([t.ratio for t in smaller]) + np.log(prior / len(tried))
    top = posterior.max()
    alike = posterior > top - _SAME
    first, *rest = sorted((smaller[k] for k in np.flatnonzero(alike)), key=lambda t: (t.reading.number, -t.ratio))
    reading = first.reading
    # The delay next to the best one is another figure of the same reading.
    others = tuple(t.reading.what for t in rest if not t.reading.delay * reading.delay > 0.0)
    same = np.array([t is first or t.reading.delay * reading.delay > 0.0 for t in smaller])
    weight = np.exp(posterior - top)
    own, total = float(weight[same | alike].sum()), float(weight.sum() + np.exp(-top))
    changes = tuple((table, key, json.dumps(value)) for table, key, value in reading.changes)
    return reading, ProbableReading(stream, changes, reading.what, first.ratio, own / total,
                                    float(np.exp(-top)) / total, others)  # fmt: skip


def _readings(log: RecordedSpec, s: Streams) -> Iterator[Reading]:
    """All hypotheses about all streams."""
    if s.imu is not None and log.imu is not None:
        yield from _of_imu(log, s)
    for name, (kind, series, _) in s.instruments.items():
        where, table = log.instruments[name], f"log.instruments.{name}"
        equation, components = KINDS[kind].equation, KINDS[kind].components
        axes = len(components) == 3 and not KINDS[kind].geodetic
        if where.columns and axes:
            body = equation == BODY_VELOCITY or name in s.field
            yield from _of_vector(name, table, where, series, body)
        elif where.columns and len(components) == 1 and equation == HEADING:
            yield from _of_heading(name, table, where, series)
            yield from _as_course(name, series, s)
        elif where.columns and len(components) == 1:
            yield from _of_scalar(name, table, where, series, equation == DEPTH)
        of_reference = KINDS[kind].geodetic and where.file == log.reference.position.file  # its clock is the same
        if not of_reference and (equation == HEADING or equation in (BODY_VELOCITY, VELOCITY) or not axes):
            yield from _late(name, table, where.offset, series)
    yield from of_positions(log, s)
    if s.velocity is not None and log.reference.velocity is not None and log.reference.velocity.columns:
        yield from _of_vector("reference.velocity", "log.reference.velocity", log.reference.velocity, s.velocity, False)
    if s.attitude is not None and log.reference.attitude is not None and log.reference.attitude.columns:
        yield from of_attitude(log.reference.attitude, s.attitude)
    yield from _reference_late(log, s)


def _changed(matrix: Array) -> int:
    """How many axes a matrix of signs and orders changes; a matrix of the other hand counts as one more."""
    return int(np.sum(np.diag(matrix) != 1.0)) + int(np.linalg.det(matrix) < 0.0)


def _columns(columns: tuple[int | str, ...], matrix: Array) -> list[int | str]:
    """The columns of a stream whose values are turned by a matrix of signs and orders."""
    order = np.argmax(np.abs(matrix), axis=1)
    return [columns[j] if matrix[i, j] > 0.0 else flip(columns[j]) for i, j in enumerate(order)]


def _of_imu(log: RecordedSpec, s: Streams) -> Iterator[Reading]:
    """Axes and signs of gyroscopes and accelerometers, each alone and together; units of the gyroscopes; delay."""
    imu = log.imu
    assert imu is not None
    mounting = dcm_from_rpy(np.asarray(imu.mounting))

    def read(**matrices: Array) -> Callable[[Streams], Streams]:
        turned = {n: mounting @ m @ mounting.T for n, m in matrices.items()}
        return lambda t: t.altered(imu=None if t.imu is None else t.imu.altered(**turned))

    rates, forces = tuple(imu.angular_rate), tuple(imu.specific_force)
    pull = s.imu.series.mean[:, 3:].mean(axis=0) if s.imu is not None else np.zeros(3)
    other = {"rad_s": "deg_s", "deg_s": "rad_s", "rad": "deg", "deg": "rad", "1": "deg_s"}
    units = [("", 1.0)]
    if imu.angular_rate_unit in other:
        unit = other[imu.angular_rate_unit]
        units.append((unit, factor(unit) / factor(imu.angular_rate_unit)))
    for matrix in _AXES:
        for unit, times in units:
            number = _changed(matrix) + (times != 1.0)
            if number == 0:
                continue
            new = _columns(rates, matrix)
            changes: list[tuple[str, str, Any]] = [("log.imu", "angular_rate", new)] if _changed(matrix) else []
            changes += [("log.imu", "angular_rate_unit", unit)] if unit else []
            what = f"the gyroscopes' forward, starboard, down are {shown(new)}" + (f" in {unit}" if unit else "")
            yield Reading("gyroscope", ("gyroscope",), read(gyroscope=times * matrix), number, what, tuple(changes))
        if not _changed(matrix):
            continue
        if (mounting @ matrix @ mounting.T @ pull)[2] > -_UPRIGHT:  # a vessel does not lie on its side
            continue
        new = _columns(forces, matrix)
        yield Reading("accelerometer", ("accelerometer",), read(accelerometer=matrix), _changed(matrix),
                       f"the accelerometers' forward, starboard, down are {shown(new)}",
                       (("log.imu", "specific_force", new),))  # fmt: skip
        both = _columns(rates, matrix), new
        changes = [("log.imu", "angular_rate", both[0]), ("log.imu", "specific_force", both[1])]
        yield Reading("imu", ("gyroscope", "accelerometer"), read(gyroscope=matrix, accelerometer=matrix),
                       _changed(matrix) + 0.5, f"the IMU's forward, starboard, down are {shown(both[0])} and "
                       f"{shown(both[1])}", tuple(changes), usual=tuple(map(tuple, matrix)) in _USUAL)  # fmt: skip
    channels = [*log.instruments.values(), log.reference.position, log.reference.velocity, log.reference.attitude]
    shared = any(c is not None and c.file == imu.file for c in channels)
    file = log.files[imu.file]
    if imu.specific_force_file is None and not shared and not isinstance(file.offset, tuple):
        for by in _both_ways():
            yield Reading(
                "imu", ("gyroscope", "accelerometer"),
                lambda t, by=by: t.altered(imu=None if t.imu is None else t.imu.altered(delay=by)),  # type: ignore[misc]
                1.0, f"the IMU is {_late_by(by)}", ((f"log.files.{imu.file}", "offset_s", _rounded(file.offset - by)),),
                by,
            )  # fmt: skip


def _both_ways() -> list[float]:
    return [float(sign * d) for d in _DELAYS for sign in FLIPS]


def _late_by(by: float) -> str:
    return f"{abs(by):g} s {'late' if by > 0.0 else 'early'}"


def _rounded(value: float) -> float:
    return float(f"{value:.9g}") if abs(value) < 1e6 else round(value, 3)


def _late(name: str, table: str, offset: float, series: Series) -> Iterator[Reading]:
    for by in _both_ways():
        yield Reading(name, (name,), with_series(name, time=series.time - by), 1.0, f"{name!r} is {_late_by(by)}",
                       ((table, "offset_s", _rounded(offset - by)),), by)  # fmt: skip


def _reference_late(log: RecordedSpec, s: Streams) -> Iterator[Reading]:
    parts = [n for n in ("position", "velocity", "attitude") if getattr(log.reference, n) is not None]
    if s.imu is None and not s.instruments:
        return
    files = {getattr(log.reference, n).file for n in parts}
    same = [n for n in s.instruments if log.instruments[n].file in files]  # of one clock with it

    def alter(t: Streams, by: float) -> Streams:
        for n in same:
            t = with_series(n, time=t.series(n).time - by)(t)
        return t.altered(late=by)

    channels = {f"log.reference.{n}": getattr(log.reference, n) for n in parts}
    channels |= {f"log.instruments.{n}": log.instruments[n] for n in same}
    told = " and ".join(["the reference", *map(repr, same)])
    for by in _both_ways():
        changes = tuple((table, "offset_s", _rounded(channel.offset - by)) for table, channel in channels.items())
        yield Reading("reference", (*(f"reference.{n}" for n in parts), *same), partial(alter, by=by), 1.5,
                       f"{told} {'are' if same else 'is'} {_late_by(by)}", changes, by)  # fmt: skip


def _units_of(channel: ChannelSpec | LogInstrumentSpec, count: int) -> tuple[str, ...]:
    given = channel.units
    return (given,) * count if isinstance(given, str) else tuple(given) or ("1",) * count


def _of_vector(
    name: str,
    table: str,
    channel: ChannelSpec | LogInstrumentSpec,
    series: Series,
    body: bool,
) -> Iterator[Reading]:
    """Axes, signs and units of three components."""
    mounting = dcm_from_rpy(np.asarray(channel.mounting)) if body else np.eye(3)
    units = _units_of(channel, 3)
    told = ("m_s", "kn", "km_h", "cm_s", "mm_s")
    speeds = [u for u in DIMENSIONS["speed"] if len(set(units)) == 1 and units[0] in (*told, "1") and u in told]
    factors = [("", 1.0), *((u, factor(u) / factor(units[0])) for u in speeds)]
    names = "forward, starboard, down" if body else "north, east, down"
    whole = np.isfinite(series.value).all()
    for matrix in _AXES:
        if not whole and matrix[2, 2] != 1.0:  # course and speed: the third is not measured
            continue
        turned = mounting @ matrix @ mounting.T
        value = np.column_stack([series.value[:, :2] @ turned[:2, :2].T, series.value[:, 2]]) if not whole else None
        value = series.value @ turned.T if value is None else value
        for unit, times in factors:
            if unit and abs(times - 1.0) < 1e-9:
                continue
            number = _changed(matrix) + bool(unit)
            if number == 0:
                continue
            new = _columns(channel.columns, matrix)
            changes: list[tuple[str, str, Any]] = [(table, "columns", new)] if _changed(matrix) else []
            if unit:
                changes.append((table, "units", unit))
            elif len(set(units)) > 1:
                changes.append((table, "units", [units[j] for j in np.argmax(np.abs(matrix), axis=1)]))
            what = f"{name!r} has {names} in {shown(new)}" + (f", in {unit}" if unit else "")
            changed = with_series(name, value=times * value)
            usual = times == 1.0 and tuple(map(tuple, matrix)) in _USUAL
            yield Reading(name, (name,), changed, number, what, tuple(changes), times=times, usual=usual)


def _of_heading(name: str, table: str, where: LogInstrumentSpec, series: Series) -> Iterator[Reading]:
    """Sign and zero of a heading: clockwise from north, or anticlockwise from east; mounted backwards or across."""
    column, mounted = where.columns[0], float(np.round(np.degrees(where.mounting[2]), 6))
    for sign in FLIPS:
        for yaw in (0.0, 90.0, 180.0, -90.0):
            if sign > 0.0 and yaw == 0.0:
                continue
            changes: list[tuple[str, str, Any]] = []
            frame = (sign, yaw) == (-1.0, 90.0)  # it is its own inverse
            if frame:
                changes = [(table, "frame", "geodetic" if where.frame == "enu" else "enu")]
            else:
                changes += [(table, "columns", [flip(column)])] if sign < 0.0 else []
                changes += [(table, "mounting_deg", [0.0, 0.0, mounted - yaw])] if yaw else []
            if not frame and where.frame == "enu":
                continue
            value = wrap_angle(sign * (series.value + where.mounting[2]) - where.mounting[2] + np.radians(yaw))
            other = "north, clockwise" if where.frame == "enu" else "east, anticlockwise"
            what = f"{'minus ' if sign < 0.0 else ''}{column}" + (f" and {yaw:g} deg" if yaw else "")
            what = f"the heading of {name!r} is " + (f"counted from {other}" if frame else what)
            yield Reading(name, (name,), with_series(name, value=value),
                           float(len(changes)), what, tuple(changes))  # fmt: skip
    unit = _units_of(where, 1)[0]
    if unit in ("deg", "rad", "1"):
        new = "rad" if unit == "deg" else "deg"
        value = wrap_angle(series.value * factor(new) / factor(unit))
        yield Reading(name, (name,), with_series(name, value=value), 1.0,
                       f"the heading of {name!r} is in {new}", ((table, "units", new),))  # fmt: skip


def _as_course(name: str, series: Series, s: Streams) -> Iterator[Reading]:
    """The course over the ground in place of a heading: they part by leeway and current."""
    if s.attitude is None:
        return
    moved = s.moved(series.time, max(2.0, 2.0 * s.spacing))
    moving = np.hypot(moved[:, 0], moved[:, 1]) > COURSE_FROM
    apart = wrap_angle(s.attitudes(series.time)[:, 2] - np.arctan2(moved[:, 1], moved[:, 0]))
    value = wrap_angle(series.value + np.where(moving & np.isfinite(apart), apart, 0.0)[:, None])
    what = f"{name!r} is the course over the ground, and no heading"
    yield Reading(name, (name,), with_series(name, value=value), 1.0, what, (), apart="reference.position")


def _of_scalar(name: str, table: str, where: LogInstrumentSpec, series: Series, depth: bool) -> Iterator[Reading]:
    """Sign and unit of a speed or a depth; a depth is not above the sea."""
    present = _units_of(where, 1)[0]
    units = next((g for g in (("m_s", "kn", "km_h", "cm_s", "mm_s"), ("m", "ft", "cm", "km")) if present in g), ())
    for sign in FLIPS:
        for unit in (present, *(u for u in units if u != present)):
            if sign > 0.0 and unit == present:
                continue
            changes: list[tuple[str, str, Any]] = [(table, "columns", [flip(where.columns[0])])] if sign < 0.0 else []
            changes += [(table, "units", unit)] if unit != present else []
            times = factor(unit) / factor(present)
            value = sign * times * series.value
            if depth and sign < 0.0 and float(np.nanmedian(value)) < -ABOVE:
                continue
            text = f"{name!r} is {'minus ' if sign < 0.0 else ''}{where.columns[0]}"
            text += f" in {unit}" if unit != present else ""
            yield Reading(name, (name,), with_series(name, value=value),
                           float(len(changes)), text, tuple(changes), times=times)  # fmt: skip
