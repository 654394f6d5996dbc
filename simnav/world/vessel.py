"""Vessels: what a kind of vessel declares, the registry of kinds, and the response of a hull to its commands.

A vessel is a specification that makes the trajectory of a run. `register_vessel` registers a kind of vessel, of simnav
(`simnav.world.hulls`) or of a third party (``docs/how-to/add-a-vessel.md``).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import wraps
from typing import Annotated, Any, ClassVar, TypeVar

from pydantic import Field

from simnav.plugins import Registry, declared_in, registered_kind, with_named_errors
from simnav.spec import NonNegative, Positive, Spec, SpecError, quantity
from simnav.world.manoeuvres import Manoeuvre
from simnav.world.manoeuvring.hull import Hull
from simnav.world.start import Start
from simnav.world.trajectory import Trajectory, Voyage

__all__ = ["VESSELS", "KinematicVessel", "Vessel", "VesselError", "register_vessel"]

_HALF_PI = 1.5707963267948966


class VesselError(SpecError):
    """A vessel whose trajectory cannot be made. The message names its kind, its file, and what is wrong."""


class Vessel(Spec):
    """Base class of all vessels: the table ``[vessel]`` of a scenario.

    Attributes
    ----------
    starts : bool
        Whether the vessel begins at the state of the table ``[start]``. False: its trajectory says where it begins.
    obeys : bool
        Whether the vessel follows manoeuvres.
    steered : bool
        Whether the trajectory has `simnav.world.trajectory.Steered.steer_by`, which a closed loop needs.
    files : tuple of str
        Names of the fields that are paths of files. A path in a scenario file is relative to the folder of that file.
        The content of these files is a part of the content of the scenario.
    """

    starts: ClassVar[bool] = True
    obeys: ClassVar[bool] = True
    steered: ClassVar[bool] = False
    files: ClassVar[tuple[str, ...]] = ()

    kind: str

    def check(self, start: Start | None, manoeuvres: Sequence[Manoeuvre], parts: Sequence[str]) -> None:
        """Check that the vessel fits the rest of its scenario. An override calls this one first.

        Parameters
        ----------
        start : Start or None
            The table ``[start]``.
        manoeuvres : sequence of Manoeuvre
            The tables ``[[manoeuvre]]``.
        parts : sequence of str
            Names of the tables ``[surroundings.NAME]``.

        Raises
        ------
        ValueError
            One sentence that names the key, its value, and what would be right.
        """
        if self.starts and start is None:
            raise ValueError("required table [start] is missing (a recorded run has a [log] instead)")
        if not self.starts and start is not None:
            raise ValueError(f"start: a vessel of kind {self.kind!r} says itself where it starts; leave [start] out")
        if not self.obeys and manoeuvres:
            raise ValueError(
                f"manoeuvre[0].kind = {manoeuvres[0].kind!r}: a vessel of kind {self.kind!r} follows no manoeuvres; "
                "leave them out"
            )

    def trajectory(self, voyage: Voyage) -> Trajectory:
        """Make the trajectory of one run.

        Parameters
        ----------
        voyage : Voyage
            Start, manoeuvres, surroundings, IMU rate, duration and seed of the run.
        """
        raise NotImplementedError(f"{type(self).__qualname__} has no trajectory()")


VESSELS: Registry[type[Vessel]] = Registry("vessel", "simnav.vessels", "simnav.world")

V = TypeVar("V", bound=Vessel)


def register_vessel(cls: type[V]) -> type[V]:
    """Register a kind of vessel (class decorator). Its name is the default of the field ``kind``.

    Raises
    ------
    PluginError
        If the class is not a subclass of `Vessel`, another class has its name, or a field hides an attribute.
    """
    name = registered_kind(cls, Vessel, decorator="register_vessel", sort="vessel", example="my_vessel")
    VESSELS.add(name, cls)
    named = with_named_errors(cls.trajectory, VesselError, _label, (SpecError, MemoryError))
    cls.trajectory = _checked(named)  # type: ignore[method-assign]
    return cls


def _checked(make: Callable[..., Any]) -> Callable[..., Trajectory]:
    """Wrap ``trajectory`` of a vessel, so that it returns a trajectory or raises."""

    @wraps(make)
    def checked(self: Vessel, voyage: Voyage) -> Trajectory:
        made = make(self, voyage)
        if not isinstance(made, Trajectory):
            place = f"{_label(self, voyage)} ({declared_in(type(self))})"
            raise VesselError(f"{place}: trajectory() returned {type(made).__name__}, where a Trajectory is wanted")
        return made

    return checked


def _label(vessel: Vessel, voyage: Voyage) -> str:
    return f"vessel of kind {vessel.kind!r}"


class KinematicVessel(Vessel):
    """Response of a hull to its commands: critically damped second-order lags, so that accelerations are continuous.

    Attributes
    ----------
    dives : bool
        Whether the vessel follows dive commands, and its wave motion decreases with depth.
    speed_time_constant, turn_time_constant, climb_time_constant : float
        Time constants of speed, yaw rate and flight-path angle [s].
    turn_rate : float
        Limit of the autopilot's yaw rate [rad/s].
    heel : float
        Outward heel in a turn, as a multiple of the centripetal acceleration in g [-]; about the ratio of the height
        of the centre of gravity above the centre of lateral resistance to the metacentric height.
    """

    dives: ClassVar[bool] = False
    steered: ClassVar[bool] = True

    speed_time_constant: Positive = quantity("s", 15.0)
    turn_time_constant: Positive = quantity("s", 4.0)
    climb_time_constant: Positive = quantity("s", 3.0)
    turn_rate: Annotated[float, Field(gt=0.0, lt=_HALF_PI)] = quantity("deg_s", 0.017453292519943295)
    heel: NonNegative = 0.0

    @property
    def hull(self) -> Hull | None:
        """Coefficients of a hull with three degrees of freedom; None: the vessel is its lags."""
        return None

    def check(self, start: Start | None, manoeuvres: Sequence[Manoeuvre], parts: Sequence[str]) -> None:
        """See `Vessel.check`."""
        super().check(start, manoeuvres, parts)
        for name in ("sea", "current"):
            if name in parts:
                raise ValueError(f"surroundings.{name}: a vessel of kind {self.kind!r} takes the table [{name}] only")
