"""What an adaptation is: it sees each innovation before it is used, and decides on its noise."""

from __future__ import annotations

from typing import NamedTuple

from simnav.types import Array, Instruments, Measurement

__all__ = ["Adaptation", "Innovation"]


class Innovation(NamedTuple):
    """One innovation of m components, with what is believed of it.

    Attributes
    ----------
    measurement : Measurement
    residual : (m,) array
        Measured minus predicted, in the units of ``KINDS[kind].errors``.
    predicted : (m, m) array
        H P H', the covariance of the prediction.
    noise : (m, m) array
        R, of the measurement.
    """

    measurement: Measurement
    residual: Array
    predicted: Array
    noise: Array


class Adaptation:
    """Uses every measurement with the noise that the model says; the base of all adaptations.

    One that gates by a chi-square test::

        class Gate(Adaptation):
            def adapt(self, innovation):
                s = innovation.predicted + innovation.noise
                nis = innovation.residual @ np.linalg.solve(s, innovation.residual)
                return innovation.noise if nis < 16.0 else None
    """

    def reset(self, instruments: Instruments) -> None:
        """Begin a run."""

    def adapt(self, innovation: Innovation) -> Array | None:
        """The (m, m) noise to use, or None to leave the measurement out; it is then flagged as faulty."""
        return innovation.noise

    def diagnostics(self) -> dict[str, float | Array]:
        """Named values of the last step, recorded by epoch."""
        return {}
