"""Checks that the parts of a scenario fit together: names, instruments, world or log, faults, orders of magnitude."""

from __future__ import annotations

import re
from typing import Any

from simnav.blocks import blocks_of
from simnav.log.spec import RecordedSpec
from simnav.scenario.catalogue import NAME
from simnav.scenario.description import SMALLEST, Description
from simnav.sensors import ImuSpec
from simnav.spec import SpecError, closest
from simnav.types import KINDS
from simnav.world.surroundings import BATHYMETRY, OWN_PARTS

__all__ = ["check"]

#: Largest number of intervals of faults: the labels of a measurement have 32 bits, one for each interval.
_MOST_BITS = 32

#: Highest rate of an instrument [Hz]. The limit catches mistakes that would fill the memory.
_FASTEST = 1e5
#: Highest speed of a vessel and of a current [m/s].
_HIGHEST_SPEED = 1e3

_INSTRUMENT = re.compile(r"[a-z][a-z0-9_]*")


def check(s: Description) -> None:
    """Check that the parts of a scenario fit together.

    Raises
    ------
    ValueError
        One sentence that names the key, its value, and what would be right.
    """
    _check_head(s)
    _check_instruments(s)
    for name in ("start", "vessel", "sea", "current"):
        part = getattr(s, name)
        _check_no_subnormal(name, {} if part is None else part.model_dump())
    for key, parts in (("manoeuvre", s.manoeuvres), ("fault", s.faults)):
        for k, part in enumerate(parts):
            _check_no_subnormal(f"{key}[{k}]", part.model_dump())
    _check_surroundings(s)
    if s.log is None:
        _check_world(s)
    else:
        _check_log(s, s.log)
    _check_sources(s)
    _check_faults(s)


def _check_head(s: Description) -> None:
    if not NAME.fullmatch(s.name) or re.search(r"-v\d+$", s.name):
        raise ValueError(f"name = {s.name!r} should be in kebab-case and without a version, like 'coastal-voyage'")
    if not NAME.fullmatch(s.track):
        raise ValueError(f"track = {s.track!r} should be in kebab-case, like 'aided-ins'")
    if not s.group.strip():
        raise ValueError(f"group = {s.group!r} should be a word or two, like 'degraded GNSS'")
    if s.step > s.duration or abs(s.epochs * s.step - s.duration) > 1e-6:
        raise ValueError(
            f"duration_s = {s.duration:g} should be a multiple of step_s = {s.step:g}, "
            f"like {max(1, s.epochs) * s.step:g}"
        )


def _check_instruments(s: Description) -> None:
    if not s.instruments:
        raise ValueError("there is no instrument; add at least one table [instruments.NAME]")
    for name, spec in s.instruments.items():
        if not _INSTRUMENT.fullmatch(name):
            raise ValueError(f"instruments.{name}: a name is of lower-case letters, digits and underscores")
        if name == "interval" or (name in KINDS and name != spec.kind):
            raise ValueError(
                f"instruments.{name}.kind = {spec.kind!r}: {name!r} is no name for it, it means something else"
            )
        _check_no_subnormal(f"instruments.{name}", spec.model_dump())
        if spec.rate > _FASTEST:
            raise ValueError(f"instruments.{name}.rate_hz = {spec.rate:g}: should be at most {_FASTEST:g}")
        if isinstance(spec, ImuSpec) != (name == "imu"):
            raise ValueError(f"instruments.{name}.kind = {spec.kind!r}: the IMU, and only the IMU, is called 'imu'")
    blocks_of((name, spec.blocks()) for name, spec in s.instruments.items() if not isinstance(spec, ImuSpec))


def _check_surroundings(s: Description) -> None:
    for name, spec in s.surroundings.items():
        if not _INSTRUMENT.fullmatch(name):
            raise ValueError(f"surroundings.{name}: a name is of lower-case letters, digits and underscores")
        own = {"sea": s.sea, "current": s.current, "bottom": s.water_depth, BATHYMETRY: s.water_depth}.get(name)
        if own is not None:
            own_part = OWN_PARTS["bottom" if name == BATHYMETRY else name]
            raise ValueError(f"surroundings.{name}: {own_part} says the same; leave out one of both")
        _check_no_subnormal(f"surroundings.{name}", spec.model_dump())
        try:
            spec.check(name, s.start)
        except SpecError as error:
            raise ValueError(str(error)) from None


def _check_no_subnormal(where: str, value: Any) -> None:
    """Refuse numbers so close to zero that a division by them overflows."""
    if isinstance(value, dict):
        for key, inner in value.items():
            _check_no_subnormal(f"{where}.{key}", inner)
    elif isinstance(value, (list, tuple)):
        for inner in value:
            _check_no_subnormal(where, inner)
    elif isinstance(value, float) and 0.0 < abs(value) < SMALLEST:
        raise ValueError(f"{where} = {value:g} (in SI units): should be 0, or at least {SMALLEST:g}")


