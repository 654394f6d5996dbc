"""GNSS noise from a neuro-fuzzy network (ANFIS): a reconstruction of Jiang et al. (2026).

Section 3 of the paper, which defines the ANFIS, is missing from the text at hand. The paper says elsewhere that it is a
five-layer first-order network, that its inputs are features of the present motion of the ship, and that its output is
the covariance of GNSS. The reconstruction follows Jang 1993 (`simnav.estimators.adaptations.sugeno`,
`simnav.estimators.training.hybrid_learning`): three inputs with three Gaussian memberships each, 27 rules. The output
is the logarithm of the variance divided by that of the datasheet. The training data are described in
`simnav.estimators.training.anfis_training`; `simnav paper train-anfis` repeats the training.
"""

from __future__ import annotations

from math import exp, log1p, sqrt
from pathlib import Path
from typing import Any, Literal

import numpy as np

from simnav.estimators.models.equations import equation_of_kind
from simnav.estimators.models.measurements import wrap
from simnav.kinds import BODY_VELOCITY, HEADING, WATER_SPEED
from simnav.types import Array, Instruments

from .anfis_file import FEATURES, FeatureSet, Parameters, shipped
from .anfis_level import Level
from .base import Innovation
from .noise import NoiseAdaptation

__all__ = ["Anfis", "Features", "Motion"]


class Motion:
    """Speed, turn rate and change of speed, from the predicted readings of compass and log.

    The prediction of a reading is the measurement minus the innovation. In it the filter has smoothed the noise of the
    instrument. The rates are its differences, filtered by a first-order low-pass filter. They are known before the fix
    for which they are used. The first compass and the first log (or DVL) of the run are used.

    Parameters
    ----------
    instruments : Instruments
        Datasheets of the run's instruments.

    Attributes
    ----------
    speed, turn_rate, change_of_speed : float
        Absolute values [m/s], [rad/s], [m/s^2]; NaN without such an instrument, or before its first measurements.
    """

    SMOOTHING = 5.0  # s; time constant of the low-pass filter

    def __init__(self, instruments: Instruments):
        headings, speeds = instruments.of_equation(HEADING), instruments.of_equation(WATER_SPEED, BODY_VELOCITY)
        self._heading = headings[0].name if headings else None
        self._speed = speeds[0].name if speeds else None
        self._last: dict[str, tuple[float, float]] = {}
        self._rates: dict[str, float] = {}

    def observe(self, innovation: Innovation) -> None:
        """Update the motion from an innovation of any instrument."""
        m = innovation.measurement
        if m.instrument not in (self._heading, self._speed):
            return
        expected = float(m.value[0]) - float(innovation.residual[0])
        before = self._last.get(m.instrument)
        self._last[m.instrument] = m.time, expected
        if before is None or m.time <= before[0]:
            return
        elapsed, change = m.time - before[0], expected - before[1]
        rate = (wrap(change) if m.instrument == self._heading else change) / elapsed
        smoothed = self._rates.get(m.instrument, 0.0)
        self._rates[m.instrument] = smoothed + (1.0 - exp(-elapsed / self.SMOOTHING)) * (rate - smoothed)

    @property
    def speed(self) -> float:
        return abs(self._last[self._speed][1]) if self._speed in self._last else np.nan

    @property
    def turn_rate(self) -> float:
        return abs(self._rates.get(self._heading or "", np.nan))

    @property
    def change_of_speed(self) -> float:
        return abs(self._rates.get(self._speed or "", np.nan))


