"""Recordings cut into windows of equal length: NumPy arrays of equal shapes, for batches to learn from."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from simnav.environment.observed_steps import pack
from simnav.environment.sample_counts import Places, places_of
from simnav.recording import Block
from simnav.types import NavigationStates

if TYPE_CHECKING:
    from simnav.recording import Recording
    from simnav.scenario import Scenario

__all__ = ["windows"]

#: Arrays whose first axis is the window, by name; those of an instrument in a mapping of their own.
Windows: TypeAlias = dict[str, Any]

#: Entries beside those of the instruments.
_OTHERS = ("seed", "truth")
_IMU_VALUES = 3
_IMU_ERRORS = 6


def windows(
    recordings: Iterable[Recording],
    scenario: Scenario | str,
    length: float,
    *,
    stride: float | None = None,
    batch: int | None = None,
) -> Iterator[Windows]:
    """Cut recordings into windows.

    Parameters
    ----------
    recordings : iterable of Recording
        Runs of the scenario.
    scenario : Scenario or str
        The scenario, or its name. It decides the shapes: they hold what any of its runs can bring.
    length : float
        Length of a window [s], a multiple of the step.
    stride : float, optional
        From the begin of a window to that of the next one [s], a multiple of the step and at most ``length``.
        Default: ``length``.
    batch : int, optional
        Number of windows of a batch; only the last one may have fewer. Default: all of a recording.

    Yields
    ------
    dict
        B windows of s steps. Of an instrument K is the largest number of samples; entries are zero where ``valid`` is.

        - ``seed`` (B,): seed of the run.
        - ``interval`` (B, 2): begin and end of the window [s].
        - ``imu`` and each aiding instrument: a dictionary as in an observation of
          `simnav.environment.navigation.NavigationEnv`, with a further first axis: ``time`` (B, K), ``valid`` (B, K),
          ``angular_rate`` (B, K, 3) or ``value`` (B, K, d) and so on. With labels: ``faults`` (B, K) and
          ``fault_error`` (B, K, 6) or (B, K, d); of an aiding instrument also ``sigma`` (B, K, d). An instrument that
          a run does not have is not valid.
        - ``truth`` (B, s + 1, 3, 3): position, velocity and attitude at the begin of the window and at the ends of its
          steps; only of recordings with a truth.

    Raises
    ------
    ValueError
        If the length, the stride or the size of a batch is not possible; one sentence.

    Examples
    --------
    >>> from itertools import islice
    >>> import simnav
    >>> two = islice(simnav.voyages("training-ships"), 2)
    >>> first = next(windows(two, "training-ships", length=30.0, batch=16))
    >>> first["gyrocompass"]["value"].shape, first["truth"].shape
    ((16, 150, 1), (16, 31, 3, 3))
    """
    if isinstance(scenario, str):
        from simnav.scenario import load

        scenario = load(scenario)
    steps = _steps("length", length, scenario, scenario.epochs)
    apart = steps if stride is None else _steps("stride", stride, scenario, steps)
    if batch is not None and batch < 1:
        raise ValueError(f"batch = {batch!r}: a batch has at least 1 window")
    places = places_of([s.model_copy(update={"step": float(length)}) for s in scenario.extremes()])
    if clash := set(_OTHERS) & set(places.most):
        raise ValueError(f"scenario {scenario.id}: {clash.pop()!r} is no name for an aiding instrument")
    parts = (_cut(recording, places, steps, apart) for recording in recordings)
    return parts if batch is None else _batches(parts, batch)


def _steps(name: str, seconds: float, scenario: Scenario, most: int) -> int:
    """A time as a number of steps, from 1 to the most that is possible."""
    count = seconds / scenario.step
    if not (math.isfinite(count) and 1 <= round(count) <= most and abs(count - round(count)) < 1e-6):
        raise ValueError(
            f"{name} = {seconds!r}: a multiple of the step of {scenario.id} is wanted, from {scenario.step:g} to "
            f"{most * scenario.step:g} s"
        )
    return round(count)


def _cut(recording: Recording, places: Places, steps: int, apart: int) -> Windows:
    """All windows of a recording."""
    first, truth = recording.initial_truth, recording.data.truth
    names = ("time", "position", "velocity", "attitude")
    states = NavigationStates(*(np.concatenate([getattr(first, n), getattr(truth, n)]) for n in names))
    begins = np.arange(0, len(truth) - steps + 1, apart)
    told = bool(np.isfinite(truth.position).all(axis=1).any())
    block = _with_labels(recording.data) if told else recording.data
    rounds = -(-steps // apart)  # windows of one round do not overlap
    parts, order = [], []
    for k in range(rounds):
        own = begins[k::rounds]
        edges = np.stack([own, own + steps], axis=1).ravel()
        ends = NavigationStates(*(getattr(states, n)[edges] for n in names))
        packed = pack(replace(block, truth=ends), 0.0, places.most)
        parts.append({name: {key: a[1::2] for key, a in entry.items()} for name, entry in packed.columns.items()})
        order.append(own)
    rows = np.argsort(np.concatenate(order), kind="stable")
    found: Windows = {
        "seed": np.full(len(begins), recording.seed, np.int64),
        "interval": np.stack([states.time[begins], states.time[begins + steps]], axis=1),
    }
    for name in places.most:
        there = name in parts[0]
        entry = {key: np.concatenate([p[name][key] for p in parts])[rows] for key in parts[0][name]} if there else {}
        found[name] = _entry(name, entry, places, len(begins), told)
    if told:
        within = begins[:, None] + np.arange(steps + 1)
        found["truth"] = np.stack([getattr(states, n)[within] for n in names[1:]], axis=2)
    return found


def _with_labels(block: Block) -> Block:
    """The block with the labels of each sample behind its values, so that they are sorted together."""
    aids = {
        name: replace(s, value=np.hstack([s.value, s.fault_error, s.sigma, s.faults[:, None]]))
        for name, s in block.aids.items()
    }
    imu, labels = block.imu, block.imu_labels
    if imu is not None:
        more = np.zeros((len(imu), _IMU_ERRORS + 1))
        if labels is not None:
            more = np.hstack([labels.fault_error, labels.faults[:, None]])
        imu = replace(imu, specific_force=np.hstack([imu.specific_force, more]))
    return replace(block, imu=imu, aids=aids)


def _entry(name: str, entry: Mapping[str, NDArray[Any]], places: Places, n: int, told: bool) -> Windows:
    """The arrays of an instrument, zero if the run does not have it; labels that stand behind its values apart."""
    k, is_imu = places.most[name], name == "imu"
    values, width = ("specific_force", _IMU_VALUES) if is_imu else ("value", places.widths[name])
    errors = [("fault_error", _IMU_ERRORS)] if is_imu else [("fault_error", width), ("sigma", width)]
    labels = [*errors, ("faults", 1)] if told else []
    found = dict(entry)
    if not found:
        found = {"time": np.zeros((n, k)), "valid": np.zeros((n, k), np.int8)}
        if is_imu:
            found |= {"length": np.zeros((n, k)), "angular_rate": np.zeros((n, k, _IMU_VALUES))}
        elif places.sides.get(name):
            found["side"] = np.zeros((n, k, places.sides[name]))
        found[values] = np.zeros((n, k, width + sum(w for _, w in labels)))
    joined, end = found[values], width
    found[values] = joined[..., :width]
    for label, w in labels:
        found[label] = joined[..., end : end + w]
        end += w
    if told:
        found["faults"] = found["faults"][..., 0].astype(np.uint32)
    return found


def _batches(parts: Iterable[Windows], size: int) -> Iterator[Windows]:
    """The same windows in batches of a size; the last may be smaller."""
    kept: list[Windows] = []
    count = 0
    for part in parts:
        kept.append(part)
        count += len(part["seed"])
        if count >= size:
            joined, whole = _joined(kept), count - count % size
            yield from (_rows(joined, slice(k, k + size)) for k in range(0, whole, size))
            kept, count = [_rows(joined, slice(whole, None))], count - whole
    if count:
        yield _joined(kept)


def _joined(parts: list[Windows]) -> Windows:
    return {
        name: _joined([p[name] for p in parts]) if isinstance(a, dict) else np.concatenate([p[name] for p in parts])
        for name, a in parts[0].items()
    }


def _rows(found: Windows, rows: slice) -> Windows:
    return {name: _rows(a, rows) if isinstance(a, dict) else a[rows] for name, a in found.items()}
