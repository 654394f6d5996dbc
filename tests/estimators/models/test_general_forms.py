"""The compiled models against the same models in the general form: one epoch, with the same blocks of states."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from simnav.estimators.models.chains import chain_of
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.models.ship import ShipModel
from simnav.recording import Recording
from simnav.source import record
from simnav.types import Array, Instruments, Measurement
from tests.cases.closed_form import EVERY_KIND
from tests.cases.fjord import fjord
from tests.cases.general_forms import GeneralInertial, GeneralShip


@pytest.fixture
def recording(plugins) -> Recording:
    """Ranges with a receiver's clock; the datasheets of all compiled kinds are added."""
    return record(fjord(plugins, "clock", duration=2.0), 2)


def close(found: Array, expected: Array, sigma: Array, part: float) -> None:
    """Whether two matrices of the error agree, each component in units of its sigma."""
    scale = sigma / sigma[:, None]
    assert np.abs(scale * (found - expected)).max() < part


@pytest.fixture
def inertial(recording) -> tuple[InertialModel, GeneralInertial, Array, Array]:
    """Both forms and their covariances after a second, not upright, with errors of the instruments."""
    given = recording.instruments
    sheets = [*EVERY_KIND, *(s for s in given.values() if s.blocks)]
    instruments = Instruments(sheets, given.imu, given.step)
    start = replace(recording.start, attitude=np.array([0.2, -0.15, 2.5]), velocity=np.array([3.0, -1.0, 0.4]))
    imu = next(recording.steps()).imu
    compiled, general = InertialModel(), GeneralInertial()
    covariances = [model.begin(start, instruments) for model in (compiled, general)]
    values = np.random.default_rng(5).standard_normal(compiled.size - 15) * np.sqrt(covariances[0].diagonal()[15:])
    compiled.calibration[:] = general.extra[:] = 0.3 * values
    for model, covariance in zip((compiled, general), covariances, strict=True):
        model.load(imu)
        model.propagate(covariance, 1.0)
    return compiled, general, *covariances


def test_both_inertial_forms_have_the_same_blocks_at_the_same_places(inertial):
    compiled, general, *_ = inertial
    declared = {label: at for label, at in compiled.blocks.at.items() if at.start >= 15}
    assert declared == general.blocks.at
    assert {label.partition(".")[2] for label in declared} >= {"bias", "current", "scale", "misalignment"}
    assert compiled.blocks.clocks == general.blocks.clocks != []
    assert compiled.blocks.states[6:] == general.blocks.states


def test_the_inertial_motion_is_the_same_bit_for_bit(inertial):
    compiled, general, *_ = inertial
    own = np.concatenate([compiled.position, compiled.velocity, compiled.dcm.ravel(), compiled.bias])
    assert np.array_equal(general.x, own)
    np.testing.assert_allclose(general.extra, compiled.calibration, rtol=1e-14)


def test_the_inertial_transition_and_covariance_are_those_of_differences(inertial):
    compiled, general, covariance, of_general = inertial
    sigma = np.sqrt(covariance.diagonal())
    F = np.eye(compiled.size)
    compiled.carry(F, 1.0)
    close(general._last, F, sigma, 1e-5)
    np.testing.assert_allclose(general._last[15:, 15:], F[15:, 15:], rtol=1e-13)
    close(of_general, covariance, 1.0 / sigma, 2e-5)
    np.testing.assert_allclose(of_general[15:, 15:], covariance[15:, 15:], rtol=1e-12)


def test_the_inertial_readings_and_jacobians_are_those_of_differences(inertial):
    """The compiled Jacobians leave out products of a scale factor or a misalignment, so these are zero for them."""
    compiled, general, covariance, _ = inertial
    sigma = np.sqrt(covariance.diagonal())
    for name, sheet in compiled.instruments.items():
        m = Measurement(1.0, name, sheet.kind, general.read(general.x, 1.0, sheet, general.extra))
        found = compiled.measure(m)
        assert np.abs(found.innovation).max() < 2e-6, name
    for label, at in general.blocks.at.items():
        if label.endswith(("scale", "misalignment")):
            compiled.calibration[at.start - 15 : at.stop - 15] = general.extra[at.start - 15 : at.stop - 15] = 0.0
    for name, sheet in compiled.instruments.items():
        m = Measurement(1.0, name, sheet.kind, general.read(general.x, 1.0, sheet, general.extra))
        found, of_general = compiled.measure(m).jacobian.copy(), general.measure(m).jacobian
        spread = np.sqrt(found**2 @ sigma**2)  # what the state lets expect of the reading
        assert np.abs((found - of_general) * sigma / spread[:, None]).max() < 1e-4, name


