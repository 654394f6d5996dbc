"""What solution separation may exclude: the rules of a vessel with an IMU, and of one without.

An IMU carries a vessel for a while without fixes and logs, but an instrument is excluded only where the position
without it is known well enough: `TELLING` sigmas of it are less than the separation, or it is at most `WORSE` times
less certain. With a poor IMU and a receiver alone, fixes that are wrong by ten metres are better than none.

Without an IMU nothing is excluded that cannot be spared: a fix, or a log and a compass, must be left. The turns of the
vessel are known by its compass alone, and they are not the random process of the model. So the separation of the filter
without a compass counts `TURNING` times less.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from math import hypot, radians, sqrt

from simnav.estimators.models.inertial_errors import ERROR
from simnav.types import Estimate

from .separation import KNOWN_HEADING
from .state_difference import difference

__all__ = ["COASTING", "ExclusionRules", "RulesWithoutImu"]

#: An instrument is excluded only if the separation of the position is this multiple of the sigma of the filter without
#: it, or if that sigma is at most the other multiple of the main filter's.
TELLING, WORSE = 3.0, 10.0
#: The last fix or log is excluded only if the filter without it knows its heading to this standard deviation [rad].
#: Otherwise a poor IMU, which is left alone, is soon lost.
ALONE = radians(1.5)
#: By how much the separation of the filter without a compass counts less.
TURNING = 3.0
#: Longest time without fixes and logs by exclusion, and for which log and compass alone are followed [s].
COASTING, DEAD_RECKONING = 60.0, 180.0


class ExclusionRules:
    """The rules of a vessel with an IMU; the subclass has those of one without.

    Parameters
    ----------
    group : mapping of str to bool
        Which instruments give fixes (True) and which are logs (`simnav.estimators.models.roles.fixes_and_logs`).
    """

    def __init__(self, group: Mapping[str, bool]):
        self.group = group

    def counted(self, name: str, separation: float) -> float:
        """The separation of the filter without an instrument, over its threshold, as it counts: as it is."""
        return separation

    def can_spare(self, left: Collection[str]) -> bool:
        """Whether the instruments that are left give a position: always, for a while."""
        return True

    def pays(self, without: Estimate, estimate: Estimate, carried: bool) -> bool:
        """Whether the filter without an instrument knows the position well enough to be believed.

        Parameters
        ----------
        without, estimate : Estimate
            Of that filter, and of the main one.
        carried : bool
            Whether it has a fix or a log.
        """
        assert without.covariance is not None
        assert estimate.covariance is not None
        if float(without.covariance[ERROR.heading, ERROR.heading]) > (KNOWN_HEADING if carried else ALONE) ** 2:
            return False
        sigma, main = (sqrt(float(p[0, 0] + p[1, 1])) for p in (without.covariance, estimate.covariance))
        apart = difference(without, estimate)
        return sigma <= max(hypot(float(apart[0]), float(apart[1])) / TELLING, WORSE * main)

    def rivals(self, names: Collection[str]) -> Collection[str]:
        """The instruments of which one may have been excluded in the place of another: fixes and logs."""
        return self.group

    def lost_without(self, fixes: list[str], logs: list[str]) -> tuple[list[str], list[str], float]:
        """Of the fixes and logs that are heard: those of which one is needed, those to be used again first, and the
        longest time without [s]. An IMU alone is soon worse than either."""
        return [*fixes, *logs], logs or fixes, COASTING


class RulesWithoutImu(ExclusionRules):
    """The rules of a vessel without an IMU."""

    def counted(self, name: str, separation: float) -> float:
        """Less without a compass."""
        return separation if name in self.group else separation / TURNING

    def can_spare(self, left: Collection[str]) -> bool:
        """If a fix is left, or a log and a compass."""
        roles = {self.group.get(n) for n in left}  # None: a compass
        return True in roles or {False, None} <= roles

    def pays(self, without: Estimate, estimate: Estimate, carried: bool) -> bool:
        """Always: what is left gives a position."""
        return True

    def rivals(self, names: Collection[str]) -> Collection[str]:
        """All of them, the compass too."""
        return names

    def lost_without(self, fixes: list[str], logs: list[str]) -> tuple[list[str], list[str], float]:
        """A fix is needed."""
        return fixes, fixes, DEAD_RECKONING
