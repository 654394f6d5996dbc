"""The loop of the filters: the same numbers compiled, with kernels from Python, and with the methods of a model."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from simnav.estimator import make
from simnav.estimators.adaptations.adkf import AdaptiveFactor
from simnav.estimators.adaptations.gating import ChiSquareGate
from simnav.estimators.adaptations.robust import HuberWeights
from simnav.estimators.adaptations.sage_husa import SageHusa
from simnav.estimators.algebra.joseph import project
from simnav.estimators.models.channels import by_channel, instrument_of
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.models.inertial_points import InertialPoints
from simnav.estimators.rows.kalman import Ekf
from simnav.estimators.solvers.filter_step import filter_step
from simnav.estimators.solvers.kalman import FilterFunctions, KalmanEstimator
from simnav.estimators.solvers.sigma_point import SigmaPointEstimator
from simnav.scenario import load
from simnav.source import record
from simnav.types import Measurement


class ByMethods(KalmanEstimator):
    """The plain filter, whose functions are methods in Python."""

    def functions(self):
        own = super().functions()
        return FilterFunctions(self.propagate, self.predict, own.choose, own.inflate, self.correct, self.retract)


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


ADAPTIVE = ("iae", "rae", "sage-husa", "vb-akf", "huber-kf", "igg3", "mckf", "student-t", "adkf", "adkf-paper", "imm")
VARIANTS = (
    "adkf:factor=two-segment", "adkf:factor=exponential", "adkf-paper:factor=two-segment",
    "adkf-paper:factor=exponential", "iae:newest=True", "mckf:begin=prediction",
)  # fmt: skip


@pytest.mark.parametrize("row", ["ekf", "gated-ekf", "fading-ekf", *ADAPTIVE, *VARIANTS])
def test_compiled_and_plain_have_the_same_bits(recording_of, row: str):
    """Readings between the samples of the IMU, two at one time, many of them, wrong ones, none, and no IMU."""
    recording = recording_of(2, 40.0)
    name, _, option = row.partition(":")
    key, _, value = option.partition("=")
    parameters = {key: True if value == "True" else value} if option else {}
    whole, single = make(name, **parameters), make(name, **parameters)
    for estimator in (whole, single):
        estimator.reset(recording.start, recording.instruments)
    assert whole.solver._compiled
    single.solver._compiled = False
    rng, used = np.random.default_rng(3), set()
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
    assert (len(used) > 5) == (name in ADAPTIVE)
    assert (flagged > 5) == (row == "gated-ekf")
    if isinstance(whole.solver.adaptation, AdaptiveFactor) and name == "adkf":
        first = [e.solver.adaptation.prediction_test.record(whole.model.size).first for e in (whole, single)]
        np.testing.assert_array_equal(*first)
        assert first[0].all()  # the motion was inflated


@pytest.mark.parametrize("adaptation", [None, SageHusa, HuberWeights, AdaptiveFactor])
def test_kernels_and_methods_are_the_same_filter(recording_of, adaptation):
    recording = recording_of(2, 60.0)
    filters = [kind(InertialModel(), adaptation and adaptation()) for kind in (KalmanEstimator, ByMethods)]
    for estimator in filters:
        estimator.reset(recording.start, recording.instruments)
    assert [f._compiled for f in filters] == [True, False]
    for packet in recording.steps():
        a, b = (estimator.update(packet) for estimator in filters)
        assert a.diagnostics == pytest.approx(b.diagnostics, rel=1e-6, nan_ok=True)
        np.testing.assert_allclose(a.position, b.position, rtol=1e-12)
        for state in ("velocity", "dcm", "bias", "calibration"):
            np.testing.assert_allclose(*(getattr(e.model, state) for e in filters), rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(a.covariance, b.covariance, rtol=1e-8, atol=1e-14)


@pytest.mark.parametrize(("solver", "model"), [(KalmanEstimator, InertialModel), (SigmaPointEstimator, InertialPoints)])
def test_the_whole_step_runs_without_a_compiler(recording_of, solver, model):
    """The plain sources of the loop, the adaptation and the model: what a kernel is made of."""
    recording = recording_of(2, 3.0)
    compiled, plain = (solver(model(), HuberWeights()) for _ in range(2))
    for estimator in (compiled, plain):
        estimator.reset(recording.start, recording.instruments)
    made = plain._filter
    names = ("propagate", "predict", "choose", "inflate", "correct", "retract")
    made.in_python = SimpleNamespace(
        dynamics=made.dynamics, choice=made.choice, **{name: getattr(made, name).function for name in names}
    )
    plain._compiled = False
    for packet in recording.steps():
        a, b = compiled.update(packet), plain.update(packet)
        np.testing.assert_allclose(a.position, b.position, rtol=1e-14)
        np.testing.assert_allclose(a.covariance, b.covariance, rtol=1e-9, atol=1e-16)


def test_an_adaptation_that_chooses_in_its_own_way_is_asked(recording_of, run_over):
    asked = []

    class Own(SageHusa):
        def choose(self, innovation):
            asked.append(innovation)
            return super().choose(innovation)

    run_over(KalmanEstimator(InertialModel(), Own()), recording_of(2, 5.0))
    assert asked
    assert SageHusa().ruled
    assert not Own().ruled
    instruments = recording_of(2, 5.0).instruments
    for full in (False, True):
        adaptation = SageHusa(full=full)
        adaptation.reset(instruments)
        assert adaptation.noise_choice(list(instruments), 15).compiled != full  # NumPy bounds a full matrix


def test_a_gate_counts_channels_in_python():
    recording = record(load("dive-to-the-bottom").with_values({"duration_s": 2.0}), 0)
    for instruments in (recording.instruments, by_channel(recording.instruments)):
        gate = ChiSquareGate()
        gate.reset(instruments)
        channels = any(sheet.name != instrument_of(sheet) for sheet in instruments.values())
        assert gate.noise_choice(list(instruments), 15).compiled != channels
    assert channels


@pytest.mark.parametrize("own", [{"statistic": "ratio"}, {"target": "P"}])
def test_a_factor_that_only_numpy_computes_has_no_rule(recording_of, own: dict[str, str]):
    adaptation = AdaptiveFactor(**own)
    adaptation.reset(recording_of(2, 5.0).instruments)
    assert not adaptation.noise_choice(list(adaptation.instruments), 15).compiled


@pytest.mark.parametrize("name", ["predict", "correct", "retract"])
def test_a_solver_replaces_one_function(recording_of, run_over, name: str):
    seen = []

    class Own(KalmanEstimator):
        def functions(self):
            functions = super().functions()

            def own(*arguments):
                seen.append(arguments)
                return getattr(functions, name)(*arguments)

            return functions.replaced(**{name: own})

    recording = recording_of(2, 5.0)
    run_over(Own(InertialModel()), recording)
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
    model.noise[name][:] = 0.0
    P[:3], P[:, :3] = 0.0, 0.0
    P[6:9], P[:, 6:9] = 0.0, 0.0
    estimator.solver.dynamics.aids.noise[:] = 0.0
    compass = next(s for s in recording.instruments.of_kind("gyrocompass", "magnetic_compass"))
    upward = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    model.dcm[:] = upward
    before, state = P.copy(), model.snapshot()
    for m in (
        Measurement(0.0, name, "gnss_position", model.position.copy()),
        Measurement(0.0, compass.name, compass.kind, np.ones(1)),
    ):
        readings = estimator.solver._arrays.fill([m])
        filter_step(estimator.solver._filter, readings, model.samples, 1, 0.0)
        assert readings.nis[0] == -1.0
    np.testing.assert_array_equal(P, before)
    np.testing.assert_array_equal(model.position, state[0])
    np.testing.assert_array_equal(model.dcm, upward)
