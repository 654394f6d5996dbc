"""Covariance intersection: a message of another vessel is used without a word on how its error is correlated."""

from __future__ import annotations

import numpy as np

from simnav.estimators.models.filtering import Dynamics, Prediction, Readings
from simnav.types import KINDS, Array, Instruments

from .base import Adaptation, Innovation

__all__ = ["CovarianceIntersection", "share", "weaken_position"]

#: Shares that are tried, and the noise of a message that is not used, times what it is.
_SHARES, _UNUSED = np.arange(1, 200) / 200.0, 1e12


def share(predicted: float, message: float, white: float) -> float:
    """The share w of the own estimate in the intersection that makes the horizontal position most certain.

    With the own covariance P of the two components and its part a along the range, the variance C of the message and W
    of the white noise, the intersection is an update of ``P / w`` by a range with the variance ``C / (1 - w) + W``. The
    determinant of the result is ::

        |P| / w^2 (C / (1 - w) + W) / (a / w + C / (1 - w) + W)

    Without white noise it is smallest at ``w = a / (2 (a - C))`` where a > 2 C. Otherwise the message tells too little
    beside what it may have told already: w = 1, and it is not used.

    Parameters
    ----------
    predicted, message, white : float
        a, C and W [m^2].

    Examples
    --------
    >>> share(1.9, 1.0, 0.0), share(4.0, 1.0, 0.0), share(400.0, 1.0, 0.0)
    (1.0, 0.665, 0.5)
    """
    noise = message / (1.0 - _SHARES) + white
    ratio = noise / (_SHARES * (predicted + _SHARES * noise))
    best = int(np.argmin(ratio))
    return float(_SHARES[best]) if ratio[best] < 1.0 else 1.0


def weaken_position(covariance: Array, factor: float) -> None:
    """Multiply the covariance of the horizontal position by a factor, in place.

    With the position p and a state x, ``x = K p + z`` with ``K = P_xp P_pp^-1``, the covariance of z is kept. So the
    variance of a state grows by as much as its error goes with that of the position.

    Parameters
    ----------
    covariance : (n, n) array
        P, whose first two components are those of the horizontal position.
    factor : float
        Factor, above 1.
    """
    columns = covariance[:, :2].copy()
    covariance += (factor - 1.0) * columns @ np.linalg.solve(columns[:2], columns.T)


def inflate_position(dynamics: Dynamics, readings: Readings, k: int, prediction: Prediction) -> bool:
    """Weaken the position by the inflation of a reading, which is then to be predicted again."""
    weaken_position(dynamics.covariance, float(readings.inflation[k]))
    return True


class CovarianceIntersection(Adaptation):
    """Uses ranges with messages of other vessels by covariance intersection, and every other measurement as it is.

    The error of a message (`simnav.kinds.MessageNoise`) is not white: the same error comes again with the next message,
    and a vessel that has used our own messages returns our own error. Covariance intersection assumes nothing of the
    correlation between the error of the message and that of the own position. With a share w between 0 and 1 it weakens
    both covariances, the own one P to ``P / w`` and that of the message C to ``C / (1 - w)``, and updates. The result
    is no smaller than the true covariance, whatever the correlation (Julier and Uhlmann 1997). The white noise of the
    range is independent, and is not weakened (split covariance intersection, Julier and Uhlmann 2001). `share` chooses
    w.

    P is the covariance of the horizontal position. What the model knows independently of it, such as most of its
    heading and of the errors of its instruments, is kept (`weaken_position`): these are taken as independent of the
    messages. With all of P, the covariance of heading and biases would grow with every message, without bound.

    The diagnostic ``share.INSTRUMENT`` is w; 1 if the message was not used.

    Source: S. J. Julier and J. K. Uhlmann, *A non-divergent estimation algorithm in the presence of unknown
    correlations*, American Control Conference, 1997; the same, *General decentralized data fusion with covariance
    intersection*, in Handbook of Multisensor Data Fusion, CRC Press, 2001.
    """

    inflates = True
    inflate = staticmethod(inflate_position)

    def reset(self, instruments: Instruments) -> None:
        """Begin a run."""
        self.inflation = 1.0
        self._shares: dict[str, float | Array] = {}
        self._white = {
            name: float(sheet.sigma[0] ** 2)
            for name, sheet in instruments.items()
            if KINDS[sheet.kind].message_noise is not None and len(sheet.sigma) == 1
        }

    def adapt(self, innovation: Innovation) -> Array | None:
        """The noise of a message, weakened but for its white part."""
        self.inflation = 1.0
        name = innovation.measurement.instrument
        white = self._white.get(name)
        if white is None:
            return innovation.noise
        message = float(innovation.noise[0, 0]) - white
        if message <= 0.0:
            return innovation.noise
        w = share(float(innovation.predicted[0, 0]), message, white)
        self._shares[f"share.{name}"] = w
        if w == 1.0:
            return _UNUSED * innovation.noise
        self.inflation = 1.0 / w
        return np.array([[message / (1.0 - w) + white]])

    def diagnostics(self) -> dict[str, float | Array]:
        """The shares of the last messages."""
        return self._shares
