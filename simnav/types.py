"""The data types that all parts of simnav exchange: datasheets, measurements, estimates, states.

SI units and radians throughout. Position is geodetic latitude [rad], longitude [rad] and height
above the WGS-84 ellipsoid [m]; velocity is north-east-down [m/s]; attitude is roll, pitch, yaw
[rad] (Z-Y-X) of the body axes (forward, starboard, down) relative to north-east-down.
Covariances are over nine components: north-east-down position error [m], velocity error [m/s] and
attitude error [rad], the rotation vector of C_est C_true^T resolved in north-east-down.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simnav.blocks import StateBlock
from simnav.compiled import Array, Flags, Integers
from simnav.kinds import KINDS, NO_SIDE, Datasheet, Kind, Role

__all__ = [
    "COMPONENTS",
    "KINDS",
    "NO_SIDE",
    "UNKNOWN_ANGLE",
    "Array",
    "Datasheet",
    "Estimate",
    "Flags",
    "ImuDatasheet",
    "ImuSamples",
    "InitialState",
    "Instruments",
    "Integers",
    "Kind",
    "Measurement",
    "Measurements",
    "NavigationStates",
    "ReferenceStates",
    "StateBlock",
    "TapStates",
    "TriadDatasheet",
]

#: Standard deviation of an angle of which nothing is known [rad]: a normal error of this size is uniform on the circle.
UNKNOWN_ANGLE = math.pi

#: The nine error components of every covariance and every ``estimated`` mask, in order.
COMPONENTS: tuple[str, ...] = (
    "north",
    "east",
    "down",
    "velocity_north",
    "velocity_east",
    "velocity_down",
    "attitude_north",
    "attitude_east",
    "attitude_down",
)


@dataclass(frozen=True, eq=False)
class TriadDatasheet:
    """Datasheet of three gyroscopes or of three accelerometers.

    All figures are one sigma and equal on the three axes; ``x`` is rad/s for gyroscopes and
    m/s^2 for accelerometers.

    Attributes
    ----------
    bias : float
        Turn-on bias [x]: constant in a run, different in each run.
    bias_instability : float
        Stationary standard deviation of the in-run bias, a first-order Gauss-Markov process [x]. If
        ``correlation_time`` is infinite, the in-run bias is a random walk of this density [x/sqrt(s)].
    correlation_time : float
        Correlation time of the in-run bias [s].
    random_walk : float
        White noise density [x/sqrt(Hz)] (angle or velocity random walk).
    rate_random_walk : float
        Random walk of the bias [x/sqrt(s)].
    scale : float
        Scale-factor error [-]: the reading is multiplied by 1 + error.
    misalignment : float
        Non-orthogonality of each axis [rad].
    quantization : float
        Step of the output increment [x s]; 0: no quantization.
    range : float
        Largest output [x]; inf: no limit.
    assumed : tuple of str
        Names of the figures that no datasheet states: they are assumed of the grade of the instrument.
    """

    bias: float = 0.0
    bias_instability: float = 0.0
    correlation_time: float = np.inf
    random_walk: float = 0.0
    rate_random_walk: float = 0.0
    scale: float = 0.0
    misalignment: float = 0.0
    quantization: float = 0.0
    range: float = np.inf
    assumed: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class ImuDatasheet:
    """Datasheet of an inertial measurement unit.

    Attributes
    ----------
    rate : float
        Nominal sample rate [Hz].
    gyroscope, accelerometer : TriadDatasheet
        Error parameters of the two triads.
    name : str
        Name of the instrument.
    """

    rate: float
    gyroscope: TriadDatasheet
    accelerometer: TriadDatasheet
    name: str = "imu"


class Instruments(Mapping[str, Datasheet]):
    """The datasheets of a run: a mapping from name to `Datasheet`, and the datasheet of the IMU as an attribute.

    Parameters
    ----------
    aids : sequence of Datasheet
        Datasheets of the aiding instruments, with different names.
    imu : ImuDatasheet or None
        Datasheet of the IMU; None for a vessel without an IMU.
    step : float
        Time from one call of ``Estimator.update`` to the next [s].
    """

    def __init__(self, aids: Sequence[Datasheet] = (), imu: ImuDatasheet | None = None, step: float = 1.0):
        self._aids = {a.name: a for a in aids}
        if len(self._aids) != len(aids):
            raise ValueError(f"two instruments share a name: {[a.name for a in aids]}")
        self.imu = imu
        self.step = step

    def __getitem__(self, name: str) -> Datasheet:
        return self._aids[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._aids)

    def __len__(self) -> int:
        return len(self._aids)

    def without(self, names: Collection[str]) -> Instruments:
        """The instruments but those of the given names; itself if it has none of them."""
        kept = [a for name, a in self._aids.items() if name not in names]
        return self if len(kept) == len(self._aids) else Instruments(kept, self.imu, self.step)

    def changed(self, change: Callable[[Datasheet], Datasheet]) -> Instruments:
        """The instruments, with another datasheet for each."""
        return Instruments([change(a) for a in self._aids.values()], self.imu, self.step)

    def of_kind(self, *kinds: str) -> list[Datasheet]:
        """The datasheets of the given kinds, in the scenario's order."""
        return [a for a in self._aids.values() if a.kind in kinds]

    def of_role(self, *roles: Role) -> list[Datasheet]:
        """The datasheets of the instruments in the given roles, in the scenario's order."""
        return [a for a in self._aids.values() if a.role in roles]

    def of_equation(self, *equations: str) -> list[Datasheet]:
        """The datasheets whose readings one of the given compiled equations predicts, in the scenario's order."""
        return [a for a in self._aids.values() if a.equation in equations]


