"""The plain form of packets and estimates: fixed headers and float64 buffers.

An estimator may run in another process than the one that holds the recording (`simnav.leaderboard.campaign`). Packets
and answers are sent in this form. The same form is used within one process, so that both give the same bits.

A **packet** holds one step or several: a header (`_PACKET`), the ends of the steps, and the first sample and the first
reading of each; times, intervals, angular rates and specific forces of the IMU; then a row for each reading, with the
number of its instrument, its time and its numbers (`simnav.steps.Steps`). All but the header are numbers of 8 bytes.
An **answer** is for one step: a header (`ANSWER`), float64 numbers
(position, velocity, attitude, covariance, diagnostics, each only where it was given) and, where there is more to say
than numbers, a tail in JSON: the names and shapes of diagnostics when they first appear, and what was flagged.
"""

from __future__ import annotations

import json
import math
import struct
from array import array
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simnav.estimates import Estimates
from simnav.recording import AidStream, Block
from simnav.steps import Steps, Stream
from simnav.timing import TIME_TOLERANCE
from simnav.types import Array, Estimate, ImuSamples

__all__ = [
    "ANSWER",
    "COVARIANCE",
    "ESTIMATE",
    "GIVEN_BITS",
    "MASKS",
    "VECTORS",
    "EstimateEncoder",
    "InvalidOutputError",
    "PacketDecoder",
    "PacketEncoder",
    "numbers_in",
    "read_tail",
    "real_array",
]

#: Header of an answer: kind, which vectors are given (bit 3: a covariance), which of the nine components are estimated,
#: number of the shape of its diagnostics (0: it has none), number of flagged measurements, bytes after the header,
#: bytes of the tail among them, time.
ANSWER = struct.Struct("<BBHHHIId")
#: Kind of an answer that is an estimate.
ESTIMATE = 1
#: The vectors of an estimate, in order, and their places among the nine components.
VECTORS = {"position": slice(0, 3), "velocity": slice(3, 6), "attitude": slice(6, 9)}
#: Bit of a covariance in the header.
COVARIANCE = 8

_DOUBLE = struct.Struct("d")
#: Header of a packet: numbers of IMU samples, of readings, of steps, and of the numbers in the row of a reading; 0,
#: which tells it from other messages; start of the first step.
_PACKET = struct.Struct("<IIHHId8x")
_NO_IMU = 0xFFFFFFFF
_IMU_WIDTH = 8  # float64 of one IMU sample
_LEAST = 3  # numbers of a reading: `Steps.numbers`

#: Which of the nine components the vectors of each number hold.
GIVEN_BITS = [sum(7 << 3 * i for i in range(3) if given >> i & 1) for given in range(8)]
#: (512, 9) bool array: the mask of each number.
MASKS: NDArray[np.bool_] = (np.arange(512)[:, None] >> np.arange(9) & 1).astype(bool)
MASKS.flags.writeable = False


class InvalidOutputError(Exception):
    """The estimator returned a value that is not a valid estimate."""


# --- packets ------------------------------------------------------------------------------------------


