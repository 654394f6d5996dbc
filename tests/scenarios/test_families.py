"""Families: every run is another voyage, and training shares nothing with the board."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.leaderboard.interface import scenarios_of
from simnav.scenario import TRAINING_ROOT, load
from simnav.scenario.catalogue import headers
from simnav.source import record

FAMILIES = [h for h in headers() if h.path.parent.name == "families"]


@pytest.mark.parametrize("header", FAMILIES, ids=lambda h: h.name)
def test_no_two_voyages_are_alike(header):
    family = load(header.id)
    runs = [family.drawn(seed) for seed in range(6)]
    assert len({run.content_hash() for run in runs}) == len(runs)
    assert len({run.start.latitude for run in runs}) == len(runs)
    assert family.drawn(2).content_hash() == runs[2].content_hash()
    assert family.track.partition("-")[0] in (("training",) if family.training else ("generalisation", "satellites"))


def test_voyages_are_of_all_kinds():
    family = load("random-voyages")
    runs = [family.drawn(seed) for seed in range(120)]
    assert {run.draws["draw.vessel"] for run in runs} == {"ship", "auv", "rov", "glider"}
    kinds = {(fault.kind, name) for run in runs for fault in run.faults for name in fault.instruments}
    assert {name for _, name in kinds} == {"gnss", "usbl", "dvl"}
    assert {"outage", "noise_step", "multipath", "gross_error", "bias_step", "ramp", "frozen", "false_zero"} == {
        kind for kind, _ in kinds
    }
    assert {len(run.faults) for run in runs} == {0, 1, 2}
    # No fault lasts to the end, so that recovery is seen.
    assert all(fault.end < run.duration for run in runs for fault in run.faults)


def test_training_families_cannot_meet_the_board():
    training = [load(h.id) for h in FAMILIES if h.training]
    assert len(training) >= 3
    for family in training:
        assert family.root(0) == TRAINING_ROOT
        # What a campaign may ask for ends below the root.
        assert family.root(0) > 2**63 - 1
    assert not any(s.training for s in scenarios_of(None, note=lambda _: None))
    assert [s.name for s in scenarios_of("training-clean")] == ["training-clean"]


def test_the_same_voyage_under_another_root_is_another_run():
    run = load("random-ships").drawn(4).model_copy(update={"duration": 60.0, "faults": ()})
    board, training = record(run, 4), record(run.model_copy(update={"training": True}), 4)
    assert not np.array_equal(board.data.aids["gnss"].value, training.data.aids["gnss"].value)


def test_a_track_is_asked_for_by_its_name():
    assert {s.name for s in scenarios_of("generalisation")} == {"random-voyages", "clean-voyages", "several-faults"}
    assert all(s.training for s in scenarios_of("training"))


@pytest.mark.parametrize("name", ["several-faults", "several-faults-ships"])
def test_faults_meet_and_come_again(name: str):
    """Some measurement is touched by two faults, in some voyage more than two faults act, and some comes again."""
    family = load(name)
    overlap, most, episodes = False, 0, 0
    for seed in range(10):
        recording = record(family, seed)
        most = max(most, len(recording.faults))
        for aid in recording.data.aids.values():
            overlap |= any(int(bits).bit_count() > 1 for bits in aid.faults)
        for j, fault in enumerate(family.drawn(seed).faults):
            if fault.mean_gap is not None:
                touched = recording.data.aids[fault.instruments[0]].faults >> np.uint32(j) & np.uint32(1)
                episodes = max(episodes, int(np.count_nonzero(np.diff(touched.astype(int)) > 0)))
    assert overlap
    assert most >= 3
    assert episodes >= 3


def test_voyages_with_poor_imus_have_no_wrong_measurement():
    family = load("training-poor-imu")
    runs = [family.drawn(seed) for seed in range(60)]
    assert {f.kind for run in runs for f in run.faults} == {"imu_dropout", "imu_disturbance", "outage"}
    assert all(1.0 <= run.draws["draw.worse"] <= 20.0 for run in runs)
    for run in runs:
        true = run.actual_sheet()
        said = run.instruments_sheet()
        assert true.imu.gyroscope.random_walk == pytest.approx(
            said.imu.gyroscope.random_walk * run.draws["draw.worse"], rel=1e-9
        )
        assert all(np.array_equal(true[name].sigma, said[name].sigma) for name in said)
        assert any(sheet.kind in ("gnss_position", "terrain_fix") for sheet in said.values())
    faulty = [load("training-poor-imu-faults").drawn(seed) for seed in range(60)]
    assert {"bias_step", "multipath", "false_zero"} <= {f.kind for run in faulty for f in run.faults}


def test_gaps_of_poor_imus_are_short():
    labels = [record(load("training-poor-imu"), seed) for seed in (1, 3)]
    lengths = []
    for run in labels:
        bit = [f.kind for f in run.faults].index("imu_dropout")
        within = np.flatnonzero(np.diff(np.r_[0, run.data.imu_labels.faults >> bit & 1, 0]))
        lengths += np.diff(within)[::2].tolist()
    assert len(lengths) > 20
    assert np.mean(np.array(lengths) <= 25) > 0.97  # a quarter of a second at 100 Hz
