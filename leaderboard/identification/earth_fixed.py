"""A part of the error of a speed that is fixed to the Earth: in body axes it turns with the heading.

A reference whose position wanders has a velocity of its own, and the difference of a Doppler log from it has this
velocity with the opposite sign. It is nearly constant for minutes. With the heading psi its parts forward and to
starboard are ``v_N cos psi + v_E sin psi`` and ``v_E cos psi - v_N sin psi``. The two numbers follow from each
recording by least squares, beside the mean of each component. They are used if they make the recordings more likely by
more than `_GAIN` in the logarithm for the number of effective samples (`simnav.log.likelihood`), beyond one for each
number, which is the gain by chance twice over (H. Akaike, *A new look at the statistical model identification*, IEEE
TAC 19(6), 1974).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import log, sqrt
from typing import Any, NamedTuple

import numpy as np

from simnav.log.likelihood import effective_samples
from simnav.scenario.residuals import ErrorSeries
from simnav.types import Array

__all__ = ["EarthFixed", "earth_fixed"]

#: More than slow errors alone reach: 180 logs with one of 20 s had 8.2 at most.
_GAIN = 10.0


class EarthFixed(NamedTuple):
    """What was found.

    Attributes
    ----------
    size : float
        Root mean square of the north and the east velocity over the recordings [m/s].
    rest : list of ErrorSeries
        The errors without it.
    """

    size: float
    rest: list[ErrorSeries]

    def processes(self, key: str, components: int) -> list[dict[str, Any]]:
        """The two processes as in TOML, the sizes under a key; of several components the first two have them."""
        size = float(f"{self.size:.3g}")
        sizes = [size, size, 0.0][:components] if components > 1 else size
        return [{"kind": "constant", key: sizes, "proportional_to": {f"{of}_heading": 1.0}} for of in ("cos", "sin")]


def earth_fixed(series: Sequence[ErrorSeries]) -> EarthFixed | None:
    """Find the part.

    Parameters
    ----------
    series : sequence of ErrorSeries
        The errors of a speed in several recordings, forward, or forward, to starboard and down, with the motion.

    Returns
    -------
    EarthFixed or None
        None where the motion is not known, or nothing is fixed to the Earth.
    """
    gain, squares, rest = 0.0, list[float](), list[ErrorSeries]()
    for one in series:
        if one.taps is None:
            return None
        heading = one.taps.attitude[:, 2]
        north = np.stack([np.cos(heading), -np.sin(heading)])[: one.error.shape[1]]
        east = np.stack([np.sin(heading), np.cos(heading)])[: one.error.shape[1]]
        error = one.error[:, : len(north)].T
        design = np.stack([_centred(north).ravel(), _centred(east).ravel()], axis=1)
        found = np.linalg.lstsq(design, _centred(error).ravel(), rcond=None)[0]
        fixed = (design @ found).reshape(error.shape)
        gain += sum(map(_gain, _centred(error), _centred(error) - fixed))
        squares += np.square(found).tolist()
        left = one.error.copy()
        left[:, : len(north)] -= fixed.T
        rest.append(replace(one, error=left))
    return EarthFixed(sqrt(float(np.mean(squares))), rest) if gain - len(squares) > _GAIN else None


def _centred(rows: Array) -> Array:
    """Rows without their means."""
    centred: Array = rows - rows.mean(axis=1, keepdims=True)
    return centred


def _gain(before: Array, after: Array) -> float:
    """By how much an error is more likely after a fit, in the logarithm."""
    least = float(after @ after)
    return 0.5 * effective_samples(after) * log(float(before @ before) / least) if least > 0.0 else 0.0
