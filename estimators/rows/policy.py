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
    error of ``ekf``. In the standard result it gains where fixes are noisy (0.67 times the error of ``ekf``) or lie
    slowly (0.30), and loses where nothing is wrong (1.2 to 1.4), with a wrong start (1.7) and with a wrong IMU (3.4).
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
    3
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 3

    def __init__(self, file: str = ""):
        super().__init__(file or str(Path(__file__).parents[1] / "learning" / "policy_ekf.npz"))
