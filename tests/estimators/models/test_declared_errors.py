"""The errors of instruments: declared once, and read by every model in one of two ways."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from simnav.blocks import StateBlock
from simnav.estimator import make
from simnav.estimators.models import declared_errors
from simnav.estimators.models.chain import chain_of
from simnav.estimators.models.channels import by_channel
from simnav.estimators.models.declared_errors import DeclaredError, error_of_fault, errors_of, errors_of_triad
from simnav.estimators.models.error_states import merged, separate_states, with_variance
from simnav.estimators.models.fault_states import FaultState, FaultStateModel
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.models.inertial_points import InertialPoints
from simnav.estimators.models.ship import ShipModel
from simnav.estimators.models.state_blocks import StateBlocks
from simnav.estimators.models.truth_linearised import TruthLinearisedModel
from simnav.plugins import import_file
from simnav.scenario import load
from simnav.source import record
from simnav.testing.contract_check import contract_recording
from simnav.trial import run_trial
from simnav.types import Datasheet, Instruments, TriadDatasheet


def error(bias: float, instability: float, time: float, walk: float = 0.0) -> DeclaredError:
    """The bias of a triad, whose processes are all that there are."""
    triad = TriadDatasheet(bias, instability, time, rate_random_walk=walk)
    return errors_of_triad(triad, "deg_s")["bias"]


def sheet(kind: str, **figures) -> Datasheet:
    return Datasheet("it", kind, 1.0, np.array(0.1), **figures)


# --- what is declared


@pytest.mark.parametrize(
    ("kind", "sigmas"),
    [
        ("dvl", {"scale": (0.01,), "misalignment": (0.1, 0.2, 0.3)}),
        ("speed_log", {"scale": (0.01,), "current": (0.5, 0.5)}),
        ("depth", {"scale": (0.01,)}),
        ("gnss_position", {}),
    ],
)
def test_each_kind_has_the_errors_of_its_equation(kind, sigmas):
    full = sheet(kind, scale=0.01, misalignment=np.array([0.1, 0.2, 0.3]))
    found = {name: e.processes[0].sigma for name, e in errors_of(full).items() if e.processes}
    assert found == sigmas
    plain = {name: e.processes for name, e in errors_of(sheet(kind)).items() if name != "current"}
    assert set(plain) >= {"bias"}
    assert not any(plain.values())


def test_the_processes_of_a_bias_have_names_and_units():
    found = errors_of(sheet("gyrocompass", bias=np.array(0.1), bias_instability=np.array(0.2), correlation_time=60.0))
    assert [p.name for p in found["bias"].processes] == ["turn_on", "in_run"]
    assert found["bias"].processes[0].units == ("deg",)
    assert [p.name for p in error(1.0, 0.0, np.inf, 2.0).processes] == ["turn_on", "walk"]
    assert [p.process for p in error(0.0, 1.0, np.inf).processes] == ["random_walk"]


def test_what_changes_from_sample_to_sample_is_white_noise():
    fast = errors_of(sheet("gyrocompass", bias_instability=np.array(0.2), correlation_time=0.49))["bias"]
    assert fast.white_variance() == pytest.approx([0.04])
    assert merged(fast) == [(0.0, 0.0, 0.0)]
    slow = errors_of(sheet("gyrocompass", bias_instability=np.array(0.2), correlation_time=0.5))["bias"]
    assert slow.white_variance() == [0.0]
    assert error(0.7, 0.4, 0.5).white_density() == pytest.approx([0.16] * 3)


def test_a_fault_of_a_size_is_a_state():
    constant, moving = error_of_fault("dvl", np.array([0.1, -0.2, 0.0])), error_of_fault("dvl", np.ones(3), 8.0)
    assert constant.rates() == [pytest.approx((x, 0.0, 0.0)) for x in (0.01, 0.04, 0.0)]
    assert moving.rates() == [(1.0, 0.125, 0.25)] * 3


# --- two ways to take them


def test_two_biases_in_one_state():
    """Same value and slope of the autocovariance at lag 0, and never above the sum of the two."""
    b, s, tau = 0.7, 0.4, 200.0
    one = merged(error(b, s, tau))[0]
    assert one.variance == pytest.approx(b * b + s * s)
    assert one.noise == pytest.approx(2.0 * one.variance * one.decay)  # stationary
    lag = np.array([0.0, 1e-3, 10.0, 100.0, 1000.0])
    ours, both = one.variance * np.exp(-one.decay * lag), b * b + s * s * np.exp(-lag / tau)
    assert (ours[0] - ours[1]) == pytest.approx(both[0] - both[1], rel=1e-3)
    assert np.all(ours[2:] < both[2:])
    assert merged(error(0.0, s, tau))[0] == pytest.approx((s * s, 1 / tau, 2 * s * s / tau))
    assert merged(error(b, 0.0, tau))[0] == (b * b, 0.0, 0.0)
    assert merged(error(b, s, np.inf, 0.1))[0] == pytest.approx((b * b, 0.0, s * s + 0.01))
    assert merged(error(b, s, 0.5))[0] == (b * b, 0.0, 0.0)


def test_several_gauss_markov_processes_have_the_value_and_slope_of_their_sum():
    parts = tuple(StateBlock.stationary(f"p{k}", 1, "m", s, t) for k, (s, t) in enumerate([(1.0, 50.0), (2.0, 300.0)]))
    one = merged(DeclaredError("bias", 1, parts))[0]
    assert one.variance == pytest.approx(5.0)
    assert one.variance * one.decay == pytest.approx(1.0 / 50.0 + 4.0 / 300.0)
    assert one.noise == pytest.approx(2.0 * one.variance * one.decay)


def test_apart_each_process_has_a_state_and_their_variances_are_those_of_the_merged_one():
    bias = errors_of(
        sheet("gnss_position", bias=np.array([1.0, 0.0, 2.0]), bias_instability=np.full(3, 0.5), correlation_time=60.0)
    )["bias"]
    found = separate_states(bias)
    assert [(p.name, k) for p, k, _ in found] == [("turn_on", 0), ("turn_on", 2), *(("in_run", k) for k in range(3))]
    total = np.zeros(3)
    for _, k, rates in found:
        total[k] += rates.variance
    assert total == pytest.approx([rates.variance for rates in merged(bias)])
    assert with_variance(np.ones(3), bias.processes) == pytest.approx(1.0 + total)


# --- places


def test_blocks_have_places_by_label():
    blocks = StateBlocks(9)
    assert blocks.add("dvl", "bias", merged(error(1.0, 0.0, 1.0))) == 9
    assert blocks.add("dvl", "scale", StateBlock("scale", 1, "", 0.1).rates()) == 12
    assert blocks.at == {"dvl.bias": slice(9, 12), "dvl.scale": slice(12, 13)}
    assert blocks.of("dvl") == [slice(9, 12), slice(12, 13)]
    assert (blocks.size, blocks.of("gnss"), blocks.places("dvl", 0)) == (13, [], {})
    assert blocks.columns(12)[0] == pytest.approx([0.01])


def test_a_block_that_is_brought_along_has_no_name_of_an_error():
    blocks = StateBlocks(9)
    blocks.add("it", "bias", merged(error(1.0, 0.0, 1.0)))
    with pytest.raises(
        ValueError, match=r"instrument 'it': its block of states 'bias' has the name of an error of its"
    ):
        blocks.bring([sheet("gnss_position", blocks=(StateBlock("bias", 1, "m", 1.0),))])


# --- one place


def variance_of(blocks: StateBlocks, source: str) -> float:
    """Sum of the initial variances of the states of an instrument."""
    return sum(blocks.states[k - blocks.first].variance for at in blocks.of(source) for k in range(at.start, at.stop))


def initial_variances(plugins) -> dict[str, tuple[float, int]]:
    """By model: initial variance of the states of a compass, and the number of all states."""
    recording = contract_recording(0)
    given, start, found = by_channel(recording.instruments), recording.start, {}
    compass = replace(given["gyrocompass"], bias=np.array([0.1]))
    aids = Instruments([compass, *(s for s in given.values() if s.name != compass.name)], given.imu, given.step)
    no_imu = Instruments([*aids.values()], None, given.step)
    general = import_file(plugins / "steady_turn.py").SteadyTurn
    for name, model, instruments in (
        ("filter", InertialModel(), aids),
        ("points", InertialPoints(), aids),
        ("oracle", TruthLinearisedModel(recording.data.truth), aids),
        ("ship", ShipModel(), no_imu),
        ("general", general(), no_imu),
    ):
        covariance = model.begin(start, instruments)
        found[name] = variance_of(model.blocks, compass.name), len(covariance)
    for name, model, instruments in (("window", InertialModel(), aids), ("ship window", ShipModel(), no_imu)):
        chain = chain_of(model)
        chain.begin(start, instruments)
        at = model.blocks.of(compass.name)[0]
        found[name] = float(chain.prior.covariance.diagonal()[at].sum()), chain.size
    noise = InertialModel(calibrate=False)
    noise.begin(start, aids)
    found["without states"] = float(noise.noise[compass.name][0, 0]), noise.size
    return found


def test_one_more_process_of_an_error_is_declared_in_one_place(monkeypatch, plugins):
    """Filter, window, sigma points, oracle, ship, general model and one without states then know it."""
    before = initial_variances(plugins)
    declared = declared_errors.processes_of_bias

    def with_one_more(sheet: Datasheet) -> tuple[StateBlock, ...]:
        return (*declared(sheet), StateBlock.stationary("warm_up", len(sheet.sigma), "", 3.0, 90.0))

    monkeypatch.setattr(declared_errors, "processes_of_bias", with_one_more)
    after = initial_variances(plugins)
    assert {name: after[name][0] - before[name][0] for name in before} == pytest.approx(dict.fromkeys(before, 9.0))
    assert after["oracle"][1] > before["oracle"][1]  # it takes the processes apart


# --- reports


def test_a_model_reports_all_its_states_by_name_on_request():
    recording = contract_recording(0)
    given = recording.instruments
    dvl = replace(given["dvl"], scale=0.01)
    model = InertialModel()
    covariance = model.begin(recording.start, Instruments([dvl, given["speed_log"]], given.imu))
    assert not model.estimate(covariance).states
    model.reports_all = True
    found = model.estimate(covariance).states
    assert list(found)[:2] == ["imu.gyroscope_bias", "imu.accelerometer_bias"]
    assert {"dvl.scale", "dvl.misalignment", "speed_log.current"} <= set(found)
    sigma = np.sqrt(covariance.diagonal())
    assert np.array_equal(np.concatenate([each for _, each in found.values()]), sigma[9:])


def test_the_states_of_faults_have_names():
    recording = contract_recording(0)
    fault = FaultState("dvl", error_of_fault("dvl", np.array([0.3, 0.0, 0.2])), lambda time: 1.0)
    model = FaultStateModel(InertialModel(), [fault])
    model.reports_all = True
    covariance = model.begin(recording.start, by_channel(recording.instruments))
    _, sigma = model.estimate(covariance).states["dvl.fault_0"]
    assert sigma == pytest.approx([0.3, 0.2])


@pytest.mark.parametrize("row", ["ekf", "ukf", "sw-fgo", "ship-ekf", "oracle"])
def test_a_row_reports_all_states_on_request_and_estimates_the_same(row):
    scenario = load("fishing-vessel" if row == "ship-ekf" else "harbour-multipath")
    recording = record(scenario.model_copy(update={"duration": 4.0}), 1)
    plain, asked = make(row), make(row)
    asked.solver.reports_all = True
    first, second = run_trial(plain, recording), run_trial(asked, recording)
    assert not any(name.startswith("state.") for name in first.diagnostics)
    found = {name.removeprefix("sigma.") for name in second.diagnostics if name.startswith("sigma.")}
    assert any("bias" in name or "turn_on" in name or "scale" in name for name in found), found
    assert np.array_equal(first.position, second.position)
    assert np.array_equal(first.covariance, second.covariance, equal_nan=True)
