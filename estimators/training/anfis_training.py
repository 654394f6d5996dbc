"""The training data of the ANFIS of `simnav.estimators.adaptations.anfis`: its own voyages, on seeds that are not
scored.

This is a reconstruction, because the training of Jiang et al. (2026) is not known. The data are three voyages of ships
with receivers of different quality, in five conditions of GNSS: without faults; increased noise; gross errors;
multipath; all of them. Faults start and end at random, and about seven fixes in ten have none. The scenarios of the
catalogue are not used, because a network could learn the fixed times of their faults.

The target for each fix is ``ln(true variance / datasheet's)``, the mean of north and east. The true variance is that of
the white noise of the measurement, plus the variance of multipath and the second moment of a gross error, if these
faults affected the fix. So the target has the statistics of the faults, not their values.

During the collection of data the ship's filter uses this true variance, so the innovations are those of a filter with
the right noise, as with a trained network.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cache
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from simnav.estimators.adaptations.anfis import Features
from simnav.estimators.adaptations.anfis_file import FEATURES, Parameters
from simnav.estimators.adaptations.base import Adaptation, Innovation
from simnav.estimators.adaptations.sugeno import Sugeno
from simnav.estimators.models.equations import equation_of_kind
from simnav.types import Array, Instruments

from .hybrid_learning import Learned, learn, rmse

if TYPE_CHECKING:
    from simnav.recording import AidStream, Recording
    from simnav.scenario import Scenario

__all__ = ["FIRST_TRAINING_SEED", "FIRST_VALIDATION_SEED", "Data", "gather", "log_factors", "scenarios", "train"]

#: Training takes seeds from here on, validation from the other; campaigns, the papers and the tests count from 0 up.
FIRST_TRAINING_SEED = 1_000_000_000
FIRST_VALIDATION_SEED = 1_500_000_000
#: A filter has settled after this time [s]; what comes before is not learnt from.
SETTLED = 60.0

_SHIP = """
name = "anfis-{name}"
version = 1
title = "Training of the ANFIS"
duration_s = 1200.0

[start]
latitude_deg = 45.0
longitude_deg = -20.0
heading_deg = {heading}
speed_m_s = {speed}

[initial_error]
position_m = [5.0, 5.0, 5.0]
velocity_m_s = [0.2, 0.2, 0.2]
attitude_deg = [1.0, 1.0, 1.0]

[vessel]
kind = "ship"
speed_time_constant_s = 20.0
turn_time_constant_s = 6.0
turn_rate_deg_s = 0.8

[sea]
significant_height_m = {waves}
peak_period_s = 7.0
direction_deg = 90.0

[current]
speed_m_s = {current}
direction_deg = 320.0

[instruments.gnss]
kind = "gnss_position"
rate_hz = 1.0
sigma_m = [{sigma}, {sigma}, {sigma}]

[instruments.gyrocompass]
rate_hz = 1.0
sigma_deg = 0.5
bias_deg = 0.5

