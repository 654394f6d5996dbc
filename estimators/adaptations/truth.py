"""The adaptations of the oracles: the knowledge of each oracle about the noise and the faults of a measurement.

The oracles know the statistics of a fault, not its values:

- A noise step changes the sigma, which is known.
- Multipath, a bias step and a ramp are lasting errors. They are states (`simnav.estimators.models.fault_states`): if a
  time-correlated error is modelled as white noise, the covariance becomes too small.
- A gross error is noise with the second moment of its distribution. If that is more than `LIMIT` sigma, the measurement
  is rejected.
- A frozen or false value contains no information and is rejected.
- An error by a reflection of obstacles or the sea is subtracted: the oracles know the map. If another fault has touched
  the measurement, too, its error is not known by itself, and the next rule holds.

If a recording does not hold the size of its faults, or a fault of a third party has another effect, the true added
error is used.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from simnav.estimators.models.channels import of_channels, whole
from simnav.estimators.models.declared_errors import error_of_fault
from simnav.estimators.models.fault_states import FaultState
from simnav.labels import REFLECTION, FaultLabel
from simnav.recording import AidStream, Recording
from simnav.sensors.faults import FAULTS, effect_of, size_by_component, size_range
from simnav.types import KINDS, Array, Instruments, Measurement

from .base import Adaptation, Innovation

__all__ = ["FaultTimes", "FisherNoise", "MixtureNoise", "NominalNoise", "TrueNoise", "fisher_information", "imu_faults"]

#: A component with a fault of more than this many sigma is rejected.
LIMIT = 3.0
#: Without knowledge of the labels, a measurement has a gross error if its probability is above this.
CERTAIN = 0.95
#: Points of the integral for the Fisher information, as a power of two.
_POINTS = 14
#: Faults with these effects are states (`simnav.sensors.faults.Effect`).
LASTING = ("lasting", "growing")


class _TrueError(NamedTuple):
    """What is known of the error of a measurement.

    Attributes
    ----------
    noise : (d, d) array
        Covariance with the true sigma.
    faults : list of int
        The faults that are neither steps of the noise nor states.
    stream : AidStream
        The instrument's measurements.
    place : int
        Index of the measurement in it.
    """

    noise: Array
    faults: list[int]
    stream: AidStream
    place: int


class TrueNoise(Adaptation):
    """The oracle O1: it knows the true sigma of each measurement, and the faults that affect it."""

    reads_truth = True

    def __init__(self) -> None:
        self.faults: tuple[FaultLabel, ...] = ()
        self._streams: dict[str, tuple[AidStream, Array]] = {}
        self._states: dict[str, int] = {}
        self._affected: list[list[str]] = []
        self._reflections = 0

    def reveal(self, recording: Recording) -> None:
        """Receive the labels of a recording."""
        parts = [part for stream in recording.data.aids.values() for part in of_channels(stream)]
        self._streams = {part.name: (part, np.asarray(part.time)) for part in parts}
        self.faults = recording.faults
        self._reflections = sum(1 << j for j, fault in enumerate(self.faults) if fault.kind == REFLECTION)
        self._affected = [_sources(fault, recording) for fault in self.faults]

    def reset(self, instruments: Instruments) -> None:
        """Begin a run."""
        self._sheets = instruments
        self._variances: dict[tuple[int, str], Array | None] = {}

    def states(self) -> list[FaultState]:
        """The lasting faults as states of the model. They no longer count as noise."""
        self._states = dict.fromkeys(self._streams, 0)
        found: dict[tuple[Any, ...], tuple[FaultState, int]] = {}
        for j, fault in enumerate(self.faults):
            for name in self._affected[j]:
                if effect_of(fault.kind) not in LASTING or name not in self._streams:
                    continue
                growing = effect_of(fault.kind) == "growing"
                size = _size(fault, self._streams[name][0])
                if size is None or (growing and "mean_active" in fault.parameters):
                    continue
                # The intervals of one fault are one process; a ramp starts from zero in each.
                key = (name, fault.kind, repr(fault.parameters), fault.start if growing else 0.0)
                mask = 1 << j | (found[key][1] if key in found else 0)
                factor: Callable[[float], float] = partial(self._factor, name, mask, fault.start if growing else None)
                time = float(fault.parameters.get("correlation_time", np.inf))
                block = error_of_fault(self._streams[name][0].kind, size, time)
                found[key] = FaultState(name, block, factor), mask
                self._states[name] |= mask
        return [state for state, _ in found.values()]

    def _factor(self, source: str, mask: int, start: float | None, time: float) -> float:
        stream, k = self._label(source, time)
        if not int(stream.faults[k]) & mask:
            return 0.0
        return 1.0 if start is None else max(time - start, 0.0)

    def corrected(self, measurement: Measurement) -> Measurement:
        """A measurement without the error by a reflection, if that is the only one."""
        if not self._reflections or measurement.source not in self._streams:
            return measurement
        stream, k = self._label(measurement.source, measurement.time)
        return _without_error(measurement, stream, k) if self._bits(stream, k) != stream.faults[k] else measurement

    def _bits(self, stream: AidStream, k: int) -> int:
        """The faults of a measurement, without a reflection that is subtracted."""
        bits = int(stream.faults[k])
        return bits if bits & ~self._reflections else 0

    def _label(self, source: str, time: float) -> tuple[AidStream, int]:
        """The stream of an instrument or a channel, and the index of its measurement at a time."""
        stream, times = self._streams[source]
        return stream, min(int(np.searchsorted(times, time - 1e-9)), len(times) - 1)

    def _white(self, innovation: Innovation) -> _TrueError:
        """What is known of the error of a measurement."""
        m = innovation.measurement
        stream, k = self._label(m.source, m.time)
        d = len(innovation.residual)
        sheet, of_reading = self._sheets[m.source], KINDS[m.kind].reading_sigma
        nominal = sheet.sigma if of_reading is None else np.asarray(of_reading(m.side, whole(sheet)))
        noise = innovation.noise + np.diag(stream.sigma[k, :d] ** 2 - nominal[:d] ** 2)
        bits = self._bits(stream, k) & ~self._states.get(m.source, 0)
        faults = (
            [j for j, f in enumerate(self.faults) if bits >> j & 1 and effect_of(f.kind) != "noise"] if bits else []
        )
        return _TrueError(noise, faults, stream, k)

    def _variance(self, j: int, stream: AidStream, k: int, d: int) -> Array | None:
        """The variance that fault j adds to a measurement; None if the measurement must be rejected."""
        fault, key = self.faults[j], (j, stream.name)
        if key not in self._variances:
            variance = None
            if effect_of(fault.kind) == "gross" and fault.parameters:
                variance = _second_moment(fault, stream)
            self._variances[key] = variance
        effect = effect_of(fault.kind)
        if effect == "other" or (not fault.parameters and effect != "replaced"):
            return np.asarray(stream.fault_error[k, :d] ** 2)
        variance = self._variances[key]
        return None if variance is None else variance[:d]

    def adapt(self, innovation: Innovation) -> Array | None:
        """The true noise, or None."""
        noise, faults, stream, k = self._white(innovation)
        d = len(noise)
        for j in faults:
            variance = self._variance(j, stream, k, d)
            if variance is None or np.all(variance > LIMIT**2 * np.maximum(np.diag(noise), 1e-24)):
                return None
            noise = noise + np.diag(variance)
        return noise


class FaultTimes(TrueNoise):
    """The oracle that knows when a fault touches a measurement, and nothing of its size: it uses none of them.

    What the best detection and exclusion of faults could reach. A wrong measurement has information for those only who
    know how wrong it may be.
    """

    def states(self) -> list[FaultState]:
        """An empty list, because no size is known."""
        return []

    def adapt(self, innovation: Innovation) -> Array | None:
        """The true noise of a measurement without a fault; None with one."""
        m = innovation.measurement
        stream, k = self._label(m.source, m.time)
        return None if self._bits(stream, k) else self._white(innovation).noise


class NominalNoise(TrueNoise):
    """The oracle O0: the errors of the faults are subtracted, and the sigma is that without faults."""

    def states(self) -> list[FaultState]:
        """An empty list, because the faults are subtracted."""
        return []

    def restore(self, measurement: Measurement) -> Measurement:
        """A measurement without the error that the faults added."""
        stream, k = self._label(measurement.source, measurement.time)
        return _without_error(measurement, stream, k) if stream.faults[k] else measurement

    def adapt(self, innovation: Innovation) -> Array | None:
        """The noise without faults."""
        m = innovation.measurement
        stream, k = self._label(m.source, m.time)
        steps = sum(1 << j for j, f in enumerate(self.faults) if effect_of(f.kind) == "noise")
        return innovation.noise if int(stream.faults[k]) & steps else self._white(innovation).noise


class MixtureNoise(TrueNoise):
    """The oracle O3: it knows the rate and size of gross errors, but not which measurements have them.

    Each measurement may have any of the gross errors that are active at its time. The hypotheses j have the noise R_j
    and, by Bayes' rule with the innovation, the probability w_j. The noise is ``R^-1 = sum w_j R_j^-1``, from the
    expected information. Faults with a fixed schedule (noise steps, multipath, frozen values, ...) are known as in O1.

    Source: C. J. Masreliez, "Approximate non-Gaussian filtering with linear state and observation relations", IEEE
    Trans. Automatic Control 20(1), 1975, for the weights; the collapse into one noise is ours.
    """

    def adapt(self, innovation: Innovation) -> Array | None:
        """The expected noise; None if a gross error that leaves no information is almost certain."""
        mixture = self.mixture(innovation)
        if mixture is None or len(mixture) == 1:
            return None if mixture is None else mixture[0][1]
        logs, r = [], innovation.residual
        for probability, noise in mixture:
            s = innovation.predicted + noise
            logs.append(np.log(probability) - 0.5 * (np.linalg.slogdet(s)[1] + r @ np.linalg.solve(s, r)))
        weights = np.exp(np.array(logs) - max(logs))
        weights /= weights.sum()
        if weights[0] < 1.0 - CERTAIN and np.all(
            np.diag(mixture[1][1] - mixture[0][1]) > LIMIT**2 * np.diag(mixture[0][1])
        ):
            return None
        information = sum(w * np.linalg.inv(noise) for w, (_, noise) in zip(weights, mixture, strict=True))
        return np.asarray(np.linalg.inv(information))

    def mixture(self, innovation: Innovation) -> list[tuple[float, Array]] | None:
        """Probability and noise of each hypothesis, "no gross error" first; None if there is no information."""
        noise, faults, stream, k = self._white(innovation)
        d = len(noise)
        for j in faults:
            if effect_of(self.faults[j].kind) != "gross" or not self.faults[j].parameters:
                variance = self._variance(j, stream, k, d)
                if variance is None:
                    return None
                noise = noise + np.diag(variance)
        t = innovation.measurement.time
        about = [
            (float(f.parameters["probability"]), self._variance(j, stream, k, d))
            for j, f in enumerate(self.faults)
            if effect_of(f.kind) == "gross" and "probability" in f.parameters and stream.name in self._affected[j]
            if f.start - 1e-6 <= t < f.end - 1e-6
        ]
        about = [(p, v) for p, v in about if p > 0.0 and v is not None]
        hypotheses = []
        for hits in product((False, True), repeat=len(about)):
            probability, spread = 1.0, noise
            for hit, (p, v) in zip(hits, about, strict=True):
                probability *= p if hit else 1.0 - p
                if hit:
                    spread = spread + np.diag(v)  # type: ignore[arg-type]
            if probability > 0.0:
                hypotheses.append((probability, spread))
        return hypotheses


class FisherNoise(MixtureNoise):
    """Noise from the Fisher information of each measurement's density: a bound without knowledge of the labels."""

    def reset(self, instruments: Instruments) -> None:
        """Begin a run."""
        super().reset(instruments)
        self._known: dict[bytes, Array] = {}

    def adapt(self, innovation: Innovation) -> Array | None:
        """The inverse of the Fisher information; None if it is zero."""
        mixture = self.mixture(innovation)
        if mixture is None or len(mixture) == 1:
            return None if mixture is None else mixture[0][1]
        variances = np.array([np.diag(noise) for _, noise in mixture])
        # In units of the first hypothesis' sigmas the information hardly changes from one measurement to the next.
        ratio = np.round(np.log(variances / variances[0]), 2)
        key = ratio.tobytes()
        if key not in self._known:
            self._known[key] = fisher_information(np.array([p for p, _ in mixture]), np.exp(ratio))
        gain = 1.0 / np.sqrt(self._known[key])
        return np.asarray(mixture[0][1] * np.outer(gain, gain))


