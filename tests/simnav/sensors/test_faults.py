"""Every fault: its effect, its labels, its unit checks, and that faults and blocks do not disturb each other."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from simnav.geometry import earth
from simnav.recording import AidStream
from simnav.sensors.faults import AnyFault, build_layers, labels
from simnav.spec import Spec, SpecError
from simnav.types import KINDS, ImuSamples

INSTRUMENTS = {
    "gnss": "gnss_position",
    "gnss2": "gnss_position",
    "velocity": "gnss_velocity",
    "dvl": "dvl",
    "compass": "magnetic_compass",
    "log": "speed_log",
    "depth": "depth",
    "terrain": "terrain_fix",
}


class Holder(Spec):
    """A file that holds one fault."""

    faults: tuple[AnyFault, ...]


def faults(*tables) -> tuple:
    return Holder.from_toml({"faults": list(tables)}, source="f.toml").faults


def check_faults(faults, instruments, *, imu=True) -> None:
    for fault in faults:
        fault.check(instruments, imu=imu)


def layer(table, seed=1):
    return build_layers(faults(table), seed)[0]


def stream(name="gnss", n=100, rate=1.0, sigma=2.0, seed=5) -> AidStream:
    kind = INSTRUMENTS[name]
    d = len(KINDS[kind].errors)
    rng = np.random.default_rng(seed)
    value = 0.5 + 1e-6 * rng.normal(size=(n, d))
    return AidStream(
        name, kind, np.arange(1, n + 1) / rate, value, np.zeros(n, np.uint32), np.zeros((n, d)),
        np.full((n, d), sigma), np.empty(0),
    )  # fmt: skip


def part(s: AidStream, a: float, b: float) -> AidStream:
    """The stretch (a, b] of a stream."""
    rows = (s.time > a) & (s.time <= b)
    fields = {n: getattr(s, n)[rows] for n in ("time", "value", "faults", "fault_error", "sigma")}
    return AidStream(s.name, s.kind, **fields, dropped=s.dropped[(s.dropped > a) & (s.dropped <= b)])


def added(before: AidStream, after: AidStream) -> np.ndarray:
    return KINDS[before.kind].difference(after.value, before.value)


def assert_consistent(before: AidStream, after: AidStream) -> None:
    """The labels say what happened: fault_error is what was added, and only to labelled measurements."""
    np.testing.assert_allclose(after.fault_error, added(before, after), rtol=1e-9, atol=1e-7)
    untouched = after.faults == 0
    assert np.array_equal(after.value[untouched], before.value[untouched])
    assert not after.fault_error[untouched].any()
    assert not before.faults.any(), "the argument was changed"


def assert_same(a: AidStream, b: AidStream) -> None:
    for field in ("time", "value", "faults", "fault_error", "sigma", "dropped"):
        assert np.array_equal(getattr(a, field), getattr(b, field)), field


# --- effect and label of each


def test_bias_step_in_metres():
    s = stream()
    after = layer(
        {"kind": "bias_step", "instruments": "gnss", "offset_m": [25, -3, 1], "start_s": 10, "end_s": 20}
    ).apply(s)
    active = (s.time >= 10) & (s.time < 20)
    assert np.array_equal(after.faults, active.astype(np.uint32))
    moved = earth.relative_position(after.value, s.value)
    assert moved == pytest.approx(np.where(active[:, None], [25.0, -3.0, 1.0], 0.0), abs=1e-7)
    assert_consistent(s, after)


@pytest.mark.parametrize(
    ("name", "key", "value", "error"),
    [
        ("dvl", "offset_m_s", [0.1, 0.2, 0.3], [0.1, 0.2, 0.3]),
        ("velocity", "offset_m_s", 0.5, [0.5, 0.5, 0.5]),
        ("log", "offset_m_s", -0.2, [-0.2]),
        ("compass", "offset_deg", 5, [np.radians(5)]),
        ("depth", "offset_m", 1.5, [1.5]),
        ("terrain", "offset_m", [100, -50], [100, -50]),
    ],
)
def test_bias_step_in_the_unit_of_each_kind(name, key, value, error):
    s = stream(name)
    after = layer({"kind": "bias_step", "instruments": [name], key: value}).apply(s)
    assert added(s, after) == pytest.approx(np.broadcast_to(error, s.value.shape), abs=1e-7)
    assert np.all(after.faults == 1)
    assert_consistent(s, after)


def test_ramp_starts_at_zero_in_each_interval():
    s = stream("dvl")
    table = {"kind": "ramp", "instruments": "dvl", "slope_m_s2": [0.1, 0, -0.2], "intervals_s": [[10, 20], [50, 60]]}
    after = layer(table).apply(s)
    since = np.where(s.time < 20, s.time - 10, s.time - 50)
    active = ((s.time >= 10) & (s.time < 20)) | ((s.time >= 50) & (s.time < 60))
    expected = np.where(active[:, None], since[:, None] * [0.1, 0, -0.2], 0.0)
    assert added(s, after) == pytest.approx(expected, abs=1e-12)
    assert set(after.faults[(s.time > 10) & (s.time < 20)]) == {1}
    assert set(after.faults[(s.time > 50) & (s.time < 60)]) == {2}
    assert_consistent(s, after)


@pytest.mark.parametrize("how", [{"factor": 3.0}, {"sigma_m": 6.0}])
def test_noise_step(how):
    s = stream(n=20_000)
    after = layer({"kind": "noise_step", "instruments": "gnss", **how, "start_s": 10_001}).apply(s)
    late = s.time >= 10_001
    assert np.all(after.sigma[late] == 6.0)
    assert np.all(after.sigma[~late] == 2.0)
    # The measurement had sigma 2 already: what is added makes it 6.
    assert np.std(added(s, after)[late], axis=0) == pytest.approx(np.full(3, np.sqrt(36 - 4)), rel=0.03)
    assert_consistent(s, after)


def test_noise_step_below_the_present_noise_adds_nothing():
    s = stream(sigma=5.0)
    after = layer({"kind": "noise_step", "instruments": "gnss", "sigma_m": [1, 1, 8]}).apply(s)
    assert after.sigma[0] == pytest.approx([5, 5, 8])
    assert not after.fault_error[:, :2].any()
    assert after.fault_error[:, 2].all()


def test_outage_moves_times_to_dropped():
    s = stream()
    after = layer({"kind": "outage", "instruments": "gnss", "intervals_s": [[10, 20], [30, 31]]}).apply(s)
    assert np.array_equal(after.dropped, [*range(10, 20), 30])
    assert np.array_equal(np.sort(np.concatenate([after.time, after.dropped])), s.time)
    kept = ~np.isin(s.time, after.dropped)
    assert np.array_equal(after.value, s.value[kept])
    assert not after.faults.any()


@pytest.mark.parametrize("common", [False, True])
def test_uniform_gross_errors(common):
    s = stream(n=20_000)
    table = {"kind": "gross_error", "instruments": "gnss", "probability": 0.1, "size_m": [10, 60], "common": common}
    after = layer(table).apply(s)
    hit = after.faults == 1
    assert hit.mean() == pytest.approx(0.1, abs=0.01)
    size = added(s, after)[hit]
    assert np.abs(size).min() >= 10.0 - 1e-6
    assert np.abs(size).max() <= 60.0 + 1e-6
    assert np.mean(np.abs(size)) == pytest.approx(35.0, rel=0.03)
    assert (size > 0).mean() == pytest.approx(0.5, abs=0.05)
    correlation = np.corrcoef(size.T)[0, 1]
    assert correlation == pytest.approx(1.0 if common else 0.0, abs=0.1)
    assert_consistent(s, after)


def test_normal_and_fixed_gross_errors():
    s = stream("dvl", n=20_000)
    table = {"kind": "gross_error", "instruments": "dvl", "probability": 0.5, "distribution": "normal", "size_m_s": 0.5}
    after = layer(table).apply(s)
    assert np.std(added(s, after)[after.faults == 1]) == pytest.approx(0.5, rel=0.03)
    table |= {"distribution": "fixed", "size_m_s": [1, 0, -1]}
    after = layer(table).apply(s)
    assert added(s, after)[after.faults == 1] == pytest.approx(np.tile([1.0, 0.0, -1.0], (after.faults.sum(), 1)))
    assert_consistent(s, after)


def test_multipath_is_stationary_and_correlated():
    s = stream(n=50_000)
    table = {"kind": "multipath", "instruments": "gnss", "correlation_time_s": 5, "sigma_m": [4, 4, 8]}
    error = added(s, layer(table).apply(s))
    assert np.std(error, axis=0) == pytest.approx([4, 4, 8], rel=0.05)
    for lag in (1, 5):
        assert np.corrcoef(error[lag:, 0], error[:-lag, 0])[0, 1] == pytest.approx(np.exp(-lag / 5), abs=0.04)
    first = np.array([layer(table, seed).apply(stream(n=1)).fault_error[0] for seed in range(400)])
    assert np.std(first, axis=0) == pytest.approx([4, 4, 8], rel=0.15)


def test_random_intervals_have_their_mean_lengths():
    s = stream(n=100_000)
    table = {
        "kind": "bias_step", "instruments": "gnss", "offset_m": 5, "mean_active_s": 30, "mean_gap_s": 70,
        "start_s": 1000,
    }  # fmt: skip
    after = layer(table).apply(s)
    active = after.faults == 1
    assert not active[s.time < 1000].any()
    assert active[s.time >= 1000].mean() == pytest.approx(0.3, abs=0.04)
    starts = np.count_nonzero(np.diff(active.astype(int)) == 1)
    assert active.sum() / starts == pytest.approx(30, rel=0.15)
    assert_consistent(s, after)


def test_frozen_repeats_the_last_value():
    s = stream("dvl")
    after = layer({"kind": "frozen", "instruments": "dvl", "intervals_s": [[10, 20], [40, 50]]}).apply(s)
    for a, b in ((10, 20), (40, 50)):
        here = (s.time >= a) & (s.time < b)
        assert np.array_equal(after.value[here], np.broadcast_to(s.value[s.time == a - 1], (10, 3)))
    assert_consistent(s, after)
    from_start = layer({"kind": "frozen", "instruments": "dvl"}).apply(s)
    assert np.array_equal(from_start.value, np.broadcast_to(s.value[0], s.value.shape))


@pytest.mark.parametrize("name", ["dvl", "log", "gnss"])
def test_false_zero(name):
    s = stream(name)
    after = layer({"kind": "false_zero", "instruments": name, "start_s": 10, "end_s": 20}).apply(s)
    assert not after.value[(s.time >= 10) & (s.time < 20)].any()
    assert after.value[s.time >= 20].all()
    if name != "gnss":  # the other side of the Earth is no small distance
        assert_consistent(s, after)


def imu(n=100) -> ImuSamples:
    return ImuSamples(0.01 * np.arange(1, n + 1), np.full(n, 0.01), np.ones((n, 3)), np.full((n, 3), 2.0))


def test_imu_disturbance():
    table = {"kind": "imu_disturbance", "specific_force_m_s2": 0.5, "angular_rate_deg_s": [0, 1, 0], "end_s": 0.5}
    before = imu()
    after, marks = layer(table).apply_imu(before, None)
    active = before.time < 0.5 - 1e-9
    assert np.array_equal(marks.faults, active.astype(np.uint32))
    force = after.specific_force - before.specific_force
    assert force == pytest.approx(np.where(active, 0.5, 0.0)[:, None].repeat(3, axis=1))
    error = np.column_stack([after.angular_rate - before.angular_rate, force])
    assert marks.fault_error == pytest.approx(error)
    assert error[0] == pytest.approx([0, np.radians(1), 0, 0.5, 0.5, 0.5])
    assert np.all(before.specific_force == 2.0)


def test_imu_disturbance_noise_and_bits():
    noise = {"kind": "imu_disturbance", "specific_force_noise_m_s2": [0, 0, 2.0]}
    constant = {"kind": "imu_disturbance", "angular_rate_deg_s": 1.0, "start_s": 50.0}
    samples, marks = imu(10_000), None
    for one in build_layers(faults({"kind": "outage", "instruments": "gnss"}, noise, constant), 1):
        samples, marks = one.apply_imu(samples, marks)
    assert np.std(samples.specific_force[:, 2]) == pytest.approx(2.0, rel=0.03)
    assert np.all(samples.specific_force[:, :2] == 2.0)
    assert np.array_equal(np.unique(marks.faults), [2, 6])


def moving_imu(n=100) -> ImuSamples:
    """Samples of which no two are alike."""
    return ImuSamples(
        0.01 * np.arange(1, n + 1),
        np.full(n, 0.01),
        np.arange(3.0 * n).reshape(n, 3),
        -np.arange(3.0 * n).reshape(n, 3),
    )


def test_imu_dropout_repeats_the_sample_before_it():
    before = moving_imu()
    after, marks = layer({"kind": "imu_dropout", "intervals_s": [[0.2, 0.25], [0.6, 0.61]]}).apply_imu(before, None)
    gap = np.isin(np.arange(100), [19, 20, 21, 22, 23])
    single = np.arange(100) == 59
    for name in ("angular_rate", "specific_force"):
        value, was = getattr(after, name), getattr(before, name)
        assert np.all(value[gap] == was[18])
        assert np.all(value[single] == was[58])
        assert np.array_equal(value[~gap & ~single], was[~gap & ~single])
    assert np.array_equal(marks.faults, gap + 2 * single)
    error = np.hstack([after.angular_rate - before.angular_rate, after.specific_force - before.specific_force])
    assert np.array_equal(marks.fault_error, error)
    assert np.array_equal(before.angular_rate, moving_imu().angular_rate)


def test_imu_dropout_at_the_very_start_repeats_its_first_sample():
    after, _ = layer({"kind": "imu_dropout", "end_s": 0.05}).apply_imu(moving_imu(), None)
    assert np.all(after.angular_rate[:4] == moving_imu().angular_rate[0])
    assert np.all(after.angular_rate[4] == moving_imu().angular_rate[4])


@pytest.mark.parametrize("edges", [(0, 50, 100), (0, 1, 20, 21, 22, 60, 100)])
def test_imu_dropout_in_pieces_gives_the_same(edges):
    table = {"kind": "imu_dropout", "mean_active_s": 0.05, "mean_gap_s": 0.1}
    samples = moving_imu()
    whole, marks = layer(table).apply_imu(samples, None)
    one = layer(table)
    parts = [one.apply_imu(samples[a:b], None) for a, b in pairwise(edges)]
    assert 20 < np.count_nonzero(marks.faults) < 80
    assert np.array_equal(np.concatenate([p.specific_force for p, _ in parts]), whole.specific_force)
    assert np.array_equal(np.concatenate([m.faults for _, m in parts]), marks.faults)
    assert np.array_equal(np.concatenate([m.fault_error for _, m in parts]), marks.fault_error)


# --- how they compose


ALL = [
    {"kind": "gross_error", "instruments": ["gnss", "dvl"], "probability": 0.3, "size_m": [1, 60],
     "size_m_s": [0.5, 1]},
    {"kind": "multipath", "instruments": "gnss_position", "correlation_time_s": 7, "sigma_m": 5, "mean_active_s": 9,
     "mean_gap_s": 11},
    {"kind": "noise_step", "instruments": ["gnss", "dvl"], "factor": 2.0, "start_s": 20, "end_s": 60},
    {"kind": "ramp", "instruments": "gnss", "slope_m_s": [0.1, 0.2, 0], "start_s": 30, "end_s": 50},
    {"kind": "bias_step", "instruments": "dvl", "offset_m_s": 1.0, "intervals_s": [[5, 15], [40, 45]]},
    {"kind": "frozen", "instruments": ["gnss", "dvl"], "intervals_s": [[62, 66], [70, 75]]},
    {"kind": "false_zero", "instruments": "dvl", "start_s": 80, "end_s": 85},
    {"kind": "outage", "instruments": ["gnss", "dvl"], "intervals_s": [[33, 36], [63, 65], [90, 93]]},
]  # fmt: skip


def through(layers, s: AidStream) -> AidStream:
    for one in layers:
        s = one.apply(s)
    return s


def test_faults_that_overlap_add_up_and_each_is_labelled():
    s = stream("dvl")
    steps = [
        {"kind": "bias_step", "instruments": "dvl", "offset_m_s": offset, "start_s": start, "end_s": start + 30}
        for offset, start in ((0.5, 10), (0.25, 25))
    ]
    after = through(build_layers(faults(*steps), 1), s)
    first, second = (s.time >= 10) & (s.time < 40), (s.time >= 25) & (s.time < 55)
    assert np.array_equal(after.faults, first + 2 * second)
    assert after.fault_error == pytest.approx(np.tile(0.5 * first + 0.25 * second, (3, 1)).T)
    assert_consistent(s, after)


@given(cuts=st.lists(st.floats(0, 100), max_size=6), name=st.sampled_from(["gnss", "dvl"]))
@settings(max_examples=40)
def test_blocks_of_any_length_give_the_same_bits(cuts, name):
    s = stream(name)
    whole = through(build_layers(faults(*ALL), 3), s)
    layers = build_layers(faults(*ALL), 3)
    blocks = [through(layers, part(s, a, b)) for a, b in pairwise([0.0, *sorted(cuts), 100.0])]
    assert_same(AidStream.concatenate(blocks), whole)
    assert len(np.unique(whole.faults)) > 5


def test_an_outage_before_other_faults_does_not_change_what_they_draw():
    s = stream()
    first, last = faults(ALL[7], *ALL[:4]), faults(*ALL[:4], ALL[7])
    a, b = (through(build_layers(f, 3), s) for f in (first, last))
    assert np.array_equal(a.value, b.value)
    assert np.array_equal(a.time, b.time)
    assert np.array_equal(a.dropped, b.dropped)


def test_one_more_fault_leaves_the_others_as_they_were():
    s = stream()
    alone = through(build_layers(faults(ALL[0]), 3), s)
    more = {"kind": "gross_error", "instruments": "gnss", "probability": 0.0, "size_m": [1, 2]}
    both = through(build_layers(faults(more, ALL[0]), 3), s)
    assert np.array_equal(alone.value, both.value)
    assert np.array_equal(alone.faults * 2, both.faults)


def test_two_equal_faults_draw_independently():
    table = {"kind": "gross_error", "instruments": "gnss", "probability": 0.5, "size_m": [1, 2]}
    s = stream()
    one, two = (x.apply(s).faults > 0 for x in build_layers(faults(table, table), 3))
    assert 0.3 < np.mean(one == two) < 0.7


def test_instruments_of_one_fault_draw_independently():
    table = {"kind": "gross_error", "instruments": "gnss_position", "probability": 0.5, "size_m": [1, 2]}
    one = layer(table)
    a, b = (one.apply(stream(n)).faults > 0 for n in ("gnss", "gnss2"))
    assert 0.3 < np.mean(a == b) < 0.7


def test_faults_of_other_instruments_do_nothing():
    s = stream("compass")
    assert through(build_layers(faults(*ALL), 3), s) is s


def test_irregular_and_empty_streams():
    rng = np.random.default_rng(1)
    s = stream(n=300)
    irregular = AidStream(
        s.name, s.kind, np.sort(rng.uniform(0, 100, 300)), s.value, s.faults, s.fault_error, s.sigma, s.dropped
    )
    after = through(build_layers(faults(*ALL), 3), irregular)
    assert len(after) + len(after.dropped) == 300
    assert np.isfinite(after.value).all()
    empty = part(s, 500, 600)
    assert len(through(build_layers(faults(*ALL), 3), empty)) == 0


# --- labels


def test_labels_and_bits_agree():
    fs = faults(*ALL, {"kind": "imu_disturbance", "specific_force_m_s2": 0.5})
    truth = labels(fs, 92.0, INSTRUMENTS)
    assert len(truth) == sum(f.bits for f in fs) == 13
    s = stream()
    after = through(build_layers(fs, 3), s)
    for bit, label in enumerate(truth):
        touched = s.time[np.isin(s.time, after.time[after.faults >> bit & 1 == 1])]
        assert label.instruments
        if touched.size:
            assert "gnss" in label.instruments
            assert touched.min() >= label.start
            assert touched[touched <= 92].max() <= label.end
    outages = [t for t in truth if t.kind == "outage"]
    assert [(t.start, t.end) for t in outages] == [(33, 36), (63, 65), (90, 92)]
    assert truth[1].instruments == ("gnss", "gnss2")
    assert truth[-1].instruments == ("imu",)


# --- mistakes


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"kind": "outage", "instruments": "gns"}, "no instrument 'gns'.*'gnss'"),
        ({"kind": "outage", "instruments": "imu"}, "imu_disturbance"),
        ({"kind": "bias_step", "instruments": "gnss", "offset_m_s": 1}, "'offset_m_s' is of no use to gnss"),
        ({"kind": "bias_step", "instruments": "gnss"}, "'offset_m' is missing"),
        ({"kind": "bias_step", "instruments": ["gnss", "dvl"], "offset_m": 1}, "on 'dvl'.*'offset_m_s' is missing"),
        ({"kind": "bias_step", "instruments": "gnss", "offset_m": [1, 2]}, "'offset_m' has 2 numbers; it takes 3"),
        ({"kind": "ramp", "instruments": "terrain", "slope_m_s": [1, 2, 3]}, "takes 2"),
        ({"kind": "noise_step", "instruments": ["gnss", "log"], "sigma_m": 5}, "on 'log'.*'sigma_m_s'"),
        ({"kind": "multipath", "instruments": "compass", "sigma_m": 5, "correlation_time_s": 1}, "'sigma_m'.*compass"),
        ({"kind": "gross_error", "instruments": "dvl", "size_m": [1, 2], "probability": 0.1}, "'size_m'.*dvl"),
    ],
)
def test_faults_that_do_not_fit_the_instruments(table, message):
    with pytest.raises(SpecError, match=message):
        check_faults(faults(table), INSTRUMENTS)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"kind": "outtage", "instruments": "gnss"}, "did you mean 'outage'"),
        ({"kind": "outage"}, "'faults\\[0\\].instruments' is missing"),
        ({"kind": "outage", "instruments": []}, "at least one instrument"),
        ({"kind": "outage", "instruments": "gnss", "start_s": 20, "end_s": 10}, "before it starts"),
        ({"kind": "outage", "instruments": "gnss", "start_s": -1}, "start_s = -1"),
        ({"kind": "outage", "instruments": "gnss", "intervals_s": [[20, 10]]}, "start before end"),
        ({"kind": "outage", "instruments": "gnss", "intervals_s": [10, 20]}, "list of \\[start, end\\]"),
        ({"kind": "outage", "instruments": 5}, "list of names"),
        ({"kind": "outage", "instruments": "gnss", "intervals_s": [[10, 20], [15, 30]]}, "without overlap"),
        ({"kind": "outage", "instruments": "gnss", "intervals_s": [[10, 20]], "start_s": 5}, "exclude each other"),
        ({"kind": "outage", "instruments": "gnss", "mean_active_s": 5}, "belong together"),
        ({"kind": "noise_step", "instruments": "gnss"}, "either a factor or a new sigma"),
        ({"kind": "noise_step", "instruments": "gnss", "factor": 2, "sigma_m": 3}, "either a factor or a new sigma"),
        ({"kind": "noise_step", "instruments": "gnss", "factor": 0.5}, "factor = 0.5"),
        ({"kind": "noise_step", "instruments": "gnss", "sigma_m": -3}, "sigma_m is not negative"),
        ({"kind": "gross_error", "instruments": "gnss", "size_m": [1, 2], "probability": 2}, "probability = 2"),
        ({"kind": "gross_error", "instruments": "gnss", "size_m": 5, "probability": 0.1}, "minimum, maximum"),
        ({"kind": "gross_error", "instruments": "gnss", "size_m": [5, 1], "probability": 0.1}, "minimum, maximum"),
        ({"kind": "multipath", "instruments": "gnss", "sigma_m": 5}, "correlation_time_s"),
        ({"kind": "bias_step", "instruments": "gnss", "offset": 5}, "unknown key 'faults\\[0\\].offset'"),
        ({"kind": "imu_disturbance"}, "specific_force_m_s2"),
        ({"kind": "imu_dropout", "instruments": "gnss"}, "on 'imu' and nothing else"),
        ({"kind": "imu_disturbance", "instruments": "dvl", "specific_force_m_s2": 1}, "on 'imu' and nothing else"),
    ],
)
def test_faults_that_make_no_sense(table, message):
    with pytest.raises(SpecError, match=message) as caught:
        faults(table)
    assert str(caught.value).startswith("f.toml: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("fault", [{"kind": "imu_disturbance", "specific_force_m_s2": 0.5}, {"kind": "imu_dropout"}])
def test_faults_of_the_imu_need_an_imu(fault):
    check_faults(faults(fault), INSTRUMENTS)
    with pytest.raises(SpecError, match="no IMU"):
        check_faults(faults(fault), INSTRUMENTS, imu=False)
