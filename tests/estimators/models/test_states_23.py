"""The 23-state and the 9-state model against finite differences, realised errors and closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from simnav.estimator import UnsuitableScenario, make
from simnav.estimators.models.dvl_calibration import DvlCalibrationModel, DvlErrors
from simnav.estimators.models.nine_state import NineStateModel
from simnav.estimators.rows.kalman import Ekf9, Ekf23
from simnav.geometry import earth, rotation
from simnav.types import Datasheet, Instruments, Measurement

LEVER = np.array([2.0, -1.0, -8.0])
SHEETS = (
    Datasheet("gnss", "gnss_position", 1.0, np.ones(3), bias=np.ones(3), lever_arm=LEVER),
    Datasheet("gnss_velocity", "gnss_velocity", 1.0, np.ones(3), lever_arm=LEVER),
    Datasheet("dvl", "dvl", 1.0, 0.01 * np.ones(3), bias=np.full(3, 0.01), scale=0.02, misalignment=np.full(3, 0.01),
              lever_arm=np.array([1.0, 0.5, 3.0])),
    Datasheet("magnetic", "magnetic_compass", 1.0, np.ones(1), bias=np.ones(1)),
    Datasheet("depth", "depth", 1.0, np.ones(1), lever_arm=np.array([1.0, 0.5, 3.0])),
    Datasheet("terrain", "terrain_fix", 1.0, np.ones(2), lever_arm=np.array([1.0, 0.5, 3.0])),
)  # fmt: skip
VALUES = {
    "gnss": [0.9, 0.1, 5.0], "gnss_velocity": [3.0, 1.0, 0.5], "dvl": [3.0, 1.0, 0.5], "magnetic": [0.7],
    "depth": [0.7], "terrain": [0.9, 0.1],
}  # fmt: skip


def shifted(model, e: np.ndarray):
    """Put an error on the state, by its definition; return what undoes it."""
    saved = model.snapshot()
    model.position[:] = earth.displace(model.position, e[:3])
    model.velocity += e[3:6]
    model.dcm[:] = rotation.dcm_from_rotation_vector(e[6:9]) @ model.dcm
    if len(e) > 9:
        model.bias += e[9:15]
        model.calibration += e[15:]
    return saved


def numeric_jacobian(model, m: Measurement, steps: np.ndarray) -> np.ndarray:
    """Central differences of the innovation, which falls by H e when the state has the error e."""
    columns = []
    for k, h in enumerate(steps):
        e = np.zeros(model.size)
        e[k] = h
        innovations = []
        for sign in (-1.0, 1.0):
            saved = shifted(model, sign * e)
            innovations.append(model.measure(m).innovation)
            model.restore(saved)
        columns.append((innovations[0] - innovations[1]) / (2 * h))
    return np.stack(columns, axis=1)


def underway(model, recording_of, large: bool = False):
    """A model in the middle of a voyage, turning and pitching; ``large``: as after a poor start."""
    recording = recording_of(3, 20.0, aids=())
    attitude, velocity = ([0.5, -0.5, 2.5], [8.0, -6.0, 2.0]) if large else ([0.2, -0.15, 2.5], [3.0, -5.0, 0.4])
    start = replace(recording.start, attitude=np.array(attitude), velocity=np.array(velocity))
    P = model.begin(start, Instruments(SHEETS, recording.instruments.imu))
    model.load(recording.data.imu)
    model.propagate(P, 7.004)
    return P


@pytest.mark.parametrize("name", VALUES)
@pytest.mark.parametrize("state", ["usual", "calibrated", "large"])
def test_jacobians_by_finite_differences(recording_of, name: str, state: str):
    model = DvlCalibrationModel()
    underway(model, recording_of, state == "large")
    assert model.size == 23
    if state != "usual":
        model.bias[:] = np.array([1e-4, -2e-4, 1e-4, 1e-3, 2e-3, -1e-3]) * (100.0 if state == "large" else 1.0)
        model.calibration[:] = [0.01, -0.02, 0.015, 0.1, -0.2, 0.05, 0.03, 0.0]
    m = Measurement(7.0, name, model.instruments[name].kind, np.array(VALUES[name]))
    jacobian = model.measure(m).jacobian.copy()
    steps = np.concatenate([np.full(3, 1.0), np.full(3, 1e-2), np.full(3, 1e-5), np.full(6, 1e-5), np.full(8, 1e-4)])
    numeric = numeric_jacobian(model, m, steps)
    # Left out: how the Earth's rate over the lever arm turns with the attitude; the radii, with the latitude.
    for k in (*range(0, 18, 3), 18, 21, 22):
        columns, floor = slice(k, min(k + 3, 23)), {0: 3e-5, 6: 1e-3, 9: 1e-5}.get(k, 1e-6)
        ours, theirs = jacobian[:, columns], numeric[:, columns]
        np.testing.assert_allclose(ours, theirs, rtol=1e-5, atol=floor, err_msg=f"columns {k} on")


def test_the_delay_leaves_the_other_columns_almost_alone(recording_of):
    """With a delay of 5 ms, what its product with other errors adds is of that size."""
    model = DvlCalibrationModel()
    underway(model, recording_of)
    model.calibration[7] = 0.005
    m = Measurement(7.0, "dvl", "dvl", np.array(VALUES["dvl"]))
    jacobian = model.measure(m).jacobian.copy()
    numeric = numeric_jacobian(model, m, np.concatenate([np.full(3, 1.0), np.full(12, 1e-5), np.full(8, 1e-4)]))
    # 5 ms times gravity (attitude) and times 15 m/s (gyroscope bias)
    np.testing.assert_allclose(jacobian, numeric, rtol=0.01, atol=0.08)
    np.testing.assert_allclose(jacobian[:, 15:], numeric[:, 15:], rtol=1e-5, atol=1e-6)


def test_acceleration_is_the_derivative_of_what_the_dvl_sees(recording_of):
    """The column of the delay against the DVL's own velocity, a fiftieth of a second earlier and later."""
    recording = recording_of(3, 20.0, aids=())
    sheet = Datasheet("dvl", "dvl", 1.0, np.ones(3))
    m = Measurement(7.0, "dvl", "dvl", np.zeros(3))
    seen = []
    for at in (9.99, 10.01, 10.0):
        model = DvlCalibrationModel()
        P = model.begin(recording.start, Instruments((sheet,), recording.instruments.imu))
        model.load(recording.data.imu)
        model.propagate(P, at)
        seen.append(-model.measure(m).innovation)
        column = model.measure(m).jacobian[:, model.places.delay][:, 0]
    np.testing.assert_allclose(column, -(seen[1] - seen[0]) / 0.02, atol=0.04)


