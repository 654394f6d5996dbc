"""The named error processes: closed forms, units, messages, datasheets, and what oracles know."""

from __future__ import annotations

from math import exp, pi, sqrt

import numpy as np
import pytest

from simnav.declared_process import DeclaredProcess
from simnav.estimators.models.declared_errors import bias_of
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.models.state_blocks import StateBlocks
from simnav.estimators.models.truth_linearised_factors import TruthLinearisedFactors
from simnav.geometry.rotation import dcm_from_rpy
from simnav.kinds import INSTRUMENTS as INSTRUMENTS_BY_KIND
from simnav.kinds import KINDS
from simnav.recording import Recording
from simnav.scenario import Scenario, parse
from simnav.sensors.error_processes import ERROR_PROCESSES, FACTORS, Factors, TotalError
from simnav.simulation.simulator import Simulator, simulate
from simnav.spec import SpecError
from simnav.streams import stream
from simnav.types import NavigationStates, TapStates
from simnav.world import Surroundings

HEAD = """
name = "coloured"
version = 1
title = "Every named process"
duration_s = 60.0
[start]
latitude_deg = 54.0
longitude_deg = 8.0
heading_deg = 30.0
speed_m_s = 6.0
[[manoeuvre]]
kind = "zigzag"
angle_deg = 40.0
rate_deg_s = 3.0
duration_s = 60.0
[sea]
significant_height_m = 2.0
peak_period_s = 7.0
"""
INSTRUMENTS = """
[instruments.gnss]
kind = "gnss_position"
rate_hz = 1.0
sigma_m = [0.5, 0.5, 1.0]
[[instruments.gnss.error]]
kind = "gauss_markov"
sigma_m = [1.0, 1.0, 2.0]
correlation_time_s = 60.0
[[instruments.gnss.error]]
kind = "heavy_tailed"
sigma_cm = 20.0
[[instruments.gnss.error]]
kind = "quantised"
step_m = 0.18
components = ["north", "east"]
[instruments.gyrocompass]
rate_hz = 2.0
sigma_deg = 0.03
[[instruments.gyrocompass.error]]
kind = "gauss_markov_2"
sigma_deg = 0.3
period_s = 8.0
damping = 0.3
proportional_to = { secant_latitude = 1.0 }
[[instruments.gyrocompass.error]]
kind = "constant"
sigma_deg = 0.5
proportional_to = { sin_2heading = 1.0, roll_squared_deg = 5.0 }
[[instruments.gyrocompass.error]]
kind = "settling"
sigma_deg = 1.0
[[instruments.gyrocompass.error]]
kind = "ballistic"
sigma_deg = 0.5
speed_change_kn = 10.0
[[instruments.gyrocompass.error]]
kind = "random_walk"
sigma_deg = 0.2
after_h = 1.0
stated = false
[instruments.dvl]
rate_hz = 1.0
sigma_m_s = 0.01
[[instruments.dvl.error]]
kind = "white"
sigma_percent = 0.2
proportional_to = { speed_m_s = 5.0 }
[[instruments.dvl.error]]
kind = "loss"
probability = 0.1
proportional_to = { wave_height_m = 1.0 }
"""


def sampled(
    kind: str, instrument: str = "gyrocompass", n: int = 200_000, dt: float = 1.0, **table: object
) -> np.ndarray:
    """A long stretch of a process, by component."""
    spec = ERROR_PROCESSES.items()[kind].from_toml({"kind": kind, **table})
    process = spec.sampled(KINDS[instrument], np.random.default_rng(5))
    return process.sample(np.arange(n) * dt)


def autocorrelation(x: np.ndarray, lag: int) -> float:
    return float(np.mean(x[:-lag] * x[lag:]) / np.mean(x * x))


@pytest.mark.parametrize(("correlation_time", "lag"), [(10.0, 7), (60.0, 30)])
def test_gauss_markov_has_its_sd_and_autocorrelation(correlation_time, lag):
    x = np.degrees(sampled("gauss_markov", sigma_deg=0.3, correlation_time_s=correlation_time)[:, 0])
    assert x.std() == pytest.approx(0.3, rel=0.05)
    assert autocorrelation(x, lag) == pytest.approx(exp(-lag / correlation_time), abs=0.03)


