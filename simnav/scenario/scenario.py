"""The description of a run: motion, instruments, faults, and the values that are drawn for each run."""

from __future__ import annotations

import hashlib
import json
import math
import pickle
import sys
from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, Any, Literal, Self, SupportsIndex

import numpy as np
from pydantic import Field, PrivateAttr, field_validator, model_validator

from simnav.log.spec import RecordedSpec
from simnav.plugins import is_file_module, load_plugin, source_digest
from simnav.scenario.catalogue import NAME, gym_id
from simnav.scenario.consistency import LONGEST, check
from simnav.scenario.draws import Distribution, Draws, Template, has_draws, with_values
from simnav.sensors import AidSpec, AnyFault, AnyInstrument, ImuSpec
from simnav.spec import Positive, Spec, SpecError, entries, quantity
from simnav.types import Array, Instruments
from simnav.world import AnySurrounding, AnyVessel, Current, Manoeuvre, Sea, Ship, Start, Surroundings, Vessel, Voyage
from simnav.world.surroundings import surround

__all__ = ["TRAINING_ROOT", "Dial", "InitialError", "Scenario"]

#: What is added to the seed of a run of a training scenario. A campaign's seeds are below it, so that no run of the
#: board shares a random stream with one that parameters were chosen on.
TRAINING_ROOT = 1 << 63

#: Files with draws that were tried at the ends of their ranges in this process.
_CHECKED: set[str] = set()

Sigmas = tuple[float, float, float]


class InitialError(Spec):
    """Standard deviations, north-east-down, of the errors of the initial state that an estimator receives.

    The errors of a run are drawn from them independently. The estimator also receives the covariance.
    """

    position: Sigmas = quantity("m", (2.0, 2.0, 2.0), description="position error north, east, down")
    velocity: Sigmas = quantity("m_s", (0.05, 0.05, 0.05), description="velocity error north, east, down")
    attitude: Sigmas = quantity(
        "deg",
        tuple(math.radians(d) for d in (0.05, 0.05, 0.5)),
        description="attitude error about north, east, down (the last is heading)",
    )
    times_told: dict[Literal["position", "velocity", "attitude"], Positive] = Field(
        {}, description="errors that really are so many times what an estimator is told, like `attitude = 10`"
    )

    @field_validator("position", "velocity", "attitude")
    @classmethod
    def _positive(cls, value: Sigmas) -> Sigmas:
        if not all(v > 0.0 for v in value):
            raise ValueError("the initial covariance must be positive definite: every sigma should be greater than 0")
        return value

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


