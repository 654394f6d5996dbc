"""The vector form of guidance: n voyages in compiled passes, from the world to the scores.

The numbers are those of `GuidanceEnv` (`simnav.estimators.learning.guidance`), bit for bit.
"""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode

from simnav.estimator import Estimator
from simnav.scenario import Scenario

from .batch import Decided, Flags, VoyagesVectorEnv
from .features import Numbers
from .guidance import GuidanceOptions, GuidedVoyages

__all__ = ["GuidanceVectorEnv"]


class GuidanceVectorEnv(VoyagesVectorEnv):
    """Steer n vessels by their estimates (`simnav.estimators.learning.guidance`).

    The plain inertial filters of all voyages run in one compiled pass. Other navigators, and those of vessels without
    an IMU, run one after the other.

    Parameters
    ----------
    scenario, route, half_width, navigator, steps, voyages, reveal_truth
        The options of the task, see `simnav.estimators.learning.guidance.GuidanceOptions`. Each voyage has a copy of
        the navigator.
    num_envs, autoreset_mode, independent_seeds, render_mode
        The options of a vector form, see `simnav.estimators.learning.batch.VoyagesVectorEnv`.
    """

    def __init__(
        self,
        scenario: Scenario | str | Path,
        num_envs: int = 1,
        *,
        route: str = "track",
        half_width: float = 50.0,
        navigator: Estimator | str | None = None,
        steps: int | None = None,
        voyages: int | None = None,
        reveal_truth: bool = False,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        independent_seeds: bool = False,
        render_mode: str | None = None,
    ):
        self.options = o = GuidanceOptions(scenario, route, half_width, navigator, steps, voyages, reveal_truth)
        super().__init__(
            "Guidance", num_envs, o.observation_space, o.action_space, autoreset_mode, independent_seeds, voyages,
            render_mode,
        )  # fmt: skip
        own = None if o.navigator is None else [copy.deepcopy(o.navigator) for _ in range(num_envs)]
        self._guided = GuidedVoyages(o, num_envs, own)

    def _begin_voyage(self, i: int, seed: int) -> dict[str, Any]:
        return self._guided.begin(i, seed)

    def _look(self, mask: Flags) -> None:
        self._guided.look(mask)

    def _observations(self) -> Numbers:
        return self._guided.observation

    def _decide(self, actions: Numbers, active: Flags) -> Decided:
        guided = self._guided
        rewards, aground, last = guided.step(active, actions)
        infos: dict[str, Any] = {}
        if self.options.reveal_truth:
            truth = guided.runs.truth.reshape(-1, 3, 3).copy()
            infos = {"truth": truth, "_truth": active.copy(), "aside": guided.aside.copy(), "_aside": active.copy()}
        for i in np.flatnonzero(active & (aground | last)).tolist():
            infos = self._add_info(infos, {"scores": guided.scores(i)}, i)
        return Decided(rewards, aground, last, infos)
