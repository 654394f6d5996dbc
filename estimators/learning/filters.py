"""The filters of b agents: state, memory and decisions, around the kernels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from simnav.environment.sample_counts import most_samples
from simnav.estimator import UnsuitableScenario
from simnav.scenario import Scenario
from simnav.structures import length
from simnav.types import Array, InitialState, Instruments

from .bank import KEPT, Steps, observe, take
from .features import observation_size
from .reference import Linear, ReferenceFilter
from .rewards import REWARDS, StepResult
from .tasks import Decision, Task

__all__ = ["Filters", "Layout", "checked_actions", "layout_of", "layout_of_scenario"]


class Layout:
    """The instruments for which an agent decides, and their places in its observation.

    Parameters
    ----------
    watched : list of str
        The instruments that the plain filter uses in any run.
    kinds : list of str
        Kinds of the instruments for which the agent decides.
    names : list of str
        Names of these instruments.
    most : int
        Largest number of measurements of an instrument in a step.
    states : int
        Largest number of states of the filter.
    events : float
        Largest number of measurements of all instruments in a step.

    Attributes
    ----------
    place : (k,) int array
        Place of each watched instrument; -1 if the agent does not decide for it.
    size : int
        Length of the observation.
    """

    def __init__(self, watched: list[str], names: list[str], kinds: list[str], most: int, states: int, events: float):
        self.watched, self.names, self.kinds, self.most = watched, names, kinds, most
        self.states, self.events = states, events
        self.place = np.array([names.index(name) if name in names else -1 for name in watched], dtype=np.int64)
        self.size = observation_size(len(names), most)

    def periods(self, instruments: Instruments) -> Array:
        """(p,) array: nominal time between two measurements of each in a run [s]; 1 where it is not there."""
        return np.array([1.0 / instruments[name].rate if name in instruments else 1.0 for name in self.names])


def layout_of(runs: Sequence[Instruments], which: str, most: Sequence[Mapping[str, int]] | None = None) -> Layout:
    """The layout that holds the instruments of any run.

    Parameters
    ----------
    runs : sequence of Instruments
        Of all that a run may have.
    which : "all" or "fixes"
        Whom the agent is asked about: every instrument that the filter uses, or those that give a position.
    most : sequence of mapping, optional
        For each, most measurements of each instrument in one step; by default of its rate.

    Raises
    ------
    UnsuitableScenario
        If no filter fits the instruments, or one of them has channels.
    ValueError
        If there is nobody to be asked about.
    """
    if which not in ("all", "fixes"):
        raise ValueError(f"instruments is 'all' or 'fixes', not {which!r}")
    # Any start does: it is the instruments that decide on the states.
    start = InitialState(0.0, np.array([0.5, 0.5, 0.0]), np.zeros(3), np.zeros(3), np.eye(9))
    watched: dict[str, str] = {}
    names: dict[str, str] = {}
    room, states, events = 1, 0, 0.0
    for i, instruments in enumerate(runs):
        for sheet in instruments.values():
            if sheet.channels:
                raise UnsuitableScenario(
                    f"a learning task takes instruments without channels; {sheet.name!r} has the channels "
                    f"{', '.join(sheet.channels)}"
                )
        trial = ReferenceFilter(list(instruments))
        trial.reset(start, instruments)
        states = max(states, trial.model.size)
        events = max(events, instruments.step * sum(sheet.rate for sheet in instruments.values()))
        for name in trial.watched:
            sheet = instruments[name]
            watched.setdefault(name, sheet.kind)
            if which == "all" or sheet.role == "fix":
                names.setdefault(name, sheet.kind)
                by_rate = max(1, int(np.ceil(sheet.rate * instruments.step - 1e-6)))
                room = max(room, by_rate if most is None else most[i][name])
    if not names:
        raise ValueError("there is no instrument that gives a position; say instruments='all'")
    return Layout(list(watched), list(names), list(names.values()), room, states, events)


_layouts: dict[tuple[str, str], Layout] = {}


def layout_of_scenario(scenario: Scenario, which: str) -> Layout:
    """The layout for a scenario, whatever is drawn; that of a log has room for measurements that come late."""
    key = scenario.content_hash(), which
    if key not in _layouts:  # a family has hundreds of extremes
        possible = scenario.extremes()
        _layouts[key] = layout_of([s.instruments_sheet() for s in possible], which, [most_samples(s) for s in possible])
    return _layouts[key]


class Filters:
    """b filters, each with its own noise, over given linear problems.

    Parameters
    ----------
    task : Task
        The task of the agents.
    layout : Layout
        The instruments of the observation, and their places.
    reward : str
        Name of a reward of the task.
    b, n : int
        Number of filters, and number of states of each.

    Attributes
    ----------
    covariance, delta : (b, n, n), (b, n) array
        Covariances P of the filters, and differences from the plain filter.
    decision : Decision
        The last decisions of the agents.
    observation : (b, o) float32 array
        The last observations of the agents.
    """

    def __init__(self, task: Task, layout: Layout, reward: str, b: int, n: int):
        self.task, self.layout, self._reward = task, layout, REWARDS[reward]
        p = len(layout.names)
        self.covariance, self.delta = np.zeros((b, n, n)), np.zeros((b, n))
        self.memory = np.zeros((b, p, length(KEPT)))
        self.decision = Decision(b, p, layout.most)
        self.observation = np.zeros((b, layout.size), np.float32)
        self.rewards, self.period = np.zeros(b), np.ones((b, p))

    def begin(self, i: int, start_covariance: Array, period: Array) -> None:
        """Begin a voyage with the i-th filter; ``period`` as of `Layout.periods`."""
        n = len(start_covariance)
        self.covariance[i], self.delta[i], self.memory[i] = 0.0, 0.0, 0.0
        self.covariance[i, :n, :n], self.period[i] = start_covariance, period
        self.observation[i] = 0.0

    def observe(
        self,
        linear: Linear,
        first: NDArray[np.int64],
        last: NDArray[np.int64],
        end: Array,
        context: Array,
        active: NDArray[np.bool_],
    ) -> None:
        """Fill `observation` for the active filters; the arguments as of `simnav.estimators.learning.bank.observe`."""
        layout = self.layout.place, self.period, self.layout.most
        observe.unchecked(
            Steps(active, first, last), linear, end, context, layout, (self.covariance, self.delta, self.memory),
            self.observation,
        )  # fmt: skip

    def decide(self, actions: Array) -> None:
        """Take the decisions of all b agents."""
        self.task.decide(actions, self.decision)

    def step(
        self, linear: Linear, first: NDArray[np.int64], last: NDArray[np.int64], active: NDArray[np.bool_]
    ) -> None:
        """Take the active filters through a step, with what was decided."""
        decision = self.decision
        take.unchecked(
            Steps(active, first, last), linear, self.layout.place, decision.scale, decision.process_scale,
            self.covariance, self.delta,
        )  # fmt: skip
        self.memory.view(KEPT)["setting"][active, :, 0] = decision.setting[active]

    def reward(
        self,
        linear: Linear,
        first: NDArray[np.int64],
        last: NDArray[np.int64],
        active: NDArray[np.bool_],
        error: Array,
        oracle: Array,
        faulty: NDArray[np.bool_],
    ) -> Array:
        """(b,) array: what the step was worth; the arguments as of `simnav.estimators.learning.rewards.StepResult`."""
        decision = self.decision
        result = StepResult(
            steps=Steps(active, first, last),
            linear=linear,
            faulty=faulty,
            error=error,
            oracle=oracle,
            place=self.layout.place,
            scale=decision.scale,
            correction=decision.correction,
            covariance=self.covariance,
            delta=self.delta,
        )
        self._reward.unchecked(result, self.rewards)
        return self.rewards.copy()


def checked_actions(actions: object, shape: tuple[int, ...], what: str) -> Array:
    """Actions as an array; ValueError, in one sentence, where the shape is another or a number is not finite."""
    try:
        array = np.asarray(actions, dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"{what} an array of numbers of shape {shape}, not {actions!r}") from None
    if array.shape != shape:
        raise ValueError(f"{what} an array of shape {shape}, not {array.shape}")
    if not np.isfinite(array).all():
        raise ValueError(f"{what} finite, not {array.tolist()}")
    return array
