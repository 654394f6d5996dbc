"""Base of the adaptations: an adaptation receives each innovation before it is used, and chooses its noise."""

from __future__ import annotations

from typing import ClassVar, NamedTuple

from simnav.types import Array, Instruments, Measurement

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
        R, of the measurement.
    covariance : (n, n) array or None
        P, of the model's error before the measurement; to be read, not changed.
    cross : (n, m) array or None
        P H'.
    """

    measurement: Measurement
    residual: Array
    predicted: Array
    noise: Array
    covariance: Array | None = None
    cross: Array | None = None


class Adaptation:
    """Base of all adaptations: uses every measurement with the noise of the model.

    One that gates by a chi-square test::

        class Gate(Adaptation):
            def adapt(self, innovation):
                s = innovation.predicted + innovation.noise
                nis = innovation.residual @ np.linalg.solve(s, innovation.residual)
                return innovation.noise if nis < 16.0 else None

    Attributes
    ----------
    inflation : float
        What the solver inflates the prediction by before it uses the measurement that `adapt` has just seen; for those
        who doubt the prediction rather than the measurement.
    inflates : bool
        Whether all of P is multiplied by ``inflation``. A window keeps no covariance of a prediction to multiply, and
        refuses such an adaptation.
    inflates_motion : bool
        Whether the covariance of the motion is inflated, and no other (`ErrorModel.loosen`). A window weighs motion by
        its own residuals, and leaves this out.
    reads_truth : bool
        Whether it needs the truth of a run, by a method ``reveal``; only an oracle passes it on.
    """

    inflation: float = 1.0
    inflates: bool = False
    inflates_motion: bool = False
    reads_truth: ClassVar[bool] = False

    def reset(self, instruments: Instruments) -> None:
        """Begin a run."""

    def adapt(self, innovation: Innovation) -> Array | None:
        """The (m, m) noise to use, or None to leave the measurement out; it is then flagged as faulty."""
        return innovation.noise

    def diagnostics(self) -> dict[str, float | Array]:
        """Named values of the last step, recorded by epoch."""
        return {}
