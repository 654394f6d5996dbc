"""Guidance: an agent steers a vessel by an estimate, along a track, through a channel or to a dock.

The track is the one that the scenario's manoeuvres plan (`simnav.world.track.PlannedTrack`). A navigator (the plain
filter, or any estimator) runs on what the instruments deliver; the agent sees its estimate and never the truth, and the
vessel goes where the agent steers it, so that an error of the estimate becomes an error of the track.

Action: two numbers in [-1, 1], clipped. The first is the heading that is steered, as the navigator believes it, less
the planned one (ahead by the time that the vessel needs to answer), over `LARGEST_TURN`. The second, a, is the speed
through the water: ``1 + a / 2`` times the planned one. 0, 0 is the planned heading and speed. An agent does not steer
the depth: the vessel dives and surfaces by itself, as planned for the point of the track nearest to the estimate.

Observation, float32, clipped to +-`LIMIT`, all as estimated:

============ ==========================================================================================================
number       what it is
============ ==========================================================================================================
0            distance to starboard of the track over `ASIDE`
1, 2         sine and cosine of the course over ground less the course of the track
3, 4, 5      change of the course of the track 10, 30 and 60 s ahead [rad]
6, 7, 8      speed over ground, planned speed, over `SPEED`; turn rate over `TURN_RATE`
9, 10        decimal logarithm of the sigmas of position [m] and of heading over 1 deg
11           ``ln(1 + seconds since the last fix)``
12           ``ln(1 + metres left of the track)`` over 5
13           half the width of the channel over `ASIDE`; 1 without one
14, 15       decimal logarithm of the sigmas at the start, of position [m] and of heading over 1 deg
============ ==========================================================================================================

Reward of a step of dt seconds: ``dt * (progress - |aside| / ASIDE - FUEL * (speed / planned)^3)``, with progress along
the track over the planned one, at most 1, and the true distance from the track, which is clipped at 10 `ASIDE`. In a
channel a vessel that touches the side ends the episode at -`AGROUND`. At a dock the last step adds ``BERTH exp(-(d / 10
m)^2 - (v / 0.5 m/s)^2)`` for the distance d to the end of the track and the speed v.
"""

from __future__ import annotations

from math import atan2, inf
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from simnav.environment.charted import ChartedEnv
from simnav.environment.rendering import Chart
from simnav.estimator import Estimator, make
from simnav.scenario import Scenario, load
from simnav.simulation.simulator import Simulator
from simnav.simulation.steps import SteppedRuns
from simnav.structures import filled, length
from simnav.types import KINDS, Array
from simnav.world import KinematicVessel, motion

from .environment import check_counts, run_seed
from .features import LIMIT, Numbers
from .filters import checked_actions
from .guidance_kernels import ASIDE, BERTH, LARGEST_TURN, SIZE, TALLY, Commands, Route, judge, look, steer
from .navigators import Navigators
from .routes import Routes

__all__ = ["GuidanceEnv", "GuidanceOptions", "GuidanceScores", "GuidedVoyages", "LineOfSight"]

ROUTES = ("track", "channel", "dock")


class GuidanceScores(NamedTuple):
    """The scores of a voyage, from the true track.

    Attributes
    ----------
    cross_track : float
        RMS of the distance from the track [m].
    clearance : float
        Smallest distance to the sides of the channel [m]; inf without a channel.
    fuel : float
        Fuel as a ratio to the planned voyage: mean of the cube of speed over planned speed.
    aground : bool
        Whether the vessel touched the side of the channel.
    """

    cross_track: float
    clearance: float
    fuel: float
    aground: bool


