"""A magnetometer with three axes in a vessel with iron.

With the field of the Earth b at the place, north-east-down, the reading is ::

    m = (I + S) C' (b + a) + h

with the attitude C (body to north-east-down), the hard iron h (block ``hard_iron``), the symmetric soft iron S (block
``soft_iron``: xx, yy, zz, xy, xz, yz) and what the field really is more than the model says (block ``anomaly``,
north-east-down). The antisymmetric part of the soft iron is a turn of the sensor, which an estimator cannot tell from
the attitude; it is left out.

The field is that of the World Magnetic Model at a place and date, or given. The anomaly is, unless given, as large as
the model's report says that the field differs from it, one sigma. A field is the same in the whole run.

Sources: J. F. Vasconcelos, G. Elkaim, C. Silvestre, P. Oliveira and B. Cardeira, *Geometric approach to strapdown
magnetometer calibration in sensor frame*, IEEE Transactions on Aerospace and Electronic Systems 47 (2), 2011 (hard and
soft iron); National Centers for Environmental Information and British Geological Survey, *The US/UK World Magnetic
Model for 2025-2030: technical report* (the model and its error model), by the library pygeomag.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from simnav.blocks import StateBlock
from simnav.kinds import Component, Datasheet, Kind, NavigationPoint
from simnav.sensors.instrument import ZERO, AidSpec, Instrument, SigmaTriple, register_instrument, turn_to_body
from simnav.spec import NonNegative, Vector, quantity, register_unit
from simnav.types import Array, TapStates

__all__ = ["MagneticField", "model_field"]

register_unit("nt", 1e-9)

_NANOTESLA = 1e-9
#: Rows and columns of the components of the soft iron.
_ROWS, _COLUMNS = np.array([0, 1, 2, 0, 0, 1]), np.array([0, 1, 2, 1, 2, 2])


def model_field(latitude: float, longitude: float, date: float) -> tuple[Array, Array]:
    """The field at sea level by the World Magnetic Model, and its uncertainty.

    Parameters
    ----------
    latitude, longitude : float
        [rad]
    date : float
        Year with its fraction, 2015 or later.

    Returns
    -------
    (3,) array
        North, east, down [T].
    (3,) array
        Standard deviation of the real field about it, by the error model of its report [T].

    Raises
    ------
    ValueError
        If the library is not installed, or no edition of the model holds at the date.
    """
    try:
        from pygeomag import GeoMag
    except ImportError:
        raise ValueError(
            "the World Magnetic Model needs the library pygeomag: pip install 'simnav[logs]'; or give field_nt"
        ) from None
    try:
        model = GeoMag(coefficients_file=f"wmm/WMM_{5 * int(date // 5)}.COF")
        found = model.calculate(float(np.degrees(latitude)), float(np.degrees(longitude)), 0.0, date)
        doubt = found.calculate_uncertainty()
    except (ValueError, OSError):
        raise ValueError(f"date = {date:g}: pygeomag has no World Magnetic Model of that year") from None
    field = _NANOTESLA * np.array([found.x, found.y, found.z])
    return field, _NANOTESLA * np.array([doubt.x, doubt.y, doubt.z])


def _soft(components: Array) -> Array:
    """(3, 3) matrix I + S."""
    matrix = np.eye(3)
    matrix[_ROWS, _COLUMNS] += components
    matrix[_COLUMNS, _ROWS] = matrix[_ROWS, _COLUMNS]
    return matrix


def observe(point: NavigationPoint, sheet: Datasheet) -> tuple[Array, dict[str, Array]]:
    """The reading and its Jacobian by block (`simnav.kinds.Observation`)."""
    blocks = point.blocks
    earth = np.array(sheet.details["field"])
    if "anomaly" in blocks:
        earth = earth + blocks["anomaly"]
    soft_iron = _soft(blocks["soft_iron"]) if "soft_iron" in blocks else np.eye(3)
    into = soft_iron @ point.dcm.T
    body = point.dcm.T @ earth
    north, east, down = earth
    navigation = np.zeros((3, 9))
    navigation[:, 6:9] = into @ np.array([[0.0, -down, east], [down, 0.0, -north], [-east, north, 0.0]])
    jacobian = {"navigation": navigation}
    reading = soft_iron @ body
    if "hard_iron" in blocks:
        reading = reading + blocks["hard_iron"]
        jacobian["hard_iron"] = np.eye(3)
    if "soft_iron" in blocks:
        change = np.zeros((3, 6))
        for k, (i, j) in enumerate(zip(_ROWS, _COLUMNS, strict=True)):
            change[i, k] += body[j]
            if i != j:
                change[j, k] += body[i]
        jacobian["soft_iron"] = change
    if "anomaly" in blocks:
        jacobian["anomaly"] = into
    return reading, jacobian


@register_instrument(
    Kind(
        "magnetic field along three axes of the vessel",
        role="other",
        components=tuple(Component(axis, "nt", limit=1e-3) for axis in ("forward", "starboard", "down")),
        equation=observe,
        datasheet=("field",),
    ),
    example={"sigma_nt": 100.0, "field_nt": [18000.0, 700.0, 46000.0], "hard_iron_nt": 4000.0, "soft_iron": 0.05},
)
class MagneticField(AidSpec):
    """Magnetic field along three axes of the vessel, with its hard and soft iron.

    Attributes
    ----------
    field : tuple of float
        Field of the Earth, north-east-down [T]. Without it, it is that of the World Magnetic Model at the place.
    latitude, longitude, date : float
        Place [rad] and date, a year with its fraction, for the model.
    anomaly : tuple of float
        One sigma of what the field is more than ``field``, north-east-down [T]. By default it is that of the model's
        report; none if ``field`` is given.
    hard_iron : float or tuple of float
        One sigma of the constant field of the vessel [T].
    soft_iron : float
        One sigma of the components of the soft iron.

    Examples
    --------
    >>> spec = MagneticField.from_toml({"sigma_nt": 50.0, "field_nt": [18000.0, 0.0, 46000.0], "soft_iron": 0.05})
    >>> [block.name for block in spec.blocks()]
    ['soft_iron']
    """

    errors: ClassVar[tuple[str, ...]] = (*AidSpec.errors, "hard_iron", "soft_iron", "anomaly")

    kind: Literal["magnetic_field"] = "magnetic_field"
    sigma: SigmaTriple = quantity("nt")
    bias: SigmaTriple = quantity("nt", ZERO)
    bias_instability: SigmaTriple = quantity("nt", ZERO)
    field: Vector = quantity("nt", ZERO)
    latitude: float | None = quantity("deg", None, ge=-np.pi / 2, le=np.pi / 2)
    longitude: float | None = quantity("deg", None)
    date: float | None = Field(None, description="a year with its fraction")
    hard_iron: SigmaTriple = quantity("nt", ZERO)
    soft_iron: NonNegative = 0.0
    anomaly: SigmaTriple = quantity("nt", ZERO)

    @model_validator(mode="before")
    @classmethod
    def _field_of_the_model(cls, given: Any) -> Any:
        """The field at the place, and what it may differ from the real one."""
        if not isinstance(given, Mapping) or "field" in given:
            return given
        place = [given.get(name) for name in ("latitude", "longitude", "date")]
        if not all(isinstance(x, int | float) and not isinstance(x, bool) for x in place):
            raise ValueError("give field_nt (north, east, down), or latitude_deg, longitude_deg and date of the waters")
        field, doubt = model_field(*map(float, place))  # type: ignore[arg-type]
        return {"anomaly": tuple(doubt), **given, "field": tuple(field)}

    @model_validator(mode="after")
    def _horizontal(self) -> MagneticField:
        if not np.hypot(*self.field[:2]) > 0.0:
            raise ValueError(f"field_nt: a field without a horizontal part has no direction; it is {self.field}")
        return self

    def blocks(self) -> tuple[StateBlock, ...]:
        """Hard and soft iron and the anomaly, as far as there are any."""
        found = []
        if any(self.hard_iron):
            found.append(StateBlock("hard_iron", 3, "nt", self.hard_iron))
        if self.soft_iron:
            found.append(StateBlock("soft_iron", 6, "", self.soft_iron))
        if any(self.anomaly):
            found.append(StateBlock("anomaly", 3, "nt", self.anomaly))
        return tuple(found)

    def build(self, name: str, seed: int) -> Instrument:
        """See `AidSpec.build`."""
        return _MagneticField(self, name, seed)


class _MagneticField(Instrument):
    """Parameters as of `Instrument`."""

    def __init__(self, spec: MagneticField, name: str, seed: int):
        super().__init__(spec, name, seed)
        self.spec = spec

    def observe(self, tap: TapStates) -> Array:
        """See `Instrument.observe`."""
        spec, first = self.spec, np.zeros(1)
        earth = np.array(spec.field)
        if any(spec.anomaly):
            earth = earth + self.block("anomaly", first)[0]
        reading = turn_to_body(tap.attitude, earth)
        if spec.soft_iron:
            reading = reading @ _soft(self.block("soft_iron", first)[0])
        if any(spec.hard_iron):
            reading = reading + self.block("hard_iron", first)[0]
        return reading