@dataclass(frozen=True, eq=False)
class ImuSamples:
    """A series of n IMU samples: averages over the interval that ends at each sample's time.

    Attributes
    ----------
    time, interval : (n,) array
        End of the interval and its length [s].
    angular_rate, specific_force : (n, 3) array
        Mean over the interval, body axes [rad/s], [m/s^2]. The increment is the mean times the interval.
    """

    time: Array
    interval: Array
    angular_rate: Array
    specific_force: Array

    def __len__(self) -> int:
        return len(self.time)

    def __getitem__(self, index: slice) -> ImuSamples:
        return ImuSamples(self.time[index], self.interval[index], self.angular_rate[index], self.specific_force[index])


class Measurement(NamedTuple):
    """One reading of an aiding instrument.

    An instrument with channels (satellites, beams, beacons) gives one `Measurement` for each channel that it reads at a
    time; their number may differ from one time to the next. An estimator uses them one by one.

    Attributes
    ----------
    time : float
        Time stamp [s]. It is the time of validity, but for what ``Datasheet.timing`` says of the clock.
    instrument, kind : str
        Name in the scenario, and key of `KINDS`.
    value : (d,) array
        Components as in ``KINDS[kind].values``.
    channel : str
        Which channel it is, one of ``Datasheet.channels``; empty for an instrument without channels.
    side : (s,) array
        What else the instrument says about the reading, which is no measurement: the position of the satellite, the
        direction of the beam. Components as in ``KINDS[kind].side``. Of an instrument that states its noise
        (`Datasheet.stated`) the standard deviations (d,) of this reading, or nothing.
    """

    time: float
    instrument: str
    kind: str
    value: Array
    channel: str = ""
    side: Array = NO_SIDE

    @property
    def source(self) -> str:
        """The instrument, or ``INSTRUMENT:CHANNEL``: what an estimator flags, weighs and tests by itself."""
        return f"{self.instrument}:{self.channel}" if self.channel else self.instrument

    def kept(self) -> Measurement:
        """A copy with arrays of its own, for later steps."""
        return self._replace(value=self.value.copy(), side=self.side.copy())


@dataclass(frozen=True, eq=False, slots=True)
class Measurements:
    """All measurements of one step, the interval (start, time].

    Attributes
    ----------
    start, time : float
        Beginning and end of the step [s]. The estimate must be valid at ``time``.
    imu : ImuSamples or None
        IMU samples of the step; None for a vessel without an IMU.
    aids : list of Measurement
        Aiding measurements that arrive in the step, in order of their stamps. One that arrives late may be older than
        the step. Iteration over the packet gives these.
    """

    start: float
    time: float
    imu: ImuSamples | None
    aids: list[Measurement]

    def __iter__(self) -> Iterator[Measurement]:
        return iter(self.aids)

    def __len__(self) -> int:
        return len(self.aids)

    def latest(self, kind: str) -> Measurement | None:
        """The newest measurement of a kind (or of an instrument's name), or None."""
        for m in reversed(self.aids):
            if m.kind == kind or m.instrument == kind:
                return m
        return None

    def kept(self) -> Measurements:
        """A copy with arrays of its own, for later steps: those of a packet belong to its step."""
        imu = self.imu
        if imu is not None:
            imu = ImuSamples(**{name: array.copy() for name, array in vars(imu).items()})
        return Measurements(self.start, self.time, imu, [m.kept() for m in self.aids])


