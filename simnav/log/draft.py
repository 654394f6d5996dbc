"""A scenario to begin with, from the streams of a log and what their columns probably are."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from simnav.log.column_guesses import Guess, guesses, told_unit
from simnav.log.inspection import WITH_TOPICS, Stream
from simnav.log.spec import TO_FILL_IN
from simnav.log.variation import dated

__all__ = ["draft"]

#: What autopilots measure: their other places, velocities and attitudes are those of their own filters.
_MEASURED = {"dataflash": r"GPS", "ulog": r"sensor_gps|vehicle_gps_position"}
#: Fixes of autopilots that count.
_FIXED = {"Status": "Status >= 3", "fix_type": "fix_type >= 3"}
_WITHOUT = (
    "# No columns with latitude and longitude were found in {} streams. A scenario needs\n"
    "# positions as a reference: see docs/how-to/use-your-own-log.md.\n"
)
#: An IMU whose specific force is so far from the vertical is not level [rad].
_TILTED = np.radians(15.0)
#: Kinds of instruments that a quantity becomes, with a sigma to begin with.
_INSTRUMENTS = {
    "position": ("gnss", 'kind = "gnss_position"', "sigma_m = [2.0, 2.0, 4.0]"),
    "heading": ("gyrocompass", 'kind = "gyrocompass"', "sigma_deg = 1.0"),
    "dvl": ("dvl", 'kind = "dvl"', "sigma_m_s = 0.05"),
    "velocity": ("gnss_velocity", 'kind = "gnss_velocity"', "sigma_m_s = 0.1"),
    "speed": ("speed_log", 'kind = "speed_log"', "sigma_m_s = 0.3"),
    "depth": ("depth", 'kind = "depth"', "sigma_m = 0.3"),
}
#: Sentences of compasses; the true heading goes first.
_COMPASSES = {"HDT": 2, "THS": 2, "HDG": 1, "HDM": 1}
_EVERY = 10
#: From this share of repeated values on they are left out.
_MANY = 0.3


def draft(streams: Sequence[Stream], name: str = "my-log", file: str | None = None) -> str:
    """The text of a scenario file over the streams, with all that has to be checked as comments.

    Parameters
    ----------
    streams : sequence of Stream
        From `simnav.log.inspection.inspect_log`, of one folder.
    name : str
        Name of the scenario.
    file : str or None
        Name of the file that the text goes to; None: that of the scenario and ``.toml``.

    Returns
    -------
    str
        TOML. It can be run where one of the streams has positions; otherwise it says what is missing.
    """
    found = [g for s in streams for g in guesses(s)]
    reference = _solution(found)
    if reference is not None:  # it is compared with, and is no instrument
        found = [g for g in found if g.stream is not reference["position"].stream]
    attitude = None if reference is not None else _attitude(found)
    if attitude is not None:  # of a filter: it is compared with, and is no compass
        found = [g for g in found if g.quantity not in ("heading", "level") or g.stream is not attitude.stream]
    best: dict[str, Guess] = {}
    for guess in found:
        if guess.quantity in ("heading", "velocity", "speed") and not _is_measured(guess.stream):
            continue
        if guess.quantity == "velocity" and guess.columns[2] == "=nan":  # course and speed are no instrument yet
            continue
        if guess.quantity not in best or _worth(guess) > _worth(best[guess.quantity]):
            best[guess.quantity] = guess
    fixes = best.get("position")
    position = fixes if reference is None else reference["position"]
    if position is None and not streams:
        return _WITHOUT.format(0)
    known = position is not None
    if position is None:
        longest = max(streams, key=lambda s: float(np.ptp(s.time)) if len(s.time) else 0.0)
        position = Guess(longest, "position", (TO_FILL_IN,), ("deg", "deg", "m"))
    rate, force = best.get("angular_rate"), best.get("specific_force")
    if rate is not None and force is not None and rate.stream is not force.stream:  # rather both of one stream
        both = [(r, f) for r in found for f in found if r.stream is f.stream
                and (r.quantity, f.quantity) == ("angular_rate", "specific_force")]  # fmt: skip
        rate, force = both[0] if both else (rate, force)
    if rate is not None and len(rate.stream.time) < 2:
        rate = None  # a single sample is no IMU
    if reference is None:
        best.pop("velocity", None)  # of the same receiver as the reference
    used = [position, *(g for q, g in best.items() if q in _INSTRUMENTS), *([attitude] if attitude is not None else [])]
    if rate is not None and force is not None:
        used += [rate, force]
    if not known:  # in any of them may be positions
        used += [Guess(s, "", (), ()) for s in streams]
    keys = _file_keys(used)
    time = position.stream.time
    if known and len(time) == len(position.stream.table):
        time = time[~position.without_fix]
    span = float(np.ptp(time)) if len(time) else 0.0
    lines = [
        "# A scenario to begin with. Check everything that is marked: simnav cannot know it.",
        f"# Then: simnav check {file or f'{name}.toml'}; simnav run {file or f'{name}.toml'}",
        f'name = "{name}"',
        "version = 1",
        f'title = "{name}"',
        f"duration_s = {max(1.0, np.floor(span)):.1f}",
        "",
        "[initial_error]",
        "position_m = [2.0, 2.0, 3.0]",
        "velocity_m_s = [0.2, 0.2, 0.2]",
        "attitude_deg = [1.0, 1.0, 5.0]",
        "",
        "[log]",
        f"folder = {_toml(str(position.stream.path.resolve().parent))}",
        'begin = "moving"                 # check: the course of the moving vessel is its heading at the start',
    ]
    if "heading" in best or reference is not None or attitude is not None or span < 20.0:
        lines[-1] = f"# {lines[-1]}"
    for stream, key in keys.values():
        lines += ["", *_file(stream, key)]
    if rate is not None and force is not None:
        lines += ["", *_imu(rate, force, keys)]
    for quantity, guess in best.items():
        if quantity in _INSTRUMENTS:
            lines += ["", *_channel(f"log.instruments.{_declared(guess, reference)[0]}", guess, keys)]
            if quantity == "position":
                if _graded(guess):
                    lines.append('sigma = ["sdn", "sde", "sdu"]')
                if reference is None:
                    lines.append(f"every = {_EVERY}                     # every tenth fix to the estimators ...")
    if _graded(position):
        lines += ["", "[log.reference]",
                  'quality = "Q"                  # only fixed and float solutions are scored']  # fmt: skip
    lines += ["", *_channel("log.reference.position", position, keys)]
    if reference is None:
        if known:
            lines.append(f"hold_out = {_EVERY}                  # ... and the others to compare with")
        if attitude is not None:
            lines += ["", *_channel("log.reference.attitude", attitude, keys)]
    else:
        lines += ["", *_channel("log.reference.velocity", reference["velocity"], keys)]
        whole = _of_angles(reference["level"], reference["heading"])
        lines += ["", *_channel("log.reference.attitude", whole, keys)]
    if rate is not None and force is not None:
        hertz = 1.0 / float(np.median(np.diff(rate.stream.time)))
        lines += ["", "[instruments.imu]", f"rate_hz = {_round(hertz)}",
                  'grade = "mems"                   # check: or the figures of its datasheet']  # fmt: skip
    for quantity, guess in best.items():
        if quantity in _INSTRUMENTS:
            label, kind, sigma = _declared(guess, reference)
            hertz = 1.0 / max(1e-3, float(np.median(np.diff(guess.stream.time)))) if len(guess.stream.time) > 1 else 1.0
            hertz *= 1.0 - (_repeated(guess) if _stale(guess) else 0.0)
            hertz = hertz / _EVERY if quantity == "position" and reference is None else hertz
            lines += ["", f"[instruments.{label}]", kind, f"rate_hz = {_round(hertz)}", f"{sigma}   # check"]
    return ("" if known else _WITHOUT.format(len(streams))) + "\n".join(lines) + "\n"


def _solution(found: Sequence[Guess]) -> dict[str, Guess] | None:
    """Position, velocity, roll and pitch, and heading of one stream that has them all, where other streams aid.

    It is a solution of all of them, or the truth. Where no other stream has fixes or a velocity, its own are needed.
    """
    by_stream: dict[int, dict[str, Guess]] = {}
    for guess in found:
        by_stream.setdefault(id(guess.stream), {}).setdefault(guess.quantity, guess)
    whole = [g for g in by_stream.values() if {"position", "velocity", "level", "heading"} <= set(g)]
    measured = ("position", "dvl", "speed")
    chosen = max(whole, key=lambda g: len(g["position"].stream.time), default=None)
    if chosen is None or not any(set(g) & set(measured) for g in by_stream.values() if g is not chosen):
        return None
    return chosen


def _of_angles(level: Guess, heading: Guess) -> Guess:
    """Roll, pitch and yaw of one stream, in one unit where no name says another: small angles do not tell theirs."""
    columns, units = level.columns + heading.columns, level.units + heading.units
    one = "deg" if "deg" in units else "rad"
    told = tuple(told_unit(level.stream, c, "angle") or one for c in columns) if level.stream.form != "nmea" else units
    return Guess(level.stream, "attitude", columns, told)


def _attitude(found: Sequence[Guess]) -> Guess | None:
    """The attitude of a filter beside the instruments: a quaternion, or the angles of an autopilot."""
    whole = [g for g in found if g.quantity == "quaternion"]
    for level in found:
        if level.quantity == "level" and level.stream.form in _MEASURED:
            whole += [_of_angles(level, g) for g in found if g.quantity == "heading" and g.stream is level.stream]
    return max(whole, key=lambda g: len(g.stream.time), default=None)


def _is_measured(stream: Stream) -> bool:
    """Whether a stream is measured, and not of the filter of an autopilot."""
    pattern = _MEASURED.get(stream.form)
    return pattern is None or re.match(pattern, stream.sentence or "") is not None


def _declared(guess: Guess, reference: dict[str, Guess] | None) -> tuple[str, str, str]:
    """Name, kind and sigma of an instrument; of positions without a height, beside a reference, a horizontal one."""
    if guess.quantity == "position" and reference is not None and guess.columns[2] == "=0":
        return "fix", 'kind = "terrain_fix"', "sigma_m = [5.0, 5.0]"
    return _INSTRUMENTS[guess.quantity]


def _round(value: float) -> str:
    return f"{float(f'{value:.4g}')!r}"


#: Streams and the keys of their files, by path and, where a file has topics, topic.
_Keys = dict[tuple[Path, str | None], tuple[Stream, str]]


def _place(guess: Guess) -> tuple[Path, str | None]:
    if guess.stream.form in ("mat", "hdf5"):
        return guess.stream.path, str(guess.stream.keys["time"])
    return guess.stream.path, guess.stream.sentence if guess.stream.form in WITH_TOPICS else None


def _file_keys(used: Sequence[Guess]) -> _Keys:
    """A name for each file, topic, and time of arrays."""
    keys: _Keys = {}
    taken: set[str] = set()
    for guess in used:
        place = _place(guess)
        if place not in keys:
            text = guess.stream.path.stem if place[1] is None else place[1]
            stem = re.sub(r"[^a-z0-9]+", "_", text.lower()).strip("_") or "file"  # a bare key of TOML is ASCII
            key = stem if stem not in taken else f"{stem}_{len(keys)}"
            taken.add(key)
            keys[place] = guess.stream, key
    return keys


def _key_of(keys: _Keys, guess: Guess) -> str:
    return keys[_place(guess)][1]


def _file(stream: Stream, key: str) -> list[str]:
    lines = [f"[log.files.{key}]", f"path = {_toml(stream.path.name)}"]
    if stream.form != "csv":
        lines.append(f'format = "{stream.form}"')
    for name, value in stream.keys.items():
        lines.append(f"{name} = {_toml(value)}")
        if name == "time_unit" and value != "iso":
            lines[-1] += "   # check"
    if stream.form == "csv" and len(stream.time) > 1 and (np.diff(stream.time) == 0.0).any():
        lines.append('same_time = "spread"             # check: some rows have the same time')
    return lines


def _toml(value: Any) -> str:
    """A text, a number, a sequence or a table of them, as TOML."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{name} = {_toml(inner)}" for name, inner in value.items()) + " }"
    return json.dumps(list(value) if isinstance(value, tuple) else value, ensure_ascii=False)


