"""The ANFIS: its features, its files, what it learnt from, and what it does to fixes that are good and bad."""

from __future__ import annotations

import json
from dataclasses import replace
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

from simnav.estimator import make
from simnav.estimators.adaptations.anfis import Anfis, Features, Motion
from simnav.estimators.adaptations.anfis_file import FEATURES, Parameters, ParametersError, shipped
from simnav.estimators.adaptations.anfis_level import Level
from simnav.estimators.adaptations.base import Innovation
from simnav.estimators.adaptations.sugeno import Sugeno
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.solvers.kalman import KalmanEstimator
from simnav.estimators.training.anfis_training import (
    FIRST_TRAINING_SEED,
    FIRST_VALIDATION_SEED,
    gather,
    log_factors,
    scenarios,
    train,
)
from simnav.geometry.earth import relative_position
from simnav.scenario import load, parse
from simnav.scoring import score
from simnav.source import record
from simnav.trial import run_trial
from simnav.types import Datasheet, Instruments, Measurement

SHEETS = Instruments(
    [
        Datasheet("gnss", "gnss_position", 1.0, np.full(3, 4.0)),
        Datasheet("gyro", "gyrocompass", 1.0, np.array([0.01])),
        Datasheet("log", "speed_log", 1.0, np.array([0.1])),
    ]
)
NOISE_STEP = '[[fault]]\nkind = "noise_step"\ninstruments = ["gnss"]\nstart_s = 600.0\nend_s = 900.0\nfactor = 6.0\n'


def innovation(instrument: str, time: float, value: float, residual: list[float]) -> Innovation:
    """One with unit H P H' and a noise of 3, or of a compass or a log."""
    kind = SHEETS[instrument].kind
    m = len(residual)
    measured = Measurement(time, instrument, kind, np.full(3 if kind == "gnss_position" else 1, value))
    return Innovation(measured, np.array(residual), np.eye(m), 3.0 * np.eye(m))


def constant(features: str, log_factor: float) -> Parameters:
    """A network that always says the same."""
    grid = Sugeno.grid(3)
    grid.consequents[:, -1] = log_factor
    return Parameters(features, np.zeros(3), np.ones(3), np.full(3, 0.5), 20.0, grid)


def log_factor(parameters: Parameters, x: np.ndarray) -> np.ndarray:
    """Of (k, n) inputs, (k,)."""
    return np.array([parameters.log_factor_of(row) for row in x.tolist()])


# Features


def test_motion_is_of_what_the_filter_expects():
    """A ship that turns by 0.01 rad/s through north and slows down by 0.02 m/s^2; the innovations are noise."""
    motion = Motion(SHEETS)
    assert np.isnan([motion.speed, motion.turn_rate, motion.change_of_speed]).all()
    rng = np.random.default_rng(0)
    for k in range(60):
        noise = 0.5 * rng.standard_normal(2)
        heading = 3.0 + 0.01 * k  # wraps at pi
        motion.observe(innovation("gyro", k, heading - 2 * np.pi * (heading > np.pi) + noise[0], [noise[0]]))
        motion.observe(innovation("log", k, 6.0 - 0.02 * k + noise[1], [noise[1]]))
    assert motion.speed == pytest.approx(6.0 - 0.02 * 59)
    assert motion.turn_rate == pytest.approx(0.01, rel=1e-4)
    assert motion.change_of_speed == pytest.approx(0.02, rel=1e-4)


def test_features_of_the_innovation():
    """Whitened by S = 4: two components of 4 are norm 2; the fading mean takes 1 - exp(-1/10) of it."""
    features = Features("recent", SHEETS)
    assert features.observe(innovation("log", 1.0, 5.0, [0.1])) is None
    first = features.observe(innovation("gnss", 1.0, 0.0, [4.0, 4.0]))
    second = features.observe(innovation("gnss", 2.0, 0.0, [0.0, 0.0]))
    assert first is not None
    assert second is not None
    np.testing.assert_allclose(first[:2], np.log(3.0))
    np.testing.assert_allclose(second[:2], [0.0, np.log(3.0) * np.exp(-0.1)])
    assert np.isnan(first[2])  # no compass yet