[instruments.speed_log]
rate_hz = 1.0
sigma_m_s = 0.1
bias_m_s = 0.1
scale_percent = 1.0
"""
_HOLD = '\n[[manoeuvre]]\nkind = "hold"\nduration_s = {}\n'
_TURN = '\n[[manoeuvre]]\nkind = "turn"\nangle_deg = {}\nrate_deg_s = {}\n'
_SPEED = '\n[[manoeuvre]]\nkind = "accelerate"\nspeed_m_s = {}\nacceleration_m_s2 = {}\n'
_ZIGZAG = '\n[[manoeuvre]]\nkind = "zigzag"\nangle_deg = {}\nrate_deg_s = {}\nduration_s = {}\n'
_VOYAGES = {
    "passage": (
        {"heading": 20.0, "speed": 9.0, "waves": 1.5, "current": 0.4, "sigma": 4.0},
        _HOLD.format(200.0) + _TURN.format(40.0, 0.3) + _HOLD.format(250.0) + _SPEED.format(11.0, 0.02)
        + _HOLD.format(150.0) + _TURN.format(-60.0, 0.4),
    ),
    "coast": (
        {"heading": 150.0, "speed": 6.0, "waves": 0.8, "current": 0.25, "sigma": 2.5},
        _HOLD.format(100.0) + _ZIGZAG.format(20.0, 0.6, 300.0) + _SPEED.format(8.0, 0.03) + _TURN.format(120.0, 0.5)
        + _HOLD.format(100.0) + _SPEED.format(4.0, 0.03) + _ZIGZAG.format(30.0, 0.8, 250.0),
    ),
    "approach": (
        {"heading": 270.0, "speed": 5.0, "waves": 0.3, "current": 0.15, "sigma": 1.5},
        _SPEED.format(3.0, 0.04) + _TURN.format(-90.0, 0.8) + _HOLD.format(120.0) + _SPEED.format(6.0, 0.06)
        + _TURN.format(360.0, 0.7) + _SPEED.format(2.0, 0.05) + _HOLD.format(100.0) + _TURN.format(90.0, 1.0),
    ),
}  # fmt: skip
_FAULT = '\n[[fault]]\ninstruments = ["gnss"]\nmean_active_s = 60.0\nmean_gap_s = {gap}\nname = "{name}"\n'
#: By weather: faults with the mean gap between them [s] and their keys; ``s`` is the datasheet's sigma [m].
_STEPS = (("noise_step", 200.0, "factor = 3.0"), ("noise_step", 200.0, "factor = 8.0"))
_GROSS = (
    ("gross_error", 60.0, "probability = 0.1\nsize_m = [{4s}, {10s}]"),
    ("gross_error", 120.0, "probability = 0.1\nsize_m = [{10s}, {30s}]"),
)
_MULTIPATH = (
    ("multipath", 200.0, "sigma_m = {2s}\ncorrelation_time_s = 15.0"),
    ("multipath", 200.0, "sigma_m = {5s}\ncorrelation_time_s = 40.0"),
)
_WEATHERS = {
    "healthy": (),
    "noise": _STEPS,
    "gross": _GROSS,
    "multipath": _MULTIPATH,
    "all": (_STEPS[1], _GROSS[0], _MULTIPATH[0]),
}


@cache
def scenarios() -> tuple[Scenario, ...]:
    """The voyages of training and validation, each in each weather."""
    from simnav.scenario import parse

    found = []
    for (voyage, (values, motion)), (weather, faults) in product(_VOYAGES.items(), _WEATHERS.items()):
        text = _SHIP.format(name=f"{voyage}-{weather}", **values) + motion
        sigma = float(values["sigma"])
        for i, (kind, gap, keys) in enumerate(faults):
            sized = keys
            for factor in (2, 4, 5, 10, 30):
                sized = sized.replace(f"{{{factor}s}}", str(factor * sigma))
            text += _FAULT.format(gap=gap, name=f"{kind}-{i}") + f'kind = "{kind}"\n{sized}\n'
        found.append(parse(text))
    return tuple(found)


def log_factors(recording: Recording, stream: AidStream) -> Array:
    """(k,) logarithms of the true variance over the datasheet's of the k fixes of a stream, mean of north and east."""
    variance = stream.sigma[:, :2] ** 2
    for j, fault in enumerate(recording.faults):
        hit = (stream.faults >> np.uint32(j) & np.uint32(1)).astype(bool)[:, None]
        if fault.kind == "multipath":
            variance = variance + hit * np.broadcast_to(fault.parameters["sigma_position"], 3)[:2] ** 2
        elif fault.kind == "gross_error":  # uniform between two sizes
            low, high = fault.parameters["size_position"]
            variance = variance + hit * (low * low + low * high + high * high) / 3.0
    nominal = recording.instruments[stream.name].sigma[:2] ** 2
    return np.asarray(np.mean(np.log(variance / nominal), axis=1))


