"""Structures: what a field may be named."""

from __future__ import annotations

import pytest

from simnav.structures import filled, structure


@pytest.mark.parametrize("name", ["shape", "size", "mean", "copy"])
def test_a_field_that_a_record_of_numpy_would_hide_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match=f"field '{name}' of a structure: .* rename it"):
        structure(**{name: float})


def test_a_field_is_read_and_written_by_its_name() -> None:
    kind = structure(count=int, limits=2)
    array = filled(kind, limits=[1.0, 3.0])
    own = array.view(kind)[0]
    own.count += 2
    own.limits[1] = 4.0
    assert array.view(kind)[0].count == 2
    assert array.tolist()[1:] == [1.0, 4.0]
