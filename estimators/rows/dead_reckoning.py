"""Dead reckoning."""

from simnav.estimator import register
from simnav.estimators.composition import Row
from simnav.estimators.solvers.dead_reckoning import DeadReckoningEstimator

__all__ = ["DeadReckoning"]


@register("dead-reckoning", aliases=("dr",))
class DeadReckoning(Row, solver=DeadReckoningEstimator):
    """Dead reckoning: heading from gyroscopes or compass, speed from DVL or log, from the initial position on.

    It does not notice that the initial state is further off than its covariance says (``wrong-start``): no fix is used.

    Source: N. Bowditch, *The American Practical Navigator*, chapter on dead reckoning.
    """
