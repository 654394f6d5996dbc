"""The noise of each reading from a recurrent network, which sees the innovations of the filter.

The network has one memory for each instrument. Its output is the information of the present reading, as a part w of
what the datasheet says: ``R = R_datasheet / w``. It is trained to predict the mean of ``ln(R_datasheet / R_true)``. If
the noise may be one of two, this is their geometric mean, between the mean of the informations, which trusts a reading
that may be wrong, and the mean of the variances, which a rare large fault decides.

It is in the manner of KalmanNet (G. Revach, N. Shlezinger, X. Ni et al., IEEE Trans. Signal Processing 70, 2022), where
a recurrent network replaces the gain, and of A-KIT (N. Cohen and I. Klein, *Adaptive Kalman-informed transformer*,
Engineering Applications of Artificial Intelligence 146, 2025), where a network sets the process noise. Here the filter
stays as it is, the network sets the measurement noise, and it learns from labels. The recipe is
`simnav.estimators.training.noise_network`.
"""

from __future__ import annotations

from functools import partial
from math import asinh, exp, log, log1p, sqrt

import numpy as np

from simnav.compiled import helper, kernel
from simnav.estimators.algebra.direct_update import normalised_square
from simnav.estimators.models.filtering import Prediction, Readings
from simnav.estimators.networks.file import Network, NetworkPiece
from simnav.estimators.networks.groups import GROUPS, group_of
from simnav.estimators.networks.recurrent import advance, fitting, flat
from simnav.kernel_types import Vector
from simnav.structures import filled, length, structure
from simnav.types import Array, Instruments

from .noise import NoiseAdaptation
from .prediction import standardised
from .rules import copied

__all__ = ["MEMORY", "RECIPE", "VERSION", "LearnedNoise", "learned_noise", "set_by_network"]

RECIPE, VERSION = "noise-network", 1
#: The inputs: three standardised components, size of the innovation, certainty of the prediction, time since the last
#: reading, group of the instrument, and the mean size of the innovations of each group.
INPUT = structure(component=3, magnitude=float, certainty=float, elapsed=float, group=GROUPS, usual=GROUPS)
NUMBER_OF_INPUTS = length(INPUT)
#: Group of the instrument, smallest weight, and number of units; behind them are the parameters of the network.
SETTINGS = structure(group=int, least=float, units=int)
#: Time and inputs of the last reading; behind them is the memory of the network.
MEMORY = structure(heard=float, inputs=NUMBER_OF_INPUTS)
#: Of each group: mean size of the innovations, and the time of the last one.
TOGETHER = structure(usual=GROUPS, time=GROUPS)
_WEIGHTS, HIDDEN = length(SETTINGS), length(MEMORY)
#: Time constant of the mean sizes [s], and the size without a fault, ln(1 + 0.82).
_MEMORY, _TYPICAL = 10.0, 0.6
#: Innovations beyond this, in their sigmas, are none of the training.
LARGEST = 1000.0


