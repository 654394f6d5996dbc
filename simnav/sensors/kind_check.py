"""Whether the specification of an instrument fits the kind that it is registered as."""

from __future__ import annotations

from simnav.kinds import Kind
from simnav.plugins import PluginError
from simnav.spec import UNITS, Spec, unit_of

__all__ = ["check_kind"]


def check_kind(cls: type[Spec], base: type[Spec], name: str, kind: Kind) -> None:
    """PluginError, one sentence, where fields, units or details of a class do not fit.

    Parameters
    ----------
    cls, base : type
        The specification, and the base class of all instruments.
    name : str
        Name of the kind.
    kind : Kind
        Its properties.
    """
    for field, info in base.model_fields.items():
        unit = unit_of(info)
        if unit_of(cls.model_fields[field]) != unit:
            raise PluginError(
                f"kind {name!r}: every instrument has the field {field!r}"
                f"{'' if unit is None else f', in {unit}'}; {cls.__qualname__} should call its own something else"
            )
    for component in kind.components:
        for unit in (component.unit, component.error_unit):
            if unit not in UNITS:
                raise PluginError(
                    f"kind {name!r}: the unit {unit!r} is unknown; simnav.spec.register_unit adds one; "
                    f"there are: {', '.join(UNITS)}"
                )
    for component in kind.side:
        if component.unit and component.unit not in UNITS:
            raise PluginError(
                f"kind {name!r}: the unit {component.unit!r} of its side information {component.name!r} is "
                f"unknown; it is empty for a number without a unit, or one of: {', '.join(UNITS)}"
            )
    for detail in kind.datasheet:
        if detail not in cls.model_fields:
            raise PluginError(
                f"kind {name!r}: the datasheet names {detail!r}, but {cls.__qualname__} has no such field"
            )
