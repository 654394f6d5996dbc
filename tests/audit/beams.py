"""What the network of ``beams-ekf`` knows of the velocity while a DVL is silent, and what its row makes of it.

For each family of its training, on validation voyages that it has not seen: the error of the predicted velocity over
that of the velocity held from the last readings; and the horizontal RMSE over that of ``ekf``, where the DVL and all
fixes are silenced for 5 to 120 s, twice in a voyage. Beside it is the same row with a network that always says: as
before, with the error that holding has in the training.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from simnav.estimator import make
from simnav.estimators.networks.file import Network, shipped
from simnav.estimators.networks.velocity import RECIPE, VERSION, VelocityNetwork, shapes_of
from simnav.estimators.training.recipe import FIRST_COMPARED, error_over_plain
from simnav.estimators.training.velocity_network import FAMILIES, gather, lost
from simnav.estimators.training.voyages import voyages

__all__ = ["HELD", "measure", "parts", "rows"]

VOYAGES = 8
#: Sigma of a velocity that is held, in speeds.
HELD = 0.15


def held(path: Path) -> str:
    """A network that says: as before."""
    arrays = {name: np.zeros(shape) for name, shape in shapes_of({"output_weight": np.zeros((6, 2))}).items()}
    arrays["output_bias"][3:] = np.log(HELD)
    Network(RECIPE, VERSION, arrays, ("dvl",)).save(path)
    return str(path)


def measure(family: str) -> dict[str, float]:
    """The figures of a family."""
    recordings = list(voyages((family,), "validation", range(FIRST_COMPARED, FIRST_COMPARED + VOYAGES)))
    network = Network.load(shipped(RECIPE, 1000), RECIPE, VERSION, shapes_of)
    ratios = []
    for part in (part for voyage in gather(recordings) for part in voyage):
        asked, missing = VelocityNetwork(network), part.missing > 0
        difference = np.array([asked.advance(x)[0] for x in part.inputs.astype(np.float64)])
        errors = [np.sqrt(np.mean(np.sum(e[missing] ** 2, axis=1))) for e in (difference - part.target, part.target)]
        if missing.any():
            ratios.append(errors[0] / errors[1])
    with tempfile.TemporaryDirectory() as folder:
        file = held(Path(folder) / "held.npz")
        made = {"row": lambda: make("beams-ekf"), "held": lambda: make("beams-ekf", file=file)}
        found = error_over_plain(made, map(lost, recordings))
    means = {name: [x for x in values if x is not None] for name, values in {"velocity": ratios, **found}.items()}
    return {name: float(np.exp(np.mean(np.log(values)))) for name, values in means.items() if values}


def parts() -> Mapping[str, Callable[[], Any]]:
    """One for each family."""
    return {family: partial(measure, family) for family in FAMILIES}


def rows(found: Mapping[str, Any]) -> Iterator[tuple[str, str, str, bool]]:
    """What is measured, its figures, what is promised, and whether that is kept."""
    for family, figures in found.items():
        words = f"velocity {figures['velocity']:.2f}, position {figures['row']:.2f} (held {figures['held']:.2f})"
        yield f"beams-ekf: {family}", words, "position at most 1.05", figures["row"] <= 1.05
