"""One kernel a measurement or a step, where nothing adapts: the same numbers, and never in a hook's way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from simnav.estimator import make
from simnav.estimators.adaptations.adaptive_step import step_rule
from simnav.estimators.adaptations.adkf import AdaptiveFactor
from simnav.estimators.adaptations.base import Adaptation
from simnav.estimators.adaptations.gating import ChiSquareGate
from simnav.estimators.adaptations.sage_husa import SageHusa
from simnav.estimators.algebra.joseph import project
from simnav.estimators.composition import Row
from simnav.estimators.models.channels import by_channel, instrument_of
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.rows.kalman import Ekf, Ekf23
from simnav.estimators.solvers.kalman import KalmanEstimator
from simnav.scenario import load
from simnav.source import record
from simnav.types import Measurement


class StepByStep(Adaptation):
    """Changes nothing, but might."""


def test_projection():
    rng = np.random.default_rng(1)
    root = rng.standard_normal((7, 7))
    P, H = root @ root.T, rng.standard_normal((3, 7)) * (rng.random((3, 7)) < 0.5)
    cross, predicted = np.empty((7, 3)), np.empty((3, 3))
    project(P, H, cross, predicted)
    np.testing.assert_allclose(cross, P @ H.T, rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(predicted, H @ P @ H.T, rtol=1e-13, atol=1e-13)
    again = np.empty((7, 3)), np.empty((3, 3))
    project.unchecked(P, H, *again)
    np.testing.assert_array_equal(again[0], cross)
    np.testing.assert_array_equal(again[1], predicted)


@pytest.mark.parametrize("row", [Ekf, Ekf23])
def test_it_is_the_same_filter(recording_of, row: type[Row]):
    recording = recording_of(2, 60.0)
    plain, stepwise = row(), row()
    stepwise.solver.adaptation = StepByStep()
    for estimator in (plain, stepwise):
        estimator.reset(recording.start, recording.instruments)
    taken = counted(plain.model, "assimilate"), counted(plain.model, "assimilate_step")
    for packet in recording.steps():
        a, b = plain.update(packet), stepwise.update(packet)
        assert a.diagnostics == pytest.approx(b.diagnostics, rel=1e-6, nan_ok=True)
        np.testing.assert_allclose(a.position, b.position, rtol=1e-12)
        for state in ("velocity", "dcm", "bias", "calibration"):
            np.testing.assert_allclose(*(getattr(e.model, state) for e in (plain, stepwise)), rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(a.covariance, b.covariance, rtol=1e-8, atol=1e-14)
    assert taken[row is Ekf][0] > 50
    assert taken[row is Ekf23][0] == 0


def counted(model, name: str) -> list[int]:
    """How often a method of a model had a result."""
    method, times = getattr(model, name), [0]

    def counting(*args):
        used = method(*args)
        times[0] += used is not None
        return used

    setattr(model, name, counting)
    return times


ADAPTIVE = ("iae", "rae", "sage-husa", "vb-akf", "huber-kf", "igg3", "mckf", "student-t", "adkf", "adkf-paper", "imm")
FACTORS = ("adkf:factor=two-segment", "adkf:factor=exponential")


@pytest.mark.parametrize("row", ["ekf", "gated-ekf", "fading-ekf", *ADAPTIVE, *FACTORS])
def test_a_step_in_one_call_has_the_same_bits(recording_of, row: str):
    """Readings between the samples of the IMU, two at one time, many of them, wrong ones, none, and no IMU."""
    recording = recording_of(2, 40.0)
    name, _, option = row.partition(":")
    parameters = dict([option.split("=")]) if option else {}
    whole, single = make(name, **parameters), make(name, **parameters)
    single.solver.takes_steps = False
    for estimator in (whole, single):
        estimator.reset(recording.start, recording.instruments)
    times, rng, used = counted(whole.model, "assimilate_step"), np.random.default_rng(3), set()
    flagged = 0
    for k, packet in enumerate(recording.steps()):
        aids = [m for _ in range(4) for m in packet.aids] if k % 5 == 1 else packet.aids if k % 5 else []
        late = sorted(min(m.time, packet.time - rng.uniform(0.0, 0.9)) for m in aids)
        aids = [m._replace(time=time) for m, time in zip(aids, late, strict=True)]
        if k % 4 == 2:
            aids = [m._replace(value=m.value + 1e-5 * rng.standard_normal(len(m.value))) for m in aids]
        if 20 <= k < 28:  # all at once: the prediction is taken as wrong
            aids = [m._replace(value=m.value + (1e-4 if m.kind == "gnss_position" else 2.0)) for m in aids]
        packet = replace(packet, aids=aids, imu=None if k % 7 == 3 else packet.imu)
        a, b = whole.update(packet), single.update(packet)
        np.testing.assert_equal(a.diagnostics, b.diagnostics)
        assert a.flagged == b.flagged
        flagged += len(a.flagged)
        for state in (*whole.model.state, *whole.model.memory):
            np.testing.assert_array_equal(getattr(whole.model, state), getattr(single.model, state))
        np.testing.assert_array_equal(whole.covariance, single.covariance)
        used.add(tuple(value for name, value in a.diagnostics.items() if name.startswith("sigma_")))
    assert times[0] == 40
    assert (len(used) > 5) == (name in ADAPTIVE)
    assert (flagged > 5) == (row == "gated-ekf")
    if isinstance(whole.solver.adaptation, AdaptiveFactor) and name == "adkf":
        kept = [e.solver.adaptation.prediction.arrays(whole.model.size)[-1] for e in (whole, single)]
        np.testing.assert_array_equal(*kept)
        assert kept[0][1:].all()  # the motion was inflated


def test_an_adaptation_that_chooses_in_its_own_way_is_asked(recording_of, run_over):
    asked = []

    class Own(SageHusa):
        def estimate(self, innovation):
            asked.append(innovation)
            return super().estimate(innovation)

    run_over(KalmanEstimator(InertialModel(), Own()), recording_of(2, 5.0))
    assert asked
    assert Own.rule is None is not SageHusa.rule
    instruments = recording_of(2, 5.0).instruments
    for full in (False, True):
        adaptation = SageHusa(full=full)
        adaptation.reset(instruments)
        rule = step_rule(adaptation, list(instruments), np.ones(15))
        assert (rule is None) == full  # NumPy bounds a full matrix


def test_a_gate_counts_channels_in_python():
    recording = record(load("dive-to-the-bottom").with_values({"duration_s": 2.0}), 0)
    for instruments in (recording.instruments, by_channel(recording.instruments)):
        gate = ChiSquareGate()
        gate.reset(instruments)
        channels = any(sheet.name != instrument_of(sheet) for sheet in instruments.values())
        assert (step_rule(gate, list(instruments), np.ones(15)) is None) == channels
    assert channels


@pytest.mark.parametrize("own", [{"statistic": "ratio"}, {"target": "P"}])
def test_a_factor_that_only_numpy_computes_has_no_rule(recording_of, own: dict[str, str]):
    adaptation = AdaptiveFactor(**own)
    adaptation.reset(recording_of(2, 5.0).instruments)
    assert step_rule(adaptation, list(adaptation.instruments), np.ones(15)) is None


@pytest.mark.parametrize("hook", ["_observe", "_absorb"])
def test_a_solver_that_does_it_in_its_own_way_is_asked(recording_of, run_over, hook: str):
    seen = []

    def own(self, argument):
        seen.append(argument)
        return getattr(KalmanEstimator, hook)(self, argument)

    recording = recording_of(2, 5.0)
    estimator = type("Hooked", (KalmanEstimator,), {hook: own, "assimilates": False})(InertialModel())
    run_over(estimator, recording)
    assert len(seen) == sum(map(len, (p.aids for p in recording.steps())))


@pytest.mark.parametrize("method", ["measure", "correct"])
def test_a_model_that_does_it_in_its_own_way_says_so_and_is_asked(recording_of, run_over, method: str):
    seen = []

    def own(self, argument):
        seen.append(argument)
        return getattr(InertialModel, method)(self, argument)

    with pytest.raises(TypeError, match=f"Silent has {method} of its own"):
        type("Silent", (InertialModel,), {method: own})
    recording = recording_of(2, 5.0)
    estimator = KalmanEstimator(type("Own", (InertialModel,), {method: own, "fused": False})())
    run_over(estimator, recording)
    assert seen


def test_singular_or_meaningless_measurements_change_nothing(recording_of):
    """Two noiseless fixes of one place: the second has a singular covariance. And a heading straight up."""
    recording = recording_of(2, 5.0)
    estimator = Ekf()
    estimator.reset(recording.start, recording.instruments)
    model, P = estimator.model, estimator.covariance
    name = next(s.name for s in recording.instruments.of_kind("gnss_position"))
    model.noise[name] = np.zeros((3, 3))
    m = Measurement(0.0, name, "gnss_position", model.position.copy())
    dx = np.empty(model.size)
    P[:3], P[:, :3] = 0.0, 0.0
    P[6:9], P[:, 6:9] = 0.0, 0.0
    before, state = P.copy(), model.snapshot()
    assert model.assimilate(m, P, dx)[0] == -1.0
    compass = next(s for s in recording.instruments.of_kind("gyrocompass", "magnetic_compass"))
    upward = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    model.dcm[:] = upward
    assert model.assimilate(Measurement(0.0, compass.name, compass.kind, np.ones(1)), P, dx)[0] == -1.0
    np.testing.assert_array_equal(P, before)
    np.testing.assert_array_equal(model.position, state[0])
    np.testing.assert_array_equal(model.dcm, upward)
