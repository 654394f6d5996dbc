"""What part of the fast error of a speed grows with the speed, and what part in turns.

The error of a Doppler log is small at rest, grows with the speed, and is largest while the vessel turns. With the speed
v and the turn rate w at each reading its variance is ``a + b (v / v0)^2 + c (v / v0)^2 (w / w0)^2``. A reading less the
mean of its two neighbours has this variance times a constant, and nothing of an error that is slow. The three parts
follow from its squares by non-negative least squares (C. L. Lawson and R. J. Hanson, *Solving Least Squares Problems*,
1974, chapter 23). Plain squares: weights by the predicted variance are better where the model is exact, but give all
weight to straight courses, and then a turn of a recorded log has too small an error. What is correlated from reading to
reading is given to the turns, as far as their part goes; outside of them the error is white.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import log, sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls
from scipy.stats import t as student

from simnav.scenario.residuals import ErrorSeries
from simnav.types import Array

__all__ = ["SPEED", "TURN_RATE_DEG_S", "MotionShares", "Part", "motion_shares"]

#: Speed [m/s] and turn rate [deg/s] at which the sizes are given.
SPEED, TURN_RATE_DEG_S = 1.0, 10.0
#: Fewer readings tell nothing; above this many degrees of freedom white noise is normal.
_LEAST, _NORMAL = 200, 20.0
#: A process with a longer period or correlation time is slow [s].
_FAST = 5.0
#: Largest factor between the size of a part in a recording and that in all.
_APART = 3.0
#: A smaller share of the variance is nothing.
_NOTHING = 1e-3

Process = Mapping[str, Any]


class Part(NamedTuple):
    """A part of the fast error of a component.

    Attributes
    ----------
    share : float
        Of the variance in the log.
    motion : float
        Root mean square of what it is proportional to, in the log.
    least, largest : float
        Its size in the recordings where it is smallest and largest, over that in all.
    proportional_to : mapping of str to float
        As in TOML; empty for a constant size.
    """

    share: float
    motion: float
    least: float
    largest: float
    proportional_to: Mapping[str, float]

    def of(self, process: Process, share: float) -> dict[str, Any]:
        """A share of the variance of a process, with the factors of this part and sizes that are drawn."""

        def size(value: float) -> Any:
            whole = value * sqrt(share) / self.motion
            if self.least == self.largest or value == 0.0:
                return float(f"{whole:.3g}")
            return {"log_uniform": [float(f"{k * whole:.3g}") for k in (self.least, self.largest)]}

        def sizes(value: Any) -> Any:
            return [size(v) for v in value] if isinstance(value, list) else size(value)

        made = {key: sizes(value) if key.startswith("sigma_") else value for key, value in process.items()}
        return {**made, "proportional_to": dict(self.proportional_to)} if self.proportional_to else made


class MotionShares(NamedTuple):
    """The parts of the fast error of a component.

    Attributes
    ----------
    constant, with_speed, in_turns : Part
        Their shares sum to 1.
    freedom : float
        Degrees of freedom of Student's t of each reading; infinite for normal noise.
    """

    constant: Part
    with_speed: Part
    in_turns: Part
    freedom: float

    def split(self, processes: Sequence[Process], key: str) -> list[dict[str, Any]]:
        """The processes of a component in their parts; those that are slow stay as they are.

        Parameters
        ----------
        processes : sequence of mapping
            As in TOML.
        key : str
            Key of the sizes.
        """
        slow = [dict(p) for p in processes if _length(p) > _FAST]
        fast = [(p, float(np.max(np.square(p[key])))) for p in processes if _length(p) <= _FAST]
        total = sum(variance for _, variance in fast)
        alternating = sum(variance for p, variance in fast if _length(p)) / total if total else 0.0
        turning = min(self.in_turns.share, alternating)
        made = []
        for process, variance in fast:
            if variance < _NOTHING * total:
                continue
            if _length(process):
                own, plain = turning / alternating, dict(process)
            else:
                own, plain = (self.in_turns.share - turning) / (1.0 - alternating), self._white(process)
            rest = (1.0 - own) / max(1.0 - self.in_turns.share, 1e-9)
            shares = rest * self.constant.share, rest * self.with_speed.share, own
            forms = (self._white(process), self._white(process), plain)
            parts = zip((self.constant, self.with_speed, self.in_turns), shares, forms, strict=True)
            made += [part.of(form, share) for part, share, form in parts if share > _NOTHING]
        return [*made, *slow]

    def _white(self, process: Process) -> dict[str, Any]:
        """White noise with the tails that are left when its size follows the motion."""
        plain = {key: value for key, value in process.items() if key.startswith("sigma_")}
        if not np.isfinite(self.freedom):
            return {**plain, "kind": "white"}
        return {**plain, "kind": "heavy_tailed", "degrees_of_freedom": float(f"{self.freedom:.3g}")}


def _length(process: Process) -> float:
    """Correlation time or period of a process [s]; 0 for white noise."""
    return float(max(process.get("correlation_time_s", 0.0), process.get("period_s", 0.0)))


def motion_shares(series: Sequence[ErrorSeries]) -> list[MotionShares] | None:
    """Find the parts.

    Parameters
    ----------
    series : sequence of ErrorSeries
        The errors of a speed in several recordings, with the motion.

    Returns
    -------
    list of MotionShares or None
        For each component; None where there are too few readings, or none of the motion.
    """
    squares, motion = [], []
    for one in series:
        if one.taps is None:
            return None
        speed = np.square(np.linalg.norm(one.taps.velocity, axis=1) / SPEED)
        turning = np.square(np.degrees(one.taps.angular_rate[:, 2]) / TURN_RATE_DEG_S)
        regular = np.abs(one.time[2:] - one.time[:-2] - 2.0 / one.rate) < 0.5 / one.rate
        squares.append(np.square(one.error[1:-1] - 0.5 * (one.error[:-2] + one.error[2:]))[regular])
        motion.append(np.stack([np.ones_like(speed), speed, speed * turning], axis=-1)[1:-1][regular])
    y, X = np.concatenate(squares), np.concatenate(motion)
    ends = np.cumsum([len(one) for one in squares])[:-1]
    usable = len(y) >= _LEAST and y.any(axis=0).all() and X.any(axis=0).all()
    return [_of_component(column, X, ends) for column in y.T] if usable else None


def _of_component(y: Array, X: Array, ends: NDArray[np.int64]) -> MotionShares:
    whole, factors = nnls(X, y)[0], X.mean(axis=0)
    each = [nnls(*one)[0] for one in zip(np.split(X, ends), np.split(y, ends), strict=True)]
    # Nothing of a part in a recording may be chance, and so may a large one: within a factor of `_APART`.
    sizes = np.sqrt(np.clip(each, whole / _APART**2, whole * _APART**2) / np.maximum(whole, 1e-300))
    speed = {"speed_m_s": SPEED}
    proportional: tuple[dict[str, float], ...] = ({}, speed, {**speed, "turn_rate_deg_s": TURN_RATE_DEG_S})
    shares = whole * factors / float(whole @ factors)
    constant, with_speed, in_turns = (
        Part(float(share), sqrt(factor), *_range(size), names)
        for share, factor, size, names in zip(shares, factors, sizes.T, proportional, strict=True)
    )
    scaled = np.sqrt(y / np.maximum(X @ whole, 1e-3 * float(y.mean())))
    freedom = float(student.fit(np.concatenate([scaled, -scaled]), floc=0.0)[0])
    return MotionShares(constant, with_speed, in_turns, max(freedom, 2.2) if freedom < _NORMAL else np.inf)


def _range(size: Array) -> tuple[float, float]:
    """The least and the largest of some sizes, log-uniform between them with the root mean square 1."""
    least, largest = float(size.min()), float(size.max())
    if not largest > (1.0 + 1e-9) * least or not least > 0.0:
        return 1.0, 1.0
    times = 1.0 / sqrt((largest**2 - least**2) / (2.0 * log(largest / least)))
    return times * least, times * largest
