"""The surroundings of a vessel in one run: sea, current, bottom, and parts that third parties register.

The parts are known by name. An instrument receives all of them at once (`simnav.sensors.Instrument.enter`) and asks
those that it needs, at its place and time; so a new part changes no signature. simnav has three parts with tables of
their own:

- ``sea``, of the table ``[sea]``: `simnav.world.sea.Waves`
- ``current``, of the table ``[current]``: `simnav.world.current.WaterFlow`
- ``bottom``, of the key ``water_depth_m``: `FlatBottom`; a part with the name ``bathymetry`` takes its place

`register_surrounding` registers a kind of part; a scenario has it by a table ``[surroundings.NAME]``
(``docs/how-to/add-surroundings.md``).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, TypeVar

import numpy as np

from simnav.plugins import Registry, registered_kind, with_named_errors
from simnav.spec import Spec, SpecError, closest
from simnav.types import Array
from simnav.world.current import Current, WaterFlow
from simnav.world.sea import Sea, Waves
from simnav.world.start import Start

__all__ = [
    "SURROUNDINGS",
    "FlatBottom",
    "SurroundingSpec",
    "Surroundings",
    "SurroundingsError",
    "register_surrounding",
    "surround",
]

#: Tables and keys of a scenario that make the parts of simnav, by the name of the part.
OWN_PARTS = {"sea": "[sea]", "current": "[current]", "bottom": "water_depth_m"}
#: The part that is the bottom, too, unless there is another one.
BATHYMETRY = "bathymetry"


class SurroundingsError(SpecError):
    """A part of the surroundings that does not exist or cannot be made. The message names it."""


class SurroundingSpec(Spec):
    """Base class of the specifications of parts of the surroundings: a table ``[surroundings.NAME]`` of a scenario.

    Attributes
    ----------
    files : tuple of str
        Names of the fields that are paths of files, as of `simnav.world.vessel.VesselSpec`.
    later : mapping of str to object
        Defaults of fields that were added later and are left out of digests where they have them
        (`simnav.spec.without_later`).
    """

    files: ClassVar[tuple[str, ...]] = ()
    later: ClassVar[Mapping[str, Any]] = {}

    kind: str

    def build(self, name: str, seed: int) -> Any:
        """Make the part of one run.

        Parameters
        ----------
        name : str
            Name of the part in the scenario.
        seed : int
            Seed of the world. Random numbers come from `simnav.streams.stream`, with the name of the part.

        Returns
        -------
        object
            What instruments and vessels find under the name. A bottom has the method ``depth(position, time)`` of
            `FlatBottom`; what other parts can be asked is between them and the instruments that ask.
        """
        raise NotImplementedError(f"{type(self).__qualname__} has no build()")

    def chart(self) -> Mapping[str, Any] | None:
        """What navigators know of the part: numbers, texts and arrays; None: nothing.

        The datasheet of an instrument that names the part (`simnav.sensors.AidSpec.charts`) has it in its details.
        """
        return None

    def check(self, name: str, start: Start | None) -> None:
        """Check that the part fits the start of the vessel; nothing by default.

        Raises
        ------
        ValueError
            One sentence that names the key, its value, and what would be right.
        """
        return


SURROUNDINGS: Registry[type[SurroundingSpec]] = Registry("surrounding", "simnav.surroundings", "simnav.world")

S = TypeVar("S", bound=SurroundingSpec)


def register_surrounding(cls: type[S]) -> type[S]:
    """Register a kind of part of the surroundings (class decorator). Its name is the default of the field ``kind``.

    Raises
    ------
    PluginError
        If the class is not a subclass of `SurroundingSpec`, another class has its name, or a field hides an attribute.
    """
    name = registered_kind(cls, SurroundingSpec, decorator="register_surrounding", sort="surrounding", example="sky")
    SURROUNDINGS.add(name, cls)
    build = with_named_errors(cls.build, SurroundingsError, _label, (SpecError, MemoryError))
    cls.build = build  # type: ignore[method-assign]
    return cls


def _label(spec: SurroundingSpec, name: str, seed: int) -> str:
    return f"surroundings.{name} of kind {spec.kind!r}"


class Surroundings:
    """The parts of the surroundings of one run, by name.

    Parameters
    ----------
    parts : mapping of str to object
        The parts. No part is None.

    Examples
    --------
    >>> surroundings = Surroundings({"bottom": FlatBottom(40.0)})
    >>> "sky" in surroundings, surroundings.get("sky")
    (False, None)
    >>> surroundings["bottom"].depth(np.zeros((2, 3)), np.zeros(2))
    array([40., 40.])
    """

    def __init__(self, parts: Mapping[str, Any] | None = None):
        self._parts = dict(parts or {})

    def __contains__(self, name: object) -> bool:
        return name in self._parts

    def __iter__(self) -> Iterator[str]:
        return iter(self._parts)

    def get(self, name: str) -> Any:
        """The part of a name; None if there is none."""
        return self._parts.get(name)

    def __getitem__(self, name: str) -> Any:
        """The part of a name.

        Raises
        ------
        SurroundingsError
            If there is none: the message says which table the scenario needs.
        """
        if name not in self._parts:
            table = OWN_PARTS.get(name, f"the table [surroundings.{name}]")
            near = closest(name, list(self._parts)) if self._parts else ""
            raise SurroundingsError(f"the surroundings have no part {name!r}; the scenario needs {table}{near}")
        return self._parts[name]


@dataclass(frozen=True)
class FlatBottom:
    """A bottom of the same depth everywhere.

    Attributes
    ----------
    water_depth : float
        Depth below the mean sea surface [m].
    """

    water_depth: float

    def depth(self, position: Array, time: Array) -> Array:
        """The (n,) depths of the bottom below the mean sea surface [m] at n positions and times."""
        return np.full(len(time), self.water_depth)


def surround(
    sea: Sea | None,
    current: Current | None,
    water_depth: float | None,
    parts: Mapping[str, SurroundingSpec],
    *,
    start: Start | None,
    seed: int,
) -> Surroundings:
    """Make the surroundings of one run.

    Parameters
    ----------
    sea, current : Sea, Current, or None
        The sea state and the current; None: there is none.
    water_depth : float or None
        Depth of the bottom below the mean sea surface [m]; None: it is not known.
    parts : mapping of str to SurroundingSpec
        More parts, by name.
    start : Start or None
        Start of the vessel, where the phases of waves and current are drawn.
    seed : int
        Seed of the world.
    """
    made: dict[str, Any] = {}
    origin = np.zeros(3) if start is None else np.array([start.latitude, start.longitude, 0.0])
    if sea is not None:
        made["sea"] = Waves(sea, seed, origin, water_depth)
    if current is not None:
        made["current"] = WaterFlow(current, seed, origin)
    if water_depth is not None:
        made["bottom"] = FlatBottom(water_depth)
    made |= {name: spec.build(name, seed) for name, spec in parts.items()}
    if BATHYMETRY in made:
        made.setdefault("bottom", made[BATHYMETRY])
    return Surroundings(made)
