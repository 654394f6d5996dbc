"""The tables of a scenario file: motion, surroundings, instruments and faults of a run, as they are written."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, field_validator, model_validator

import simnav.log.own_track  # noqa: F401 (it registers vessels)
from simnav.declared_process import DeclaredProcess
from simnav.log.spec import RecordedSpec
from simnav.scenario.catalogue import NAME, gym_id
from simnav.sensors import AidSpec, AnyFault, AnyInstrument, ImuSpec
from simnav.sensors.error_processes import in_sea
from simnav.spec import Positive, Spec, entries, quantity
from simnav.types import UNKNOWN_ANGLE, Array, Datasheet, Instruments
from simnav.world import AnySurrounding, AnyVessel, Current, Manoeuvre, Sea, Ship, Start, Surroundings, Vessel, Voyage
from simnav.world.depth_grid import DepthGrid
from simnav.world.surroundings import BATHYMETRY, surround

__all__ = ["LONGEST", "SMALLEST", "TRAINING_ROOT", "Description", "Dial", "InitialError"]

#: What is added to the seed of a run of a training scenario. A campaign's seeds are below it, so that no run of the
#: board shares a random stream with one that parameters were chosen on.
TRAINING_ROOT = 1 << 63

#: Longest run [s]. The limit catches mistakes that would fill the memory.
LONGEST = 1e7
#: Smallest magnitude of a number other than 0: its square and the inverse of its square are numbers, too.
SMALLEST = 1e-150

Sigmas = tuple[float, float, float]
Factor = Annotated[float, Field(ge=1e-6, le=1e6)]


class InitialError(Spec):
    """Standard deviations, north-east-down, of the errors of the initial state that an estimator receives.

    The errors of a run are drawn from them independently. The estimator also receives the covariance.
    """

    position: Sigmas = quantity("m", (2.0, 2.0, 2.0), description="position error north, east, down")
    velocity: Sigmas = quantity("m_s", (0.05, 0.05, 0.05), description="velocity error north, east, down")
    attitude: Sigmas = quantity(
        "deg",
        tuple(math.radians(d) for d in (0.05, 0.05, 0.5)),
        description="attitude error about north, east, down (the last is heading); `[1, 1, 180]`: an unknown heading, "
        "`[180, 180, 180]`: an unknown attitude",
    )
    times_told: dict[Literal["position", "velocity", "attitude"], Factor] = Field(
        {}, description="errors that really are so many times what an estimator is told, like `attitude = 10`"
    )

    @field_validator("position", "velocity", "attitude")
    @classmethod
    def _positive(cls, value: Sigmas) -> Sigmas:
        # The square of a smaller one may be 0, and that of an infinite one is no variance.
        if not all(SMALLEST <= v < math.inf for v in value):
            least = "greater than 0" if min(value) <= 0.0 else f"finite and at least {SMALLEST:g} in SI units"
            raise ValueError(f"the initial covariance must be positive definite: every sigma should be {least}")
        return value

    @field_validator("attitude")
    @classmethod
    def _whole(cls, value: Sigmas) -> Sigmas:
        unknown = [v >= (1.0 - 1e-9) * UNKNOWN_ANGLE for v in value]
        if any(unknown[:2]) and not all(unknown):
            told = ", ".join(f"{math.degrees(v):g}" for v in value)
            raise ValueError(
                f"[{told}] deg: 180 deg is an angle of which nothing is known; without roll or pitch nothing of the "
                "attitude is known: [180, 180, 180]; an unknown heading alone is [1, 1, 180]"
            )
        return value

    @property
    def unknown(self) -> bool:
        """Whether nothing is known of the heading; see `simnav.types.InitialState.unknown`."""
        return self.attitude[2] >= (1.0 - 1e-9) * UNKNOWN_ANGLE

    def covariance(self) -> Array:
        """(9, 9) covariance over `simnav.types.COMPONENTS` that an estimator receives."""
        return np.diag(np.square([*self.position, *self.velocity, *self.attitude]))

    def actual_covariance(self) -> Array | None:
        """(9, 9) covariance from which the errors are drawn; None if it is that of `covariance`."""
        f = self.factors()
        return np.outer(f, f) * self.covariance() if self.times_told else None

    def factors(self) -> Array:
        """(9,) factors of the true standard deviations over those of `covariance`."""
        return np.repeat([self.times_told.get(name, 1.0) for name in ("position", "velocity", "attitude")], 3)


class Dial(Spec):
    """A figure of a scenario that ``simnav sweep`` sets to one value after the other."""

    name: str = Field(description="how it is called on the command line, in kebab-case")
    key: str = Field(description="key path of what it sets, like `draw.size` or `fault[0].sigma_m`")
    range: tuple[float, float] = Field(description="lowest and highest value that makes sense, in the unit")
    unit: str = Field("", description="of the value, for tables and drawings")
    title: str = Field(description="what it is, in a few words")
    clean: float | None = Field(None, description="value at which nothing is wrong; default: the lowest")

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if not NAME.fullmatch(self.name):
            raise ValueError(f"name = {self.name!r} should be in kebab-case, like 'multipath'")
        low, high = self.range
        if not low < high:
            raise ValueError(f"range = {list(self.range)!r}: the lowest should be less than the highest")
        if self.clean is not None and not low <= self.clean <= high:
            raise ValueError(f"clean = {self.clean:g} should lie in the range, {low:g} to {high:g}")
        return self


class Description(Spec):
    """The fields of a `simnav.scenario.Scenario`, and what follows from them alone."""

    name: str = Field(description="kebab-case; with the version it is the scenario's id")
    version: int = Field(ge=1, description="raise it whenever a change alters the numbers of a run")
    title: str = Field(description="one line")
    description: str = Field("", description="what happens and why, for the reader of the board")
    source: str = Field("", description="paper or data that it follows")
    tags: tuple[str, ...] = Field((), description="free words to select by")
    track: str = Field("other", description="kebab-case; scenarios of one track are ranked together")
    group: str = Field("other", description="what scenarios of a track have in common, in a word or two")
    training: bool = Field(
        False, description="parameters are chosen on it: its runs share no random stream with the board's"
    )
    plugins: tuple[str, ...] = Field(
        (),
        description="Python files that register instruments, faults, vessels or others, from this file's folder",
    )
    duration: Annotated[float, Field(gt=0.0, le=LONGEST)] = quantity(
        "s", description="length of a run; a multiple of the step"
    )
    step: Positive = quantity("s", 1.0, description="from one estimate to the next")
    world_seed: int | None = Field(
        None, ge=0, description="fixes sea and truth for all runs, which then differ in errors and faults only"
    )
    water_depth: Positive | None = quantity(
        "m", None, description="below the mean sea surface; absent: a DVL always has the bottom"
    )
    start: Start | None = Field(None, description="state of the vessel at time 0")
    initial_error: InitialError = Field(InitialError(), description="what the estimator does not know of it")
    vessel: AnyVessel | None = Field(None, description="what moves, and how; absent: a ship")
    manoeuvres: tuple[Manoeuvre, ...] = entries("manoeuvre", (), description="in order; the last holds to the end")
    sea: Sea | None = Field(None, description="waves; absent: flat calm")
    current: Current | None = Field(None, description="absent: none")
    surroundings: dict[str, AnySurrounding] = Field(
        default_factory=dict, description="more parts of the surroundings, by name, for instruments that ask them"
    )
    instruments: dict[str, AnyInstrument] = Field(
        default_factory=dict, description="by name; the IMU, if there is one, is called imu"
    )
    faults: tuple[AnyFault, ...] = entries("fault", (), description="laid over the measurements, in order")
    log: RecordedSpec | None = Field(None, description="files of a recorded run; then there is no simulated world")
    dials: tuple[Dial, ...] = entries("dial", (), description="what `simnav sweep` may turn")

    @property
    def id(self) -> str:
        """Name and version: ``coastal-voyage-v1``."""
        return f"{self.name}-v{self.version}"

    @property
    def gym_id(self) -> str:
        """The Gymnasium id: ``simnav/CoastalVoyage-v1``."""
        return gym_id(self.name, self.version)

    @property
    def recorded(self) -> bool:
        """Whether the measurements come from a log."""
        return self.log is not None

    @property
    def epochs(self) -> int:
        """Number of steps in a run."""
        return round(self.duration / self.step)

    def root(self, seed: int) -> int:
        """The number from which the random streams of a run start: its seed, plus an offset for training scenarios."""
        return seed + TRAINING_ROOT if self.training else seed

    @property
    def craft(self) -> Vessel:
        """The vessel; a ship where the scenario describes none."""
        return Ship() if self.vessel is None else self.vessel

    def surround(self, seed: int) -> Surroundings:
        """Make the surroundings of the run with this seed."""
        parts, root = self.surroundings, self._world_root(seed)
        return surround(self.sea, self.current, self.water_depth, parts, start=self.start, seed=root)

    def voyage(self, seed: int, surroundings: Surroundings, rate: float) -> Voyage:
        """What the vessel needs to make its trajectory, with an IMU of this sample rate [Hz]."""
        return Voyage(self.start, self.manoeuvres, surroundings, rate, self.duration, self._world_root(seed))

    def _world_root(self, seed: int) -> int:
        return self.root(seed) if self.world_seed is None else self.world_seed

    @property
    def imu(self) -> ImuSpec | None:
        """The IMU's specification, or None."""
        spec = self.instruments.get("imu")
        return spec if isinstance(spec, ImuSpec) else None

    @property
    def aids(self) -> dict[str, AidSpec]:
        """The instruments beside the IMU, by name, in order."""
        return {n: s for n, s in self.instruments.items() if not isinstance(s, ImuSpec)}

    def instruments_sheet(self) -> Instruments:
        """The datasheets that an estimator receives."""
        imu, stated = self.imu, () if self.log is None else self.log.stated
        sheets = [self._charted(spec.datasheet(name), spec) for name, spec in self.aids.items()]
        return Instruments(
            [replace(sheet, stated=True) if sheet.name in stated else sheet for sheet in sheets],
            imu=None if imu is None else imu.datasheet(),
            step=self.step,
        )

    def chart(self, part: str) -> Mapping[str, Any] | None:
        """What navigators know of a part of the surroundings; None: nothing."""
        spec = self.surroundings.get(part)
        if part == "bottom" and spec is None:
            spec = self.surroundings.get(BATHYMETRY)
            if spec is None and self.water_depth is not None:
                return DepthGrid.level(self.water_depth).chart()
        return None if spec is None else spec.chart()

    def _charted(self, sheet: Datasheet, spec: AidSpec) -> Datasheet:
        """A datasheet with the charts that belong to it."""
        found = {part: chart for part in spec.charts if (chart := self.chart(part)) is not None}
        return replace(sheet, details={**sheet.details, **found}) if found else sheet

    def actual(self) -> Self:
        """The scenario with the true figures of its instruments, after the factors of ``times_datasheet``."""
        actual = {name: spec.actual() for name, spec in self.instruments.items()}
        if all(actual[name] is spec for name, spec in self.instruments.items()):
            return self
        return self.model_copy(update={"instruments": actual})

    def actual_sheet(self) -> Instruments | None:
        """The datasheets with the true figures; None if those of `instruments_sheet` are true.

        Their details include the figures that are in no datasheet (`AidSpec.unstated`), if they are not zero. Processes
        that depend on the wave height have the size of this scenario's sea.
        """
        actual = self.actual()
        unstated = {name: {u: getattr(s, u) for u in s.unstated if getattr(s, u)} for name, s in actual.aids.items()}
        waves = any(f.name == "wave_height" for s in actual.aids.values() for p in s.processes for f in p.factors())
        if actual is self and not any(unstated.values()) and not waves:
            return None
        sheet = actual.instruments_sheet()
        aids = [
            replace(s, details={**s.details, **unstated[s.name]}, processes=self._in_sea(s)) for s in sheet.values()
        ]
        return Instruments(aids, sheet.imu, sheet.step)

    def _in_sea(self, sheet: Datasheet) -> tuple[DeclaredProcess, ...]:
        """The processes of a datasheet with the size that they have in the waves of this scenario."""
        height = 0.0 if self.sea is None else self.sea.significant_height
        return tuple(in_sea(process, height) for process in sheet.processes)