def test_inputs_are_clipped_to_training_and_unknown_ones_typical():
    rng = np.random.default_rng(1)
    grid = Sugeno.grid(3)
    network = replace(grid, consequents=rng.random(grid.consequents.shape))
    low, high, typical = np.array([1.0, 0.0, 0.0]), np.array([9.0, 0.1, 0.2]), np.array([5.0, 0.02, 0.01])
    p = Parameters("motion", low, high, typical, 9.0, network)
    np.testing.assert_allclose(p.scale(np.array([[5.0, 0.1, 0.05]])), [[0.5, 1.0, 0.25]])
    far, edge = np.array([[90.0, 7.0, -1.0]]), np.array([[9.0, 0.1, 0.0]])
    assert log_factor(p, far) == log_factor(p, edge)
    assert log_factor(p, np.full((1, 3), np.nan)) == log_factor(p, p.typical[None])
    assert log_factor(replace(p, largest=0.1), edge) == 0.1
    for row in (far, edge, np.array([[np.nan, 0.05, 0.03]])):
        assert log_factor(p, row)[0] == pytest.approx(np.clip(p.network(p.scale(row))[0], 0.0, p.largest), rel=1e-12)


# The adaptation


def test_a_fix_is_scaled_and_nothing_else(tmp_path: Path):
    """Fourfold variance, within the bounds; compass and log keep theirs."""
    path = tmp_path / "four.json"
    constant("innovation", float(np.log(4.0))).save(path)
    for kwargs, factor in (({}, 4.0), ({"highest": 1.5}, 2.25), ({"lowest": 3.0}, 9.0)):
        anfis = Anfis("innovation", str(path), **kwargs)
        anfis.reset(SHEETS)
        np.testing.assert_allclose(anfis.adapt(innovation("gyro", 1.0, 0.0, [0.1])), [[3.0]])
        np.testing.assert_allclose(anfis.adapt(innovation("gnss", 1.0, 0.0, [1.0, -1.0])), 3.0 * factor * np.eye(2))
        np.testing.assert_allclose(anfis.adapt(innovation("log", 1.0, 0.0, [0.1])), [[3.0]])
        assert anfis.diagnostics()["sigma_north.gnss"] == pytest.approx(np.sqrt(3.0 * factor))
    with pytest.raises(ValueError, match="lowest = 3 and highest = 2"):
        Anfis(lowest=3.0, highest=2.0)


@pytest.mark.parametrize("features", ["innovation", "recent"])
def test_larger_innovations_are_believed_less(features: str):
    """From the first to the thirtieth sigma the noise never falls by more than a tenth, and grows a hundredfold."""
    parameters = Parameters.load(shipped(features))
    norm = np.linspace(1.0, 30.0, 200)
    x = np.tile(parameters.typical, (len(norm), 1))
    x[:, 0] = np.log1p(norm)
    y = log_factor(parameters, x)
    assert np.diff(y).min() > -0.02
    assert y[0] < 1.0
    assert y[-1] > np.log(100.0)


def test_it_works_without_compass_and_log_and_in_three_dimensions(recording_of):
    """Inertial model, GNSS only: motion is unknown; a fix that is 60 m off counts for little."""
    aids = (Datasheet("gnss", "gnss_position", 1.0, np.array([1.5, 1.5, 3.0])),)
    recording = recording_of(3, 60.0, aids=aids)
    recording.data.aids["gnss"].value[40, 0] += 60.0 / 6.37e6
    trial = run_trial(KalmanEstimator(InertialModel(), Anfis()), recording)
    sigma = trial.diagnostics["sigma_north.gnss"]
    assert trial.status == "ok"
    assert sigma[40] > 10.0
    assert np.median(sigma) < 2.0


@pytest.mark.parametrize("name", ["anfis-ekf", "anfis-fgo"])
@pytest.mark.parametrize("features", ["innovation", "recent"])
def test_a_noise_step_raises_sigma(name: str, features: str):
    """Sixfold noise: the sigma in use grows with it, and comes back."""
    text = resources.files("simnav.scenarios").joinpath("ship-dead-reckoning.toml").read_text(encoding="utf-8")
    scenario = parse(text[: text.index("[[fault]]")].replace("ship-dead-reckoning", "ship-noise-step") + NOISE_STEP)
    recording = record(scenario, 0)
    trial = run_trial(make(name, features=features), recording)
    sigma = trial.diagnostics["sigma_north.gnss"]
    inside = (trial.time > 620.0) & (trial.time < 900.0)
    outside = (trial.time < 600.0) | (trial.time > 940.0)
    rms_in, rms_out = (np.sqrt(np.mean(sigma[w] ** 2)) for w in (inside, outside))
    assert rms_out < 1.5 * 4.0
    assert rms_in > 2.5 * rms_out


@pytest.mark.parametrize(("name", "plain", "runs"), [("anfis-ekf", "ship-ekf", 3), ("anfis-fgo", "ship-fgo", 1)])
def test_on_clean_data_it_is_as_good_as_the_plain_filter(name: str, plain: str, runs: int):
    """Within 5 % in the mean, straight and in a turn, for every set of features."""
    ratios: dict[str, list[float]] = {f: [] for f in FEATURES}
    for scenario in ("ship-straight", "ship-turn"):
        for seed in range(runs):
            recording = record(load(scenario), seed)
            base = score(run_trial(make(plain), recording), recording)["horizontal_rmse"]
            for features, found in ratios.items():
                mine = score(run_trial(make(name, features=features), recording), recording)["horizontal_rmse"]
                found.append(np.log(mine / base))
    for features, found in ratios.items():
        assert np.exp(np.mean(found)) < 1.05, features


