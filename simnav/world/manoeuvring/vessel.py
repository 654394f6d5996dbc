"""A registered vessel of a hull with three degrees of freedom."""

from __future__ import annotations

from collections.abc import Sequence

from simnav.world.current import WaterFlow
from simnav.world.manoeuvres import Manoeuvre
from simnav.world.manoeuvring.hull import Hull
from simnav.world.sea import Waves
from simnav.world.start import Start
from simnav.world.trajectory import Voyage
from simnav.world.vessel import KinematicVessel
from simnav.world.wind import AirFlow
from simnav.world.world import World

__all__ = ["ManoeuvringVessel"]


class ManoeuvringVessel(KinematicVessel):
    """A vessel that moves in surge, sway and yaw by the forces on its hull, and is steered by an autopilot.

    It drifts: in a turn it moves to the outside, and in a wind to leeward. A subclass has a `hull` and a kind.

    The time constants of a kinematic vessel are those that the autopilot aims for, and ``turn_rate`` is the highest
    rate that it asks for.
    """

    @property
    def hull(self) -> Hull:
        """The coefficients of the hull."""
        raise NotImplementedError(f"{type(self).__qualname__} has no hull")

    def check(self, start: Start | None, manoeuvres: Sequence[Manoeuvre], parts: Sequence[str]) -> None:
        """See `Vessel.check`."""
        super().check(start, manoeuvres, parts)
        if not self.dives:
            if start is not None and start.altitude < 0.0:
                raise ValueError(f"start.depth_m = {-start.altitude:g}: a vessel of kind {self.kind!r} floats")
            for i, m in enumerate(manoeuvres):
                if m.kind in ("dive", "surface"):
                    raise ValueError(f"manoeuvre[{i}].kind = {m.kind!r}: a vessel of kind {self.kind!r} floats")
        most = self.hull.top_speed
        speeds = {f"manoeuvre[{i}].speed_m_s": m.speed for i, m in enumerate(manoeuvres) if m.kind == "accelerate"}
        for key, speed in ({"start.speed_m_s": start.speed} if start is not None else {}).items() | speeds.items():
            if speed > most:
                raise ValueError(f"{key} = {speed:g}: a vessel of kind {self.kind!r} reaches {most:.2f} m/s")

    def trajectory(self, voyage: Voyage) -> World:
        """See `Vessel.trajectory`."""
        assert voyage.start is not None  # `Vessel.check`
        waves, flow, air = (voyage.surroundings.get(name) for name in ("sea", "current", "wind"))
        return World(
            voyage.start,
            self,
            voyage.manoeuvres,
            waves.sea if isinstance(waves, Waves) else None,
            flow.current if isinstance(flow, WaterFlow) else None,
            rate=voyage.rate,
            seed=voyage.seed,
            depth=waves.depth if isinstance(waves, Waves) else None,
            air=air if isinstance(air, AirFlow) else None,
        )
