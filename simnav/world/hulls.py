"""The vessels of simnav: a ship, and an underwater vehicle. Both move by the kinematics of `simnav.world.world`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, Literal

from simnav.world.current import WaterFlow
from simnav.world.manoeuvres import Manoeuvre
from simnav.world.sea import Waves
from simnav.world.start import Start
from simnav.world.trajectory import Voyage
from simnav.world.vessel import KinematicVessel, register_vessel
from simnav.world.world import World

__all__ = ["Ship", "Uuv"]


def _world(vessel: KinematicVessel, voyage: Voyage) -> World:
    assert voyage.start is not None  # `Vessel.check`
    waves, flow = voyage.surroundings.get("sea"), voyage.surroundings.get("current")
    return World(
        voyage.start,
        vessel,
        voyage.manoeuvres,
        waves.sea if isinstance(waves, Waves) else None,
        flow.current if isinstance(flow, WaterFlow) else None,
        rate=voyage.rate,
        seed=voyage.seed,
        depth=waves.depth if isinstance(waves, Waves) else None,
    )


@register_vessel
class Ship(KinematicVessel):
    """A vessel on the surface."""

    kind: Literal["ship"] = "ship"

    def check(self, start: Start | None, manoeuvres: Sequence[Manoeuvre], parts: Sequence[str]) -> None:
        """See `Vessel.check`."""
        super().check(start, manoeuvres, parts)
        depth = 0.0 if start is None else -start.altitude
        if depth > 0.0:
            raise ValueError(
                f"start.depth_m = {depth:g}: a ship floats; say vessel.kind = 'uuv' for a submerged vehicle"
            )
        for i, m in enumerate(manoeuvres):
            if m.kind in ("dive", "surface"):
                raise ValueError(f"manoeuvre[{i}].kind = {m.kind!r}: a ship cannot; say vessel.kind = 'uuv'")

    def trajectory(self, voyage: Voyage) -> World:
        """See `Vessel.trajectory`."""
        return _world(self, voyage)


@register_vessel
class Uuv(KinematicVessel):
    """An underwater vehicle. It follows dive commands, and its wave motion decreases with depth."""

    dives: ClassVar[bool] = True

    kind: Literal["uuv"] = "uuv"

    def trajectory(self, voyage: Voyage) -> World:
        """See `Vessel.trajectory`."""
        return _world(self, voyage)