class _Teacher(Adaptation):
    """Tells the filter the true variance of each fix, and notes inputs and output of the network."""

    def __init__(self, recording: Recording):
        stream = recording.data.aids["gnss"]
        self._factors = dict(zip(stream.time.tolist(), log_factors(recording, stream).tolist()))
        self.inputs: dict[str, list[list[float]]] = {name: [] for name in FEATURES}
        self.outputs: list[float] = []

    def reset(self, instruments: Instruments) -> None:
        self._features = {name: Features(name, instruments) for name in FEATURES}

    def adapt(self, innovation: Innovation) -> Array:
        rows = {name: f.observe(innovation) for name, f in self._features.items()}
        m = innovation.measurement
        if not equation_of_kind(m.kind).has_height:
            return innovation.noise
        factor = self._factors[m.time]
        if m.time > SETTLED:
            for name, row in rows.items():
                assert row is not None
                self.inputs[name].append(row)
            self.outputs.append(factor)
        return innovation.noise * float(np.exp(factor))


@dataclass(frozen=True, eq=False)
class Data:
    """What was gathered of k fixes.

    Attributes
    ----------
    inputs : dict of str to (k, n) array
        By set of features.
    outputs : (k,) array
        Logarithms of the variance over the datasheet's.
    """

    inputs: dict[str, Array]
    outputs: Array


def gather(seeds: Iterable[int], progress: Callable[[int], None] | None = None) -> Data:
    """Sail all training voyages on each seed, and gather.

    Parameters
    ----------
    seeds : iterable of int
        Seeds of the voyages.
    progress : callable, optional
        Called after each run with the number of runs so far.

    Raises
    ------
    ValueError
        On a seed that is not reserved for training: results might be scored on it.
    """
    from simnav.estimators.models.ship import ShipModel
    from simnav.estimators.solvers.kalman import KalmanEstimator
    from simnav.source import record

    inputs: dict[str, list[list[float]]] = {name: [] for name in FEATURES}
    outputs: list[float] = []
    done = 0
    for seed in seeds:
        if seed < FIRST_TRAINING_SEED:
            raise ValueError(f"seed {seed} may be scored: training takes those from {FIRST_TRAINING_SEED} on")
        for scenario in scenarios():
            recording = record(scenario, seed)
            teacher = _Teacher(recording)
            model = ShipModel()
            model.turn_rate = 0.01  # as the files that are shipped were trained
            ship = KalmanEstimator(model, teacher)
            ship.reset(recording.start, recording.instruments)
            for packet in recording.steps():
                ship.update(packet)
            for name, rows in teacher.inputs.items():
                inputs[name] += rows
            outputs += teacher.outputs
            done += 1
            if progress is not None:
                progress(done)
    return Data({name: np.array(rows) for name, rows in inputs.items()}, np.array(outputs))


def train(
    features: str,
    data: Data,
    validation: Data,
    passes: int = 200,
    progress: Callable[[int, float, float], None] | None = None,
) -> tuple[Parameters, Learned]:
    """Learn the network of a set of features; nothing in it is random.

    Parameters
    ----------
    features : str
        Name of the set of inputs, a key of `FEATURES`.
    data, validation : Data
        Inputs and targets for training and for validation.
    passes : int
        Largest number of passes over the data.
    progress : callable, optional
        Called after each pass with its number, training and validation error.

    Returns
    -------
    Parameters, Learned
        The record of the parameters holds the errors; who trains adds the rest.
    """
    x, y = data.inputs[features], data.outputs
    known = Parameters(
        features,
        np.nanmin(x, axis=0),
        np.nanmax(x, axis=0),
        np.nanmedian(x, axis=0),
        float(np.max(y)),
        Sugeno.grid(x.shape[1]),
    )
    checked = known.scale(validation.inputs[features]), validation.outputs
    learned = learn(known.network, (known.scale(x), y), checked, passes=passes, progress=progress)
    record = {
        "passes": len(learned.training),
        "best": learned.best + 1,
        "rmse": float(f"{learned.training[learned.best]:.6g}"),
        "validation_rmse": float(f"{rmse(learned.network, *checked):.6g}"),
        "validation_of_constant": float(f"{np.sqrt(np.mean((validation.outputs - np.mean(y)) ** 2)):.6g}"),
    }
    return (
        Parameters(features, known.low, known.high, known.typical, known.largest, learned.network, record),
        learned,
    )