def fisher_information(probability: Array, variance: Array) -> Array:
    """Diagonal of the Fisher information of location of a mixture of zero-mean normal densities.

    For the density p(x) it is ``J_ii = integral of (d p / d x_i)^2 / p``; other elements are zero by symmetry. Under
    one hypothesis the components are independent. The integral is a mean over quasi-random points, accurate to 0.5 %.

    Parameters
    ----------
    probability : (c,) array
        Probabilities of the components of the mixture.
    variance : (c, d) array
        Variance of each of d measurement components under each hypothesis.

    Returns
    -------
    (d,) array
        The diagonal of the Fisher information.

    Examples
    --------
    >>> fisher_information(np.array([1.0]), np.array([[4.0]])).round(3)
    array([0.25])
    """
    from scipy.special import ndtri
    from scipy.stats.qmc import Sobol

    d = variance.shape[1]
    points = ndtri(np.clip(Sobol(d, seed=0).random_base2(_POINTS), 1e-9, 1.0 - 1e-9))
    information = np.zeros(d)
    for p, v in zip(probability, variance, strict=True):
        at = points * np.sqrt(v)
        logs = np.log(probability) - 0.5 * (np.log(variance).sum(axis=1) + at**2 @ (1.0 / variance).T)
        share = np.exp(logs - logs.max(axis=1, keepdims=True))
        share /= share.sum(axis=1, keepdims=True)
        score = at * (share @ (1.0 / variance))
        information += p * np.mean(score**2, axis=0)
    return information