@helper
def set_by_network(
    settings: Vector, memory: Vector, common: Vector, readings: Readings, k: int, prediction: Prediction
) -> float:
    """Note the inputs of a reading, ask the network, and scale the noise; return w, or 0 if it is not asked."""
    nominal, noise, m = prediction.nominal, prediction.noise, prediction.innovation.size
    own, kept = settings[:_WEIGHTS].view(SETTINGS)[0], memory[:HIDDEN].view(MEMORY)[0]
    groups, time, group = common.view(TOGETHER)[0], readings.time[k], own.group
    copied(nominal, noise)
    u0, u1, u2 = standardised(prediction.innovation, prediction.predicted, nominal)
    square, before = normalised_square(prediction.innovation, prediction.predicted, nominal), 0.0
    for i in range(m):
        before += prediction.predicted[i, i] / nominal[i, i]
    if not (square >= 0.0 and before >= 0.0 and u0 * u0 + u1 * u1 + u2 * u2 < LARGEST * LARGEST):
        return 0.0  # the filter is lost, and its innovations say nothing of the noise
    size = log1p(sqrt(square / m))
    inputs, elapsed = kept.inputs[:].view(INPUT)[0], time - kept.heard
    inputs.component[0], inputs.component[1], inputs.component[2] = asinh(u0), asinh(u1), asinh(u2)
    inputs.magnitude = size
    inputs.certainty = min(max(log(before / m + 1e-12), -10.0), 10.0) / 3.0
    inputs.elapsed = log1p(max(elapsed, 0.0)) if elapsed == elapsed else 0.0
    for g in range(GROUPS):
        inputs.group[g] = 1.0 if g == group else 0.0
        inputs.usual[g] = groups.usual[g]
    kept.heard = time
    last = groups.time[group]
    part = 1.0 - exp(-max(time - last, 0.0) / _MEMORY) if last == last else 0.3
    groups.usual[group] += part * (size - groups.usual[group])
    groups.time[group] = time
    logit = np.empty(1)
    advance(settings[_WEIGHTS:], kept.inputs[:], memory[HIDDEN : HIDDEN + own.units], logit)
    weight: float = max(1.0 / (1.0 + exp(-logit[0])), own.least)
    for i in range(m):
        for j in range(m):
            noise[i, j] /= weight
    return weight


@kernel(passed=True)
def learned_noise(
    settings: Vector, memory: Vector, common: Vector, readings: Readings, k: int, prediction: Prediction
) -> float:
    """The rule of `LearnedNoise`: scale the noise by the network, and report the weight."""
    return set_by_network(settings, memory, common, readings, k, prediction)


class LearnedNoise(NetworkPiece, NoiseAdaptation):
    """The noise of each reading from a recurrent network, which sees the innovations (see the module).

    Instruments of kinds that the network has not learned from keep their nominal noise.

    Parameters
    ----------
    file : str
        Network of the recipe `simnav.estimators.training.noise_network`; empty: the one of ``budget``.
    budget : int
        Budget of training voyages of a network that comes with simnav: 1000 or 20000.
    highest : float
        Bound of the sigma, as a multiple of the datasheet's; the lowest is the datasheet's.

    Raises
    ------
    NetworkError
        If the file cannot be used.
    ValueError
        If the bound is below 1, or no network of this budget comes with simnav.
    """

    rule = learned_noise
    reported = "weight"

    def __init__(self, file: str = "", highest: float = 30.0, budget: int = 1000):
        if not highest >= 1.0:
            raise ValueError(f"highest = {highest:g}: it must be at least 1")
        self.use(self.chosen(file, budget, RECIPE, VERSION, partial(fitting, NUMBER_OF_INPUTS)))
        self.highest = highest

    def use(self, network: Network) -> None:
        """Take a network in place of that of the file."""
        self.network, self._weights = network, flat(network.arrays)
        self._units = len(network.arrays["output_weight"])

    def in_scope(self, kind: str) -> bool:
        """Whether the network has learned from this kind of instrument."""
        return kind in self.network.kinds

    def settings_of(self, per_second: float) -> Array:
        """As `NoiseAdaptation.settings_of`; `reset` fills in the group."""
        return np.concatenate([filled(SETTINGS, least=self.highest**-2, units=self._units), self._weights])

    def begun(self, per_second: float, m: int) -> Array:
        """As `NoiseAdaptation.begun`."""
        return np.concatenate([filled(MEMORY, heard=np.nan), np.zeros(self._units)])

    def begun_together(self) -> Array:
        """As `NoiseAdaptation.begun_together`."""
        return filled(TOGETHER, usual=_TYPICAL, time=np.nan)

    def reset(self, instruments: Instruments) -> None:
        """Begin a run."""
        super().reset(instruments)
        for settings, sheet in zip(self.rule_settings, instruments.values(), strict=True):
            settings[:_WEIGHTS].view(SETTINGS)[0].group = group_of(sheet.kind)
