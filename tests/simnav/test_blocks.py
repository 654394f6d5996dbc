"""Blocks of states: what may be declared, and that the simulated values follow the declared process."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest

from simnav.blocks import StateBlock, blocks_of
from simnav.kinds import Component, Kind
from simnav.plugins import PluginError
from simnav.recording import Recording
from simnav.scenario import parse
from simnav.sensors import AidSpec, register_instrument
from simnav.sensors.block_values import BlockValues
from simnav.simulation.simulator import ideal
from simnav.source import open_source, record
from simnav.spec import NonNegative, SpecError, quantity
from simnav.types import Datasheet
from tests.cases.fjord import fjord, true_blocks

BLOCKS = {
    "constant": StateBlock("scale", 2, "", (0.1, 0.0)),
    "random_walk": StateBlock("bias", 1, "m", 2.0, "random_walk", 0.3),
    "gauss_markov": StateBlock("bias", 2, "m_s", (1.0, 0.5), "gauss_markov", correlation_time=20.0),
    "clock": StateBlock("clock", 2, ("m", "m_s"), (30.0, 0.1), "clock", (0.2, 0.02)),
}


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"name": "Iron"}, "name = 'Iron' of a block of states should be in snake_case"),
        ({"name": "navigation"}, "name = 'navigation' of a block"),
        ({"shared": "a.b"}, "shared = 'a.b' of a block"),
        ({"size": 0}, "block 'iron': size = 0 should be an integer of 1 or more"),
        ({"units": "furlong"}, "units = 'furlong' should be one unit or 3"),
        ({"units": ("m", "m")}, "should be one unit or 3"),
        ({"sigma": (1.0, 2.0)}, r"sigma = \(1.0, 2.0\) should be one number or 3"),
        ({"sigma": -1.0}, "finite and not negative"),
        ({"density": float("nan")}, "density = nan should be"),
        ({"process": "brownian"}, "process = 'brownian' should be one of: constant, random_walk, gauss_markov, clock"),
        ({"process": "clock"}, "a clock has size = 2, bias and drift, not 3"),
        ({"process": "gauss_markov"}, "correlation_time = inf of a Gauss-Markov process should be above 0 and finite"),
    ],
)
def test_a_wrong_field_is_named(fields, message):
    with pytest.raises(ValueError, match=message):
        StateBlock(**{"name": "iron", "size": 3, "units": "m", "sigma": 1.0, **fields})


def test_shared_blocks_are_one_and_agree():
    clock = replace(BLOCKS["clock"], shared="receiver")
    found = blocks_of([("a", [clock]), ("b", [clock, BLOCKS["constant"]])])
    assert list(found) == ["receiver", "b.scale"]
    with pytest.raises(ValueError, match=r"instruments 'a' and 'b' share the block 'receiver', but its sigma is \(30"):
        blocks_of([("a", [clock]), ("b", [replace(clock, sigma=1.0)])])
    with pytest.raises(ValueError, match="instrument 'a' has two blocks of states of the name 'clock'"):
        blocks_of([("a", [clock, BLOCKS["clock"]])])


@pytest.mark.parametrize("name", BLOCKS)
def test_two_steps_are_one_of_twice_the_length(name):
    block = BLOCKS[name]
    F, Q = block.transition(3.0), block.noise(3.0)
    np.testing.assert_allclose(F @ F, block.transition(6.0))
    np.testing.assert_allclose(F @ Q @ F.T + Q, block.noise(6.0), rtol=1e-9, atol=1e-15)
    if name == "gauss_markov":  # it is stationary
        assert block.covariance(7.0) == pytest.approx(np.diag(np.square(block.sigma)))


@pytest.mark.parametrize("name", BLOCKS)
def test_simulated_values_have_the_declared_covariance(name):
    block = BLOCKS[name]
    time = np.array([0.0, 12.0, 30.0])
    runs = np.array([BlockValues(block, "a", seed).at(time) for seed in range(600)])
    for k, t in enumerate(time):
        expected = block.covariance(t)
        scale = np.sqrt(np.diag(expected)) + 1e-12
        found = runs[:, k].T @ runs[:, k] / len(runs)
        assert found / scale / scale[:, None] == pytest.approx(expected / scale / scale[:, None], abs=0.2)


def test_values_do_not_depend_on_who_asks_and_when():
    block = BLOCKS["gauss_markov"]
    time = np.linspace(0.3, 90.0, 400)
    at_once, in_pieces, later = (BlockValues(block, "a", 5) for _ in range(3))
    whole = at_once.at(time)
    assert np.array_equal(np.concatenate([in_pieces.at(part) for part in np.array_split(time, 7)]), whole)
    later.at(np.array([500.0]))
    assert np.array_equal(later.at(time), whole)
    assert not np.array_equal(BlockValues(block, "b", 5).at(time), whole)


# --- instruments of a scenario


def test_instruments_that_share_a_block_have_one_true_value(plugins):
    scenario = fjord(plugins, "clock")
    time = np.array([3.0, 30.5])
    values = [scenario.aids[name].build(name, 3).block("clock", time) for name in list(scenario.aids)[1:]]
    assert len(values) == 3
    assert all(np.array_equal(value, values[0]) for value in values)


def test_a_recording_has_the_blocks_in_its_datasheets_and_keeps_them(plugins, tmp_path):
    scenario = fjord(plugins, "clock", duration=5.0)
    recording = record(scenario, 1)
    sheet = recording.instruments["transponder_0"]
    assert sheet.blocks == scenario.aids["transponder_0"].blocks()
    recording.save(tmp_path / "run.npz")
    again = Recording.load(tmp_path / "run.npz")
    assert again.instruments["transponder_0"].blocks == sheet.blocks
    assert again.instruments["depth"].blocks == ()


def test_a_run_in_pieces_gives_the_same_measurements(plugins):
    scenario = fjord(plugins, "clock", duration=20.0)
    whole = record(scenario, 4).data.aids["transponder_1"].value
    source = open_source(scenario, 4)
    pieces = [source.advance(until).aids["transponder_1"].value for until in (3.0, 3.5, 11.0, 20.0)]
    assert np.array_equal(np.concatenate(pieces), whole)


def test_ideal_instruments_have_none_and_true_figures_may_be_others(plugins):
    scenario = fjord(plugins, "iron", duration=5.0)
    clean, real = (make(scenario, 1).data.aids["magnetometer"].value for make in (ideal, record))
    assert np.abs(real - clean).max() > 1e-6
    wrong = fjord(plugins, "iron", duration=5.0, tables="[instruments.magnetometer.times_datasheet]\nhard_iron = 3.0\n")
    before, after = (true_blocks(s, 1, np.zeros(1))["magnetometer.iron"][0] for s in (scenario, wrong))
    assert after == pytest.approx(before * [3.0, 3.0, 3.0, 1.0, 1.0, 1.0])
    recording = record(wrong, 1)
    assert recording.instruments["magnetometer"].blocks[0].sigma[0] == pytest.approx(4e-6)
    assert recording.actual["magnetometer"].blocks[0].sigma[0] == pytest.approx(12e-6)


def test_a_scenario_whose_instruments_disagree_on_a_block_is_refused(plugins):
    text = (plugins / "fjord.toml").read_text().partition("[instruments.fix]")[0].replace("magnetometer.py", "beam.py")
    beam = '[instruments.beam_{0}]\nkind = "beam"\nsigma_m_s = 0.02\nazimuth_deg = 0\nsound_speed = 0.0{0}\n'
    with pytest.raises(
        SpecError, match=r"'beam_1' and 'beam_2' share the block 'sound_speed', but its sigma is \(0.01"
    ):
        parse(text + beam.format(1) + beam.format(2), folder=plugins)


def test_a_mistake_in_the_declaration_is_named_when_it_is_registered(clean_registry):
    class Iron(AidSpec):
        kind: Literal["iron"] = "iron"
        sigma: NonNegative = quantity("m")
        iron: NonNegative = quantity("m", 0.0)

        def blocks(self):
            return (StateBlock("iron", 1, "m", self.iron),)

    def observe(point, sheet):
        return point.blocks["iron"]

    kind = Kind("iron", role="other", components=(Component("iron", "m"),), equation=observe)
    example = {"sigma_m": 1.0, "iron_m": 2.0}
    with pytest.raises(PluginError, match=r"an ideal instrument still has sigma = \(2.0,\) .*Iron.errors should name"):
        register_instrument(kind, example=example)(Iron)
    broken = type("Broken", (Iron,), {"blocks": lambda self: (StateBlock("iron", 1, "furlong", self.iron),)})
    with pytest.raises(PluginError, match="the example of kind 'iron': block 'iron': units = 'furlong' should"):
        register_instrument(kind, example=example)(broken)

    class Biased(Iron):
        bias: NonNegative = quantity("m", 0.0)

        def blocks(self):
            return (StateBlock("bias", 1, "m", self.iron),)

    with pytest.raises(PluginError, match="its block of states 'bias' has the name of the error of its field 'bias'"):
        register_instrument(kind, example=example)(Biased)
    with pytest.raises(PluginError, match="kind 'iron' brings blocks of states; its equation should be a function"):
        register_instrument(replace(kind, equation=None), example=example)(Iron)


def test_a_datasheet_without_blocks_is_as_it_was():
    assert Datasheet("depth", "depth", 1.0, np.array([0.1])).blocks == ()
