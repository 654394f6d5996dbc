"""The row of trained policies: a filter whose noise an agent sets, learned by reinforcement."""

from pathlib import Path

from simnav.estimator import register
from simnav.estimators.learning.policy_estimator import PolicyEstimator

__all__ = ["PolicyEkf"]


@register("policy-ekf")
class PolicyEkf(PolicyEstimator):
    """EKF whose GNSS noise a trained policy sets, from the innovations.

    The policy that comes with it was trained by the cross-entropy method (``examples/cross_entropy.py``, 1 152 000
    steps) on 64 training voyages of ``training-gnss-faults``: an IMU, a GNSS receiver and in half of them a DVL, with
    noise steps and multipath. They are never scored. It is asked about the first receiver, and does not see faults of
    other instruments. Do not use it where another instrument may be wrong, or on vessels unlike those of the training:
    it does not notice that it is lost (on 7 % of the 157 runs of the board beyond ten times the plain row neither its
    covariance nor its status admits it), and on a ferry with multipath and false zeros of the log it had 4.4 times the
    error of ``ekf``. By ``python -m tests.audit learned`` it loses in the mean in the groups "Training" (1.08 times the
    error of the plain row), "Nothing wrong" (1.13), "Outage" (1.11), "Velocity aid wrong" (1.34), "Start or heading
    wrong" (1.32), "The IMU wrong" (2.06), "Generalisation" (1.96) and "Recorded voyages" (1.36).
    ``file`` names another policy (docs/how-to/learn-to-navigate.md). Source: ours; R. Y. Rubinstein, *The cross-entropy
    method for combinatorial and continuous optimization*, Methodology and Computing in Applied Probability 1, 1999.

    Parameters
    ----------
    file : str
        Policy file; empty for the one that comes with the package.

    Versions
    --------
    2
        It is inconsistent, too, while fixes that it sets aside contradict it (`FixTest`).
    """

    version = 2

    def __init__(self, file: str = ""):
        super().__init__(file or str(Path(__file__).parents[1] / "learning" / "policy_ekf.npz"))