def _check_speeds(s: Description) -> None:
    """Refuse speeds above `_HIGHEST_SPEED`, at which the truth might not be finite."""
    speeds = {f"manoeuvre {k} ({m.kind}).speed_m_s": getattr(m, "speed", 0.0) for k, m in enumerate(s.manoeuvres, 1)}
    speeds |= {"start.speed_m_s": getattr(s.start, "speed", 0.0), "current.speed_m_s": getattr(s.current, "speed", 0.0)}
    for key, speed in speeds.items():
        if isinstance(speed, (int, float)) and abs(speed) > _HIGHEST_SPEED:
            raise ValueError(f"{key} = {speed:g}: should be at most {_HIGHEST_SPEED:g}")


def _check_world(s: Description) -> None:
    """Check a simulated run: start and manoeuvres fit the vessel and the water."""
    if s.imu is not None and abs(s.step * s.imu.rate - round(s.step * s.imu.rate)) > 1e-6:
        raise ValueError(
            f"step_s = {s.step:g} should be a multiple of the IMU's sample interval, 1 / {s.imu.rate:g} Hz"
        )
    _check_speeds(s)
    s.craft.check(s.start, s.manoeuvres, tuple(s.surroundings))
    depth = 0.0 if s.start is None else -s.start.altitude
    if s.water_depth is not None and depth >= s.water_depth:
        raise ValueError(f"start.depth_m = {depth:g} is below the sea bed, water_depth_m = {s.water_depth:g}")
    for i, m in enumerate(s.manoeuvres):
        if m.kind == "dive" and s.water_depth is not None and m.depth >= s.water_depth:
            raise ValueError(
                f"manoeuvre[{i}].depth_m = {m.depth:g} is below the sea bed, water_depth_m = {s.water_depth:g}"
            )


def _check_log(s: Description, log: RecordedSpec) -> None:
    """Check a recorded run: it has no world, and a source for every instrument."""
    for key in ("start", "vessel", "manoeuvres", "sea", "current", "world_seed"):
        if getattr(s, key):
            table = "manoeuvre" if key == "manoeuvres" else key
            raise ValueError(f"{table}: a recorded run ([log]) has no simulated world; leave it out")
    aids = list(s.aids)
    for name in log.instruments:
        if name not in aids:
            raise ValueError(f"log.instruments.{name}: there is no [instruments.{name}] datasheet{closest(name, aids)}")
    for name, spec in s.aids.items():
        if spec.channels():
            raise ValueError(f"instruments.{name}: an instrument with channels cannot be read from a log")
        if name not in log.instruments:
            raise ValueError(f"instruments.{name}: the log says not where it comes from; add [log.instruments.{name}]")
    if (log.imu is None) != (s.imu is None):
        there, missing = ("log.imu", "instruments.imu") if s.imu is None else ("instruments.imu", "log.imu")
        raise ValueError(f"[{there}] needs [{missing}] beside it")


def _check_sources(s: Description) -> None:
    """Check that an instrument that reads others finds them, and fits the charts."""
    for name, spec in s.aids.items():
        for source, kind in spec.sources().items():
            kinds = (kind,) if isinstance(kind, str) else kind
            if source not in s.aids or s.aids[source].kind not in kinds:
                there = [n for n, other in s.aids.items() if other.kind in kinds]
                right = f"one of that kind is {there[0]!r}" if there else f"add a table of kind = {kinds[0]!r}"
                raise ValueError(
                    f"instruments.{name}: it reads {source!r} of kind {' or '.join(map(repr, kinds))}, which there is "
                    f"not; {right}"
                )
            if s.log is not None:
                raise ValueError(f"instruments.{name}: it reads {source!r}, which a recorded run ([log]) does not have")
        try:
            spec.fits(s.chart)
        except ValueError as error:
            raise ValueError(f"instruments.{name}: {error}") from None


def _check_faults(s: Description) -> None:
    kinds = {name: spec.kind for name, spec in s.aids.items()}
    channels = {name: spec.channels() for name, spec in s.aids.items()}
    for i, fault in enumerate(s.faults):
        try:
            fault.check(kinds, imu=s.imu is not None)
            fault.check_channels(kinds, channels)
        except SpecError as error:
            raise ValueError(f"fault[{i}] {str(error).removeprefix('fault ')}") from None
        first = fault.intervals[0][0] if fault.intervals else fault.start
        if first >= s.duration:
            raise ValueError(f"fault[{i}] {fault.kind!r}: it starts at {first:g} s, but duration_s = {s.duration:g}")
    bits = sum(fault.bits for fault in s.faults)
    if bits > _MOST_BITS:
        raise ValueError(f"fault: {bits} intervals are too many; the labels have room for {_MOST_BITS}")