class GuidanceOptions:
    """The common options of the environment of one voyage and of the vector form.

    Parameters
    ----------
    scenario : Scenario, str or path
        A simulated scenario, its name in the catalogue, or a TOML file.
    route : {"track", "channel", "dock"}
        Kind of the route, which decides the reward.
    half_width : float
        Half the width of the channel [m].
    navigator : Estimator or str, optional
        An estimator or its name; by default the plain filter of ``ekf``, or ``ship-ekf`` without an IMU.
    steps : int, optional
        Number of steps of an episode; None: the whole run.
    voyages : int, optional
        Number of training voyages (`simnav.environment.seeds`); None: the seed of a reset is the seed of the run.
    reveal_truth : bool
        True: ``info`` holds the truth and the distance from the track.

    Raises
    ------
    ValueError
        If an argument is not valid, or the scenario is a recorded log, which cannot be steered.
    """

    def __init__(
        self,
        scenario: Scenario | str | Path,
        route: str,
        half_width: float,
        navigator: Estimator | str | None,
        steps: int | None,
        voyages: int | None,
        reveal_truth: bool,
    ):
        scenario = load(scenario) if isinstance(scenario, (str, Path)) else scenario
        if scenario.recorded:
            raise ValueError(f"scenario {scenario.id} is a recorded log: its vessel cannot be steered")
        for vessel in (s.craft for s in scenario.extremes()):
            if not isinstance(vessel, KinematicVessel):
                raise ValueError(
                    f"scenario {scenario.id}: a vessel of kind {vessel.kind!r} takes no commands; "
                    "guidance needs a vessel of simnav, like vessel.kind = 'ship'"
                )
        if route not in ROUTES:
            raise ValueError(f"route is one of {', '.join(ROUTES)}, not {route!r}")
        if not half_width > 0.0:
            raise ValueError(f"half_width = {half_width!r} m should be positive")
        check_counts(steps=steps, voyages=voyages)
        self.scenario, self.route, self.half_width, self.steps = scenario, route, half_width, steps
        self.voyages, self.reveal_truth = voyages, reveal_truth
        if isinstance(navigator, str):
            navigator = make(navigator)
        if navigator is not None and navigator.reference:
            raise ValueError(f"navigator {navigator.name!r} is a reference that is told the truth")
        self.navigator = navigator
        self.observation_space = spaces.Box(-LIMIT, LIMIT, (SIZE,), dtype=np.float32)
        self.action_space = spaces.Box(-1.0, 1.0, (2,), dtype=np.float32)