@pytest.fixture
def ship(recording) -> tuple[ShipModel, GeneralShip, Array, Array]:
    """Both forms of the ship and their covariances after a second of a turn."""
    sheets = [s for s in EVERY_KIND if s.kind in ("terrain_fix", "gyrocompass", "speed_log")]
    start = replace(recording.start, attitude=np.array([0.0, 0.0, 2.5]), velocity=np.array([3.0, -1.0, 0.0]))
    instruments = Instruments([replace(s, lever_arm=np.array([4.0, -2.0, 0.0])) for s in sheets])
    compiled, general = ShipModel(), GeneralShip()
    covariances = [model.begin(start, instruments) for model in (compiled, general)]
    compiled.x[4:7] = general.x[5:] = 0.02, 0.4, -0.2
    values = np.random.default_rng(5).standard_normal(compiled.size - 7) * np.sqrt(covariances[0].diagonal()[7:])
    compiled.x[7:] = general.extra[:] = values
    for model, covariance in zip((compiled, general), covariances, strict=True):
        model.propagate(covariance, 1.0)
    return compiled, general, *covariances


def test_both_ships_have_the_same_blocks_at_the_same_places(ship):
    compiled, general, *_ = ship
    declared = {label: at for label, at in compiled.blocks.at.items() if at.start >= 7}
    assert declared == general.blocks.at
    assert {label.partition(".")[2] for label in declared} == {"bias", "scale"}


def test_the_ship_s_motion_transition_and_covariance_are_those_of_differences(ship):
    compiled, general, covariance, of_general = ship
    np.testing.assert_allclose(general.x, np.concatenate([compiled.position, compiled.x[2:7]]), rtol=1e-14)
    np.testing.assert_allclose(general.extra, compiled.x[7:], rtol=1e-14)
    sigma = np.sqrt(covariance.diagonal())
    close(general._last, compiled.transition, sigma, 1e-6)
    close(of_general, covariance, 1.0 / sigma, 1e-5)


def test_the_ship_s_readings_and_jacobians_are_those_of_differences(ship):
    compiled, general, *_ = ship
    for name, sheet in compiled.instruments.items():
        reading = general.read(general.x, 1.0, sheet, general.extra)
        found, of_general = (
            model.measure(Measurement(1.0, name, sheet.kind, reading)) for model in (compiled, general)
        )
        assert np.abs(found.innovation).max() < 2e-6
        np.testing.assert_allclose(found.jacobian, of_general.jacobian, atol=3e-5)
        if sheet.kind != "terrain_fix":  # its lever arm heels
            np.testing.assert_allclose(found.noise, of_general.noise, rtol=1e-14)


def test_the_ship_s_chain_is_that_of_the_general_form(ship, recording):
    """Residuals and derivatives of motion factors away from where the front went, and a step along the motion."""
    chains = [chain_of(type(model)()) for model in ship[:2]]
    rng = np.random.default_rng(2)
    found = []
    for chain in chains:
        chain.begin(recording.start, Instruments([*ship[0].instruments.values()]))
        for time in (0.6, 1.5):
            chain.propagate(time)
            chain.extend()
    step = rng.standard_normal((3, chains[0].size)) * np.where(np.arange(chains[0].size) < 2, 3.0, 0.01)
    for chain in chains:
        chain.retract(step)
        chain.linearise_motion()
        motions = chain.motions
        found.append((motions["residual"].copy(), motions["jacobian"].copy(), chain.along_motion(0.1 * step)))
    for compiled, general in zip(*found, strict=True):
        np.testing.assert_allclose(general, compiled, atol=2e-4)