class Features:
    """The inputs of the network, at each fix.

    - ``innovation``: ``ln(1 + sqrt(v' S^-1 v / m))`` of the innovation v of the fix with m components; S is its
      covariance with the datasheet's noise. The logarithm is used because most innovations to be distinguished are
      between 1 and 5 sigma, while gross errors reach 30.
    - ``recent_innovations``: the fading mean of ``innovation``, including the present one.
    - ``speed``, ``turn_rate``, ``change_of_speed``: from `Motion`.

    Parameters
    ----------
    features : str
        Name of the set of inputs, a key of `FEATURES`.
    instruments : Instruments
        Datasheets of the run's instruments.
    """

    MEMORY = 10.0  # s; time constant of the fading mean

    def __init__(self, features: str, instruments: Instruments):
        self._names = FEATURES[features]
        self._motion = Motion(instruments)
        self._recent: dict[str, tuple[float, float]] = {}

    def observe(self, innovation: Innovation) -> list[float] | None:
        """Update from an innovation; return the n inputs for a GNSS fix, or None for other measurements."""
        m = innovation.measurement
        if not equation_of_kind(m.kind).has_height:
            self._motion.observe(innovation)
            return None
        now = _whitened(innovation)
        before, mean = self._recent.get(m.instrument, (m.time, now))
        mean += (1.0 - exp(-max(m.time - before, 0.0) / self.MEMORY)) * (now - mean)
        self._recent[m.instrument] = m.time, mean
        known = {"innovation": now, "recent_innovations": mean}
        return [known[n] if n in known else getattr(self._motion, n) for n in self._names]


class Anfis(NoiseAdaptation):
    """Scales the noise of GNSS fixes by the network (reconstruction of Jiang et al. 2026).

    Inputs beyond the range of the training data are clipped to it. An unknown input (no compass, no log) is replaced by
    the median of the training data. All components of a fix have the same factor. Other instruments keep their nominal
    noise.

    Parameters
    ----------
    features : "innovation", "motion" or "recent"
        The set of inputs: innovation and motion; motion only; or innovation and earlier innovations.
    file : str
        Parameter file of `simnav paper train-anfis`; empty: the file that comes with simnav.
    lowest, highest : float
        Bounds of the sigma, as multiples of the datasheet's sigma (of the learned one with ``level="learned"``).
    level : "learned" or "datasheet"
        What the inputs and the output are relative to: the noise that the last innovations have, which is the
        datasheet's until they contradict it (`simnav.estimators.adaptations.anfis_level`); or always the datasheet's
        noise, as in the training.

    Raises
    ------
    ValueError
        If the bounds are not 0 < lowest <= highest, or the file cannot be used or holds other features.
    """

    def __init__(
        self,
        features: FeatureSet = "innovation",
        file: str = "",
        lowest: float = 1.0,
        highest: float = 30.0,
        level: Literal["datasheet", "learned"] = "learned",
    ):
        if level not in ("datasheet", "learned"):
            raise ValueError(f"level is {level!r}; it must be 'datasheet' or 'learned'")
        if not 0.0 < lowest <= highest:
            raise ValueError(f"lowest = {lowest:g} and highest = {highest:g}: it must be 0 < lowest <= highest")
        path = Path(file).expanduser() if file else shipped(features)
        self.parameters = Parameters.load(path)
        if self.parameters.features != features:
            raise ValueError(f"{path}: features should be {features!r}, not {self.parameters.features!r}")
        self.features, self.lowest, self.highest, self.level = features, lowest, highest, level

    @property
    def trained_on(self) -> dict[str, Any]:
        """The record of the training."""
        return self.parameters.record

    def reset(self, instruments: Instruments) -> None:
        """Begin a run. The network was trained with a model that does not use the IMU."""
        super().reset(Instruments(list(instruments.values()), None, instruments.step))
        self._inputs = Features(self.features, instruments)
        self._seen: list[float] | None = None
        self._levels: dict[str, Level] = {}

    def adapt(self, innovation: Innovation) -> Array | None:
        """The noise to use; also updates the motion from compass and log."""
        if self.level == "datasheet" or not equation_of_kind(innovation.measurement.kind).has_height:
            self._seen = self._inputs.observe(innovation)
            return super().adapt(innovation)
        level = self._levels.setdefault(innovation.measurement.instrument, Level())
        relative = innovation._replace(noise=innovation.noise * level.value)
        level.observe(innovation)
        self._seen = self._inputs.observe(relative)
        return super().adapt(relative)

    def choose(self, innovation: Innovation) -> Array:
        """The noise scaled by the network, for a fix; the nominal noise for anything else."""
        if self._seen is None:
            return innovation.noise
        factor = exp(self.parameters.log_factor_of(self._seen))
        return innovation.noise * min(max(factor, self.lowest**2), self.highest**2)


def _whitened(innovation: Innovation) -> float:
    v = innovation.residual
    nis = float(v @ np.linalg.solve(innovation.predicted + innovation.noise, v))
    return log1p(sqrt(max(nis, 0.0) / len(v)))
