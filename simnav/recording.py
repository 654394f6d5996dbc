"""A recording: everything that the instruments delivered in a run, and the truth beside it.

Simulated runs and real logs are recordings alike. A `Block` is a stretch of one; a `Recording` is
a whole run with its start and its datasheets. Faults are labelled: per measurement, which fault
touched it, what the faults added, and the noise that it really had.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from simnav.types import (
    Array,
    ImuSamples,
    InitialState,
    Instruments,
    Measurement,
    Measurements,
    NavigationStates,
)

__all__ = ["AidStream", "Block", "FaultLabel", "ImuLabels", "Recording"]


@dataclass(frozen=True, eq=False)
class FaultLabel:
    """One fault of a run, as the truth knows it.

    Attributes
    ----------
    kind : str
        As in the scenario (``outage``, ``gross_error``, ...).
    instruments : tuple of str
        Names of the instruments that it touches.
    start, end : float
        When it is active [s].
    """

    kind: str
    instruments: tuple[str, ...]
    start: float
    end: float


@dataclass(frozen=True, eq=False)
class AidStream:
    """All k measurements of one aiding instrument over a stretch of time, with their labels.

    Attributes
    ----------
    name, kind : str
    time : (k,) array
    value : (k, d) array
        As delivered; components as in ``KINDS[kind].values``.
    faults : (k,) uint32 array
        Bit j is set where fault j of the recording touched the measurement.
    fault_error : (k, d) array
        What the faults added, in the units of ``KINDS[kind].errors``.
    sigma : (k, d) array
        The white noise that the measurement really had, likewise.
    dropped : (m,) array
        Times of measurements that an outage or a lost bottom lock took away.
    """

    name: str
    kind: str
    time: Array
    value: Array
    faults: NDArray[np.uint32]
    fault_error: Array
    sigma: Array
    dropped: Array

    def __len__(self) -> int:
        return len(self.time)

    @staticmethod
    def concatenate(parts: Sequence[AidStream]) -> AidStream:
        """Join stretches that follow each other."""
        names = ("time", "value", "faults", "fault_error", "sigma", "dropped")
        joined = {n: np.concatenate([getattr(p, n) for p in parts]) for n in names}
        return AidStream(parts[0].name, parts[0].kind, **joined)


@dataclass(frozen=True, eq=False)
class ImuLabels:
    """Labels of n IMU samples that a fault touched.

    Attributes
    ----------
    faults : (n,) uint32 array
        As in `AidStream`.
    fault_error : (n, 6) array
        What the faults added: angular rate [rad/s], then specific force [m/s^2].
    """

    faults: NDArray[np.uint32]
    fault_error: Array


@dataclass(frozen=True, eq=False)
class Block:
    """A stretch (start, end] of a run.

    Attributes
    ----------
    start, end : float
    imu : ImuSamples or None
    imu_labels : ImuLabels or None
        None where no fault of the scenario touches the IMU.
    aids : dict of str to AidStream
    truth : NavigationStates
        At the ends of the steps within the stretch.
    """

    start: float
    end: float
    imu: ImuSamples | None
    imu_labels: ImuLabels | None
    aids: dict[str, AidStream]
    truth: NavigationStates

    @staticmethod
    def concatenate(parts: Sequence[Block]) -> Block:
        """Join stretches that follow each other."""
        first, imu, labels = parts[0], None, None
        if first.imu is not None:
            names = ("time", "interval", "angular_rate", "specific_force")
            imu = ImuSamples(*(np.concatenate([getattr(p.imu, n) for p in parts]) for n in names))
        if first.imu_labels is not None:
            labels = ImuLabels(
                *(np.concatenate([getattr(p.imu_labels, n) for p in parts]) for n in ("faults", "fault_error"))
            )
        names = ("time", "position", "velocity", "attitude")
        truth = NavigationStates(*(np.concatenate([getattr(p.truth, n) for p in parts]) for n in names))
        aids = {n: AidStream.concatenate([p.aids[n] for p in parts]) for n in first.aids}
        return Block(first.start, parts[-1].end, imu, labels, aids, truth)


@dataclass(frozen=True, eq=False)
class Recording:
    """A whole run.

    Attributes
    ----------
    scenario : str
        Versioned id, e.g. ``open-sea-v1``.
    seed : int
    instruments : Instruments
        The datasheets; ``instruments.step`` is the step of the run [s].
    initial_truth : NavigationStates
        One state: the truth at time 0.
    start : InitialState
        What an estimator is told of it.
    faults : tuple of FaultLabel
    data : Block
        From time 0 to the end; ``data.truth`` holds the ends of all steps.
    note : str
        E.g. which recording of a folder of logs this is.
    """

    scenario: str
    seed: int
    instruments: Instruments
    initial_truth: NavigationStates
    start: InitialState
    faults: tuple[FaultLabel, ...]
    data: Block
    note: str = ""

    @property
    def duration(self) -> float:
        """Length of the run [s]."""
        return self.data.end

    def steps(self) -> Iterator[Measurements]:
        """The packets that an estimator is fed, one a step, in order."""
        yield from packets(self.data, self.data.truth.time)


def packets(data: Block, ends: Array) -> Iterator[Measurements]:
    """Cut a block into the packets of successive steps.

    Parameters
    ----------
    data : Block
    ends : (n,) array
        End of each step [s], ascending; the first step begins at ``data.start``.

    Yields
    ------
    Measurements
    """
    aids = [
        Measurement(float(t), s.name, s.kind, v)
        for s in data.aids.values()
        for t, v in zip(s.time, s.value, strict=True)
    ]
    aids.sort(key=lambda m: m.time)  # stable: ties keep the scenario's order of instruments
    # Times are multiples of the sample interval up to rounding: half a microsecond decides.
    edges = np.asarray(ends) + 0.5e-6
    cut = np.searchsorted([m.time for m in aids], edges, side="right")
    cut_imu = None if data.imu is None else np.searchsorted(data.imu.time, edges, side="right")
    start, i, j = data.start, 0, 0
    for k, end in enumerate(ends):
        imu = None
        if data.imu is not None and cut_imu is not None:
            imu = data.imu[j : int(cut_imu[k])]
            j = int(cut_imu[k])
        yield Measurements(start, float(end), imu, aids[i : int(cut[k])])
        start, i = float(end), int(cut[k])