def with_dvl(recording, *, late: float = 0.0, arm: np.ndarray | None = None, sheet: Datasheet):
    """The recording with a DVL that is stamped late, and a datasheet of another lever arm."""
    stream = recording.data.aids["dvl"]
    aids = {**recording.data.aids, "dvl": replace(stream, time=stream.time + late)}
    sheet = replace(sheet, lever_arm=sheet.lever_arm if arm is None else sheet.lever_arm - arm)
    others = [s for s in recording.instruments.values() if s.name != "dvl"]
    return replace(
        recording,
        data=replace(recording.data, aids=aids),
        instruments=Instruments((*others, sheet), recording.instruments.imu, recording.instruments.step),
    )


def test_realised_errors_are_found(recording_of, run_over):
    """Misalignment and scale as drawn, a lever arm and a delay laid over: each within four sigma of the truth."""
    from simnav.sensors import Dvl
    from simnav.types import TapStates

    gnss = Datasheet("gnss", "gnss_position", 1.0, 0.1 * np.ones(3))
    velocity = Datasheet("gnss_velocity", "gnss_velocity", 1.0, 0.01 * np.ones(3))
    sheet = Datasheet(
        "dvl", "dvl", 5.0, 0.005 * np.ones(3), phase=0.1, scale=0.02, misalignment=np.full(3, 0.02),
        lever_arm=np.array([1.0, 0.5, 3.0]),
    )  # fmt: skip
    recording = recording_of(4, 300.0, aids=(gnss, velocity, sheet))
    # What the closed-form world drew, from what it measures without noise.
    ideal = recording_of(4, 300.0, aids=(gnss, velocity, replace(sheet, sigma=1e-9 * np.ones(3))))
    value = ideal.data.aids["dvl"].value
    straight = recording_of(4, 300.0, aids=(gnss, velocity, replace(sheet, sigma=1e-9 * np.ones(3), scale=0.0,
                                                                    misalignment=np.zeros(3))))  # fmt: skip
    u = straight.data.aids["dvl"].value
    matrix = np.linalg.lstsq(u, value, rcond=None)[0].T  # value = matrix u
    scale = np.cbrt(np.linalg.det(matrix)) - 1.0
    eta = rotation.rotation_vector_from_dcm((matrix / (1.0 + scale)).T)
    # The simulator's DVL has the same sign: z = (1 + k) R(eta)' u.
    one = np.zeros((1, 3))
    tap = TapStates(np.array([1.0]), one, np.array([[2.0, 0.0, 0.0]]), one, one, one)
    turned = Dvl(sigma=0.0, fixed_misalignment=(0.0, 0.0, 0.01), fixed_scale=0.1).build("dvl", 1).sense(tap).value[0]
    np.testing.assert_allclose(turned, 1.1 * 2.0 * np.array([np.cos(0.01), -np.sin(0.01), 0.0]), atol=1e-12)

    arm, late = np.array([0.3, -0.2, 0.25]), 0.04
    estimator = Ekf23(lever_arm=0.3, delay=0.05)
    run_over(estimator, with_dvl(recording, late=late, arm=arm, sheet=sheet))
    found, P = estimator.model.calibration, estimator.covariance
    truth = np.concatenate([eta, arm, [scale, late]])
    sigma = np.sqrt(np.diag(P)[15:])
    assert np.all(np.abs(found - truth) < 4.0 * sigma), (found - truth) / sigma
    # And they were found, not merely allowed for.
    assert sigma[0:3].max() < 0.004
    assert sigma[3:5].max() < 0.15
    assert sigma[6] < 0.002
    assert sigma[7] < 0.01
    places = DvlErrors(slice(15, 18), slice(18, 21), slice(21, 22), slice(22, 23))
    assert estimator.model.places == places
    assert estimator.model.blocks.of("dvl") == list(places)