class GuidedVoyages:
    """n voyages that are steered side by side: world, instruments, faults, filters and scores in compiled passes.

    Parameters
    ----------
    options : GuidanceOptions
        Scenario, route and navigator of the voyages.
    navigators : list of Estimator, optional
        One of each voyage's own; by default the plain filter.

    Attributes
    ----------
    runs : SteppedRuns
        World, instruments and faults of the voyages.
    navigators : Navigators
        The plain filters of the voyages.
    observation : (n, 16) float32 array
        What the agents saw last.
    aside : (n,) array
        True distance to starboard of the track at the end of the last step [m].
    """

    def __init__(self, options: GuidanceOptions, n: int, navigators: list[Estimator] | None = None):
        self.options, self.n, self._own = options, n, navigators
        self.runs = SteppedRuns(n)
        self.navigators = Navigators(self.runs)
        self._routes = Routes(n)
        self._at, self._true_at, self._ahead = (np.zeros(n, np.int64) for _ in range(3))
        self._steps, self._dt = np.zeros(n, np.int64), np.zeros(n)
        self._notes, self._start, self._tally = np.zeros((n, 3)), np.zeros((n, 2)), np.zeros((n, length(TALLY)))
        self._fix = np.zeros((n, 1), np.bool_)
        self._commands = Commands(*(np.zeros(n) for _ in range(4)))
        self.aside, self._rewards, self._aground = np.zeros(n), np.zeros(n), np.zeros(n, np.bool_)
        self.observation = np.zeros((n, SIZE), np.float32)

    def begin(self, b: int, seed: int) -> dict[str, Any]:
        """Begin a voyage with the seed of a run; its info."""
        o, runs = self.options, self.runs
        scenario = o.scenario.drawn(seed)
        vessel = scenario.craft
        assert isinstance(vessel, KinematicVessel)  # `GuidanceOptions`
        self._routes.put(b, o.scenario, scenario)
        self._ahead[b] = round(2.0 * vessel.turn_time_constant)
        source = Simulator(scenario.model_copy(update={"manoeuvres": (), "world_seed": None}), seed)
        runs.begin(b, source)
        own = None if self._own is None else self._own[b]
        self.navigators.begin(b, source.start, source.instruments, own)
        fix = np.array([KINDS[kind].role == "fix" for kind in runs.kinds[b]], np.bool_)
        if len(fix) > self._fix.shape[1]:
            self._fix = np.pad(self._fix, ((0, 0), (0, len(fix) - self._fix.shape[1])))
        self._fix[b], self._fix[b, : len(fix)] = False, fix
        self._at[b] = self._true_at[b] = 0
        self._dt[b] = source.step
        epochs = int(source.duration / source.step + 1e-6)
        self._steps[b] = min(o.steps or epochs, epochs)
        self._notes[b], self._tally[b] = 0.0, filled(TALLY, clearance=inf)
        spread = self.navigators.spread[b]
        self._start[b] = spread[0] + spread[2], spread[3]
        return {"seed": seed, "start": source.start, "instruments": source.instruments}

    def look(self, active: NDArray[np.bool_]) -> None:
        """What the agents of some voyages see."""
        runs, spread = self.runs, self.navigators.spread
        variance = np.stack([spread[:, 0] + spread[:, 2], spread[:, 3]], axis=1)
        o = self.options
        look.unchecked(
            active, (runs.step, self.time, self._dt), (self.navigators.estimate, variance),
            runs.delivered, self._fix, self._routes.tracks,
            o.half_width if o.route == "channel" else ASIDE, (self._at, self._notes, self._start), self.observation,
        )  # fmt: skip

    @property
    def time(self) -> Array:
        """(n,) array: time of the last step's end [s]."""
        time: Array = self._dt * self.runs.step
        return time

    def step(self, active: NDArray[np.bool_], actions: Array) -> tuple[Array, NDArray[np.bool_], NDArray[np.bool_]]:
        """Steer some voyages for a step; rewards, who touched the side, and for whom it was the last step."""
        runs, tracks, o = self.runs, self._routes.tracks, self.options
        steer(
            active, actions, self._at, self._ahead, tracks, runs.truth, self.navigators.estimate,
            self._commands,
        )  # fmt: skip
        motion.command(active, runs.x, self._commands.wrong, self._commands.heading, self._commands.speed)
        dive = self._routes.dive(self._at)
        state = runs.x.view(motion.STATE)[:, 0]
        state["target_depth"][active], state["largest_path_angle"][active] = dive[active].T
        runs.advance(active)
        self.navigators.update(active)
        last = runs.step >= self._steps
        paces = self._dt, self._commands.planned, np.ascontiguousarray(state["speed"])
        route = Route(o.half_width if o.route == "channel" else inf, BERTH if o.route == "dock" else 0.0)
        judge.unchecked(
            (active, last), paces, runs.truth, tracks,
            route, self._true_at, self._tally,
            (self.aside, self._rewards, self._aground),
        )  # fmt: skip
        self.look(active)
        return self._rewards.copy(), self._aground.copy(), active & last & ~self._aground

    def scores(self, b: int) -> GuidanceScores:
        """What a voyage was worth so far."""
        own, n = self._tally[b].view(TALLY)[0], int(self.runs.step[b])
        offset, fuel = (own.squares.item() / n) ** 0.5, own.fuel.item() / n
        return GuidanceScores(offset, own.clearance.item(), fuel, bool(self._aground[b]))