class PacketEncoder:
    """The packets of a recording in plain form.

    Parameters
    ----------
    data : Block
        Measurements, IMU samples included.
    ends : (n,) array
        End of each step [s], ascending; the first step begins at ``data.start``.

    Attributes
    ----------
    streams : list of Stream
        The aiding instruments, for `PacketDecoder`.
    """

    def __init__(self, data: Block, ends: Array):
        streams = list(data.aids.values())
        self.streams = [Stream(s.name, s.kind, s.value.shape[1], s.channels, s.side.shape[1]) for s in streams]
        parts = [_numbers(s) for s in streams]
        self._ends, self._start = [float(t) for t in ends], float(data.start)
        edges = np.array(self._ends) + TIME_TOLERANCE
        rows = np.zeros((sum(map(len, parts)), 2 + max([_LEAST, *(p.shape[1] for p in parts)])))
        begin = 0
        for number, (stream, own) in enumerate(zip(streams, parts, strict=True)):
            part = rows[begin : begin + len(own)]
            part[:, 0], part[:, 1], part[:, 2 : 2 + own.shape[1]] = number, stream.stamps, own
            begin += len(own)
        step = np.concatenate([np.searchsorted(edges, s.arrivals) for s in streams] or [np.empty(0, np.intp)])
        order = np.lexsort((rows[:, 1], step))  # stable: ties keep the scenario's order of instruments
        self._rows = rows[order]
        self._readings: list[int] = np.searchsorted(step[order], np.arange(len(edges) + 1)).tolist()
        self._imu: tuple[Array, ...] | None = None
        self._samples = [0] * (len(edges) + 1)
        if data.imu is not None:
            arrays = (data.imu.time, data.imu.interval, data.imu.angular_rate, data.imu.specific_force)
            self._imu = tuple(np.ascontiguousarray(a, dtype=np.float64) for a in arrays)
            self._samples[1:] = np.searchsorted(data.imu.time, edges, side="right").tolist()

    def __len__(self) -> int:
        return len(self._ends)

    def __getitem__(self, k: int) -> list[Any]:
        """The packet of a step as buffers that follow each other; those of measurements are not copies."""
        return self.of(k, k + 1)

    def of(self, first: int, last: int) -> list[Any]:
        """The packet of the steps from the first to before the last, likewise."""
        i, j, a, b = self._samples[first], self._samples[last], self._readings[first], self._readings[last]
        start = self._ends[first - 1] if first else self._start
        count, width = _NO_IMU if self._imu is None else j - i, self._rows.shape[1]
        firsts = [x - i for x in self._samples[first : last + 1]] + [x - a for x in self._readings[first : last + 1]]
        head = _PACKET.pack(count, b - a, last - first, width, 0, start)
        buffers: list[Any] = [head + struct.pack(_edges(last - first), *self._ends[first:last], *firsts)]
        if self._imu is not None and j > i:
            buffers += [part[i:j] for part in self._imu]
        if b > a:
            buffers.append(self._rows[a:b])
        return buffers


def _edges(steps: int) -> str:
    """The form of the ends of some steps, and of the first sample and the first reading of each."""
    return f"{steps}d{2 * steps + 2}q"


def _numbers(stream: AidStream) -> Array:
    """What a packet holds of each reading of a stream, beside instrument and time."""
    if not stream.channels:
        return np.hstack([stream.value, stream.side]) if stream.states_sigma else stream.value
    return np.hstack([stream.value, stream.channel[:, None].astype(np.float64), stream.side])


class PacketDecoder:
    """From plain packets to `Steps`.

    Parameters
    ----------
    streams : sequence of Stream
        ``streams`` of the `PacketEncoder`.
    """

    #: Bytes of a header.
    HEADER = _PACKET.size

    def __init__(self, streams: Iterable[Stream]):
        self._streams = list(streams)

    @staticmethod
    def size(header: bytes | bytearray) -> int:
        """Bytes of a packet, header included."""
        samples, readings, steps, width, _, _ = _PACKET.unpack_from(header)
        numbers = 3 * steps + 2 + width * readings
        return int(_PACKET.size + 8 * (numbers if samples == _NO_IMU else numbers + _IMU_WIDTH * samples))

    def __call__(self, packet: bytearray) -> Steps:
        """The packet; its arrays are views of the buffer, which should not be used again."""
        n, count, t, width, _, start = _PACKET.unpack_from(packet)
        values = np.frombuffer(packet, dtype=np.float64, offset=_PACKET.size)
        edges = struct.unpack_from(_edges(t), packet, _PACKET.size)
        i, imu = len(edges), None
        if n != _NO_IMU:
            parts = (values[i : i + n], values[i + n : i + 2 * n], values[i + 2 * n : i + 5 * n].reshape(n, 3))
            imu = ImuSamples(*parts, values[i + 5 * n : i + 8 * n].reshape(n, 3))
            i += _IMU_WIDTH * n
        rows = values[i : i + width * count].reshape(count, width)
        return Steps(start, edges[:t], imu, edges[t : 2 * t + 1], edges[2 * t + 1 :], rows, self._streams)


# --- answers ------------------------------------------------------------------------------------------


