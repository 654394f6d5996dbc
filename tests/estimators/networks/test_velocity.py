"""The velocity of a network while a DVL gives none: its inputs, the network without PyTorch, and the row."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from simnav.estimator import make, unsuitable
from simnav.estimators.networks.file import Network, NetworkError
from simnav.estimators.networks.velocity import (
    INPUTS,
    RECIPE,
    VERSION,
    VelocityNetwork,
    VelocitySeconds,
    shapes_of,
)
from simnav.estimators.training import velocity_network as recipe
from simnav.scenario import load
from simnav.source import record
from simnav.trial import run_trial

UNITS, AT = 4, {name: i for i, name in enumerate(INPUTS)}


def shapes(units=UNITS):
    return shapes_of({"output_weight": np.zeros((6, units))})


def constant(path, difference, sigma):
    """A network that always says the same."""
    arrays = {name: np.zeros(shape) for name, shape in shapes().items()}
    arrays["output_bias"][:3], arrays["output_bias"][3:] = difference, np.log(sigma)
    Network(RECIPE, VERSION, arrays, ("dvl",), {"voyages": 3, "streams": [[7, 9]]}).save(path)
    return str(path)


@cache
def recording(silent=False):
    """Forty seconds of a vehicle with a DVL, which is silent from 20 s on."""
    table = load("auv-survey").model_copy(update={"duration": 40.0, "faults": ()})
    whole = record(table, 1)
    if not silent:
        return whole
    stream = whole.data.aids["dvl"]
    kept = {**whole.data.aids, "dvl": stream.rows(np.flatnonzero(stream.time < 20.5))}
    return replace(whole, data=replace(whole.data, aids=kept))


def seconds():
    return VelocitySeconds(recording().instruments["dvl"], recording().start)


def test_the_inputs_of_a_second_tell_what_was_heard_and_for_how_long_nothing_was():
    taken, noted, missing = seconds(), [], []
    for packet in recording(silent=True).steps():
        noted.append(taken.take(packet))
        missing.append(taken.is_missing)
    noted = np.array(noted)
    assert noted.shape == (40, len(INPUTS))
    np.testing.assert_array_equal(noted[:, AT["is_heard"]], [1.0] * 20 + [0.0] * 20)
    np.testing.assert_allclose(np.expm1(2.0 * noted[19:, AT["elapsed"]]), np.arange(21.0))
    assert missing == [False] * 21 + [True] * 19  # one reading may be late
    readings = recording().data.aids["dvl"].value
    assert np.abs(taken.held - readings[:20].mean(axis=0)).max() < 0.5  # a fading mean of the last ones
    np.testing.assert_array_equal(noted[20:, :3], 0.0)
    turned = np.arctan2(noted[-1, AT["sine_turned"]], noted[-1, AT["cosine_turned"]])
    truth = recording().data.truth.attitude[:, 2]
    assert turned == pytest.approx(truth[39] - truth[19], abs=0.02)


def test_a_step_that_is_shorter_than_a_second_waits_for_it():
    taken, whole = seconds(), seconds()
    packet = next(iter(recording().steps()))
    imu, middle = packet.imu, packet.start + 0.5
    early = int(np.searchsorted(imu.time, middle + 1e-9))
    halves = (
        replace(packet, time=middle, imu=imu[:early], aids=[m for m in packet if m.time <= middle]),
        replace(packet, start=middle, imu=imu[early:], aids=[m for m in packet if m.time > middle]),
    )
    assert taken.take(halves[0]) is None
    np.testing.assert_allclose(taken.take(halves[1]), whole.take(packet), rtol=1e-6, atol=1e-9)


def test_it_is_the_network_of_the_library():
    torch = pytest.importorskip("torch", reason="the extra learn is not installed")
    torch.manual_seed(3)
    layer, output = torch.nn.GRU(len(INPUTS), UNITS, batch_first=True), torch.nn.Linear(UNITS, 6)
    own = VelocityNetwork(Network(RECIPE, VERSION, recipe._arrays(layer, output)))
    given = np.random.default_rng(0).normal(size=(5, len(INPUTS))).astype(np.float32)
    with torch.no_grad():
        expected = output(layer(torch.from_numpy(given[None]))[0])[0].numpy()
    for x, y in zip(given.astype(np.float64), expected, strict=True):
        mean, sigma = own.advance(x)
        np.testing.assert_allclose(mean, y[:3], atol=1e-5)
        np.testing.assert_allclose(np.log(sigma), y[3:], atol=1e-5)


def last_velocity(row, run):
    trial = run_trial(row, run)
    assert trial.status == "ok", trial.reason
    return trial.velocity[-1]


def test_a_row_is_the_plain_filter_while_the_dvl_is_heard_and_follows_the_prediction_when_not(tmp_path):
    file = constant(tmp_path / "n.npz", [0.0, 0.5, 0.0], 1e-2)
    plain, own = (last_velocity(row, recording()) for row in (make("ekf"), make("beams-ekf", file=file)))
    np.testing.assert_array_equal(plain, own)
    silent = recording(silent=True)
    aside = [last_velocity(make("beams-ekf", file=file, lasting=t), silent) for t in (1.0, 1e6)]
    aside.append(last_velocity(make("ekf"), silent))
    heading = silent.data.truth.attitude[-1, 2]
    starboard = np.array([-np.sin(heading), np.cos(heading)])
    first, weak, none = (float(v[:2] @ starboard) for v in aside)
    speed = float(np.linalg.norm(silent.data.aids["dvl"].value[-1]))
    assert first - none > 0.2 * speed  # it was told to go aside by half its speed
    assert weak == pytest.approx(none, abs=1e-3 * speed)


def test_what_the_row_needs_and_which_files_it_refuses(tmp_path):
    row = make("beams-ekf", file=constant(tmp_path / "n.npz", 0.0, 1.0))
    assert row.learned_from == [(7, 9)]
    assert unsuitable(row, recording().instruments.without({"dvl"})) == "it needs dvl or dvl_solution; there is none"
    Network("noise-network", 1, {}).save(tmp_path / "other.npz")
    with pytest.raises(NetworkError, match="recipe should be 'velocity-network', not 'noise-network'"):
        Network.load(tmp_path / "other.npz", RECIPE, VERSION, shapes_of)
    with pytest.raises(ValueError, match="lasting = 0: it must be positive"):
        make("beams-ekf", file=constant(tmp_path / "n.npz", 0.0, 1.0), lasting=0.0)


def test_the_dvl_is_silenced_at_the_times_that_are_drawn():
    rng = np.random.default_rng(2)
    for _ in range(20):
        for begin, end in recipe.silent_times(400.0, rng):
            assert 40.0 <= begin <= 360.0
            assert 5.0 <= end - begin <= recipe.LONGEST
    packet = next(iter(recording().steps()))
    (reading,) = (m for m in packet if m.instrument == "dvl")
    others = [m for m in packet if m is not reading]
    assert recipe.silenced(packet, "dvl", [(reading.time, reading.time + 1.0)]).aids == others
    assert recipe.silenced(packet, "dvl", [(reading.time + 0.1, 9.0)]).aids == packet.aids
