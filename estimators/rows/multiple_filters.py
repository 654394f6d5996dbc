"""Rows of several filters side by side: one for each initial heading, or for each instrument that could be wrong."""

from simnav.estimator import register
from simnav.estimators.composition import Row
from simnav.estimators.models.suitable import Suitable
from simnav.estimators.solvers.heading_bank import HeadingBank
from simnav.estimators.solvers.solution_separation import SolutionSeparation

__all__ = ["HeadingBankEkf", "SolutionSeparationEkf"]


@register("heading-bank")
class HeadingBankEkf(Row, solver=HeadingBank, model=Suitable):
    """The EKF from an unknown heading: a bank of EKFs round the compass, weighed until one of them is left.

    With a heading known to 15 degrees or better it is the plain EKF. Source: D. T. Magill, *Optimal adaptive estimation
    of sampled stochastic processes*, IEEE TAC 10(4), 1965; H. W. Sorenson and D. L. Alspach, *Recursive Bayesian
    estimation using Gaussian sums*, Automatica 7(4), 1971.
    """


@register("solution-separation")
class SolutionSeparationEkf(Row, solver=SolutionSeparation, model=Suitable):
    """Solution separation: an EKF without each instrument beside the one with all; detects and excludes a wrong one.

    It gives a protection level. Source: R. G. Brown and P. W. McBurney, *Self-contained GPS integrity check using
    maximum solution separation*, Navigation 35(1), 1988; J. Blanch, T. Walter, P. Enge et al., *Baseline advanced RAIM
    user algorithm and possible improvements*, IEEE Trans. Aerospace and Electronic Systems 51(1), 2015.

    Versions
    --------
    2
        The IMU is a suspect also beside a single fix or log. The last fix or log that delivers is not excluded if a
        disturbed IMU would explain why it disagrees, and an excluded one is used again where the position without it
        becomes more uncertain than the separation was.
    """

    version = 2