def _channel(table: str, guess: Guess, keys: _Keys) -> list[str]:
    stream = guess.stream
    if guess.columns == (TO_FILL_IN,):
        return [
            f"[{table}]",
            f'file = "{TO_FILL_IN}"                # the name in [log.files] of the file that has positions',
            f'columns = ["{TO_FILL_IN}"]           # its columns of latitude, longitude and height',
            f"units = {_toml(guess.units)}   # check",
        ]
    lines = [f"[{table}]", f'file = "{_key_of(keys, guess)}"']
    if stream.sentence is not None and stream.form not in WITH_TOPICS:
        lines.append(f"sentence = {_toml(stream.sentence)}")
    if stream.talker is not None:
        lines.append(f'talker = "{stream.talker}"')
    columns = list(guess.columns)
    units = list(guess.units)
    if table == "log.instruments.fix":
        columns, units = columns[:2], units[:2]
    lines.append(f"columns = {_toml(columns)}")
    if guess.quantity == "quaternion" and stream.form in ("mcap", "rosbag"):
        lines.append('frame = "enu"                   # check: ROS has axes forward, left, up in east, north, up')
    if guess.quantity == "position" and stream.form in _MEASURED:
        lines += [f"where = {_toml(good)}" for name, good in _FIXED.items() if name in stream.table.names]
    if guess.quantity == "position" and (none := int(np.sum(guess.without_fix))):
        lines.append(f"# rows with latitude 0 and longitude 0 are no fixes, and left out: {none}")
    if _stale(guess):
        lines.append("drop_repeated = true            # check: many values are those of the row before")
    if columns == ["heading_magnetic"]:
        lines.append(
            'variation_model = "wmm"        # check: the file has no variation'
            if dated(stream.time)
            else "variation_deg = 0.0            # check: the variation of the place, positive east"
        )
    if set(guess.units) != {"1"}:
        lines.append(f"units = {_toml(units)}   # check")
    return lines


