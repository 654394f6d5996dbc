"""The compiled measurement equations as objects: complete, and with the terms of the instruments that have them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from simnav import estimators, kinds
from simnav.estimators.models.equations import EQUATIONS, Equation, equation_of, equation_of_kind
from simnav.testing.contract_check import contract_recording
from simnav.types import KINDS, Datasheet


def test_there_is_one_for_each_name_and_one_for_none():
    assert set(EQUATIONS) == set(kinds.EQUATIONS)
    assert len({each.code for each in EQUATIONS.values()}) == len(EQUATIONS)
    for sheet in contract_recording(0).instruments.values():
        found = equation_of(sheet)
        assert found is equation_of_kind(sheet.kind)
        assert found.name == sheet.equation
        assert found is EQUATIONS.get(sheet.equation, found)
        if KINDS[sheet.kind].observation is not None:
            assert type(found) is Equation


def sheet(kind: str) -> Datasheet:
    return Datasheet(
        "it", kind, 1.0, np.array(0.1), scale=0.01, misalignment=np.array([0.1, 0.2, 0.3]),
        lever_arm=np.array([2.0, 1.0, 0.5]),
    )  # fmt: skip


def test_the_noise_of_the_gyroscopes_is_that_of_the_velocity_of_the_lever_arm():
    """Of ``w x l`` with white w, by drawing it."""
    rates = 0.1 * np.random.default_rng(1).standard_normal((200_000, 3))
    arm = sheet("dvl").lever_arm
    drawn = np.cov(np.cross(rates, arm).T)
    for kind, axes in (("dvl", slice(0, 3)), ("speed_log", slice(0, 1))):
        found = equation_of(sheet(kind)).white_noise(sheet(kind), 0.0, 0.01) - 0.01 * np.eye(axes.stop)
        np.testing.assert_allclose(found, drawn[axes, axes], atol=0.01 * np.abs(drawn).max())
    for kind in ("gnss_position", "depth", "gyrocompass"):
        found = equation_of(sheet(kind)).white_noise(sheet(kind), 0.04, 0.01)
        np.testing.assert_allclose(found, 0.05 * np.eye(len(found)))


def test_an_uncalibrated_log_has_the_errors_of_its_scale_and_its_mounting_as_noise():
    rng = np.random.default_rng(2)
    s, a = 0.01 * rng.standard_normal((100_000, 1)), [0.1, 0.2, 0.3] * rng.standard_normal((100_000, 3))
    u = np.array([3.0, 1.0, -0.5])
    drawn = np.var(s * u + np.cross(u, a), axis=0)
    found = equation_of(sheet("dvl")).uncalibrated_noise(sheet("dvl"), u)
    np.testing.assert_allclose(np.diag(found), drawn, rtol=0.03)


def test_no_other_file_compares_names_of_equations():
    folder = Path(estimators.__file__).parent
    assert not [
        p.name for p in folder.rglob("*.py") if ".equation ==" in p.read_text() or ".equation !=" in p.read_text()
    ]
