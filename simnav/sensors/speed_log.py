"""Speed log: forward speed through the water."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import model_validator

from simnav import kinds
from simnav.geometry.earth import displace
from simnav.geometry.rotation import dcm_from_rpy
from simnav.kinds import Kind, speed_components
from simnav.sensors.instrument import ZERO, AidSpec, Instrument, register_instrument
from simnav.sensors.observation import WATER_SPEED, CompiledInstrument
from simnav.spec import NonNegative, Positive, Vector, quantity
from simnav.types import Array, TapStates

__all__ = ["SpeedLog", "layer_share"]

#: Kinematic viscosity of sea water at 15 degrees Celsius [m^2/s] (ITTC 7.5-02-01-03).
_VISCOSITY = 1.19e-6


def layer_share(speed: Array, protrusion: float, distance: float) -> Array:
    """Share of the speed of the ship that the water has at a log within the turbulent boundary layer of the hull.

    Parameters
    ----------
    speed : (n,) array
        Speed through the water [m/s].
    protrusion : float
        Distance of the sensing volume from the hull [m].
    distance : float
        Length of the hull ahead of it [m].

    Returns
    -------
    (n,) array
        ``(d / delta)^(1/7)`` within the layer of thickness ``delta = 0.37 x (u x / nu)^(-1/5)`` of a flat plate, 1
        outside of it (H. Schlichting and K. Gersten, *Boundary-Layer Theory*, 9th edition, 2017, chapter 18).
    """
    reynolds = np.maximum(np.abs(speed), 1e-3) * distance / _VISCOSITY
    thickness = 0.37 * distance * reynolds**-0.2
    return np.asarray(np.minimum(protrusion / thickness, 1.0) ** (1.0 / 7.0))


@register_instrument(
    Kind("forward speed through the water", "velocity", speed_components("speed"), kinds.WATER_SPEED),
    example={"sigma_m_s": 0.1},
)
class SpeedLog(AidSpec):
    """Forward component of the sensor's velocity through the water, (1 + k) (C' (v - c) + omega x l)_forward.

    v is the velocity of the vessel and c that of the water, north-east-down, C the direction cosine matrix from body
    axes to north-east-down, omega the angular rate, l the lever arm and k the scale-factor error.

    With ``protrusion``, ``distance_from_bow`` and ``calibrated_at`` the log is within the boundary layer of the hull
    (`layer_share`), and was calibrated at a speed: it reads too little below it, and too much above. With ``shear`` the
    water is that at the depth of the sensor, where a current with ``shear_per_s`` is weaker than at the surface.

    Attributes
    ----------
    protrusion, distance_from_bow : float or None
        Place of the sensor in the boundary layer: distance from the hull and from the bow [m].
    calibrated_at : float or None
        Speed at which the log was calibrated in the boundary layer [m/s].
    shear : bool
        Whether it measures the current at its own depth, where ``shear_per_s`` makes that weaker.
    """

    later: ClassVar[Mapping[str, Any]] = {
        **AidSpec.later, "protrusion": None, "distance_from_bow": None, "calibrated_at": None, "shear": False,
    }  # fmt: skip

    kind: Literal["speed_log"] = "speed_log"
    sigma: NonNegative = quantity("m_s")
    bias: NonNegative = quantity("m_s", 0.0)
    bias_instability: NonNegative = quantity("m_s", 0.0)
    scale: NonNegative = quantity("percent", 0.0)
    lever_arm: Vector = quantity("m", ZERO)
    protrusion: Positive | None = quantity("m", None)
    distance_from_bow: Positive | None = quantity("m", None)
    calibrated_at: Positive | None = quantity("m_s", None)
    shear: bool = False
    fixed_bias: float = quantity("m_s", 0.0)
    fixed_scale: float = quantity("percent", 0.0)

    @model_validator(mode="after")
    def _whole_layer(self) -> Self:
        given = {"protrusion_m": self.protrusion, "distance_from_bow_m": self.distance_from_bow}
        given["calibrated_at_m_s"] = self.calibrated_at
        missing = [key for key, value in given.items() if value is None]
        if missing and len(missing) < len(given):
            raise ValueError(f"a log in the boundary layer has {', '.join(given)}; {' and '.join(missing)} is missing")
        return self

    def build(self, name: str, seed: int) -> Instrument:
        """See `AidSpec.build`."""
        return _SpeedLog(self, name, seed)


class _SpeedLog(CompiledInstrument):
    code = WATER_SPEED

    def __init__(self, spec: SpeedLog, name: str, seed: int):
        super().__init__(spec, name, seed)
        self._shear = spec.shear
        self._layer: tuple[float, float, float] | None = None
        if spec.protrusion is not None and spec.distance_from_bow is not None and spec.calibrated_at is not None:
            self._layer = spec.protrusion, spec.distance_from_bow, spec.calibrated_at
        self.in_kernel = self._layer is None and not self._shear

    def reading(self, tap: TapStates) -> tuple[Array, Array, NDArray[np.bool_] | None]:
        """See `Instrument.reading`."""
        value, sigma, there = super().reading(tap)
        if self.in_kernel:
            return value, sigma, there
        flow = self.surroundings.get("current") if self._shear else None
        if flow is not None:
            place = displace(tap.position, self.lever_displacement(tap))
            less = flow.velocity(tap.position, tap.time) - flow.velocity(place, tap.time)
            value = (
                value + (1.0 + self.scale) * np.einsum("ni,ni->n", dcm_from_rpy(tap.attitude)[:, :, 0], less)[:, None]
            )
        if self._layer is not None:
            *layer, calibrated = self._layer
            value = value * (layer_share(value[:, 0], *layer) / layer_share(np.array([calibrated]), *layer))[:, None]
        return value, sigma, there
