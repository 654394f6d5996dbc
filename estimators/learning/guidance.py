"""Guidance: an agent steers a vessel by an estimate, along a track, through a channel or to a dock.

The track is the one that the scenario's manoeuvres plan (`simnav.world.track.PlannedTrack`). A navigator (the plain
filter, or any estimator) runs on what the instruments deliver; the agent sees its estimate and never the truth, and the
vessel goes where the agent steers it, so that an error of the estimate becomes an error of the track.

Action: two numbers in [-1, 1], clipped. The first is the heading that is steered, as the navigator believes it, less
the planned one (ahead by the time that the vessel needs to answer), over `LARGEST_TURN`. The second, a, is the speed
through the water: ``1 + a / 2`` times the planned one. 0, 0 is the planned heading and speed.

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

from math import atan2, cos, exp, hypot, log1p, log10, pi, radians, remainder, sin, tau
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import gymnasium
import numpy as np
from gymnasium import spaces

from simnav.environment.charted import ChartedEnv
from simnav.environment.rendering import Chart
from simnav.estimator import Estimator, make
from simnav.estimators.learning.environment import run_seed
from simnav.estimators.learning.features import LIMIT, SPEED, TURN_RATE, Numbers
from simnav.estimators.learning.filters import checked_actions
from simnav.estimators.models.suitable import Suitable
from simnav.estimators.solvers.kalman import KalmanEstimator
from simnav.geometry.earth import relative_position
from simnav.recording import packets
from simnav.scenario import Scenario, load
from simnav.simulator import Simulator
from simnav.types import KINDS, Array, Estimate
from simnav.world import Vessel, World
from simnav.world.track import PlannedTrack

__all__ = ["GuidanceEnv", "GuidanceScores", "LineOfSight"]

#: Unit of the distance from the track [m], and largest change of heading [rad].
ASIDE, LARGEST_TURN = 20.0, radians(60.0)
#: Weights of the reward.
FUEL, AGROUND, BERTH = 0.2, 100.0, 100.0
ROUTES = ("track", "channel", "dock")
SIZE = 16


class GuidanceScores(NamedTuple):
    """What a voyage was worth, of the true track.

    Attributes
    ----------
    cross_track : float
        RMS of the distance from the track [m].
    clearance : float
        Least distance to the sides of the channel [m]; inf without one.
    fuel : float
        Of the planned voyage: mean of the cube of speed over planned speed.
    aground : bool
        Whether it touched the side.
    """

    cross_track: float
    clearance: float
    fuel: float
    aground: bool


class Route:
    """The planned track as a line of points, from a geodetic position to a place on it."""

    def __init__(self, track: PlannedTrack, duration: float):
        track.reach(duration)
        keep = np.concatenate([[True], np.hypot(*np.diff(track.points[:, :2], axis=0).T) > 0.05])
        self.position, self.points = track.position[keep], track.points[keep]
        steps = relative_position(self.position[1:], self.position[:-1])[:, :2]
        self.course = np.arctan2(steps[:, 1], steps[:, 0])
        self.course = np.append(self.course, self.course[-1:]) if len(steps) else np.array([track.points[0, 2]])
        self.along = np.concatenate([[0.0], np.cumsum(np.hypot(steps[:, 0], steps[:, 1]))])

    def place(self, position: Array, at: int) -> tuple[int, float, float]:
        """Nearest point within two minutes of one, the distance to starboard [m], and how far along [m]."""
        low, high = max(at - 20, 0), min(at + 120, len(self.points))
        offsets = relative_position(position, self.position[low:high])[:, :2]
        k = int(np.argmin(offsets[:, 0] ** 2 + offsets[:, 1] ** 2))
        at, (north, east), course = low + k, offsets[k].tolist(), float(self.course[low + k])
        ahead = north * cos(course) + east * sin(course)
        return at, east * cos(course) - north * sin(course), float(self.along[at]) + ahead

    def course_ahead(self, at: int, seconds: int) -> float:
        """Course of the track so many seconds after a point [rad]."""
        return float(self.course[min(at + seconds, len(self.course) - 1)])


class GuidanceEnv(ChartedEnv[Numbers, Numbers]):
    """Steer by the estimate (see the module).

    Parameters
    ----------
    scenario : Scenario, str or path
        A simulated scenario.
    route : {"track", "channel", "dock"}
        What is scored.
    half_width : float
        Of the channel [m].
    navigator : Estimator or str, optional
        An estimator or its name; by default the plain filter of ``ekf``, or ``ship-ekf`` without an IMU.
    steps : int, optional
        An episode ends after so many; None: with the run.
    voyages : int, optional
        Learn from so many training voyages (`simnav.environment.seeds`); None: the seed of a reset is the run's.
    reveal_truth : bool
        Put the truth and the distance from the track into ``info``.
    render_mode : {"human", "rgb_array"}, optional

    Notes
    -----
    The last ``info`` of an episode holds ``scores`` (`GuidanceScores`).

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
        scenario = load(scenario) if isinstance(scenario, (str, Path)) else scenario
        if scenario.recorded or scenario.start is None:
            raise ValueError(f"scenario {scenario.id} is a recorded log: its vessel cannot be steered")
        if route not in ROUTES:
            raise ValueError(f"route is one of {', '.join(ROUTES)}, not {route!r}")
        if not half_width > 0.0:
            raise ValueError(f"half_width = {half_width!r} m should be positive")
        for name, value in (("steps", steps), ("voyages", voyages)):
            if value is not None and (isinstance(value, bool) or not isinstance(value, int) or value < 1):
                raise ValueError(f"{name} is a positive integer or None, not {value!r}")
        self.scenario, self.route, self.half_width, self.steps = scenario, route, half_width, steps
        self.voyages, self.reveal_truth = voyages, reveal_truth
        if isinstance(navigator, str):
            navigator = make(navigator)
        self.navigator: Estimator = KalmanEstimator(Suitable()) if navigator is None else navigator
        if self.navigator.reference:
            raise ValueError(f"navigator {self.navigator.name!r} is a reference that is told the truth")
        self._fixes: set[str] = set()
        self.observation_space = spaces.Box(-LIMIT, LIMIT, (SIZE,), dtype=np.float32)
        self.action_space = spaces.Box(-1.0, 1.0, (2,), dtype=np.float32)
        self._source: Simulator | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Numbers, dict[str, Any]]:
        """Begin a voyage; the observation is of the start. The arguments as of `NavigationEnv.reset`."""
        super().reset(seed=seed)
        run = run_seed(seed, self.np_random, self.voyages)
        scenario = self.scenario.drawn(run)
        assert scenario.start is not None
        vessel = scenario.vessel or Vessel()
        planned = World.plan(scenario.start, vessel, scenario.manoeuvres, scenario.current)
        self._route = Route(planned, scenario.duration)
        self._ahead = round(2.0 * vessel.turn_time_constant)
        adrift = scenario.model_copy(update={"manoeuvres": (), "world_seed": None})
        self._source = source = Simulator(adrift, run)
        self.navigator.reset(source.start, source.instruments)
        self._fixes = {sheet.name for sheet in source.instruments.of_role("fix")}
        start, truth = source.start, source.initial_truth
        self._truth = np.stack([truth.position[0], truth.velocity[0], truth.attitude[0]])
        self._estimate = Estimate(0.0, start.position, start.velocity, start.attitude, start.covariance)
        self._start = np.diag(start.covariance)
        self._at = self._true_at = self._k = 0
        self._turn, self._last_fix, self._along = 0.0, 0.0, 0.0
        self._squares, self._fuel, self._clearance = 0.0, 0.0, np.inf
        self._begin_chart(self.scenario.id, self.scenario.duration)
        info: dict[str, Any] = {"seed": run, "start": start, "instruments": source.instruments}
        return self._observe(), info

    def step(self, action: Numbers) -> tuple[Numbers, float, bool, bool, dict[str, Any]]:
        """Steer for a step; get its reward and what the navigator then believes.

        Raises
        ------
        ValueError
            If the action has another shape or is not finite.
        gymnasium.error.ResetNeeded
            If the voyage is over or has not begun.
        """
        turn, haste = np.clip(checked_actions(action, (2,), "an action of Guidance is"), -1.0, 1.0).tolist()
        source = self._source
        if source is None:
            raise gymnasium.error.ResetNeeded("no voyage is under way: call reset() first")
        planned = float(self._route.points[self._at, 3])
        attitude = self._estimate.attitude
        if attitude is not None:
            source.world.believe(remainder(float(attitude[2] - self._truth[2, 2]), tau))
        heading = self._steered(turn)
        source.world.command(heading, planned * (1.0 + 0.5 * haste))
        dt = source.step
        block = source.advance(min(source.time + dt, source.duration))
        truth = block.truth
        self._truth = np.stack([truth.position[-1], truth.velocity[-1], truth.attitude[-1]])
        (packet,) = packets(block, truth.time)
        before = self._estimate
        self._estimate = self.navigator.update(packet)
        self._noticed(before, packet.aids, dt)
        value, aground, aside = self._worth(dt, planned, float(source.world.track[3]))
        self._k += 1
        last = self._k == (self.steps or self.scenario.epochs) or source.time + 0.5 * dt > source.duration
        if last and self.route == "dock":
            value += BERTH * exp(-((self._left() / 10.0) ** 2) - (float(np.hypot(*self._truth[1, :2])) / 0.5) ** 2)
        info: dict[str, Any] = {"truth": self._truth, "aside": aside} if self.reveal_truth else {}
        if self._chart is not None:
            self._draw(self._chart, block, truth.time[-1])
        if last or aground:
            n = self._k
            info["scores"] = GuidanceScores((self._squares / n) ** 0.5, self._clearance, self._fuel / n, aground)
            self._source = None
        return self._observe(), value, aground, last and not aground, info

    def _forget(self) -> None:
        self._source = None

    # ---------------------------------------------------------------------------------------------- the voyage

    def _steered(self, turn: float) -> float:
        """Heading that is steered: the planned one, a few seconds ahead, and what the agent adds."""
        points = self._route.points
        return float(points[min(self._at + self._ahead, len(points) - 1), 2]) + LARGEST_TURN * turn

    def _noticed(self, before: Estimate, aids: Any, dt: float) -> None:
        if before.attitude is not None and self._estimate.attitude is not None:
            self._turn = remainder(float(self._estimate.attitude[2] - before.attitude[2]), tau) / dt
        for m in aids:
            if m.instrument in self._fixes:
                self._last_fix = m.time

    def _worth(self, dt: float, planned: float, speed: float) -> tuple[float, bool, float]:
        """Reward, whether she touched the side, and the true distance from the track."""
        self._true_at, aside, along = self._route.place(self._truth[0], self._true_at)
        progress = min((along - self._along) / (max(planned, 0.1) * dt), 1.0)
        self._along = along
        burnt = (speed / max(planned, 0.1)) ** 3
        self._squares += aside * aside
        self._fuel += burnt
        value = dt * (progress - min(abs(aside) / ASIDE, 10.0) - FUEL * burnt)
        aground = False
        if self.route == "channel":
            self._clearance = min(self._clearance, self.half_width - abs(aside))
            aground = self._clearance <= 0.0
        return value - AGROUND * aground, aground, aside

    def _left(self) -> float:
        """Distance to the end of the track [m]."""
        offset = relative_position(self._truth[0], self._route.position[-1])
        return hypot(offset[0], offset[1])

    def _observe(self) -> Numbers:
        e, route = self._estimate, self._route
        position = self._truth[0] * np.nan if e.position is None else e.position
        if np.isfinite(position[:2]).all():
            self._at, aside, along = route.place(np.nan_to_num(position), self._at)
        else:
            aside, along = 0.0, float(route.along[self._at])
        velocity = np.zeros(3) if e.velocity is None else e.velocity
        course = route.course_ahead(self._at, 0)
        over_ground = atan2(float(velocity[1]), float(velocity[0])) - course
        speed = hypot(velocity[0], velocity[1])
        variance = np.ones(9) if e.covariance is None else np.diag(e.covariance)
        ahead = [remainder(route.course_ahead(self._at, k) - course, tau) for k in (10, 30, 60)]
        numbers = [
            aside / ASIDE, sin(over_ground), cos(over_ground), *ahead, speed / SPEED,
            float(route.points[self._at, 3]) / SPEED, self._turn / TURN_RATE,
            _sigma(variance[0] + variance[1], 1.0), _sigma(variance[8], pi / 180.0),
            log1p(max(e.time - self._last_fix, 0.0)), log1p(max(float(route.along[-1]) - along, 0.0)) / 5.0,
            self.half_width / ASIDE if self.route == "channel" else 1.0,
            _sigma(self._start[0] + self._start[1], 1.0), _sigma(self._start[8], pi / 180.0),
        ]  # fmt: skip
        observation: Numbers = np.clip(np.nan_to_num(np.array(numbers)), -LIMIT, LIMIT).astype(np.float32)
        return observation

    def _draw(self, chart: Chart, block: Any, time: float) -> None:
        for stream in block.aids.values():
            if KINDS[stream.kind].role == "fix":
                chart.add_fixes(stream.value[:, :2], stream.faults != 0)
        e = self._estimate
        if e.position is not None:
            covariance = None if e.covariance is None else e.covariance[:2, :2]
            chart.add(time, self._truth[0], e.position, covariance=covariance)
        self._show()


class LineOfSight:
    """A controller for `GuidanceEnv`: steers for a point of the track that is ahead, at the planned speed.

    Source: T. I. Fossen, *Handbook of Marine Craft Hydrodynamics and Motion Control*, Wiley 2011, section 10.3.

    Parameters
    ----------
    lookahead : float
        [m].
    """

    def __init__(self, lookahead: float = 60.0):
        self.lookahead = lookahead

    def __call__(self, observation: Numbers) -> Numbers:
        """The action."""
        aside = float(observation[0]) * ASIDE
        return np.array([-atan2(aside, self.lookahead) / LARGEST_TURN, 0.0], np.float32)


def _sigma(variance: float, unit: float) -> float:
    """Decimal logarithm of a sigma in a unit."""
    return 0.5 * log10(max(float(variance), 1e-18)) - log10(unit)
