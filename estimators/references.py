"""The oracles beside ``oracle``: rows that are told of the truth, and are not ranked.

O0, O1, O1 with a smoother, and O3 of the reference literature differ in what they know of the faults:

- ``oracle-clairvoyant`` (O0): what each fault added; it works on the run without faults
- ``oracle`` (O1): which measurements a fault touched, and the statistics of the faults
- ``oracle-rts``: the same, smoothed; the reference of the post-processing track
- ``oracle-mixture`` (O3): how often gross errors come and how large they are, not which measurements they hit
"""

from __future__ import annotations

from simnav.estimator import register
from simnav.estimators.adaptations.truth import MixtureNoise, NominalNoise
from simnav.estimators.oracle import Oracle
from simnav.estimators.solvers.smoother import SmoothingEstimator
from simnav.types import Estimate, Measurements

__all__ = ["OracleClairvoyant", "OracleMixture", "OracleRts"]


@register("oracle-clairvoyant")
class OracleClairvoyant(Oracle):
    """Oracle that takes off each measurement what the faults added; only outages are left of them. (Oracle O0.)

    What an estimator would do on the clean run; the bound ``clean`` is its.
    """

    knowledge = NominalNoise

    def update(self, measurements: Measurements) -> Estimate:
        """Take one step, without the faults."""
        truth = self.truth
        assert isinstance(truth, NominalNoise)
        aids = [truth.restore(m) for m in measurements.aids]
        return super().update(Measurements(measurements.start, measurements.time, measurements.imu, aids))


@register("oracle-rts")
class OracleRts(SmoothingEstimator, Oracle):
    """The oracle with a Rauch-Tung-Striebel smoother behind it; the reference of the post-processing track."""


@register("oracle-mixture")
class OracleMixture(Oracle):
    """Oracle that knows the density of each measurement's noise, not which measurements a gross error hit. (Oracle O3.)

    The realistic target of robust estimators: the schedule of the faults and their sizes are known, each hit has to be
    told from the innovation (`simnav.estimators.adaptations.truth.MixtureNoise`). The bound ``mix`` is its.
    """

    knowledge = MixtureNoise
