"""The row of trained policies: a filter whose noise an agent sets, learned by reinforcement."""

from pathlib import Path

from simnav.estimator import register
from simnav.estimators.learning.policy_estimator import PolicyEstimator

__all__ = ["PolicyEkf"]


@register("policy-ekf")
class PolicyEkf(PolicyEstimator):
    """EKF whose GNSS noise and process noise a trained policy sets, from the innovations.

    The policy that comes with it was trained by PPO on ``training-gnss-faults``, a family of voyages with an IMU and a
    GNSS receiver, noise steps and multipath, whose seeds are never scored; on other voyages it does what it can. It
    asks for one instrument that gives positions, a GNSS receiver with one fix a step. ``file`` names another policy
    (docs/how-to/learn-to-navigate.md). Source: ours; PPO is of J. Schulman et al., *Proximal policy
    optimization algorithms*, 2017.

    Parameters
    ----------
    file : str
        Policy file; empty for the one that comes with the package.
    """

    def __init__(self, file: str = ""):
        super().__init__(file or str(Path(__file__).parents[1] / "learning" / "policy_ekf.npz"))
