"""Recordings that differ from another one in a way that a contract test asks for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from simnav.recording import Block, Recording
from simnav.types import KINDS, ImuSamples, Instruments

__all__ = ["altered", "silenced", "until", "without"]


def altered(recording: Recording, after: float) -> Recording:
    """The recording with other and fewer measurements after a time."""
    data = recording.data
    imu = data.imu
    if imu is not None:
        late = imu.time > after + 1e-6
        imu = ImuSamples(
            imu.time,
            imu.interval,
            np.where(late[:, None], -imu.angular_rate, imu.angular_rate),
            np.where(late[:, None], imu.specific_force + 0.1, imu.specific_force),
        )
    aids = {}
    for name, stream in data.aids.items():
        late = stream.arrivals > after + 1e-6
        small = 1e-6 if KINDS[stream.kind].geodetic else 0.1
        changed = replace(stream, value=np.where(late[:, None], stream.value + small, stream.value))
        aids[name] = changed.rows(~late | (np.arange(len(late)) % 3 > 0))
    return replace(recording, data=replace(data, imu=imu, aids=aids))


def until(recording: Recording, end: float) -> Recording:
    """The recording up to a time."""
    data, whole = silenced(recording, end, imu=False).data, recording.data.truth
    truth = whole[: int(np.searchsorted(whole.time, end + 1e-6))]
    return replace(recording, data=replace(data, end=float(truth.time[-1]), truth=truth))


def silenced(recording: Recording, after: float, imu: bool) -> Recording:
    """The recording without what arrives after a time: aiding instruments, and without ``imu`` the IMU, too."""
    data = recording.data
    samples = data.imu
    if samples is not None and not imu:
        samples = samples[: int(np.searchsorted(samples.time, after + 1e-6))]
    aids = {n: s.rows(s.arrivals <= after + 1e-6) for n, s in data.aids.items()}
    return replace(recording, data=replace(data, imu=samples, aids=aids))


def without(recording: Recording, absent: Sequence[str]) -> Recording:
    """The recording without some instruments; ``imu`` is the name of the IMU."""
    old = recording.instruments
    imu = "imu" not in absent
    sheets = Instruments([s for n, s in old.items() if n not in absent], old.imu if imu else None, old.step)
    data: Block = replace(
        recording.data,
        imu=recording.data.imu if imu else None,
        aids={n: s for n, s in recording.data.aids.items() if n not in absent},
    )
    return replace(recording, instruments=sheets, data=data)