class EstimateEncoder:
    """From `Estimate` to an answer in plain form; one for each run.

    What is no array of the right shape raises `InvalidOutputError` here. What the numbers are worth is for
    `simnav.trial.log` to judge.
    """

    def __init__(self) -> None:
        self._shapes: dict[tuple[tuple[str, tuple[int, ...]], ...], int] = {(): 0}
        self._of_numbers: dict[tuple[str, ...], int] = {}  # the shapes of diagnostics that are single numbers

    def __call__(self, estimate: object) -> bytes:
        """The answer.

        Raises
        ------
        InvalidOutputError
            With what is wrong.
        """
        if not isinstance(estimate, Estimate):
            raise InvalidOutputError(f"expected an Estimate, got {type(estimate).__name__}")
        stamp = _number(estimate.time, "time")
        given, parts = 0, []
        for bit, name in enumerate(VECTORS):
            vector = getattr(estimate, name)
            if vector is not None:
                given |= 1 << bit
                parts.append(_bytes_of(vector, name, (3,)))
        bits = GIVEN_BITS[given]
        if estimate.estimated is not None:
            if np.shape(estimate.estimated) != (9,):
                raise InvalidOutputError(f"estimated has shape {np.shape(estimate.estimated)}, expected (9,)")
            bits = int.from_bytes(np.packbits(estimate.mask(), bitorder="little").tobytes(), "little")
        if estimate.covariance is not None:
            given |= COVARIANCE
            parts.append(_bytes_of(estimate.covariance, "covariance", (9, 9)))
        if not isinstance(estimate.diagnostics, Mapping):
            raise InvalidOutputError(f"diagnostics is a dict, not {type(estimate.diagnostics).__name__}")
        if not isinstance(estimate.flagged, Iterable):
            raise InvalidOutputError(f"flagged is a list, not {type(estimate.flagged).__name__}")
        shape, tail = 0, b""
        more: dict[str, Any] = {}
        diagnostics = _with_states(estimate) if estimate.states else estimate.diagnostics
        names = tuple(diagnostics)
        single = set(map(type, diagnostics.values())) == {float}  # nearly always
        if single and names in self._of_numbers:
            shape = self._of_numbers[names]
            parts.append(array("d", diagnostics.values()).tobytes())
        elif diagnostics:
            signature = []
            for key, value in diagnostics.items():
                if type(value) is float:
                    signature.append((str(key), ()))
                    parts.append(_DOUBLE.pack(value))
                    continue
                numbers = real_array(value, f"diagnostic {key!r}", None)
                signature.append((str(key), numbers.shape))
                parts.append(numbers.tobytes())
            shape, new = self._shape(tuple(signature))
            if new:
                more["shape"] = signature
            if single and set(map(type, names)) == {str}:
                self._of_numbers[names] = shape
        flagged = [_flag(item) for item in estimate.flagged]
        if flagged:
            if len(flagged) > 0xFFFF:
                raise InvalidOutputError(f"flagged holds {len(flagged)} measurements of one step")
            more["flagged"] = flagged
        if more:
            tail = json.dumps(more).encode()
            parts.append(tail)
        size = sum(map(len, parts))
        if size > 0xFFFFFFFF:
            raise InvalidOutputError("the diagnostics of one step take more than 4 GiB")
        return b"".join([ANSWER.pack(ESTIMATE, given, bits, shape, len(flagged), size, len(tail), stamp), *parts])

    def each(self, estimates: Estimates) -> list[bytes]:
        """The answers of several steps; the bytes are those of one step after the other."""
        t, given, parts = len(estimates), 0, []
        for bit, name in enumerate(VECTORS):
            if getattr(estimates, name) is not None:
                given |= 1 << bit
                parts.append(getattr(estimates, name))
        bits = GIVEN_BITS[given]
        if estimates.estimated is not None:
            bits &= int.from_bytes(np.packbits(estimates.estimated, bitorder="little").tobytes(), "little")
        if estimates.covariance is not None:
            given |= COVARIANCE
            parts.append(estimates.covariance)
        shape, new = self._shape(tuple((name, a.shape[1:]) for name, a in estimates.diagnostics.items()))
        table = np.column_stack([*(part.reshape(t, -1) for part in (*parts, *estimates.diagnostics.values()))])
        flagged: dict[int, list[tuple[str, float]]] = {}
        for step, source, when in estimates.flagged:
            flagged.setdefault(step, []).append((source, when))
        answers = []
        for k, (time, numbers) in enumerate(zip(estimates.time.tolist(), table, strict=True)):
            more: dict[str, Any] = {}
            if new and k == 0:
                more["shape"] = [(name, a.shape[1:]) for name, a in estimates.diagnostics.items()]
            if k in flagged:
                more["flagged"] = flagged[k]
            tail = json.dumps(more).encode() if more else b""
            size, flags = numbers.nbytes + len(tail), len(flagged.get(k, ()))
            answers.append(
                ANSWER.pack(ESTIMATE, given, bits, shape, flags, size, len(tail), time) + numbers.tobytes() + tail
            )
        return answers

    def _shape(self, signature: tuple[tuple[str, tuple[int, ...]], ...]) -> tuple[int, bool]:
        """The number of a set of diagnostics with their shapes, and whether it is new."""
        new = signature not in self._shapes
        if new:
            if len(self._shapes) > 0xFFFF:
                raise InvalidOutputError("the diagnostics have more than 65535 different sets of names and shapes")
            self._shapes[signature] = len(self._shapes)
        return self._shapes[signature], new