def _sources(fault: FaultLabel, recording: Recording) -> list[str]:
    """The instruments and channels that a fault affects (`simnav.types.Measurement.source`)."""
    found = []
    for name in fault.instruments:
        stream = recording.data.aids.get(name)
        of_fault = [c for c in stream.channels if not fault.channels or c in fault.channels] if stream else []
        found += [f"{name}:{channel}" for channel in of_fault] if stream and stream.channels else [name]
    return found


def _without_error(measurement: Measurement, stream: AidStream, k: int) -> Measurement:
    """A measurement without all that was added to it."""
    value = KINDS[stream.kind].add_error(measurement.value[None], -stream.fault_error[k : k + 1])[0]
    return measurement._replace(value=value)


def _size(fault: FaultLabel, stream: AidStream) -> Array | None:
    """The size of a fault for each component of an instrument; None if the label does not hold it."""
    cls = FAULTS.get(fault.kind)
    if cls is None or not cls.stems:
        return None
    return size_by_component(fault.parameters, cls.stems[0], stream.kind)


def _second_moment(fault: FaultLabel, stream: AidStream) -> Array | None:
    """Variance of a gross error, by component."""
    if fault.parameters.get("distribution") == "uniform":
        low, high = size_range(fault.parameters, "size", stream.kind)
        return (low * low + low * high + high * high) / 3.0
    size = _size(fault, stream)
    return None if size is None else size**2


def imu_faults(recording: Recording) -> tuple[Array, Array] | None:
    """Times and (n, 6) fault errors of the IMU samples; None if no fault affects the IMU."""
    data = recording.data
    if data.imu is None or data.imu_labels is None:
        return None
    return data.imu.time, data.imu_labels.fault_error
