"""Base of the adaptations: an adaptation receives each innovation before it is used, and chooses its noise."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar, NamedTuple

from simnav.types import Array, Instruments, Measurement

from .inflation import inflate_moving

__all__ = ["Adaptation", "Innovation"]


class Innovation(NamedTuple):
    """One innovation of m components, with its predicted covariance and its noise.

    Attributes
    ----------
    measurement : Measurement
        The measurement that the innovation belongs to.
    residual : (m,) array
        Measured minus predicted, in the units of ``KINDS[kind].errors``.
    predicted : (m, m) array
        H P H', the covariance of the prediction.
    noise : (m, m) array
        R, the covariance of the measurement noise.
    covariance : (n, n) array or None
        P, the covariance of the model's error before the measurement. It must not be changed. None if the solver has
        no such matrix.
    cross : (n, m) array or None
        P H', the covariance between the model's error and the prediction; None if ``covariance`` is None.
    """

    measurement: Measurement
    residual: Array
    predicted: Array
    noise: Array
    covariance: Array | None = None
    cross: Array | None = None


class Adaptation:
    """Base class of all adaptations. It uses every measurement with the noise of the model.

    An adaptation that rejects measurements by a chi-square test::

        class Gate(Adaptation):
            def adapt(self, innovation):
                s = innovation.predicted + innovation.noise
                nis = innovation.residual @ np.linalg.solve(s, innovation.residual)
                return innovation.noise if nis < 16.0 else None

    Attributes
    ----------
    inflation : float
        Factor by which the solver multiplies the covariance of the prediction, before it uses the measurement of the
        last call of `adapt`. Adaptations use it if the prediction is wrong and not the measurement.
    inflates : bool
        True if the covariance of the prediction is always inflated, and not only where the motion is wrong. A window
        holds the motion by factors, and refuses such an adaptation.
    inflate : callable
        What of the covariance is inflated (`simnav.estimators.adaptations.inflation`).
    inflates_motion : bool
        Whether the covariance of the motion is inflated, and no other. A window weighs motion by its own residuals, and
        leaves this out.
    reads_truth : bool
        Whether it needs the truth of a run, by a method ``reveal``; only an oracle passes it on.
    """

    inflation: float = 1.0
    inflates: bool = False
    inflate: Callable[..., bool] = inflate_moving
    inflates_motion: bool = False
    reads_truth: ClassVar[bool] = False

    def reset(self, instruments: Instruments) -> None:
        """Start a run."""

    def adapt(self, innovation: Innovation) -> Array | None:
        """Return the (m, m) noise to use, or None to reject the measurement, which is then flagged as faulty."""
        return innovation.noise

    def diagnostics(self) -> dict[str, float | Array]:
        """Named values of the last step, which are recorded at each epoch."""
        return {}