@dataclass(frozen=True, eq=False)
class InitialState:
    """The initial state that an estimator receives, with errors drawn from ``covariance``.

    Attributes
    ----------
    time : float
        Time of validity [s].
    position, velocity, attitude : (3,) array
        Geodetic [rad, rad, m]; north-east-down [m/s]; roll, pitch, yaw [rad].
    covariance : (9, 9) array
        Covariance of the errors, in the order of `COMPONENTS`. An angle of which nothing is known has a standard
        deviation of `UNKNOWN_ANGLE`.
    """

    time: float
    position: Array
    velocity: Array
    attitude: Array
    covariance: Array

    @property
    def unknown(self) -> Literal["", "heading", "attitude"]:
        """What of the attitude the start does not know: "heading", "attitude" (all of it), or nothing."""
        known = [float(v) < (1.0 - 1e-9) * UNKNOWN_ANGLE**2 for v in self.covariance.diagonal()[6:9]]
        if any(known[:2]):
            return "" if known[2] else "heading"
        return "" if known[2] else "attitude"


@dataclass(eq=False, slots=True)
class Estimate:
    """A navigation estimate at one time.

    Attributes
    ----------
    time : float
        Time of validity [s]: the end of the step.
    position, velocity, attitude : (3,) array or None
        Geodetic [rad, rad, m]; north-east-down [m/s]; roll, pitch, yaw [rad]. None: this vector is not estimated.
    covariance : (9, 9) array or None
        Covariance of the errors, in the order of `COMPONENTS`. Only the rows and columns of estimated components are
        read.
    estimated : (9,) bool array or None
        True for each estimated component. It is needed if only a part of a vector is estimated; for example, a ship's
        filter may not estimate height, roll and pitch. None: all components of the given vectors are estimated.
    diagnostics : dict
        Named scalars or small arrays, which are recorded at each epoch.
    flagged : sequence of (source, time)
        The measurements of this step that the estimator considers faulty, by `Measurement.source` and time: the name of
        the instrument, with its channel if it has channels. They are scored against the true faults.
    states : mapping of str to (array, array)
        Further states by name, each with its value (k,) and its standard deviation (k,): those that instruments bring
        along (`simnav.blocks`). A trial keeps them as the diagnostics ``state.NAME`` and ``sigma.NAME``.
    """

    time: float
    position: Array | None = None
    velocity: Array | None = None
    attitude: Array | None = None
    covariance: Array | None = None
    estimated: NDArray[np.bool_] | None = None
    diagnostics: Mapping[str, float | Array] = field(default_factory=dict)
    flagged: Sequence[tuple[str, float]] = ()
    states: Mapping[str, tuple[Array, Array]] = field(default_factory=dict)

    def mask(self) -> NDArray[np.bool_]:
        """(9,) bool array: the components of `COMPONENTS` that this estimate holds."""
        given = np.repeat([self.position is not None, self.velocity is not None, self.attitude is not None], 3)
        return given if self.estimated is None else given & np.asarray(self.estimated, dtype=bool)


@dataclass(frozen=True, eq=False)
class NavigationStates:
    """A series of n navigation states: the truth, a reference or a smoothed trajectory.

    Attributes
    ----------
    time : (n,) array
        Times of validity [s].
    position, velocity, attitude : (n, 3) array
        Geodetic [rad, rad, m]; north-east-down [m/s]; roll, pitch, yaw [rad].
    """

    time: Array
    position: Array
    velocity: Array
    attitude: Array

    def __len__(self) -> int:
        return len(self.time)

    def __getitem__(self, index: slice) -> NavigationStates:
        return NavigationStates(self.time[index], self.position[index], self.velocity[index], self.attitude[index])


@dataclass(frozen=True, eq=False)
class ReferenceStates(NavigationStates):
    """The reference of a log at n times, which stands for the truth and says how well it is known.

    Attributes
    ----------
    sigma : (n, 3) array
        Standard deviation of its position, north-east-down [m]; NaN where it is not known.
    quality : (n,) array
        Its solution: 1 fixed, 2 float, NaN where it is not said.
    """

    sigma: Array
    quality: Array


@dataclass(frozen=True, eq=False)
class TapStates(NavigationStates):
    """The true states at the n sample times of one instrument, from which its readings are computed.

    Attributes
    ----------
    angular_rate : (n, 3) array
        Angular rate of the body relative to the Earth, body axes [rad/s].
    water_velocity : (n, 3) array
        The current at the vessel, north-east-down [m/s].
    """

    angular_rate: Array
    water_velocity: Array