class GuidanceEnv(ChartedEnv[Numbers, Numbers]):
    """Steer by the estimate (see the module).

    Parameters
    ----------
    scenario, route, half_width, navigator, steps, voyages, reveal_truth
        The options of the task, see `GuidanceOptions`.
    render_mode : {"human", "rgb_array"}, optional
        Show the chart in a window, or return it as an array; default: no chart.

    Notes
    -----
    Actions out of bounds are clipped to them; those of another shape, or not finite, are refused. The last ``info`` of
    an episode holds ``scores`` (`GuidanceScores`).

    Raises
    ------
    ValueError
        If an argument is not valid, or the scenario is a recorded log, which cannot be steered.
    """

    task: ClassVar[str] = "Guidance"

    def __init__(
        self,
        scenario: Scenario | str | Path,
        *,
        route: str = "track",
        half_width: float = 50.0,
        navigator: Estimator | str | None = None,
        steps: int | None = None,
        voyages: int | None = None,
        reveal_truth: bool = False,
        render_mode: str | None = None,
    ):
        super().__init__(render_mode)
        self.options = o = GuidanceOptions(scenario, route, half_width, navigator, steps, voyages, reveal_truth)
        self.scenario = o.scenario
        self.observation_space, self.action_space = o.observation_space, o.action_space
        self._voyages = GuidedVoyages(o, 1, None if o.navigator is None else [o.navigator])
        self._under_way = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Numbers, dict[str, Any]]:
        """Begin a voyage; the observation is of the start. The arguments as of `NavigationEnv.reset`."""
        super().reset(seed=seed)
        info = self._voyages.begin(0, run_seed(seed, self.np_random, self.options.voyages))
        self._under_way = True
        self._voyages.look(_ON)
        self._begin_chart(self.scenario.id, self.scenario.duration)
        return self._voyages.observation[0].copy(), info

    def step(self, action: Numbers) -> tuple[Numbers, float, bool, bool, dict[str, Any]]:
        """Steer for a step; return its reward and the next observation, from the navigator's estimate.

        Raises
        ------
        ValueError
            If the action has another shape or is not finite.
        gymnasium.error.ResetNeeded
            If the voyage is over or has not begun.
        """
        array = checked_actions(action, (2,), "an action of Guidance is")
        if not self._under_way:
            raise gymnasium.error.ResetNeeded("no voyage is under way: call reset() first")
        voyages = self._voyages
        (value,), (aground,), (last,) = voyages.step(_ON, array[None])
        info: dict[str, Any] = {}
        if self.options.reveal_truth:
            info = {"truth": voyages.runs.truth[0].reshape(3, 3).copy(), "aside": float(voyages.aside[0])}
        if self._chart is not None:
            self._draw(self._chart)
        if last or aground:
            info["scores"] = voyages.scores(0)
            self._under_way = False
        return voyages.observation[0].copy(), float(value), bool(aground), bool(last), info

    def _forget(self) -> None:
        self._under_way = False

    def _draw(self, chart: Chart) -> None:
        voyages = self._voyages
        runs, navigators = voyages.runs, voyages.navigators
        for j, who in enumerate(runs.who[0, : runs.count[0]].tolist()):
            if KINDS[runs.kinds[0][who]].role == "fix":
                chart.add_fixes(runs.value[0, j : j + 1, :2].copy(), runs.faults[0, j : j + 1] != 0)
        if np.isfinite(navigators.estimate[0, :2]).all():
            truth, position = runs.truth[0, :3].copy(), navigators.estimate[0, :3].copy()
            chart.add(float(voyages.time[0]), truth, position, covariance=navigators.covariance(0))
        self._show()


_ON = np.ones(1, np.bool_)


class LineOfSight:
    """A controller for `GuidanceEnv`: steers for a point of the track that is ahead, at the planned speed.

    Source: T. I. Fossen, *Handbook of Marine Craft Hydrodynamics and Motion Control*, Wiley 2011, section 10.3.

    Parameters
    ----------
    lookahead : float
        Distance along the track of the point that is steered for [m].
    """

    def __init__(self, lookahead: float = 60.0):
        self.lookahead = lookahead

    def __call__(self, observation: Numbers) -> Numbers:
        """The action."""
        aside = float(observation[0]) * ASIDE
        return np.array([-atan2(aside, self.lookahead) / LARGEST_TURN, 0.0], np.float32)
