"""The log of a trial: it checks every answer of an estimator and collects the answers.

The answers have the form of `simnav.trial.wire`. They come from this process, or from another one that is not trusted.
An answer that is not well-formed is invalid output.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simnav.trial.trial import Trial
from simnav.trial.wire import (
    ANSWER,
    COVARIANCE,
    ESTIMATE,
    GIVEN_BITS,
    MASKS,
    VECTORS,
    InvalidOutputError,
    numbers_in,
    read_tail,
    real_array,
)
from simnav.types import COMPONENTS, Array, NavigationStates

__all__ = ["DIVERGENCE_LIMIT", "DivergedError", "TrialLog"]

#: Horizontal error above which an estimate counts as diverged [m].
DIVERGENCE_LIMIT = 100e3

_TIME_TOLERANCE = 1e-6  # s; steps are multiples of the sample interval up to rounding
_ROUNDING = 1e-6  # of a correlation coefficient: asymmetry, and negative eigenvalues, up to this are rounding
_LEAST, _MOST = 1e-100, 1e100  # of a variance other than 0, and of any entry: what follows from others may overflow
_CHUNK = 1024  # covariances checked together
_EARTH_RADIUS = 6371e3
_ALL = 0b111111111
_STATE = 72  # bytes of position, velocity and attitude
_COVARIANCE = 648
_FORM = 16  # bytes of the header of an answer that tell its form: all but the time
_FIRST = ANSWER.size // 8  # where the numbers of an answer begin, in float64; the time is before them
_HELD = 100  # bytes that are counted for keeping the diagnostics and flags of a step, beside what they take
_ADDRESSABLE = 1 << 46  # bytes of all diagnostics, where there is no limit
_DIMENSIONS = 16  # of a diagnostic, at most
_VECTORS = [struct.Struct(f"{3 * n}d") for n in range(4)]  # numbers of so many vectors


class DivergedError(Exception):
    """The estimate is finite, but its error is above `DIVERGENCE_LIMIT`."""


class TrialLog:
    """Checks the answers of a run and collects them.

    Parameters
    ----------
    truth : NavigationStates
        True states at the ends of the steps; NaN if they are not known.
    keep_covariance : bool
        False: covariances are checked but not kept, which saves 648 bytes an epoch.
    limit : float
        Largest memory of diagnostics and flags together, as they arrive and as arrays of the trial [bytes].

    Attributes
    ----------
    n : int
        Number of valid answers.
    step : int
        Number of the next step, or of the step whose answer was refused.
    """

    def __init__(self, truth: NavigationStates, keep_covariance: bool, limit: float = math.inf):
        self.n = self.step = 0
        steps = len(truth.time)
        self._steps, self._keep, self._limit = steps, keep_covariance, limit
        self._ends: list[float] = truth.time.tolist()
        self._truth = truth.position
        self._pending: list[tuple[bytes, float]] = []
        self._time = np.full(steps, np.nan)
        self._seconds = np.full(steps, np.nan)
        self._states = np.full((steps, 9), np.nan)
        self._state_bytes = _bytes_of(self._states)
        self._estimated = np.zeros(steps, dtype=np.uint16)
        self._shapes: list[list[tuple[str, tuple[int, ...]]]] = [[]]  # of diagnostics
        self._sizes = [0]  # of each shape [bytes]
        self._largest: dict[str, tuple[int, ...]] = {}  # of each diagnostic, in each dimension
        self._collected_size = 0  # bytes of the arrays of the trial, if every step had all that is known
        self._diagnostics: list[list[tuple[int, int, bytes]]] = [[]]  # by shape: first step, how many, numbers
        self._flags: list[tuple[int, str, float]] = []
        self._covariance: Array | None = None
        self._chunk: Array | None = None
        self._chunk_bytes = memoryview(b"")
        self._epochs: list[int] = []  # of the covariances in the chunk
        self._held = 0  # bytes of diagnostics and flags

    def put(self, answer: bytes, seconds: float) -> None:
        """Store the answer to a step until `settle`; the arguments are those of `add`."""
        self._pending.append((answer, seconds))

    def settle(self) -> None:
        """Check and add all stored answers, one after the other; answers after an invalid one are discarded.

        Most answers are valid and have the same form. Such answers are checked and added together.

        Raises
        ------
        InvalidOutputError, DivergedError, MemoryError
            For the first answer for which `add` raises it.
        """
        pending, self._pending = self._pending, []
        first = 0
        while first < len(pending):
            answer = pending[first][0]
            head, size, last = answer[:_FORM], len(answer), first + 1
            while last < len(pending) and len(pending[last][0]) == size and pending[last][0][:_FORM] == head:
                last += 1
            taken = self._add_alike(pending[first:last]) if last > first + 1 else 0
            first += taken
            for answer, seconds in () if taken else pending[first:last]:
                self.add(answer, seconds)
                first += 1

    def add(self, answer: bytes | bytearray | memoryview, seconds: float) -> None:
        """Take the answer to one step, or raise and leave the log as it was.

        Parameters
        ----------
        answer : bytes
            The answer in the form of `simnav.trial.wire`.
        seconds : float
            Wall time of the update [s].

        Raises
        ------
        InvalidOutputError, DivergedError
            If the answer is not valid, or the estimate has diverged; the message gives the reason.
        MemoryError
            If diagnostics and flags take more than the limit.
        """
        k = self.step = self.n
        end, truth = self._ends[k], self._truth[k]
        if len(answer) < ANSWER.size:
            raise _malformed()
        kind, given, bits, shape, flags, size, tail, stamp = ANSWER.unpack_from(answer)
        if kind != ESTIMATE or len(answer) != ANSWER.size + size or given > 15 or bits > _ALL:
            raise _malformed()
        if not abs(stamp - end) <= _TIME_TOLERANCE:
            raise InvalidOutputError(f"time of the estimate is {stamp!r}, the step ends at {end!r}")
        body = memoryview(answer)
        place = ANSWER.size
        whole = given & 7 == 7
        vectors = _VECTORS[(given & 7).bit_count()]
        after = place + vectors.size + (_COVARIANCE if given & COVARIANCE else 0)
        if after + tail > len(answer) or bits & ~GIVEN_BITS[given & 7]:
            raise _malformed()
        values = vectors.unpack_from(answer, place)
        if not all(map(math.isfinite, values)):
            _check_vectors(given, bits, values)
        if bits & 3 == 3:
            distance = _distance(values, truth)
            if distance > DIVERGENCE_LIMIT:  # never where the truth is not known
                raise DivergedError(
                    f"horizontal error {distance / 1e3:.0f} km is above the limit of {DIVERGENCE_LIMIT / 1e3:.0f} km"
                )
        flagged: list[tuple[str, float]] = []
        numbers = b""
        if shape or flags or after < len(answer):
            end_of_numbers = len(answer) - tail
            numbers = bytes(body[after:end_of_numbers])
            flagged = self._named(numbers, bytes(body[end_of_numbers:]), shape, flags)
        # From here on nothing can fail.
        if whole:
            self._state_bytes[_STATE * k : _STATE * (k + 1)] = body[place : place + _STATE]
        else:
            for bit, section in enumerate(VECTORS.values()):
                if given >> bit & 1:
                    self._states[k, section], values = values[:3], values[3:]
        self.n += 1
        self._time[k], self._seconds[k], self._estimated[k] = end, seconds, bits
        if shape:
            self._diagnostics[shape].append((k, 1, numbers))
        if flagged:
            self._flags += [(k, *f) for f in flagged]
        if given & COVARIANCE:
            self._room()
            begin = _COVARIANCE * len(self._epochs)
            self._chunk_bytes[begin : begin + _COVARIANCE] = body[after - _COVARIANCE : after]
            self._epochs.append(k)
            if self._room() == 0:
                self.check_covariances()
        self.step = self.n

    def _add_alike(self, pending: list[tuple[bytes, float]]) -> int:
        """Take the first of some answers of one form; return how many, 0 where `add` must judge them."""
        answer = pending[0][0]
        if len(answer) < ANSWER.size:
            return 0
        kind, given, bits, shape, flags, size, tail, _ = ANSWER.unpack_from(answer)
        if kind != ESTIMATE or given > 15 or bits > _ALL or bits & ~GIVEN_BITS[given & 7] or flags or tail:
            return 0
        vectors = 3 * (given & 7).bit_count()
        after = vectors + (81 if given & COVARIANCE else 0)  # numbers before the diagnostics
        if shape >= len(self._shapes) or size != 8 * after + self._sizes[shape] or len(answer) != ANSWER.size + size:
            return 0
        if given & COVARIANCE:
            pending = pending[: self._room()]
        k, m = self.n, len(pending)
        held = self._held + m * (self._sizes[shape] + _HELD) if shape else self._held
        if held + self._collected_size > self._limit:
            return 0
        table = np.frombuffer(b"".join([answer for answer, _ in pending])).reshape(m, -1)
        values, rest = table[:, _FIRST : _FIRST + vectors], _FIRST + after
        ends = self._ends[k : k + m]
        good = np.isfinite(values).all() and (np.abs(table[:, _FIRST - 1] - ends) <= _TIME_TOLERANCE).all()
        if not good or (bits & 3 == 3 and _some_far(values, self._truth[k : k + m])):
            return 0
        if vectors == 9:
            self._states[k : k + m] = values
        else:
            for bit, section in enumerate(VECTORS.values()):
                if given >> bit & 1:
                    self._states[k : k + m, section], values = values[:, :3], values[:, 3:]
        self.n = k + m
        self.step = self.n - 1
        self._time[k : k + m], self._seconds[k : k + m] = ends, [seconds for _, seconds in pending]
        self._estimated[k : k + m] = bits
        self._held = held
        if shape:
            self._diagnostics[shape].append((k, m, table[:, rest:].tobytes()))
        if given & COVARIANCE and self._chunk is not None:
            begin = len(self._epochs)
            self._chunk[begin : begin + m] = table[:, rest - 81 : rest].reshape(m, 9, 9)
            self._epochs += range(k, k + m)
            if self._room() == 0:
                self.check_covariances()
        self.step = self.n
        return m

    def _room(self) -> int:
        """For how many covariances there is room before they are checked."""
        if self._chunk is None:
            self._chunk = np.empty((min(_CHUNK, self._steps), 9, 9))
            self._chunk_bytes = _bytes_of(self._chunk)
        return len(self._chunk) - len(self._epochs)

    def _named(self, numbers: bytes, tail: bytes, shape: int, flags: int) -> list[tuple[str, float]]:
        """Check the diagnostics, learn their names where they are new; return what was flagged."""
        found, flagged = read_tail(tail) if tail else (None, [])
        new = found is not None
        if new != (shape == len(self._shapes)) or shape > len(self._shapes) or len(flagged) != flags:
            raise _malformed()
        if len(numbers) != (8 * numbers_in(found) if found is not None else self._sizes[shape]):
            raise _malformed()
        learned, size = self._learned(found) if found is not None else ({}, self._collected_size)
        self._held += len(numbers) + len(tail) + _HELD * (1 + len(learned) + len(flagged))
        if self._held + size > self._limit:
            raise MemoryError(f"its diagnostics take more than {self._limit / 2**20:.0f} MiB")
        if found is not None:
            self._shapes.append(list(found))
            self._sizes.append(len(numbers))
            self._diagnostics.append([])
            self._largest |= learned
            self._collected_size = size
        return flagged

    def _learned(self, found: Sequence[tuple[str, tuple[int, ...]]]) -> tuple[dict[str, tuple[int, ...]], int]:
        """The largest sizes of the diagnostics of a new shape, and the bytes of all arrays of the trial with them."""
        learned: dict[str, tuple[int, ...]] = {}
        size = self._collected_size
        for name, sizes in found:
            if name in learned:
                raise InvalidOutputError(f"diagnostic {name[:80]!r} is given twice")
            if len(sizes) > _DIMENSIONS:
                raise InvalidOutputError(
                    f"diagnostic {name[:80]!r} has {len(sizes)} dimensions, more than {_DIMENSIONS}"
                )
            before = self._largest.get(name)
            if before is not None and len(before) != len(sizes):
                raise InvalidOutputError(f"diagnostic {name!r} changes its number of dimensions")
            learned[name] = tuple(map(max, sizes, before)) if before is not None else tuple(sizes)
            size += 8 * self._steps * (_extent(learned[name]) - (_extent(before) if before is not None else 0))
        if size > _ADDRESSABLE:
            raise MemoryError("its diagnostics take more than any memory")
        return learned, size

    def check_covariances(self) -> None:
        """Check those since the last call; at a bad one, forget all from its epoch on and raise."""
        if not self._epochs or self._chunk is None:
            return
        epochs, p = np.array(self._epochs), self._chunk[: len(self._epochs)].copy()
        self._epochs = []
        known = MASKS[self._estimated[epochs]]
        p[~(known[:, :, None] & known[:, None, :])] = np.nan
        bad, why = _first_bad_covariance(p, known)
        if bad is not None:
            self.n = int(epochs[bad])
            epochs, p = epochs[:bad], p[:bad]
        if self._keep:
            if self._covariance is None:
                self._covariance = np.full((self._steps, 9, 9), np.nan)
            self._covariance[epochs] = p
        if bad is not None:
            raise InvalidOutputError(f"at {self._time[self.n]:g} s the covariance {why}")

    def forget_diagnostics(self) -> None:
        """Leave the diagnostics out of the trial."""
        self._diagnostics = [[] for _ in self._shapes]

    def trial(self, estimator: str, status: str, reason: str) -> Trial:
        """The trial with all collected answers."""
        n = self.n
        return Trial(
            estimator=estimator,
            status=status,
            reason=reason,
            time=self._time[:n],
            position=self._states[:n, 0:3].copy(),
            velocity=self._states[:n, 3:6].copy(),
            attitude=self._states[:n, 6:9].copy(),
            estimated=MASKS[self._estimated[:n]],
            covariance=None if self._covariance is None else self._covariance[:n],
            diagnostics=self._collected(n),
            flagged=[(name, t) for k, name, t in self._flags if k < n],
            update_seconds=self._seconds[:n],
        )

    def _collected(self, n: int) -> dict[str, Array]:
        """The diagnostics of the first n steps by name, in the order in which they appeared."""
        kept = [[(k, min(m, n - k), numbers) for k, m, numbers in items if k < n] for items in self._diagnostics]
        sizes: dict[str, tuple[int, ...]] = {}
        for shape, items in zip(self._shapes, kept, strict=True):
            for name, dimensions in shape if items else ():
                sizes[name] = tuple(map(max, zip(dimensions, sizes.get(name, dimensions), strict=True)))
        found = {name: np.full((n, *dimensions), np.nan) for name, dimensions in sizes.items()}
        for shape, size, items in zip(self._shapes, self._sizes, kept, strict=True):
            if not items:
                continue
            epochs = np.concatenate([np.arange(k, k + m) for k, m, _ in items])
            joined = b"".join([numbers[: m * size] for _, m, numbers in items])
            values = (np.frombuffer(joined) if joined else np.empty(0)).reshape(len(epochs), size // 8)
            begin = 0
            for name, dimensions in shape:
                end = begin + math.prod(dimensions)
                part = values[:, begin:end].reshape(len(epochs), *dimensions)
                place: Any = (epochs, *(slice(d) for d in dimensions))
                found[name][place] = part
                begin = end
        return found

    def trajectory(self, states: object) -> NavigationStates | None:
        """A smoothed trajectory, copied, or None.

        Raises
        ------
        InvalidOutputError
            Where it does not fit the run.
        """
        if states is None:
            return None
        if not isinstance(states, NavigationStates):
            raise InvalidOutputError(f"expected NavigationStates or None, got {type(states).__name__}")
        n = self.n
        times = real_array(states.time, "time", (n,)).copy()
        if not (np.abs(times - self._time[:n]) <= _TIME_TOLERANCE).all():
            raise InvalidOutputError("the times are not the ends of the steps")
        vectors = {name: real_array(getattr(states, name), name, (n, 3)).copy() for name in VECTORS}
        given: NDArray[np.bool_] = np.any(MASKS[self._estimated[:n]], axis=0)
        for name, vector in vectors.items():
            wanted = given[VECTORS[name]] if name != "attitude" else _attitude_given(given[6:])
            if not np.isfinite(vector[:, wanted]).all():
                raise InvalidOutputError(f"{name} is not finite")
        return NavigationStates(times, **vectors)


def _extent(sizes: Sequence[int]) -> int:
    """Numbers of an array; an empty dimension counts as one, for the others cost something, too."""
    return math.prod(max(size, 1) for size in sizes)


def _bytes_of(array: Array) -> memoryview:
    """The memory of an array."""
    return memoryview(array.reshape(-1).view(np.uint8)) if array.size else memoryview(bytearray())  # type: ignore[arg-type]


def _malformed() -> InvalidOutputError:
    return InvalidOutputError("the answer is not in the form of an estimate")


def _check_vectors(given: int, bits: int, values: Sequence[float]) -> None:
    """Raise an error if an estimated component is not finite."""
    mask, begin = MASKS[bits], 0
    for bit, (name, section) in enumerate(VECTORS.items()):
        if not given >> bit & 1:
            continue
        vector = np.array(values[begin : begin + 3])
        begin += 3
        wanted = mask[section] if name != "attitude" else _attitude_given(mask[6:])
        if not np.isfinite(vector[wanted]).all():
            raise InvalidOutputError(f"{name} is not finite: {vector.tolist()}")


def _attitude_given(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which of roll, pitch, yaw the estimated components (north, east, down) of the attitude error need."""
    level = bool(mask[0] or mask[1])
    return np.array([level, level, bool(mask[2])])


