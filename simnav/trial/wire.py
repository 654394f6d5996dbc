"""The plain form of packets and estimates: fixed headers and float64 buffers.

An estimator may run in another process than the one that holds the recording (`simnav.leaderboard.campaign`). Packets
and answers are sent in this form. The same form is used within one process, so that both give the same bits.

A **packet** is a header (number of IMU samples, of other measurements, of float64 of the latter; start and end of the
step) and float64 numbers: times, intervals, angular rates and specific forces of the IMU, then for each measurement
the number of its instrument, its time and its components, and with channels the index of its channel and its side
information. An **answer** is a header (`ANSWER`), float64 numbers
(position, velocity, attitude, covariance, diagnostics, each only where it was given) and, where there is more to say
than numbers, a tail in JSON: the names and shapes of diagnostics when they first appear, and what was flagged.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simnav.recording import AidStream, Block
from simnav.timing import TIME_TOLERANCE
from simnav.types import Array, Estimate, ImuSamples, Measurement, Measurements

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
_PACKET = struct.Struct("<IIIIdd")
_NO_IMU = 0xFFFFFFFF
_IMU_WIDTH = 8  # float64 of one IMU sample

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
    streams : list of (str, str, int, tuple of str, int)
        For each aiding instrument its name, kind and number of components, its channels and the number of components of
        their side information, for `PacketDecoder`.
    """

    def __init__(self, data: Block, ends: Array):
        streams = list(data.aids.values())
        self.streams = [(s.name, s.kind, s.value.shape[1], s.channels, s.side.shape[1]) for s in streams]
        numbers = [_numbers(s) for s in streams]
        self._ends = [float(t) for t in ends]
        self._start = float(data.start)
        edges = np.asarray(ends) + TIME_TOLERANCE
        times = np.concatenate([s.stamps for s in streams]) if streams else np.empty(0)
        step = np.concatenate([np.searchsorted(edges, s.arrivals) for s in streams] or [np.empty(0, np.intp)])
        order = np.lexsort((times, step))  # stable: ties keep the scenario's order of instruments
        widths = np.concatenate([np.full(len(n), 2 + n.shape[1]) for n in numbers]) if streams else order
        first = np.zeros(len(times) + 1, dtype=np.intp)  # where each measurement begins, in order of time
        np.cumsum(widths[order], out=first[1:])
        place = np.empty(len(times), dtype=np.intp)
        place[order] = first[:-1]
        self._aids = np.empty(int(first[-1]))
        begin = 0
        for number, (s, own) in enumerate(zip(streams, numbers, strict=True)):
            at = place[begin : begin + len(s)]
            begin += len(s)
            self._aids[at], self._aids[at + 1] = number, s.stamps
            self._aids[at[:, None] + np.arange(2, 2 + own.shape[1])] = own
        cut = np.searchsorted(step[order], np.arange(len(edges)), side="right")
        self._counts = [int(c) for c in np.diff(cut, prepend=0)]
        self._edges = [int(first[c]) for c in cut]
        self._imu: tuple[Array, ...] | None = None
        if data.imu is not None:
            parts = (data.imu.time, data.imu.interval, data.imu.angular_rate, data.imu.specific_force)
            self._imu = tuple(np.ascontiguousarray(a, dtype=np.float64) for a in parts)
            self._cut_imu = [int(c) for c in np.searchsorted(data.imu.time, edges, side="right")]

    def __len__(self) -> int:
        return len(self._ends)

    def __getitem__(self, k: int) -> list[Any]:
        """The packet of a step as buffers that follow each other; they are not copies."""
        start = self._ends[k - 1] if k else self._start
        a, b = self._edges[k - 1] if k else 0, self._edges[k]
        samples = _NO_IMU
        buffers: list[Any] = []
        if self._imu is not None:
            i, j = self._cut_imu[k - 1] if k else 0, self._cut_imu[k]
            samples = j - i
            if samples:
                buffers = [part[i:j] for part in self._imu]
        if b > a:
            buffers.append(self._aids[a:b])
        return [_PACKET.pack(samples, self._counts[k], b - a, 0, start, self._ends[k]), *buffers]


def _numbers(stream: AidStream) -> Array:
    """What a packet holds of each reading of a stream, beside instrument and time."""
    if not stream.channels:
        return np.hstack([stream.value, stream.side]) if stream.states_sigma else stream.value
    return np.hstack([stream.value, stream.channel[:, None].astype(np.float64), stream.side])


class PacketDecoder:
    """From plain packets to `Measurements`.

    Parameters
    ----------
    streams : sequence of (str, str, int, tuple of str, int)
        ``streams`` of the `PacketEncoder`.
    """

    #: Bytes of a header.
    HEADER = _PACKET.size

    def __init__(self, streams: Iterable[tuple[str, str, int, tuple[str, ...], int]]):
        self._streams = list(streams)

    @staticmethod
    def size(header: bytes | bytearray) -> int:
        """Bytes of a packet, header included."""
        samples, _, numbers, _, _, _ = _PACKET.unpack_from(header)
        return int(_PACKET.size + 8 * (numbers if samples == _NO_IMU else numbers + _IMU_WIDTH * samples))

    def __call__(self, packet: bytearray) -> Measurements:
        """The packet; its arrays are views of the buffer, which should not be used again."""
        n, count, _, _, start, end = _PACKET.unpack_from(packet)
        values = np.frombuffer(packet, dtype=np.float64, offset=_PACKET.size)
        imu, i = None, 0
        if n != _NO_IMU:
            i = _IMU_WIDTH * n
            imu = ImuSamples(
                values[:n], values[n : 2 * n], values[2 * n : 5 * n].reshape(n, 3), values[5 * n : i].reshape(n, 3)
            )
        aids = []
        for _ in range(count):
            name, kind, width, channels, sides = self._streams[int(values[i])]
            time, value = float(values[i + 1]), values[i + 2 : i + 2 + width]
            i += 2 + width
            if channels:
                side = values[i + 1 : i + 1 + sides]
                aids.append(Measurement(time, name, kind, value, channels[int(values[i])], side))
                i += 1 + sides
            elif sides:  # what the reading states of its noise
                aids.append(Measurement(time, name, kind, value, side=values[i : i + sides]))
                i += sides
            else:
                aids.append(Measurement(time, name, kind, value))
        return Measurements(start, end, imu, aids)


# --- answers ------------------------------------------------------------------------------------------


class EstimateEncoder:
    """From `Estimate` to an answer in plain form; one for each run.

    What is no array of the right shape raises `InvalidOutputError` here. What the numbers are worth is for
    `simnav.trial.log` to judge.
    """

    def __init__(self) -> None:
        self._shapes: dict[tuple[tuple[str, tuple[int, ...]], ...], int] = {(): 0}

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
        if diagnostics:
            signature = []
            for key, value in diagnostics.items():
                if type(value) is float:
                    signature.append((str(key), ()))
                    parts.append(_DOUBLE.pack(value))
                    continue
                array = real_array(value, f"diagnostic {key!r}", None)
                signature.append((str(key), array.shape))
                parts.append(array.tobytes())
            found = tuple(signature)
            if found not in self._shapes:
                if len(self._shapes) > 0xFFFF:
                    raise InvalidOutputError("the diagnostics have more than 65535 different sets of names and shapes")
                self._shapes[found] = len(self._shapes)
                more["shape"] = found
            shape = self._shapes[found]
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