def _worth(guess: Guess) -> tuple[int, int]:
    """Of several streams what is measured, a position with height and the sentence of a compass go first.

    Then the longest.
    """
    if guess.quantity == "position":
        return 2 * _is_measured(guess.stream) + (guess.columns[2] != "=0"), len(guess.stream.time)
    if guess.quantity == "heading":
        return _COMPASSES.get(guess.stream.sentence or "", 0), len(guess.stream.time)
    return 0, len(guess.stream.time)


def _repeated(guess: Guess) -> float:
    """The share of rows whose values are those of the row before."""
    values = np.stack([guess.stream.table.column(c)[1] for c in guess.columns], axis=-1)
    if guess.quantity == "position":
        values = values[~guess.without_fix]
    return float(np.mean(np.all(np.diff(values, axis=0) == 0.0, axis=1))) if len(values) > 1 else 0.0


def _stale(guess: Guess) -> bool:
    """Whether a logger seems to repeat old values: of several numbers, with their noise, few are the same by chance."""
    return len(guess.columns) > 1 and _MANY < _repeated(guess) < 1.0


def _graded(position: Guess) -> bool:
    """Whether most positions say that they are fixed or float solutions of RTKLIB, and with which sigma."""
    table = position.stream.table
    if position.stream.form != "rtklib" or not {"Q", "sdn", "sde", "sdu"} <= set(table.names):
        return False
    return bool(np.mean(np.isin(table.column("Q")[1], (1.0, 2.0))) > 0.5)