def test_it_needs_a_dvl_and_has_23_states_whatever_else_there_is(recording_of):
    recording = recording_of(0, 2.0)
    without = Instruments([s for s in SHEETS if s.kind != "dvl"], recording.instruments.imu)
    for name in ("ekf-23", "kf-23"):
        with pytest.raises(UnsuitableScenario, match="DVL"):
            make(name).reset(recording.start, without)
        estimator = make(name)
        estimator.reset(recording.start, Instruments(SHEETS, recording.instruments.imu))
        assert estimator.covariance.shape == (23, 23)


def test_the_noise_as_printed(recording_of):
    recording = recording_of(0, 2.0)
    model = DvlCalibrationModel(preset="paper")
    model.begin(recording.start, Instruments(SHEETS, recording.instruments.imu))
    assert {n: model.noise[n][0, 0] for n in ("gnss", "gnss_velocity", "dvl")} == pytest.approx(
        {"gnss": 25.0, "gnss_velocity": 0.01, "dvl": 0.01}
    )
    assert model.noise["depth"][0, 0] == pytest.approx(1.0)
    with pytest.raises(ValueError, match='preset is \'print\'; it must be "default" or "paper"'):
        Ekf23(preset="print")


def test_second_dvl_has_no_states(recording_of):
    second = replace(SHEETS[2], name="dvl_two")
    model = DvlCalibrationModel()
    recording = recording_of(0, 2.0)
    model.begin(recording.start, Instruments((*SHEETS, second), recording.instruments.imu))
    linearised = model.measure(Measurement(0.0, "dvl_two", "dvl", np.ones(3)))
    assert not linearised.jacobian[:, 15:].any()
    assert np.all(np.diag(linearised.noise) > second.sigma**2 + second.bias**2 - 1e-12)


@pytest.mark.parametrize("name", VALUES)
def test_nine_state_jacobians(recording_of, name: str):
    model = NineStateModel()
    underway(model, recording_of)
    m = Measurement(7.0, name, model.instruments[name].kind, np.array(VALUES[name]))
    jacobian = model.measure(m).jacobian.copy()
    numeric = numeric_jacobian(model, m, np.concatenate([np.full(3, 1.0), np.full(3, 1e-2), np.full(3, 1e-5)]))
    np.testing.assert_allclose(jacobian, numeric, rtol=1e-5, atol=1e-3)


def test_nine_states_grow_by_fixed_sigmas(recording_of):
    """In a second, whatever the IMU: the variances printed, and what velocity and attitude errors do meanwhile."""
    recording = recording_of(0, 10.0)
    model = NineStateModel(sigma_position=0.3, sigma_velocity=0.2, sigma_attitude_deg=0.1)
    P = model.begin(recording.start, recording.instruments)
    assert P.shape == (9, 9)
    np.testing.assert_array_equal(np.diag(model.noise["gnss"]), [6.25, 6.25, 25.0])
    np.testing.assert_allclose(model.noise["dvl"], 0.01 * np.eye(3))
    np.testing.assert_array_equal(model.noise["depth"], [[0.09]])
    P[:] = 0.0
    model.load(recording.data.imu)
    model.propagate(P, 1.0)
    np.testing.assert_allclose(np.diag(P), np.repeat([0.09, 0.04, np.radians(0.1) ** 2], 3), rtol=1e-12)
    before = P.copy()  # what the motion adds in a second: there was nothing else
    model.propagate(P, 2.0)
    F = model.transition[:9, :9]
    np.testing.assert_allclose(P, F @ before @ F.T + before, rtol=1e-9, atol=1e-15)
    assert not model.bias.any()


def test_nine_states_take_the_datasheet_where_told_to(recording_of):
    recording = recording_of(0, 2.0)
    model = NineStateModel(sigma_gnss_horizontal=0.0, sigma_dvl=0.0)
    model.begin(recording.start, recording.instruments)
    np.testing.assert_allclose(np.diag(model.noise["gnss"]), [2.25, 2.25, 9.0])
    assert model.noise["dvl"][0, 0] == pytest.approx(0.0004, rel=0.01)


def test_nine_states_navigate(recording_of, run_over):
    errors, _ = run_over(Ekf9(), recording_of(2, 200.0))
    assert np.sqrt(np.mean(errors[50:, :2] ** 2)) < 1.5
    assert np.isfinite(errors).all()