@pytest.mark.parametrize("damping", [0.2, 1.0, 2.5])
def test_second_order_has_its_sd_and_autocorrelation(damping):
    x = np.degrees(sampled("gauss_markov_2", sigma_deg=0.3, period_s=12.0, damping=damping)[:, 0])
    assert x.std() == pytest.approx(0.3, rel=0.05)
    w = 2.0 * pi / 12.0
    s = np.emath.sqrt(1.0 - damping**2) * w
    for lag in (1, 4, 9):
        swing = np.cos(s * lag) + damping * w * (np.sin(s * lag) / s if s else lag)
        assert autocorrelation(x, lag) == pytest.approx((exp(-damping * w * lag) * swing).real, abs=0.03)


def test_a_second_order_process_is_the_same_at_irregular_times():
    spec = ERROR_PROCESSES.items()["gauss_markov_2"].from_toml(
        {"kind": "gauss_markov_2", "sigma_deg": 1.0, "period_s": 9.0, "damping": 0.4}
    )
    process = DeclaredProcess(spec.block("x", KINDS["gyrocompass"]), 9.0, 0.4)
    both = process.transition(1.3) @ process.noise(0, 0.9) @ process.transition(1.3).T + process.noise(0, 1.3)
    np.testing.assert_allclose(both, process.noise(0, 2.2), atol=1e-18)
    np.testing.assert_allclose(process.transition(1.3) @ process.transition(0.9), process.transition(2.2), atol=1e-12)


def test_random_walk_grows_with_the_root_of_time():
    spec = ERROR_PROCESSES.items()["random_walk"].from_toml({"kind": "random_walk", "sigma_m": 6.0, "after_min": 60.0})
    ends = [
        spec.sampled(KINDS["depth"], np.random.default_rng(k)).sample(np.array([900.0, 3600.0]))[:, 0]
        for k in range(2000)
    ]
    assert np.std(ends, axis=0) == pytest.approx([3.0, 6.0], rel=0.06)


def test_heavy_tails_have_their_sd_and_kurtosis():
    x = sampled("heavy_tailed", "dvl", sigma_m_s=0.02, degrees_of_freedom=9.0)
    assert x.std() == pytest.approx(0.02, rel=0.02)
    assert np.mean(x**4) / np.mean(x**2) ** 2 - 3.0 == pytest.approx(6.0 / 5.0, abs=0.25)
    assert abs(autocorrelation(x[:, 0], 1)) < 0.01


def test_settling_dies_away_as_a_damped_oscillation():
    x = (
        sampled("settling", sigma_deg=1.0, period_s=1000.0, damping=0.2, n=3000)[:, 0]
        / sampled("settling", sigma_deg=1.0, period_s=1000.0, damping=0.2, n=1)[0, 0]
    )
    w, t = 2e-3 * pi, np.arange(3000.0)
    s = w * sqrt(1.0 - 0.04)
    np.testing.assert_allclose(x, np.exp(-0.2 * w * t) * (np.cos(s * t) + 0.2 * w / s * np.sin(s * t)), atol=1e-12)


def test_readings_are_rounded_to_multiples_of_the_step():
    spec = ERROR_PROCESSES.items()["quantised"].from_toml({"kind": "quantised", "step_deg": 0.5})
    value = np.radians([[10.2], [10.3], [-10.3]])
    assert np.degrees(spec.rounded(value, KINDS["gyrocompass"])) == pytest.approx(np.array([[10.0], [10.5], [-10.5]]))
    fix = ERROR_PROCESSES.items()["quantised"].from_toml({"kind": "quantised", "step_m": 2.0})
    position = np.array([[0.9, 0.1, 13.1]])
    off = KINDS["gnss_position"].difference(fix.rounded(position, KINDS["gnss_position"]), position)
    assert np.all(np.abs(off) < [1.01, 1.01, 1.01])
    assert fix.rounded(position, KINDS["gnss_position"])[0, 2] == 14.0


def test_readings_are_lost_in_bursts_of_their_mean_length_and_share():
    spec = ERROR_PROCESSES.items()["loss"].from_toml({"kind": "loss", "probability": 0.05, "mean_s": 8.0})
    time, state, rng = np.arange(200_000) * 0.5, {}, np.random.default_rng(3)
    lost = spec.lost(time, np.full(len(time), 3.0), rng, state)
    assert lost.mean() == pytest.approx(0.15, abs=0.02)
    bursts = np.diff(np.flatnonzero(np.diff(np.concatenate([[0], lost.view(np.int8), [0]])))[:])[::2]
    assert 0.5 * bursts.mean() == pytest.approx(8.0, rel=0.1)


