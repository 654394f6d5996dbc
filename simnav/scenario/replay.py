"""The errors of a recording laid on a simulated instrument: real error and exact truth together.

The errors are drawn as blocks of the recorded ones, one after the other (moving-block bootstrap: H. R. Künsch, "The
jackknife and the bootstrap for general stationary observations", The Annals of Statistics 17, 1989).
"""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import lru_cache
from typing import ClassVar, Literal

import numpy as np

from simnav.blocks import StateBlock
from simnav.kinds import Kind
from simnav.scenario.residuals import ErrorSeries, instrument_of, residuals
from simnav.scenario.scenario import Scenario
from simnav.sensors.error_processes.process import Act, ErrorProcessSpec, register_error_process
from simnav.spec import Positive, quantity
from simnav.types import Array

__all__ = ["Replay", "read_logs_by"]

_NAME = re.compile(r"[a-z0-9]+(-[a-z0-9]+)*")
#: What finds a recorded scenario by name (`read_logs_by`).
_readers: list[Callable[[str], Scenario]] = []


def read_logs_by(load: Callable[[str], Scenario]) -> None:
    """Set the function that finds a scenario by name. `simnav.scenario.reading`, which is above this module, does."""
    _readers[:] = [load]


def _load(name: str) -> Scenario:
    return _readers[0](name)


@register_error_process
class Replay(ErrorProcessSpec):
    """Blocks of the errors of a measured instrument of a recorded scenario, drawn by seed.

    The mean of each recording is taken off, because it is a bias that differs from voyage to voyage; ``bias`` of the
    instrument draws one. Between the readings of the recording the error is that of the last one. The datasheet takes
    the errors for a first-order process with their standard deviation, and the time after which their autocorrelation
    is 1/e. Where that is less than the time between two readings, they are white noise.

    Attributes
    ----------
    log : str
        Name of the recorded scenario.
    instrument : str
        Name of its instrument, of the same kind.
    block_length : float
        Length of a block [s].
    """

    act: ClassVar[Act] = "coloured"

    kind: Literal["replay"] = "replay"
    log: str
    instrument: str
    block_length: Positive = quantity("s", 60.0)

    def check(self, kind: Kind) -> None:
        """See `ErrorProcessSpec.check`."""
        super().check(kind)
        if not _NAME.fullmatch(self.log):
            raise ValueError(f"log = {self.log!r} should be the name of a recorded scenario of a catalogue, not a path")
        recorded = _load(self.log)
        spec = instrument_of(recorded, self.instrument)
        if spec.definition is not kind:
            raise ValueError(
                f"instrument = {self.instrument!r} of {recorded.id} is of kind {spec.kind!r}; it should be of the kind "
                "of the instrument that gets its errors"
            )
        if recorded.log is None or recorded.log.instruments[self.instrument].source == "reference":
            raise ValueError(f"log = {self.log!r} does not measure {self.instrument!r}")

    def _affected(self, kind: Kind) -> Array:
        places = np.zeros(len(kind.errors))
        places[self._places(kind)] = 1.0
        return places

    def sampled(self, kind: Kind, rng: np.random.Generator) -> _Replayed:
        """See `ErrorProcessSpec.sampled`."""
        return _Replayed(_recorded(self.log, self.instrument), self.block_length, self._affected(kind), rng)

    def white(self, kind: Kind) -> Array:
        """See `ErrorProcessSpec.white`."""
        sigma, time, interval = _figures(self.log, self.instrument)
        return sigma * self._affected(kind) if time <= interval else np.zeros(len(sigma))

    def block(self, name: str, kind: Kind) -> StateBlock | None:
        """See `ErrorProcessSpec.block`."""
        sigma, time, interval = _figures(self.log, self.instrument)
        if time <= interval:
            return None
        units = tuple(component.error_unit for component in kind.components)
        return StateBlock.stationary(name, len(sigma), units, tuple((sigma * self._affected(kind)).tolist()), time)


@lru_cache(maxsize=16)
def _recorded(log: str, instrument: str) -> tuple[ErrorSeries, ...]:
    return tuple(residuals(_load(log), instrument))


@lru_cache(maxsize=16)
def _figures(log: str, instrument: str) -> tuple[Array, float, float]:
    """Standard deviation of each component, correlation time of the whole, and time between readings [s]."""
    series = _recorded(log, instrument)
    errors = [s.error - s.error.mean(axis=0) for s in series]
    sigma = np.sqrt(np.mean(np.concatenate(errors) ** 2, axis=0))
    interval = 1.0 / series[0].rate
    lag, most = 1, max(2, min(len(e) for e in errors) // 2)
    scaled = [e / np.where(sigma > 0.0, sigma, 1.0) for e in errors]
    while lag < most:
        share = np.sum([np.sum(e[:-lag] * e[lag:]) for e in scaled]) / np.sum([e[lag:].size for e in scaled])
        if share < np.exp(-1.0):
            break
        lag += 1
    return sigma, lag * interval, interval


class _Replayed:
    """Blocks of recorded errors, laid end to end."""

    def __init__(self, series: tuple[ErrorSeries, ...], length: float, affected: Array, rng: np.random.Generator):
        self._series, self._affected, self._rng = series, affected, rng
        self._errors = [s.error - s.error.mean(axis=0) for s in series]
        self._length = min(length, *(s.duration for s in series))
        weight = np.array([s.duration for s in series])
        self._weight = weight / weight.sum()
        self._blocks: list[tuple[int, float]] = []

    def sample(self, time: Array) -> Array:
        """The (n, d) errors at n times."""
        number = np.maximum(np.floor(time / self._length).astype(np.int64), 0)
        while len(self._blocks) <= (number.max() if len(number) else -1):
            k = int(self._rng.choice(len(self._series), p=self._weight))
            first, last = float(self._series[k].time[0]), float(self._series[k].time[-1])
            self._blocks.append((k, first + self._rng.random() * max(last - first - self._length, 0.0)))
        out = np.zeros((len(time), len(self._affected)))
        for b in np.unique(number):
            rows = number == b
            k, begin = self._blocks[b]
            wanted = begin + time[rows] - b * self._length
            place = np.clip(np.searchsorted(self._series[k].time, wanted + 1e-9, side="right") - 1, 0, None)
            out[rows] = self._errors[k][place]
        return out * self._affected