def _distance(position: Sequence[float], truth: Array) -> float:
    """Rough horizontal distance [m], on a sphere: it only has to tell 100 km from less."""
    north = float(position[0] - truth[0])
    east = math.remainder(float(position[1] - truth[1]), 2.0 * math.pi) * math.cos(float(truth[0]))
    return _EARTH_RADIUS * math.hypot(north, east)


def _some_far(position: Array, truth: Array) -> bool:
    """Whether one of the positions may be as far away as `DIVERGENCE_LIMIT`: a little less, for the rounding."""
    with np.errstate(all="ignore"):
        north = position[:, 0] - truth[:, 0]
        east = (position[:, 1] - truth[:, 1] + math.pi) % (2.0 * math.pi) - math.pi
        distance = _EARTH_RADIUS * np.hypot(north, east * np.cos(truth[:, 0]))
        return bool((distance > 0.99 * DIVERGENCE_LIMIT).any())


def _first_bad_covariance(p: Array, estimated: NDArray[np.bool_]) -> tuple[int | None, str]:
    """Index of the first covariance that is not finite, symmetric and positive semi-definite, and why."""
    variance = np.diagonal(p, axis1=1, axis2=2)
    unknown = ~(estimated[:, :, None] & estimated[:, None, :])
    infinite: NDArray[np.bool_] = ~np.all(np.isfinite(p) | unknown, axis=(1, 2))
    negative: NDArray[np.bool_] = np.any(variance < 0.0, axis=1)
    tiny = (variance > 0.0) & (variance < _LEAST)
    beyond: NDArray[np.bool_] = tiny.any(axis=1) | np.any(np.abs(p) > _MOST, axis=(1, 2))
    sigma = np.sqrt(np.where(variance >= _LEAST, variance, 1.0))
    p = np.where(unknown | (infinite | beyond)[:, None, None], 0.0, p) / sigma[:, :, None] / sigma[:, None, :]
    asymmetric: NDArray[np.bool_] = np.any(np.abs(p - p.swapaxes(1, 2)) > _ROUNDING, axis=(1, 2))
    p = 0.5 * (p + p.swapaxes(1, 2))
    indefinite: NDArray[np.bool_] = np.any(np.abs(p) > 1.0 + _ROUNDING, axis=(1, 2))  # a correlation above 1
    p[indefinite] = 0.0  # LAPACK need not converge for numbers of any size
    try:  # much faster than eigenvalues, and enough where all is well
        np.linalg.cholesky(p + _ROUNDING * np.eye(9))
    except np.linalg.LinAlgError:
        indefinite |= np.linalg.eigvalsh(p)[:, 0] < -_ROUNDING
    bad: NDArray[np.intp] = np.flatnonzero(infinite | negative | beyond | asymmetric | indefinite)
    if len(bad) == 0:
        return None, ""
    k = int(bad[0])
    if infinite[k]:
        return k, "is not finite"
    if negative[k]:
        j = int(np.nanargmin(variance[k]))
        return k, f"has a negative variance of {COMPONENTS[j]}: {variance[k, j]:g}"
    if tiny[k].any():
        j = int(np.flatnonzero(tiny[k])[0])
        return (
            k,
            f"has a variance of {COMPONENTS[j]} of {float(variance[k, j])!r}: it should be 0 or at least {_LEAST:g}",
        )
    if beyond[k]:
        return k, f"has an entry beyond {_MOST:g}"
    return k, "is not symmetric" if asymmetric[k] else "is not positive semi-definite"