def tap_states(n: int = 5) -> TapStates:
    rng = np.random.default_rng(1)
    position = np.stack([np.linspace(0.9, 0.95, n), np.zeros(n), np.zeros(n)], axis=1)
    attitude = np.stack([0.1 * rng.standard_normal(n), np.zeros(n), np.linspace(0.0, 2.0, n)], axis=1)
    return TapStates(
        np.arange(n) * 10.0, position, rng.standard_normal((n, 3)), attitude, np.zeros((n, 3)), np.zeros((n, 3))
    )


@pytest.mark.parametrize(
    ("key", "reference", "wanted"),
    [
        ("speed_m_s", 2.0, lambda t: np.linalg.norm(t.velocity, axis=1) / 2.0),
        ("secant_latitude", 1.0, lambda t: 1.0 / np.cos(t.position[:, 0])),
        ("sin_heading", 1.0, lambda t: np.sin(t.attitude[:, 2])),
        ("cos_heading", 1.0, lambda t: np.cos(t.attitude[:, 2])),
        ("sin_2heading", 1.0, lambda t: np.sin(2.0 * t.attitude[:, 2])),
        ("cos_2heading", 1.0, lambda t: np.cos(2.0 * t.attitude[:, 2])),
        ("roll_squared_deg", 5.0, lambda t: (t.attitude[:, 0] / np.radians(5.0)) ** 2),
    ],
)
def test_a_constant_is_multiplied_with_its_factor(key, reference, wanted):
    """The deviation of a fluxgate by heading, the error of a gyrocompass by latitude and roll, and others."""
    spec = ERROR_PROCESSES.items()["constant"].from_toml(
        {"kind": "constant", "sigma_deg": 1.0, "proportional_to": {key: reference}}
    )
    tap, kind = tap_states(), KINDS["magnetic_compass"]
    total = TotalError([spec], kind, 4, "compass").at(tap, tap.attitude[:, 2:], Surroundings()).error[:, 0]
    drawn = np.radians(stream(4, "instrument", "compass", "error", "constant").standard_normal())
    np.testing.assert_allclose(total, drawn * wanted(tap), rtol=1e-12)


def test_the_ballistic_error_follows_the_changes_of_the_north_velocity():
    """One change of 5 m/s: the error jumps by c / 2 sec(latitude), and dies away with the period of the compass."""
    spec = ERROR_PROCESSES.items()["ballistic"].from_toml({"kind": "ballistic", "sigma_deg": 2.0, "damping": 0.3})
    n = 6001
    velocity = np.zeros((n, 3))
    velocity[100:, 0] = 5.0
    position = np.tile([np.radians(60.0), 0.0, 0.0], (n, 1))
    tap = TapStates(np.arange(float(n)), position, velocity, np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3)))
    total = TotalError([spec], KINDS["gyrocompass"], 0, "gyro").at(tap, np.zeros((n, 1)), Surroundings()).error[:, 0]
    drawn = np.radians(2.0) * stream(0, "instrument", "gyro", "error", "ballistic").standard_normal()
    w = 2.0 * pi / spec.period
    s, t = w * sqrt(1.0 - 0.09), np.arange(n - 100.0)
    np.testing.assert_allclose(total[:100], 0.0)
    wanted = drawn * np.exp(-0.3 * w * t) * (np.cos(s * t) + 0.3 * w / s * np.sin(s * t))  # 5 / 10 / cos(60 deg) = 1
    np.testing.assert_allclose(total[100:], wanted, atol=1e-9)


# ------------------------------------------------------------------------------------------- runs


def test_one_block_or_many_give_the_same_numbers():
    scenario = parse(HEAD + INSTRUMENTS)
    whole = simulate(scenario, 3).data.aids
    simulator = Simulator(scenario, 3)
    parts = [simulator.advance(until).aids for until in (7.0, 20.0, 21.0, 60.0)]
    for name, stream_ in whole.items():
        for field in ("time", "value", "sigma", "dropped"):
            joined = np.concatenate([getattr(p[name], field) for p in parts])
            np.testing.assert_array_equal(joined, getattr(stream_, field))
    assert len(whole["dvl"].dropped) > 3  # 2 m of waves: a fifth of the readings