def _imu(rate: Guess, force: Guess, keys: _Keys) -> list[str]:
    flipped = force.columns[2].startswith("-") and not rate.columns[2].startswith("-")
    one = _key_of(keys, rate) == _key_of(keys, force)
    two = [] if one else [f'specific_force_file = "{_key_of(keys, force)}"   # check: offset_s of its clock']
    rates = [rate.columns[0], *(f"-{c}" if flipped else c for c in rate.columns[1:])]
    unit, samples = rate.units[0], 'samples = "instantaneous"        # check: or "means", "increments"'
    if (rate.columns[0].startswith("angular_rate_x") and one) or force.stream.form == "ulog":
        samples = 'samples = "means"'  # as 'simnav export' and PX4 write them
    if force.units[0] == "m_s":
        unit, samples = {"deg_s": "deg"}.get(unit, "rad"), 'samples = "increments"'
    return [
        "[log.imu]",
        f'file = "{_key_of(keys, rate)}"',
        *two,
        samples,
        f"angular_rate = {_toml(rates)}   # check: forward, starboard, down; or say mounting_deg",
        f'angular_rate_unit = "{unit}"   # check',
        f"specific_force = {_toml(force.columns)}",
        f'specific_force_unit = "{force.units[0]}"',
        *_mounting(force),
    ]


def _mounting(force: Guess) -> list[str]:
    """Roll and pitch of an IMU that is not level, from its mean specific force."""
    signs = np.array([-1.0 if c.startswith("-") else 1.0 for c in force.columns])
    values = np.stack([force.stream.table.column(c.removeprefix("-"))[1] for c in force.columns], axis=-1) * signs
    x, y, z = np.nanmean(values, axis=0)
    if np.arctan2(np.hypot(x, y), -z) < _TILTED:
        return []
    roll, pitch = np.degrees(np.arctan2(-y, -z)), np.degrees(np.arctan2(x, np.hypot(y, z)))
    return [
        f"mounting_deg = [{roll:.1f}, {pitch:.1f}, 0.0]   # check: level by its specific force; the third, its heading "
        "in the vessel, is not known"
    ]
