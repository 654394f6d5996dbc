"""The tasks around a running filter: the action of an agent in each step, and its reward.

================ =========================================== ==========================================================
task             action                                      reward
================ =========================================== ==========================================================
``Tuning``       k + 1 numbers in [-1, 1]: logarithms of the ``"error"``: ``-ln((e^2 + s^2) / (o^2 + s^2)) / 2``, e and
                 factors on each instrument's sigma and on   o the horizontal errors of the filter and the oracle, s
                 the process noise's, over ln 30. 0: as the  the oracle's sigma; ``"gain"``: relative to the plain
                 datasheet says                              filter, where errors are large; ``"likelihood"``: the
                                                             logarithm of the density that the filter gave to the true
                                                             position [1/m^2], but for the constant
``Detection``    k K bits: the j-th measurement of a step by ``"labels"``: +1 for each fault that is found, -1 for each
                 the i-th instrument is faulty               that is not, -1 for each false alarm
``Correction``   7 numbers in [-1, 1]: what is added to the  ``"improvement"``: how much the error becomes less [m];
                 plain filter's position (10 m), velocity    1 m/s counts as 10 m and 1 rad as 50 m
                 (0.5 m/s) and heading (3 deg)
================ =========================================== ==========================================================

Detection leaves a measurement out of the filter where the agent says that it is faulty. In every task the filter runs
on what the agent decides, and the observation of the next step shows what has come of it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from math import radians
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from simnav.types import Array

from .bank import set_scales
from .features import LARGEST_SCALE

if TYPE_CHECKING:
    from gymnasium import spaces

__all__ = ["CORRECTIONS", "TASKS", "Correction", "Decision", "Detection", "Task", "Tuning"]

#: Largest correction: north, east, down [m], velocity [m/s], heading [rad].
CORRECTIONS = np.array([10.0, 10.0, 10.0, 0.5, 0.5, 0.5, radians(3.0)])


class Decision:
    """The decisions of b agents about p instruments of at most K measurements a step, as the kernels take them.

    Attributes
    ----------
    scale : (b, p, K) array
        Factors on the sigma; 0: the measurement is left out.
    process_scale : (b,) array
        Factor on the sigma of the process noise.
    correction : (b, 7) array
        What is added to the plain filter's estimate.
    setting : (b, p) array
        Logarithm of the factor over that of `simnav.estimators.learning.features.LARGEST_SCALE`.
    """

    def __init__(self, b: int, p: int, most: int):
        self.scale, self.process_scale = np.ones((b, p, most)), np.ones(b)
        self.correction, self.setting = np.zeros((b, 7)), np.zeros((b, p))


class Task(ABC):
    """A task: the actions and their meaning.

    Parameters
    ----------
    instruments : list of str
        The instruments for which the agent decides.
    most : int
        Largest number K of measurements of an instrument in a step.
    """

    name: ClassVar[str]
    version: ClassVar[int] = 1
    rewards: ClassVar[tuple[str, ...]]

    def __init__(self, instruments: list[str], most: int):
        self.instruments, self.most = instruments, most

    @abstractmethod
    def action_space(self) -> spaces.Space[Any]:
        """Of one agent."""

    @abstractmethod
    def decide(self, actions: Array, decision: Decision) -> None:
        """Fill in the decisions of b agents; actions beyond their bounds are clipped to them."""


def _box(size: int) -> spaces.Box:
    """The numbers in [-1, 1]. Only an environment asks; an estimator with a trained policy imports no Gymnasium."""
    from gymnasium import spaces

    return spaces.Box(-1.0, 1.0, (size,), dtype=np.float32)


class Tuning(Task):
    """How noisy each instrument is, and the motion of the vessel."""

    name = "Tuning"
    rewards = ("error", "gain", "likelihood")

    def action_space(self) -> spaces.Box:
        """``Box(-1, 1, (k + 1,), float32)``."""
        return _box(len(self.instruments) + 1)

    def decide(self, actions: Array, decision: Decision) -> None:
        """See the module."""
        set_scales(actions, LARGEST_SCALE, decision.setting, decision.scale, decision.process_scale)


class Detection(Task):
    """Which measurements are faulty."""

    name = "Detection"
    rewards = ("labels",)

    def action_space(self) -> spaces.MultiBinary:
        """``MultiBinary(k K)``."""
        from gymnasium import spaces

        return spaces.MultiBinary(len(self.instruments) * self.most)

    def decide(self, actions: Array, decision: Decision) -> None:
        """See the module."""
        decision.scale[:] = 1.0 - (actions != 0).reshape(decision.scale.shape)


class Correction(Task):
    """What is to be added to the plain filter's estimate."""

    name = "Correction"
    rewards = ("improvement",)

    def action_space(self) -> spaces.Box:
        """``Box(-1, 1, (7,), float32)``."""
        return _box(len(CORRECTIONS))

    def decide(self, actions: Array, decision: Decision) -> None:
        """See the module."""
        decision.correction[:] = np.clip(actions, -1.0, 1.0) * CORRECTIONS


#: By name.
TASKS: dict[str, type[Task]] = {task.name: task for task in (Tuning, Detection, Correction)}
