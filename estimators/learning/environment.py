"""The tasks around a running filter as Gymnasium environments, one voyage at a time.

An episode of n steps, from reset to truncation::

    observation, info = env.reset(seed=7)       # innovations of step 1, before any of its measurements is used
    while not truncated:
        action = agent(observation)             # how the filter is to take them
        observation, reward, terminated, truncated, info = env.step(action)

`simnav.estimators.learning.features` describes the observations, and `simnav.estimators.learning.tasks` the actions and
rewards.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from simnav.environment.charted import ChartedEnv
from simnav.environment.rendering import Chart
from simnav.environment.seeds import training_seed
from simnav.geometry.earth import displace
from simnav.scenario import Scenario, load
from simnav.types import KINDS

from .features import LIMIT, Numbers
from .filters import Filters, checked_actions, layout_of_scenario
from .rewards import NEED_ORACLE
from .tasks import TASKS, Task
from .voyage import Voyage

__all__ = ["FilterTaskEnv", "TaskOptions", "check_counts", "run_seed"]

_ON = np.ones(1, np.bool_)


class TaskOptions:
    """The common options of the environment of one voyage and of the vector form.

    Parameters
    ----------
    scenario : Scenario, str or path
        A scenario, its name in the catalogue, or a TOML file.
    task : str
        Name of the task, one of `simnav.estimators.learning.tasks.TASKS`.
    reward : str, optional
        Name of a reward of the task; by default its first one.
    instruments : "all" or "fixes"
        The instruments for which the agent decides: all that the filter uses, or those that give a position.
    steps : int, optional
        Number of steps of an episode; None: the whole run.
    voyages : int, optional
        Number of training voyages (`simnav.environment.seeds`): each reset draws one of them. None: the seed of a reset
        is the seed of its run.
    reveal_truth : bool
        True: ``info`` holds the truth, and the horizontal errors of the filter and of the oracle.

    Raises
    ------
    ValueError
        If an argument is not valid.
    simnav.UnsuitableScenario
        If no filter fits the instruments.
    """

    def __init__(
        self,
        scenario: Scenario | str | Path,
        task: str,
        reward: str | None,
        instruments: str,
        steps: int | None,
        voyages: int | None,
        reveal_truth: bool,
    ):
        if task not in TASKS:
            raise ValueError(f"task is one of {', '.join(TASKS)}, not {task!r}")
        check_counts(steps=steps, voyages=voyages)
        self.scenario = load(scenario) if isinstance(scenario, (str, Path)) else scenario
        self.steps, self.voyages, self.reveal_truth = steps, voyages, reveal_truth
        self.layout = layout_of_scenario(self.scenario, instruments)
        self.task: Task = TASKS[task](self.layout.names, self.layout.most)
        self.reward = self.task.rewards[0] if reward is None else reward
        if self.reward not in self.task.rewards:
            raise ValueError(f"the reward of {task} is one of {', '.join(self.task.rewards)}, not {reward!r}")
        self.observation_space = spaces.Box(-LIMIT, LIMIT, (self.layout.size,), dtype=np.float32)
        self.action_space = self.task.action_space()
        assert self.action_space.shape is not None
        self.action_shape = self.action_space.shape

    @property
    def oracle(self) -> bool:
        """Whether the oracle must run, too."""
        return self.reward in NEED_ORACLE or self.reveal_truth


def check_counts(**counts: object) -> None:
    """ValueError, with the name, where one is neither None nor a positive integer."""
    for name, value in counts.items():
        if value is not None and (isinstance(value, bool) or not isinstance(value, int) or value < 1):
            raise ValueError(f"{name} is a positive integer or None, not {value!r}")


def run_seed(seed: int | None, rng: np.random.Generator, voyages: int | None) -> int:
    """The seed of the run that a reset begins."""
    if voyages is not None:
        return training_seed(int(rng.integers(voyages)))
    return int(rng.integers(2**63 - 1)) if seed is None else int(seed)


class FilterTaskEnv(ChartedEnv[Numbers, Numbers]):
    """One of the tasks of `simnav.estimators.learning.tasks`, over one voyage at a time.

    Parameters
    ----------
    scenario, task, reward, instruments, steps, voyages, reveal_truth
        The options of the task, see `TaskOptions`.
    render_mode : {"human", "rgb_array"}, optional
        Show the chart in a window, or return it as an array; default: no chart.

    Notes
    -----
    Actions out of bounds are clipped to them; those of another shape, or not finite, are refused.
    """

    def __init__(
        self,
        scenario: Scenario | str | Path,
        task: str = "Tuning",
        *,
        reward: str | None = None,
        instruments: str = "all",
        steps: int | None = None,
        voyages: int | None = None,
        reveal_truth: bool = False,
        render_mode: str | None = None,
    ):
        super().__init__(render_mode)
        self.options = TaskOptions(scenario, task, reward, instruments, steps, voyages, reveal_truth)
        self.observation_space, self.action_space = self.options.observation_space, self.options.action_space
        self._voyage: Voyage | None = None
        self._filters: Filters | None = None
        self._first, self._last = np.zeros(1, np.int64), np.zeros(1, np.int64)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Numbers, dict[str, Any]]:
        """Begin a voyage.

        Parameters
        ----------
        seed : int, optional
            Of the run, or, with ``voyages``, of the draws of training voyages.
        options : dict, optional
            None is known; ignored.

        Returns
        -------
        observation : (o,) float32 array
            What the agent sees at the start: o features.
        info : dict
            ``seed`` of the run, ``start`` and ``instruments``.
        """
        super().reset(seed=seed)
        o = self.options
        run = run_seed(seed, self.np_random, o.voyages)
        scenario = o.scenario
        self._voyage = voyage = Voyage(scenario, run, o.layout.watched, o.steps, oracle=o.oracle)
        n = voyage.filter.model.size
        self._filters = Filters(o.task, o.layout, o.reward, 1, n)
        self._filters.begin(0, voyage.filter.start_covariance, o.layout.periods(voyage.recording.instruments))
        self._begin_chart(scenario.id, scenario.duration)
        voyage.advance()
        recording = voyage.recording
        info = {"seed": run, "start": recording.start, "instruments": recording.instruments}
        return self._observe(voyage, self._filters), info

    def step(self, action: Numbers) -> tuple[Numbers, float, bool, bool, dict[str, Any]]:
        """Decide on the step that was observed; get its reward and the next observation.

        Raises
        ------
        ValueError
            If the action has another shape or is not finite.
        gymnasium.error.ResetNeeded
            If the voyage is over or has not begun.
        """
        o = self.options
        array = checked_actions(action, o.action_shape, f"an action of {o.task.name} is")
        voyage, filters = self._voyage, self._filters
        if voyage is None or filters is None:
            raise gymnasium.error.ResetNeeded("no voyage is under way: call reset() first")
        linear = voyage.filter.linear
        filters.decide(array[None])
        filters.step(linear, self._first, self._last, _ON)
        error, oracle = voyage.error[None], voyage.oracle[None]
        value = filters.reward(linear, self._first, self._last, _ON, error, oracle, voyage.faulty)
        info = {}
        if o.reveal_truth:
            correction = filters.decision.correction[0]
            north, east = error[0, :2] + filters.delta[0, :2] + correction[:2]
            info = {
                "truth": voyage.truth, "error": float(np.sqrt(north * north + east * east)),
                "oracle_error": float(oracle[0, 0]),
            }  # fmt: skip
        if self._chart is not None:
            self._draw(self._chart, voyage, filters)
        if voyage.advance():
            return self._observe(voyage, filters), float(value[0]), False, False, info
        self._voyage = None
        return np.zeros(o.layout.size, np.float32), float(value[0]), False, True, info

    def _forget(self) -> None:
        self._voyage = None

    def _observe(self, voyage: Voyage, filters: Filters) -> Numbers:
        self._last[0] = voyage.filter.count
        end = np.array([voyage.estimate.time])
        filters.observe(voyage.filter.linear, self._first, self._last, end, voyage.context[None], _ON)
        observation: Numbers = filters.observation[0].copy()
        return observation

    def _draw(self, chart: Chart, voyage: Voyage, filters: Filters) -> None:
        position = voyage.estimate.position
        if position is None:
            return
        linear, data = voyage.filter.linear, voyage.recording.data
        for e in range(voyage.filter.count):
            name = self.options.layout.watched[linear.instrument[e]] if linear.size[e] else ""
            if name and KINDS[data.aids[name].kind].role == "fix":
                stream = data.aids[name]
                k = min(int(np.searchsorted(stream.time, linear.time[e] - 1e-9)), len(stream.time) - 1)
                chart.add_fixes(stream.value[k : k + 1, :2], voyage.faulty[e : e + 1])
        shift = np.array([*filters.delta[0, :2], 0.0]) + filters.decision.correction[0, :3]
        chart.add(
            voyage.estimate.time, voyage.truth[0], displace(position, shift), covariance=filters.covariance[0, :2, :2]
        )
        self._show()