class Scenario(Spec):
    """The description of a run. It is simulated unless it has a ``[log]``.

    The fields carry their own descriptions (``Scenario.model_fields``) and hold SI units and radians;
    ``docs/reference/scenarios.md`` lists their TOML keys. Build one with `load` or `parse`, or from Python.
    """

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

    _template: Template | None = PrivateAttr(None)
    _declared: dict[str, Any] = PrivateAttr(default_factory=dict)
    _draws: Draws = PrivateAttr(default_factory=dict)

    @classmethod
    def from_toml(cls, table: Mapping[str, Any], *, source: str = "<toml>", path: str = "") -> Self:
        """See `Spec.from_toml`. With distributions, the result is the scenario in the middle of their ranges.

        Raises
        ------
        SpecError
            Also if the scenario is not valid for some of its draws; the message names them.
        """
        if not isinstance(table, Mapping) or not has_draws(table):
            return super().from_toml(table, source=source, path=path)
        template = Template(table, source)
        scenario = super().from_toml(template.middle(), source=source, path=path)
        content = f"{source} {json.dumps(template.table, default=str)}"
        for drawn, draws in () if content in _CHECKED else template.extremes():
            try:
                super().from_toml(drawn, source=source, path=path)
            except SpecError as error:
                raise SpecError(f"{error} (for some draws: {_listed(draws)})") from None
        _CHECKED.add(content)
        scenario._template = template
        scenario._declared = {name: getattr(scenario, name) for name in cls.model_fields}
        return scenario

    def to_toml(self) -> dict[str, Any]:
        """See `Spec.to_toml`. Distributions are written as they were given."""
        table = super().to_toml()
        if self._template is None:
            return table
        keys = {name: key for key, (name, _) in self.toml_keys().items()}
        kept = {keys[name] for name in self._declared if name not in self._replaced()} | {"draw"}
        return {
            **{k: v for k, v in table.items() if k not in kept},
            **{k: v for k, v in self._template.table.items() if k in kept},
        }

    @property
    def distributions(self) -> Mapping[str, Distribution]:
        """The distributions by key path; empty if every run has the same scenario."""
        return {} if self._template is None else self._template.distributions

    @property
    def draws(self) -> Mapping[str, Any]:
        """The values drawn for this run, by key path, in the units of the keys; empty before `drawn`."""
        return self._draws

    def root(self, seed: int) -> int:
        """The number from which the random streams of a run start: its seed, plus an offset for training scenarios."""
        return seed + TRAINING_ROOT if self.training else seed

    def drawn(self, seed: int) -> Self:
        """The scenario of one run, with all values drawn.

        Parameters
        ----------
        seed : int
            Seed of the run.

        Returns
        -------
        Scenario
            The scenario itself if it has no distributions. A field that was replaced in Python (``model_copy``) is
            kept.
        """
        if self._template is None:
            return self
        table, draws = self._template.drawn(self.root(seed))
        scenario = super().from_toml(table, source=self._template.source)
        replaced = self._replaced()
        if replaced:
            scenario = scenario.model_copy(update=replaced)
        scenario._draws = draws
        return scenario

    def extremes(self) -> list[Self]:
        """The scenario in the middle of its ranges, and what it becomes at their ends."""
        if self._template is None:
            return [self]
        replaced = self._replaced()
        source = self._template.source
        found = [super(Scenario, self).from_toml(table, source=source) for table, _ in self._template.extremes()]
        return [self, *(s.model_copy(update=replaced) for s in found)]

    def with_values(self, values: Mapping[str, Any]) -> Self:
        """The scenario with other values at some keys of its TOML, whether they were drawn or not.

        Parameters
        ----------
        values : mapping
            Key path, like ``fault[0].sigma_m`` or ``draw.length``, to a value in the unit of the key.

        Raises
        ------
        SpecError
            If a path leads nowhere, or the scenario is not valid with these values.
        """
        source = f"scenario {self.id}"
        return type(self).from_toml(with_values(self.to_toml(), values, source), source=source)

    def _replaced(self) -> dict[str, Any]:
        """Fields that are not as the template has them."""
        return {name: getattr(self, name) for name, value in self._declared.items() if getattr(self, name) != value}

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
        imu = self.imu
        return Instruments(
            [spec.datasheet(name) for name, spec in self.aids.items()],
            imu=None if imu is None else imu.datasheet(),
            step=self.step,
        )

    def actual(self) -> Self:
        """The scenario with the true figures of its instruments, after the factors of ``times_datasheet``."""
        actual = {name: spec.actual() for name, spec in self.instruments.items()}
        if all(actual[name] is spec for name, spec in self.instruments.items()):
            return self
        return self.model_copy(update={"instruments": actual})

    def actual_sheet(self) -> Instruments | None:
        """The datasheets with the true figures; None if those of `instruments_sheet` are true.

        Their details include the figures that are in no datasheet (`AidSpec.unstated`), if they are not zero.
        """
        actual = self.actual()
        unstated = {name: {u: getattr(s, u) for u in s.unstated if getattr(s, u)} for name, s in actual.aids.items()}
        if actual is self and not any(unstated.values()):
            return None
        sheet = actual.instruments_sheet()
        aids = [replace(s, details={**s.details, **unstated[s.name]}) for s in sheet.values()]
        return Instruments(aids, sheet.imu, sheet.step)

    def content_hash(self) -> str:
        """Hexadecimal digest of everything that decides the numbers of a run, defaults included.

        Title, description, source, tags, track, group and dials are not included, nor are the files of a log.
        Distributions are included as they are written.
        """
        words = {"title", "description", "source", "tags", "track", "group", "plugins", "dials"}
        if not self.surroundings:
            words.add("surroundings")
        content = self.model_dump(mode="python", exclude=words)
        if self._template is not None:
            content["distributions"] = _canonical(self._template.table, words)
        # Not sorted: the order of the instruments is the order in which simultaneous measurements are handed over.
        digest = hashlib.blake2b(json.dumps(content, default=str).encode(), digest_size=16)
        for module in sorted({type(spec).__module__ for spec in self._registered()}):
            if not module.startswith("simnav."):  # what the code of others does is not in simnav's version
                digest.update(source_digest(module).encode())
        return digest.hexdigest()

    def _registered(self) -> list[Spec]:
        """The parts of the scenario whose classes are registered, by simnav or by others."""
        return [*self.instruments.values(), *self.faults, *self.surroundings.values(), self.craft]

    def __reduce_ex__(self, protocol: SupportsIndex) -> Any:
        """Pickle for another process, which must load the plug-in files before it can build their instruments."""
        names = [type(spec).__module__ for spec in self._registered()]
        files = [sys.modules[name].__file__ for name in names if is_file_module(name) and name in sys.modules]
        reduced = super().__reduce_ex__(protocol)
        plugins = tuple(dict.fromkeys((*self.plugins, *filter(None, files))))
        return (_restore, (plugins, pickle.dumps(reduced))) if plugins else reduced

    @model_validator(mode="after")
    def _check(self) -> Self:
        check(self)
        return self


def _listed(draws: Draws) -> str:
    """A few draws, for a message."""
    shown = [
        f"{key} = {value:.6g}" if isinstance(value, float) else f"{key} = {value!r}" for key, value in draws.items()
    ]
    return ", ".join(shown[:8]) + (", ..." if len(shown) > 8 else "")


def _canonical(table: Mapping[str, Any], words: set[str]) -> dict[str, Any]:
    """What is to be drawn: the tables of a scenario file in which there is a distribution, a reference or a name."""
    return {
        key: value for key, value in table.items() if key not in words and (key == "draw" or has_draws({key: value}))
    }


def _restore(plugins: tuple[str, ...], reduced: bytes) -> Any:
    """A pickled scenario with plug-in files."""
    for path in plugins:
        load_plugin(path)
    function, arguments, state, *_ = pickle.loads(reduced)
    scenario = function(*arguments)
    scenario.__setstate__(state)
    return scenario