# Training


def test_the_target_is_the_variance_that_the_fixes_had():
    """Errors of the fixes, from the truth, over the sigma that is taught: unit variance in every weather."""
    for scenario in scenarios()[:5]:
        squares, factors = [], []
        for seed in range(3):
            recording = record(scenario, FIRST_TRAINING_SEED + 1000 + seed)
            stream = recording.data.aids["gnss"]
            np.testing.assert_allclose(stream.time, recording.data.truth.time)
            error = np.array([
                relative_position(a, b) for a, b in zip(stream.value, recording.data.truth.position, strict=True)
            ])[:, :2]  # fmt: skip
            factor = log_factors(recording, stream)
            nominal = recording.instruments["gnss"].sigma[:2]
            squares.append((error / nominal) ** 2 / np.exp(factor)[:, None])
            factors.append(factor)
        healthy = np.concatenate(factors) == 0.0
        assert np.mean(np.concatenate(squares)[healthy]) == pytest.approx(1.0, abs=0.06), scenario.name
        if scenario.name.endswith("healthy"):
            assert healthy.all()
        else:
            # Multipath is correlated in time: its variance in a few runs scatters.
            assert 0.03 < np.mean(~healthy) < 0.7, scenario.name
            assert np.mean(np.concatenate(squares)[~healthy]) == pytest.approx(1.0, abs=0.25), scenario.name


def test_seeds_of_training_and_validation_are_never_scored():
    """Campaigns, papers and bounds count from zero, by hundreds at most."""
    from simnav.leaderboard import profiles
    from simnav.leaderboard.campaign.campaign import RUNS
    from simnav.leaderboard.papers import PAPERS
    from simnav.leaderboard.papers.reading import paper_of as load_paper

    runs = [part.runs for name in profiles.profiles() for part in profiles.read_profile(name).parts]
    scored = max(RUNS, *runs, *(load_paper(key).full for key in PAPERS))
    for features in FEATURES:
        record_ = Parameters.load(shipped(features)).record
        (first, last), (check, end) = record_["training_seeds"], record_["validation_seeds"]
        assert scored < FIRST_TRAINING_SEED == first <= last < FIRST_VALIDATION_SEED == check <= end
        row = make("anfis-fgo", features=features)
        assert row.learned_from == [(first, last)]
        assert row.trained_on["voyages"] == len(scenarios()) * (last - first + 1)
        assert record_["command"] == f"simnav train anfis --features {features} --seeds {last - first + 1}"
    with pytest.raises(ValueError, match="seed 49 may be scored"):
        gather([49])


def test_shipped_files_are_in_the_package_and_have_the_score_that_they_say():
    """The validation voyages are sailed again, and the networks of the files are held against them."""
    record_ = Parameters.load(shipped("innovation")).record
    first, last = record_["validation_seeds"]
    data = gather(range(first, last + 1))
    for features in FEATURES:
        file = resources.files("simnav.estimators.adaptations").joinpath(f"anfis_{features}.json")
        assert file.is_file()
        parameters = Parameters.load(Path(str(file)))
        error = np.sqrt(np.mean((log_factor(parameters, data.inputs[features]) - data.outputs) ** 2))
        # The file's is that of the network alone, before its output is held to its range.
        raw = np.sqrt(np.mean((parameters.network(parameters.scale(data.inputs[features])) - data.outputs) ** 2))
        assert raw == pytest.approx(parameters.record["validation_rmse"], rel=0.02), features
        assert error < raw * 1.001
    by = {f: Parameters.load(shipped(f)).record for f in FEATURES}
    assert by["recent"]["validation_rmse"] < by["innovation"]["validation_rmse"]
    assert by["innovation"]["validation_rmse"] < 0.5 * by["innovation"]["validation_of_constant"]


def test_training_on_little_is_the_same_every_time(monkeypatch, tmp_path: Path):
    """Two voyages: what is learnt is the same, bit for bit, and survives its file."""
    from simnav.estimators.training import anfis_training

    few = scenarios()[1:3]
    monkeypatch.setattr(anfis_training, "scenarios", lambda: few)
    found = []
    for _ in range(2):
        data, check = gather([FIRST_TRAINING_SEED]), gather([FIRST_VALIDATION_SEED])
        found.append(train("innovation", data, check, passes=5)[0])
    a, b = found
    for name in ("centres", "widths", "consequents"):
        assert np.array_equal(getattr(a.network, name), getattr(b.network, name))
    assert a.record == b.record
    assert a.record["rmse"] < 0.8 * np.std(data.outputs)
    a.save(tmp_path / "a.json")
    loaded = Parameters.load(tmp_path / "a.json")
    x = data.inputs["innovation"][:50]
    np.testing.assert_allclose(log_factor(loaded, x), log_factor(a, x), atol=1e-6)