def test_a_process_changes_only_its_own_instrument_and_nothing_where_none_is_named():
    plain = INSTRUMENTS.split("[[instruments.gnss.error]]")[0] + "[instruments.dvl]\nsigma_m_s = 0.01\n"
    named = plain + '[[instruments.dvl.error]]\nkind = "white"\nsigma_m_s = 0.1\ncomponents = ["down"]\n'
    without, with_ = (simulate(parse(HEAD + text), 1).data.aids for text in (plain, named))
    np.testing.assert_array_equal(without["gnss"].value, with_["gnss"].value)
    np.testing.assert_array_equal(without["dvl"].value[:, :2], with_["dvl"].value[:, :2])
    assert np.std(without["dvl"].value[:, 2] - with_["dvl"].value[:, 2]) == pytest.approx(0.1, rel=0.25)
    assert with_["dvl"].sigma[0] == pytest.approx([0.01, 0.01, sqrt(0.0101)])
    hashes = [parse(HEAD + text).content_hash() for text in (plain, plain.replace("0.5, 0.5", "0.50, 0.5"))]
    assert hashes[0] == hashes[1]
    assert "processes" not in parse(HEAD + plain).model_dump()["instruments"]["gnss"]


def test_ideal_instruments_have_no_process():
    scenario = parse(HEAD + INSTRUMENTS)
    assert all(spec.ideal().processes == () for spec in scenario.aids.values())


def test_toml_and_recordings_keep_the_processes(tmp_path):
    scenario = parse(HEAD + INSTRUMENTS)
    assert Scenario.from_toml(scenario.to_toml()) == scenario
    recording = simulate(scenario, 2)
    recording.save(tmp_path / "run.npz")
    again = Recording.load(tmp_path / "run.npz")
    for name, sheet in recording.instruments.items():
        assert again.instruments[name].processes == sheet.processes
    assert again.actual is not None
    assert [p.name for p in again.actual["gyrocompass"].processes][-1] == "random_walk"


# ------------------------------------------------------------------------------------------- datasheets


def test_datasheets_have_white_processes_in_sigma_and_coloured_ones_by_name():
    sheets = parse(HEAD + INSTRUMENTS).instruments_sheet()
    rounding = np.array([0.18, 0.18, 0.0]) / sqrt(12.0)
    assert sheets["gnss"].sigma == pytest.approx(np.sqrt(np.array([0.25, 0.25, 1.0]) + 0.04 + rounding**2))
    assert sheets["dvl"].sigma == pytest.approx([sqrt(2.0) * 0.01] * 3)
    gyrocompass = sheets["gyrocompass"]
    assert [p.name for p in gyrocompass.processes] == ["gauss_markov_2", "constant", "settling", "ballistic"]
    slow = {p.name: p for p in bias_of(gyrocompass).slow}
    assert slow["gauss_markov_2"].correlation_time == pytest.approx(2.0 * 0.3 * 8.0 / (2.0 * pi))
    assert slow["constant"].sigma == pytest.approx((np.radians(0.5),))


def test_a_wrong_datasheet_scales_all_processes():
    text = HEAD + INSTRUMENTS.replace("rate_hz = 2.0", "rate_hz = 2.0\ntimes_datasheet = { error = 3.0 }")
    scenario = parse(text)
    told, true = scenario.instruments_sheet(), scenario.actual_sheet()
    assert true["gyrocompass"].processes[0].block.sigma == pytest.approx(
        tuple(3.0 * s for s in told["gyrocompass"].processes[0].block.sigma)
    )
    with pytest.raises(SpecError, match=r"times_datasheet.error: there is no such figure"):
        parse(HEAD + "[instruments.depth]\nsigma_m = 1.0\ntimes_datasheet = { error = 2.0 }\n")


def test_second_order_states_stay_stationary_in_the_oracle():
    blocks = StateBlocks(2)
    process = parse(HEAD + INSTRUMENTS).instruments_sheet()["gyrocompass"].processes[0]
    at = blocks.add_second_order("gyrocompass", "swing", process, 0)
    transition, covariance = np.eye(4), np.zeros((4, 4))
    covariance[at:, at:] = process.covariance(0)
    blocks.couple(transition, 0.7)
    after = transition @ covariance @ transition.T
    blocks.add_noise(after, 0.7)
    np.testing.assert_allclose(after, covariance, atol=1e-18)


