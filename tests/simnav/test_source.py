"""One door for simulated and recorded runs."""

from __future__ import annotations

import numpy as np

from simnav.log import LogSource
from simnav.scenario import load
from simnav.simulation.simulator import Simulator
from simnav.source import open_source, record


def test_the_scenario_says_where_the_measurements_come_from():
    assert isinstance(open_source(load("open-sea"), 0), Simulator)
    assert isinstance(open_source(load("car-kitti"), 0), LogSource)


def test_a_recording_holds_the_whole_run():
    recording = record(load("car-kitti"), 3)
    assert recording.scenario == "car-kitti-v1"
    assert recording.seed == 3
    assert recording.note
    packets = list(recording.steps())
    assert [p.time for p in packets] == list(np.arange(1.0, 468.0))
    assert sum(len(p.imu) for p in packets) == 46700
    assert all(len(p.imu) == 100 for p in packets)
    assert sum(len(p) for p in packets) == 46
