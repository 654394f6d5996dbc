"""What ``simnav show`` and the reference say of the keys of instruments and faults."""

from __future__ import annotations

import pytest

from simnav.field_meanings import meanings
from simnav.sensors import ImuSpec, fault_specs, instrument_specs
from simnav.spec import Spec, quantity

OURS = [s for s in (ImuSpec, *instrument_specs(), *fault_specs()) if s.__module__.startswith("simnav.sensors.")]


@pytest.mark.parametrize("spec", OURS, ids=lambda spec: spec.__name__)
def test_every_key_has_a_meaning(spec):
    missing = [name for name, meaning in meanings(spec).items() if not meaning and name != "kind"]
    assert not missing, f"the docstring of {spec.__name__} does not say in 'Attributes' what {missing} mean"


def test_a_class_goes_before_its_bases_and_units_of_python_are_left_out():
    class Above(Spec):
        """A base.

        Attributes
        ----------
        height, width : float
            Of the base [m].
        """

        height: float = quantity("m")
        width: float = quantity("m")

    class Below(Above):
        """What it is.

        Attributes
        ----------
        width : float
            Its own
            width [m].
        """

        width_keel: float = quantity("m")
        fixed_width: float = quantity("m")
        other: int = 0

    found = meanings(Below)
    assert found["height"] == "Of the base."
    assert found["width"] == "Its own width."
    assert found["width_keel"] == "Its own width (of the component keel)."
    assert "same in every run" in found["fixed_width"]
    assert found["other"] == ""