def test_the_oracle_multiplies_with_the_factors_of_the_simulator():
    spec = ERROR_PROCESSES.items()["ballistic"].from_toml(
        {"kind": "ballistic", "sigma_deg": 2.0, "proportional_to": {"sin_2heading": 1.0}}
    )
    tap = tap_states(6)
    simulated = Factors(spec.factors()).at(tap, tap.attitude[:, 2:], Surroundings())[:, 0]
    factors = TruthLinearisedFactors(
        spec.factors(), NavigationStates(tap.time, tap.position, tap.velocity, tap.attitude)
    )
    nominal = InertialModel()
    for k in (1, 4):
        nominal.position, nominal.velocity = tap.position[k].copy(), tap.velocity[k].copy()
        nominal.dcm, nominal.raw_rate = dcm_from_rpy(tap.attitude[k]), np.zeros(3)
        assert factors.at(tap.time[k], nominal, np.zeros(1))[0] == pytest.approx(simulated[k], abs=1e-9)
    assert set(FACTORS) >= {"speed", "reading", "wave_height", "turn_rate", "vertical_speed"}


# ------------------------------------------------------------------------------------------- messages

BAD = [
    ('kind = "gauss_markov"\nsigma_m = 1.0\ncorrelation_time_s = 5.0', "of 'heading' is in deg; give sigma_deg"),
    ('kind = "gauss_markov"\nsigma = 1.0\ncorrelation_time_s = 5.0', "the unit is the end of the key of the size"),
    ('kind = "gauss_markov"\ncorrelation_time_s = 5.0', "sigma_…' is missing; it ends in the unit"),
    ('kind = "gauss_markov"\nsigma_deg = 1.0', "'instruments.gyrocompass.error\\[0\\].correlation_time_s' is missing"),
    ('kind = "gauss_markof"\nsigma_deg = 1.0', "kind = 'gauss_markof' is unknown; did you mean 'gauss_markov'"),
    ('kind = "white"\nsigma_deg = "x"', "sigma_deg = 'x' should be a number"),
    ('kind = "white"\nsigma_deg = -1.0', "should be"),
    ('kind = "white"\nsigma_deg = [1.0, 2.0]', "sigma_deg has 2 numbers; it takes one, or 1"),
    ('kind = "white"\nsigma_deg = 1.0\ncomponents = ["down"]', "the error has no component 'down'"),
    ('kind = "white"\nsigma_percent = 1.0', "a size in percent needs one factor with a unit"),
    ('kind = "white"\nsigma_percent = 1.0\nproportional_to = { speed_m_s = 3.0 }', "the error of 'heading' is in deg"),
    ('kind = "white"\nsigma_deg = 1.0\nproportional_to = { sped_m_s = 3.0 }', "no factor 'sped_m_s'; did you mean"),
    ('kind = "white"\nsigma_deg = 1.0\nproportional_to = { speed_m_s = 0.0 }', "should not be 0"),
    ('kind = "heavy_tailed"\nsigma_deg = 1.0\ndegrees_of_freedom = 2.0', "should be greater than 2"),
    ('kind = "loss"\nprobability = 0.1\ncomponents = ["heading"]', "components is of no use to 'loss'"),
]  # fmt: skip


@pytest.mark.parametrize(("table", "message"), BAD)
def test_bad_input_is_refused_with_a_sentence(table, message):
    text = f"{HEAD}[instruments.gyrocompass]\nsigma_deg = 0.1\n[[instruments.gyrocompass.error]]\n{table}\n"
    with pytest.raises(SpecError, match=message) as caught:
        parse(text)
    assert "instruments.gyrocompass" in str(caught.value)


def test_two_processes_have_two_names():
    table = '[[instruments.depth.error]]\nkind = "white"\nsigma_m = 1.0\nname = "a"\n'
    with pytest.raises(SpecError, match="two processes have the name 'a'"):
        parse(f"{HEAD}[instruments.depth]\nsigma_m = 0.1\n{table}{table}")


def test_an_instrument_that_reads_another_one_names_no_processes():
    table = {
        "kind": "gnss_receiver",
        "observations": "gnss_raw",
        "sigma_m": 1.0,
        "error": [{"kind": "white", "sigma_m": 1.0}],
    }
    with pytest.raises(SpecError, match="which it reads; name the processes there"):
        INSTRUMENTS_BY_KIND.items()["gnss_receiver"].from_toml(table)
