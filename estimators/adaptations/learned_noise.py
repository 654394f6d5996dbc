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
from pathlib import Path

import numpy as np

from simnav.compiled import kernel
from simnav.estimators.algebra.direct_update import normalised_square
from simnav.estimators.models.filtering import Prediction
from simnav.estimators.networks.file import Network
from simnav.estimators.networks.recurrent import advance, fitting, flat
from simnav.kernel_types import Vector
from simnav.types import KINDS, Array, Instruments

from .noise import NoiseAdaptation
from .prediction import standardised
from .rules import OWN, TIME, copied

__all__ = ["INPUTS", "NOTED", "RECIPE", "VERSION", "LearnedNoise", "learned_noise", "set_by_network", "shipped"]

RECIPE, VERSION = "noise-network", 1
#: Groups of instruments, by role. The network sees how large the innovations of each group are.
_GROUPS = {"fix": 0, "velocity": 1, "heading": 2}
GROUPS = 4
#: The inputs: three standardised components, size of the innovation, certainty of the prediction, time since the last
#: reading, group of the instrument, and the mean size of the innovations of each group.
NUMBER_OF_INPUTS = 6 + 2 * GROUPS
#: Names of the inputs, in order.
INPUTS = (
    "component_0", "component_1", "component_2", "size", "certainty", "elapsed", "is_fix", "is_velocity", "is_heading",
    "is_other", "mean_of_fixes", "mean_of_velocities", "mean_of_headings", "mean_of_others",
)  # fmt: skip
#: Places in the settings: group, smallest weight, number of units, then the parameters of the network.
GROUP, LEAST, UNITS, WEIGHTS = range(4)
#: Places in the memory: time of the last reading, the inputs of the last reading, then the memory of the network.
HEARD, NOTED = range(2)
HIDDEN = NOTED + NUMBER_OF_INPUTS
#: Time constant of the mean sizes [s], and the size without a fault, ln(1 + 0.82).
_MEMORY, _TYPICAL = 10.0, 0.6
#: Innovations beyond this, in their sigmas, are none of the training.
LARGEST = 1000.0


@kernel
def set_by_network(settings: Vector, memory: Vector, shared: Vector, prediction: Prediction) -> float:
    """Note the inputs of a reading, ask the network, and scale the noise; return w, or 0 if it is not asked."""
    nominal, noise, m = prediction.nominal, prediction.noise, prediction.innovation.size
    time, group, units = shared[TIME], int(settings[GROUP]), int(settings[UNITS])
    copied(nominal, noise)
    u0, u1, u2 = standardised(prediction.innovation, prediction.predicted, nominal)
    square, before = normalised_square(prediction.innovation, prediction.predicted, nominal), 0.0
    for i in range(m):
        before += prediction.predicted[i, i] / nominal[i, i]
    if not (square >= 0.0 and before >= 0.0 and u0 * u0 + u1 * u1 + u2 * u2 < LARGEST * LARGEST):
        return 0.0  # the filter is lost, and its innovations say nothing of the noise
    size = log1p(sqrt(square / m))
    inputs = memory[NOTED : NOTED + NUMBER_OF_INPUTS]
    elapsed = time - memory[HEARD]
    inputs[0], inputs[1], inputs[2], inputs[3] = asinh(u0), asinh(u1), asinh(u2), size
    inputs[4] = min(max(log(before / m + 1e-12), -10.0), 10.0) / 3.0
    inputs[5] = log1p(max(elapsed, 0.0)) if elapsed == elapsed else 0.0
    for g in range(GROUPS):
        inputs[6 + g] = 1.0 if g == group else 0.0
        inputs[6 + GROUPS + g] = shared[OWN + 2 * g]
    memory[HEARD] = time
    own = shared[OWN + 2 * group + 1]
    part = 1.0 - exp(-max(time - own, 0.0) / _MEMORY) if own == own else 0.3
    shared[OWN + 2 * group] += part * (size - shared[OWN + 2 * group])
    shared[OWN + 2 * group + 1] = time
    output = advance(settings[WEIGHTS:], inputs, memory[HIDDEN : HIDDEN + units])
    weight: float = max(1.0 / (1.0 + exp(-output)), settings[LEAST])
    for i in range(m):
        for j in range(m):
            noise[i, j] /= weight
    return weight


@kernel(passed=True)
def learned_noise(settings: Vector, memory: Vector, shared: Vector, prediction: Prediction) -> float:
    """The rule of `LearnedNoise`: scale the noise by the network, and report the weight."""
    return set_by_network(settings, memory, shared, prediction)


def shipped() -> Path:
    """The network that comes with simnav."""
    return Path(__file__).parents[1] / "networks" / "noise_network.npz"


class LearnedNoise(NoiseAdaptation):
    """The noise of each reading from a recurrent network, which sees the innovations (see the module).

    Instruments of kinds that the network has not learned from keep their nominal noise.

    Parameters
    ----------
    file : str
        Network of the recipe `simnav.estimators.training.noise_network`; empty: the one that comes with simnav.
    highest : float
        Bound of the sigma, as a multiple of the datasheet's; the lowest is the datasheet's.

    Raises
    ------
    NetworkError
        If the file cannot be used.
    ValueError
        If the bound is below 1.
    """

    rule = learned_noise
    reported = "weight"

    def __init__(self, file: str = "", highest: float = 30.0):
        if not highest >= 1.0:
            raise ValueError(f"highest = {highest:g}: it must be at least 1")
        path = Path(file).expanduser() if file else shipped()
        self.use(Network.load(path, RECIPE, VERSION, partial(fitting, NUMBER_OF_INPUTS)))
        self.highest = highest

    def use(self, network: Network) -> None:
        """Take a network in place of that of the file."""
        self.network, self._weights = network, flat(network.arrays)
        self._units = len(network.arrays["output_weight"])

    def in_scope(self, kind: str) -> bool:
        """Whether the network has learned from this kind of instrument."""
        return kind in self.network.kinds

    def settings_of(self, longer: float) -> list[float]:
        """As `NoiseAdaptation.settings_of`; `reset` fills in the group."""
        return [0.0, self.highest**-2, float(self._units), *self._weights.tolist()]

    def begun(self, longer: float, m: int) -> Array:
        """As `NoiseAdaptation.begun`."""
        memory = np.zeros(HIDDEN + self._units)
        memory[HEARD] = np.nan
        return memory

    def reset(self, instruments: Instruments) -> None:
        """Begin a run."""
        super().reset(instruments)
        roles = [KINDS[sheet.kind].role for sheet in instruments.values()]
        self.rule_settings[:, GROUP] = [_GROUPS.get(role, GROUPS - 1) for role in roles]
        self.rule_shared = np.full(OWN + 2 * GROUPS, np.nan)
        self.rule_shared[OWN::2] = _TYPICAL
