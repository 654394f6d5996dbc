"""The Gymnasium environment: the agent is the navigator.

An observation holds the measurements of one step, the action is the navigation estimate at the end of the step, and the
reward is minus the error of that estimate. `NavigationEnv` is an adapter over the same sources of data that every
campaign uses; `EstimatorAgent` makes an agent of an estimator.

One episode of n steps, from reset to truncation::

    observation, info = env.reset(seed=7)       # the measurements of step 1; info: initial state, datasheets
    while not truncated:
        action = agent(observation)             # the estimate at observation["interval"][1]
        observation, reward, terminated, truncated, info = env.step(action)

so that every step is estimated and scored exactly once; the observation that comes with the truncation is empty.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from simnav.arrivals import Arrivals
from simnav.environment.charted import ChartedEnv
from simnav.environment.observed_steps import ClosedLoopSteps, ObservedSteps, horizontal, pack, rows_of
from simnav.environment.sample_counts import places_of
from simnav.geometry.rotation import dcm_from_rpy, rotation_vector_from_dcm
from simnav.types import Array, InitialState

if TYPE_CHECKING:
    from simnav.environment.rendering import Chart
    from simnav.scenario import Scenario
    from simnav.simulation.steps import SteppedRuns

__all__ = ["REWARDS", "NavigationEnv", "Observation", "checked_action"]

Observation = dict[str, Any]

#: What a reward can weigh: horizontal and vertical position error and its 3-D norm [m], norm of the velocity error
#: [m/s], angle of the attitude error [rad].
REWARDS: tuple[str, ...] = ("horizontal", "vertical", "position", "velocity", "attitude")

#: Bound of every observed quantity. Gymnasium requires finite bounds; no instrument reaches this value.
_LIMIT = 1e9
_ACTION_LIMIT = np.array([[np.pi / 2, np.pi, 1e5], [100.0, 100.0, 100.0], [np.pi, np.pi, 2 * np.pi]])

# The source is advanced this many steps ahead, doubling as the episode goes on: short episodes start at once, long
# ones spread the fixed cost of a block over many steps. The data are the same whatever the blocks (bit for bit).
_FEWEST_AHEAD, _MOST_AHEAD = 8, 256


class NavigationEnv(ChartedEnv[Observation, Array]):
    """Navigate one scenario.

    Observation (`gymnasium.spaces.Dict`, float64). Entries are zero if ``valid`` is 0, and never NaN. K is the largest
    number of samples in one step:

    ========================= ============ ==========================================================
    entry                     shape
    ========================= ============ ==========================================================
    ``interval``              (2,)         begin and end of the step [s]
    ``imu`` ``time``          (K,)         ends of the sample intervals [s]
    ``imu`` ``length``        (K,)         their lengths [s]
    ``imu`` ``valid``         (K,) int8    1 where there is a sample
    ``imu`` ``angular_rate``  (K, 3)       mean over the interval, body axes [rad/s]
    ``imu`` ``specific_force`` (K, 3)      likewise [m/s^2]
    *name* ``time``           (K,)         times of validity of the instrument's measurements [s]
    *name* ``valid``          (K,) int8
    *name* ``value``          (K, d)       components of ``KINDS[kind].values`` [SI, rad]
    *name* ``side``           (K, s)       components of ``KINDS[kind].side_names`` [SI, rad], if there are any
    ========================= ============ ==========================================================

    An instrument with c channels (``Datasheet.channels``) has a fixed slot for each of them at each of the k times of a
    step, K = k c: the reading of channel j at the i-th time is entry i c + j, and ``valid`` says whether there is one.

    Action: (3, 3) array, the estimate at the end of the interval: row 0 latitude [rad], longitude [rad], height [m];
    row 1 velocity north, east, down [m/s]; row 2 roll, pitch, yaw [rad]. Any finite estimate is taken; the bounds of
    the space are for sampling.

    Reward: minus the error, by default the horizontal position error in metres. Quantities that the reference of a log
    does not hold are left out. ``terminated`` is never true; ``truncated`` is true with the last step of the run.

    Info: `reset` gives ``seed`` (of the run: `simnav run --seed` repeats it), ``start`` (`InitialState`, with its
    errors and their covariance), ``instruments`` (`Instruments`, the datasheets) and ``note`` (of a log). With
    ``reveal_truth`` every info holds ``truth``, the (3, 3) array of the true states at the end of the step of the
    observation (NaN for quantities that the reference of a log does not hold).

    Parameters
    ----------
    scenario : Scenario, str or path
        A scenario, its name in the catalogue, or a TOML file.
    reward : str or mapping of str to float
        Error measure of the reward, one of `REWARDS`, or weights of several of them.
    reveal_truth : bool
        True: ``info`` holds the truth.
    closed_loop : bool
        True: the vessel steers by the position and heading of the estimate, so a wrong estimate takes it off its track.
        It steers for waypoints from the estimated position, and in all other manoeuvres it returns to the planned
        track. It works with simulated scenarios only.
    render_mode : {"human", "rgb_array"}, optional
        Show the chart in a window, or return it as an array; default: no chart.

    Raises
    ------
    ValueError
        If an argument is not valid.
    """

    def __init__(
        self,
        scenario: Scenario | str | Path,
        *,
        reward: str | Mapping[str, float] = "horizontal",
        reveal_truth: bool = False,
        closed_loop: bool = False,
        render_mode: str | None = None,
    ):
        if isinstance(scenario, (str, Path)):
            from simnav.scenario import load

            scenario = load(scenario)
        super().__init__(render_mode)
        if closed_loop and scenario.recorded:
            raise ValueError(
                f"scenario {scenario.id} is a recorded log: its vessel cannot steer by the estimate; "
                "leave closed_loop out"
            )
        # The spaces are fixed: they hold what any run of the scenario can bring.
        possible = scenario.extremes()
        if closed_loop:
            for vessel in (s.craft for s in possible):
                if not vessel.steered:
                    raise ValueError(
                        f"scenario {scenario.id}: a vessel of kind {vessel.kind!r} follows a given track and cannot "
                        "steer by the estimate; leave closed_loop out"
                    )
        self.scenario = scenario
        self.reveal_truth = reveal_truth
        self.closed_loop = closed_loop
        self._weights = _weights(reward)
        places = places_of(possible)
        self._most, self._widths, self._sides = places.most, places.widths, places.sides
        self.observation_space = _observation_space(self._most, self._widths, self._sides)
        self.action_space = spaces.Box(-_ACTION_LIMIT, _ACTION_LIMIT, dtype=np.float64)
        self._source: Any = None
        self._observed: ObservedSteps | None = None
        self._runs: SteppedRuns | None = None
        self._shared: SteppedRuns | None = None
        self._number = 0  # of the run in these
        self._row = 0
        self._size = _FEWEST_AHEAD
        self._steps = 0  # steps that the source has been advanced by
        self._arrivals = Arrivals()

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start a run.

        Parameters
        ----------
        seed : int, optional
            Seed of the run; by default a seed is drawn from `np_random`.
        options : dict, optional
            There are no options; it is ignored.

        Returns
        -------
        observation : dict
            The measurements of the first step.
        info : dict
            ``seed``, ``start``, ``instruments``, ``note`` (and ``truth``).
        """
        super().reset(seed=seed)
        if seed is None:
            seed = int(self.np_random.integers(2**63 - 1))
        self._source, note = _open(self.scenario, seed)
        self._observed, self._runs, self._steps, self._size = None, None, 0, _FEWEST_AHEAD
        self._arrivals = Arrivals()
        start: InitialState = self._source.start
        if self.closed_loop:
            truth = self._source.initial_truth
            row = rows_of(truth.position, truth.attitude)[0]
            heading = math.remainder(float(start.attitude[2]) - row[5], math.tau)
            self._source.steer_by(*horizontal(start.position.tolist(), row), heading)
            from simnav.simulation.steps import SteppedRuns

            self._runs = SteppedRuns(1) if self._shared is None else self._shared
            self._runs.begin(self._number, self._source)
        if not self._load():
            raise ValueError(f"scenario {self.scenario.id}: the run is shorter than one step")
        self._begin_chart(self.scenario.id, self._source.duration)
        info = {"seed": seed, "start": start, "instruments": self._source.instruments, "note": note}
        return _copied(self._observation()), self._reveal(info)

    def step(self, action: Array) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Give the estimate for the last observation; return its reward and the next observation.

        Parameters
        ----------
        action : (3, 3) array
            Estimated position, velocity and attitude, see the class.

        Raises
        ------
        ValueError
            If the action has another shape or is not finite.
        gymnasium.error.ResetNeeded
            If the run is over or has not begun.
        """
        observation, reward, terminated, truncated, info = self.step_from(checked_action(action))
        # Copies: a view would lead to the measurements of the steps to come, by its base.
        return _copied(observation), reward, terminated, truncated, info

    def step_from(self, estimate: list[float]) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """As `step`, for the nine numbers of a checked action; the observation may be views of longer arrays."""
        observed = self._observed
        if observed is None:
            raise gymnasium.error.ResetNeeded("no run is under way: call reset() first")
        row = observed.rows[self._row]
        north, east = horizontal(estimate, row)
        reward = -self._error(estimate, north, east, row)
        if self._chart is not None:
            self._draw(self._chart, estimate)
        if self.closed_loop:
            self._source.steer_by(north, east, math.remainder(estimate[8] - row[5], math.tau))
        self._row += 1
        if self._row < len(observed.rows) or self._load():
            return self._observation(), reward, False, False, self._reveal({})
        last = self._row - 1
        observation = self.empty(float(observed.intervals[last, 1]))
        info = {"truth": observed.truth[last].copy()} if self.reveal_truth else {}
        self._observed = None
        return observation, reward, False, True, info

    @property
    def plain(self) -> bool:
        """Whether the reward is the usual one, and no instrument has channels."""
        return self._weights is None and not self._sides

    @property
    def layout(self) -> tuple[list[str], dict[str, int], list[tuple[str, int, int]]]:
        """The aiding instruments of any run; most samples of each and of the IMU; name, most samples and components."""
        names = [name for name in self._most if name != "imu"]
        return names, self._most, [(name, self._most[name], self._widths[name]) for name in names]

    def share(self, runs: SteppedRuns, number: int) -> None:
        """Begin the next runs in closed loop among others, under a number."""
        self._shared, self._number = runs, number

    def hand_over(self) -> tuple[list[float], int]:
        """Hand over a run that has just begun: its row of `ObservedSteps.rows`, and the number of steps left."""
        assert self._observed is not None
        row, left = self._observed.rows[0], int(self._source.duration / self._source.step + 1e-6) - self._steps
        self._observed = None
        return row, left

    def _forget(self) -> None:
        self._source = self._observed = self._runs = None

    # ------------------------------------------------------------------------------------------- the run

    def _load(self) -> bool:
        """Advance the source by several steps; return False if the run is over."""
        source = self._source
        if self._runs is not None:
            return self._advance(self._runs)
        while True:
            total = int(source.duration / source.step + 1e-6)
            if self._steps >= total:
                return False
            self._steps = min(total, self._steps + self._size)
            self._size = min(2 * self._size, _MOST_AHEAD)
            block = source.advance(source.duration if self._steps == total else self._steps * source.step)
            if len(block.truth):
                begin = block.start if self._observed is None else float(self._observed.intervals[-1, 1])
                self._observed, self._row = pack(self._arrivals.of(block), begin, self._most), 0
                return True

    def _advance(self, runs: SteppedRuns) -> bool:
        """Advance a run in closed loop by one step; return False if it is over."""
        if self._steps >= int(self._source.duration / self._source.step + 1e-6):
            return False
        self._steps += 1
        observed = self._observed
        if not isinstance(observed, ClosedLoopSteps) or len(observed.rows) == observed.LENGTH:
            self._observed = observed = ClosedLoopSteps(runs, self._number, self._most, self._widths, self._sides)
        self._row = len(observed.rows)
        observed.advance()
        return True

    def _observation(self) -> Observation:
        observed, i = self._observed, self._row
        assert observed is not None
        observation: Observation = {"interval": observed.intervals[i]}
        for name, columns in observed.columns.items():
            observation[name] = {key: array[i] for key, array in columns.items()}
        if len(observed.columns) < len(self._most):
            for name in self._most.keys() - observed.columns.keys():  # instruments that other runs of the scenario have
                observation[name] = self._nothing(name)
        return observation

    def empty(self, time: float) -> Observation:
        """An observation without measurements at a time [s]."""
        observation: Observation = {name: self._nothing(name) for name in self._most}
        observation["interval"] = np.array([time, time])
        return observation

    def _nothing(self, name: str) -> dict[str, NDArray[Any]]:
        """The part of an observation for an instrument without measurements."""
        space = self.observation_space[name]  # type: ignore[index]
        return {key: np.zeros(s.shape, s.dtype) for key, s in space.items()}

    def _reveal(self, info: dict[str, Any]) -> dict[str, Any]:
        if self.reveal_truth and self._observed is not None:
            info["truth"] = self._observed.truth[self._row].copy()
        return info

    def _error(self, estimate: list[float], north: float, east: float, row: list[float]) -> float:
        """The weighted error, without quantities that the reference of a log does not hold."""
        if self._weights is None:
            error = math.hypot(north, east)
            return error if error == error else 0.0
        assert self._observed is not None
        truth = self._observed.truth[self._row]
        down = row[2] - estimate[2]
        measures: dict[str, Callable[[], float]] = {
            "horizontal": lambda: math.hypot(north, east),
            "vertical": lambda: abs(down),
            "position": lambda: math.hypot(north, east, down),
            "velocity": lambda: math.dist(estimate[3:6], truth[1].tolist()),
            "attitude": lambda: _attitude_angle(np.array(estimate[6:]), truth[2]),
        }
        terms = [weight * measures[name]() for name, weight in self._weights.items()]
        return sum(term for term in terms if term == term)

    def _draw(self, chart: Chart, estimate: list[float]) -> None:
        observed, i = self._observed, self._row
        assert observed is not None
        for position, faulty in observed.fixes(i):
            chart.add_fixes(position, faulty)
        chart.add(float(observed.intervals[i, 1]), observed.truth[i, 0], np.array(estimate[:3]))
        self._show()


def _copied(observation: Observation) -> Observation:
    """The observation in arrays of its own."""
    return {
        name: {key: array.copy() for key, array in entry.items()} if isinstance(entry, dict) else entry.copy()
        for name, entry in observation.items()
    }


def _open(scenario: Scenario, seed: int) -> tuple[Any, str]:
    """The source of a run, and its note: what in a log is not measured, or was left out of it."""
    from simnav.source import open_source

    if not scenario.recorded:
        source = open_source(scenario, seed)
        return source, getattr(source, "note", "")
    from simnav.log import LogWarning

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", LogWarning)
        source = open_source(scenario, seed)
    for other in caught:
        if not issubclass(other.category, LogWarning):
            warnings.warn_explicit(other.message, other.category, other.filename, other.lineno)
    said = dict.fromkeys(str(w.message) for w in caught if issubclass(w.category, LogWarning))
    return source, "; ".join(filter(None, [getattr(source, "note", ""), *said]))


# ------------------------------------------------------------------------------------------------- spaces


def _observation_space(most: Mapping[str, int], widths: Mapping[str, int], sides: Mapping[str, int]) -> spaces.Dict:
    def box(*shape: int) -> spaces.Box:
        return spaces.Box(-_LIMIT, _LIMIT, shape, dtype=np.float64)

    entries: dict[str, spaces.Space[Any]] = {"interval": box(2)}
    for name, k in most.items():
        entry: dict[str, spaces.Space[Any]] = {"time": box(k), "valid": spaces.MultiBinary(k)}
        if name == "imu":
            entry |= {"length": box(k), "angular_rate": box(k, 3), "specific_force": box(k, 3)}
        else:
            entry["value"] = box(k, widths[name])
            if sides.get(name):
                entry["side"] = box(k, sides[name])
        entries[name] = spaces.Dict(entry)
    return spaces.Dict(entries)


def checked_action(action: Any) -> list[float]:
    """The nine numbers of an action, row by row.

    Raises
    ------
    ValueError
        If the action does not have the shape (3, 3) or is not finite.
    """
    try:
        array = np.asarray(action, dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"an action is a (3, 3) array of numbers, not {action!r}") from None
    if array.shape != (3, 3):
        raise ValueError(
            "an action is a (3, 3) array (latitude, longitude, height; velocity north, east, down; roll, pitch, yaw), "
            f"not one of shape {array.shape}"
        )
    values: list[float] = array.ravel().tolist()
    if not math.isfinite(sum(values)) and not np.isfinite(array).all():
        raise ValueError(f"an action must be finite, not {array.tolist()}")
    return values


def _weights(reward: str | Mapping[str, float]) -> dict[str, float] | None:
    """Weights of the error measures; None for the usual one, the horizontal error."""
    weights = {reward: 1.0} if isinstance(reward, str) else dict(reward)
    for name, weight in weights.items():
        if name not in REWARDS:
            raise ValueError(f"reward is one of {', '.join(REWARDS)} or weights of them; {name!r} is unknown")
        if not math.isfinite(weight):
            raise ValueError(f"the weight of {name!r} in the reward should be finite, not {weight!r}")
    if not weights:
        raise ValueError(f"reward is one of {', '.join(REWARDS)} or weights of them, not an empty mapping")
    return None if weights == {"horizontal": 1.0} else weights


def _attitude_angle(estimate: Array, truth: Array) -> float:
    if np.isnan(truth).any():
        return math.nan
    error = dcm_from_rpy(estimate) @ dcm_from_rpy(truth).T
    return float(np.linalg.norm(rotation_vector_from_dcm(error)))