# Files


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"format": 9}, "format should be 1, not 9"),
        ({"features": "tea"}, "features should be one of innovation, motion, recent, not 'tea'"),
        ({"inputs": ["speed"]}, "inputs should be"),
        ({"centres": [[1, 2], [3, 4]]}, "centres should be 3 x any finite numbers"),
        ({"widths": [[0.1, 0.1, "x"]] * 3}, "widths should be 3 x 3 finite numbers"),
        ({"widths": [[0.1, 0.1, 0.0]] * 3}, "widths should be positive"),
        ({"consequents": None}, "consequents should be 27 x 4 finite numbers"),
        ({"consequents": [[1e999] * 4] * 27}, "consequents should be 27 x 4 finite numbers"),
        ({"high": [0, 0, 0]}, "high should be above low"),
        ({"largest": -1.0}, "largest should not be negative"),
        ({"largest": [1.0]}, "largest should be a single finite number"),
        ({"low": ...}, "the field low is missing"),
    ],
)
def test_bad_files_are_named_with_their_field(tmp_path: Path, change: dict, message: str):
    document = json.loads(shipped("innovation").read_text(encoding="utf-8"))
    document.update(change)
    path = tmp_path / "bad.json"
    path.write_text(json.dumps({k: v for k, v in document.items() if v is not ...}))
    with pytest.raises(ParametersError, match=message) as caught:
        Parameters.load(path)
    assert str(path) in str(caught.value)


def test_files_that_are_none(tmp_path: Path):
    with pytest.raises(ValueError, match=r"none\.json: No such file.*simnav paper train-anfis"):
        make("anfis-fgo", file=str(tmp_path / "none.json"))
    path = tmp_path / "text.json"
    path.write_text("hello")
    with pytest.raises(ValueError, match=r"text\.json: no parameter file of the ANFIS"):
        make("anfis-ekf", file=str(path))
    path.write_text("[1]")
    with pytest.raises(ValueError, match="format should be 1, not None"):
        make("anfis-ekf", file=str(path))
    with pytest.raises(ValueError, match="features should be 'motion', not 'innovation'"):
        make("anfis-fgo-motion", file=str(shipped("innovation")))
    with pytest.raises(ValueError, match=r"features.*innovation"):
        make("anfis-fgo", features="tea")


def test_a_learned_level_is_the_datasheet_until_it_is_contradicted():
    """Fixes of twice the datasheet's sigma: the level is found. With the datasheet's sigma it stays at 1."""
    rng = np.random.default_rng(4)
    for factor, low, high in ((1.0, 1.0, 1.0), (3.0, 6.0, 12.0)):
        level = Level()
        for t in range(200):
            residual = rng.normal(0.0, [0.5, 0.5]) + rng.normal(0.0, [2.0 * factor] * 2)
            fix = Measurement(float(t), "gnss", "gnss_position", np.zeros(3))
            level.observe(Innovation(fix, residual, 0.25 * np.eye(2), 4.0 * np.eye(2)))
        assert low <= level.value <= high


def test_few_gross_errors_are_no_level():
    rng = np.random.default_rng(5)
    level = Level()
    for t in range(200):
        residual = rng.normal(0.0, 2.0, 2) + (30.0 if t % 10 == 0 else 0.0)
        fix = Measurement(float(t), "gnss", "gnss_position", np.zeros(3))
        level.observe(Innovation(fix, residual, 0.01 * np.eye(2), 4.0 * np.eye(2)))
    assert level.value == 1.0


def test_a_wrong_datasheet_costs_nothing_with_a_learned_level():
    """On a training seed, with fixes three times as noisy as their datasheet: better than no adaptation."""
    scenario = load("ship-turn").with_values({"instruments.gnss.times_datasheet": {"sigma": 3.0}})
    recording = record(scenario, FIRST_TRAINING_SEED)
    trained = make("anfis-ekf", level="datasheet")
    rows = {"plain": make("ship-ekf"), "as trained": trained, "learned": make("anfis-ekf")}
    found = {
        name: score(run_trial(row, recording), recording, ["horizontal_rmse"])["horizontal_rmse"]
        for name, row in rows.items()
    }
    assert found["learned"] < found["plain"] < found["as trained"]