def _with_states(estimate: Estimate) -> dict[str, Any]:
    """The diagnostics of an estimate, and its further states among them.

    Raises
    ------
    InvalidOutputError
        If the further states are not a mapping of names to pairs of value and standard deviation.
    """
    if not isinstance(estimate.states, Mapping):
        raise InvalidOutputError(f"states is a dict, not {type(estimate.states).__name__}")
    diagnostics = dict(estimate.diagnostics)
    for name, pair in estimate.states.items():
        try:
            value, sigma = pair
        except (TypeError, ValueError):
            raise InvalidOutputError(f"states[{name!r}] is a pair, value and sigma, not {pair!r}") from None
        diagnostics[f"state.{name}"], diagnostics[f"sigma.{name}"] = value, sigma
    return diagnostics


def _bytes_of(value: Any, name: str, shape: tuple[int, ...]) -> bytes:
    if type(value) is np.ndarray and value.dtype == np.float64 and value.shape == shape:  # nearly always
        return value.tobytes()
    return real_array(value, name, shape).tobytes()


def real_array(value: Any, name: str, shape: tuple[int, ...] | None) -> Array:
    """As an array of float64 of a given shape, or any for None.

    Raises
    ------
    InvalidOutputError
        If it is none.
    """
    try:
        if np.iscomplexobj(value):  # conversion would drop the imaginary part
            raise TypeError
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise InvalidOutputError(f"{name} is not an array of real numbers: {type(value).__name__}") from None
    if shape is not None and array.shape != shape:
        raise InvalidOutputError(f"{name} has shape {array.shape}, expected {shape}")
    return array


def _number(value: Any, name: str) -> float:
    try:
        return float(value)
    except (TypeError, ValueError):
        raise InvalidOutputError(f"{name} is not a number: {value!r}") from None


def _flag(item: Any) -> tuple[str, float]:
    try:
        instrument, when = item
    except (TypeError, ValueError):
        instrument = when = None
    if not isinstance(instrument, str):
        raise InvalidOutputError(f"flagged holds pairs (instrument, time), not {item!r}")
    return instrument, _number(when, "time of a flagged measurement")


def read_tail(tail: bytes) -> tuple[Sequence[tuple[str, tuple[int, ...]]] | None, list[tuple[str, float]]]:
    """The tail of an answer: names and shapes of new diagnostics or None, and what was flagged.

    Raises
    ------
    InvalidOutputError
        If it is not as `EstimateEncoder` writes it.
    """
    try:
        more = json.loads(tail)
        shape = more.get("shape")
        if shape is not None:
            shape = [(_text(name), tuple(_size(s) for s in sizes)) for name, sizes in shape]
        flagged = [(_text(name), float(when)) for name, when in more.get("flagged", ())]
    except (ValueError, TypeError, AttributeError, RecursionError):
        raise InvalidOutputError("the answer is not in the form of an estimate") from None
    return shape, flagged


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise TypeError
    return value


def _size(value: Any) -> int:
    if type(value) is not int or value < 0:
        raise TypeError
    return value


def numbers_in(shape: Iterable[tuple[str, tuple[int, ...]]]) -> int:
    """How many float64 the diagnostics of a shape are."""
    return sum(math.prod(sizes) for _, sizes in shape)
