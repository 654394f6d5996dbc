"""Raw observations of satellites: their equation, their errors, and what estimators know of them."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.blocks import NAVIGATION
from simnav.geometry.earth import displace
from simnav.geometry.ecef import ecef_from_geodetic
from simnav.geometry.rotation import dcm_from_rotation_vector, dcm_from_rpy
from simnav.kinds import NavigationPoint
from simnav.satellites.multipath import sea_reflection
from simnav.satellites.receiver_clock import GRADES
from simnav.satellites.signal_errors import density_ratio, noise_factor, range_error
from simnav.sensors.gnss_raw import SHIPPED, GnssRaw
from simnav.sensors.instrument import turn_to_ned
from simnav.spec import SpecError
from simnav.types import TapStates
from tests.cases.raw_gnss import raw_gnss

TABLE = {
    "satellites": ["G12", "G29", "E27", "E30", "C26"], "sigma_pseudorange_m": 0.3, "sigma_range_rate_m_s": 0.05,
    "lever_arm_m": [2.0, -1.0, -9.0], "mask_deg": 5.0,
}  # fmt: skip


def spec(**changes) -> GnssRaw:
    return GnssRaw.from_toml(TABLE | changes)


def tap(n: int = 5, *, still: bool = False, every: float = 1.0) -> TapStates:
    """A ship that sails, turns and rolls."""
    time = np.arange(n) * every
    moves = 0.0 if still else 1.0
    velocity = moves * np.stack([4.0 + 0.0 * time, 3.0 + 0.0 * time, 0.1 + 0.0 * time], axis=1)
    position = displace(np.array([np.radians(54.0), np.radians(7.9), 2.0]), velocity * time[:, None])
    attitude = np.stack([0.1 * np.sin(time), 0.05 + 0.0 * time, 1.0 + 0.02 * time], axis=1)
    rate = moves * np.stack([0.02 * np.cos(time), 0.01 + 0.0 * time, 0.03 + 0.0 * time], axis=1)
    return TapStates(time, position, velocity, attitude, rate, np.zeros((n, 3)))


def point(at: TapStates, i: int, blocks, channel: str, side) -> NavigationPoint:
    dcm = np.ascontiguousarray(dcm_from_rpy(at.attitude[i]))
    return NavigationPoint(
        at.time[i], at.position[i], at.velocity[i], dcm, at.angular_rate[i], blocks, channel, np.ascontiguousarray(side)
    )


def test_a_perfect_receiver_measures_range_and_rate():
    at, receiver = tap(), spec().ideal().build("gnss", 1)
    stream = receiver.sense(at)
    assert len(stream) == 25
    seen = receiver.sight(at)
    antenna = displace(at.position, turn_to_ned(at.attitude, receiver.lever_arm))
    for row in range(25):
        i, j = divmod(row, 5)
        distance = np.linalg.norm(stream.side[row, :3] - ecef_from_geodetic(antenna[i]))
        delay = seen.ionosphere[i, j] + seen.troposphere[i, j]
        assert stream.value[row, 0] == pytest.approx(distance + delay, abs=1e-6)
        assert 2.0 < delay < 60.0
    assert abs(stream.value[:, 1]).max() < 800.0


def test_the_estimator_predicts_what_the_receiver_measures():
    """With the true blocks, only the white noise is left."""
    receiver = spec().build("gnss", 3)
    at = tap(200)
    stream, sheet, kind = receiver.sense(at), spec().datasheet("gnss"), GnssRaw.definition
    names = [block.name for block in sheet.blocks]
    assert names == ["clock", "troposphere", "signals", "ionosphere"]
    true = {name: receiver.block(name, at.time) for name in names}
    rest, sigma = [], []
    for row in range(len(stream)):
        i, channel = round(stream.time[row]), stream.channels[stream.channel[row]]
        values = {name: value[i] for name, value in true.items()}
        reading, _ = kind.observation(point(at, i, values, channel, stream.side[row]), sheet)
        rest.append(stream.value[row] - reading)
        sigma.append(kind.reading_sigma(stream.side[row], sheet))
    np.testing.assert_allclose(np.array(sigma), stream.sigma, rtol=1e-12)
    normal = np.array(rest) / stream.sigma
    assert abs(normal.mean()) < 0.1
    assert np.std(normal, axis=0) == pytest.approx([1.0, 1.0], abs=0.06)


@pytest.mark.parametrize("frequencies", [1, 2])
def test_the_jacobian_is_the_derivative(frequencies):
    given = spec(frequencies=frequencies)
    at, receiver, sheet = tap(), given.build("gnss", 1), given.datasheet("gnss")
    stream, observe = receiver.sense(at), GnssRaw.definition.observation
    assert ("ionosphere" in {b.name for b in sheet.blocks}) == (frequencies == 1)
    blocks = {b.name: 0.1 * np.arange(1.0, b.size + 1.0) for b in sheet.blocks}
    for row in (0, 6, 13):
        i, channel = round(stream.time[row]), stream.channels[stream.channel[row]]
        here = point(at, i, blocks, channel, stream.side[row])
        _, jacobian = observe(here, sheet)
        assert set(jacobian) == {NAVIGATION, *blocks}
        for k, step in enumerate(np.repeat([1.0, 0.1, 1e-4], 3)):
            ends = []
            for sign in (1.0, -1.0):
                error = np.zeros(9)
                error[k] = sign * step
                moved = here._replace(
                    position=displace(here.position, error[:3]), velocity=here.velocity + error[3:6],
                    dcm=np.ascontiguousarray(dcm_from_rotation_vector(error[6:9]) @ here.dcm),
                )  # fmt: skip
                ends.append(observe(moved, sheet)[0])
            slope = (ends[0] - ends[1]) / (2.0 * step)
            np.testing.assert_allclose(jacobian[NAVIGATION][:, k], slope, rtol=1e-4, atol=2e-5)
        for name, value in blocks.items():
            for k in range(len(value)):
                moved = here._replace(blocks=blocks | {name: value + np.eye(len(value))[k]})
                slope = observe(moved, sheet)[0] - observe(here, sheet)[0]
                np.testing.assert_allclose(jacobian[name][:, k], slope, rtol=0, atol=1e-6)


def test_errors_that_last_have_their_sigma_and_correlation():
    """Of many runs; by elevation, with the common errors of the atmosphere."""
    given = spec(correlation_time_s=100.0, troposphere_error_m=0.2)
    at = tap(3, still=True, every=50.0)
    errors = np.array([given.build("gnss", seed).lasting(at) for seed in range(400)])
    seen = given.build("gnss", 0).sight(at)
    wanted = np.sqrt(
        range_error(seen.elevation, 0.5, 1.0) ** 2 + (0.5 * seen.ionosphere) ** 2 + (0.2 * seen.mapping) ** 2
    )
    np.testing.assert_allclose(errors.std(axis=0), wanted, rtol=0.12)
    own = errors - np.array([
        seen.ionosphere * b.block("ionosphere", at.time) + seen.mapping * b.block("troposphere", at.time)
        for b in (given.build("gnss", seed) for seed in range(400))
    ])  # fmt: skip
    for j in range(5):
        correlation = np.corrcoef(own[:, :, j].T)
        assert correlation[0, 1] == pytest.approx(np.exp(-0.5), abs=0.1)
        assert correlation[0, 2] == pytest.approx(np.exp(-1.0), abs=0.1)


def test_low_satellites_are_weaker_noisier_and_lost():
    elevation = np.radians([5.0, 20.0, 85.0])
    assert density_ratio(elevation) == pytest.approx([33.07, 37.66, 49.43], abs=0.01)
    assert noise_factor(39.0) == pytest.approx(2.0, abs=0.01)
    at = tap(2)
    assert set(spec().build("gnss", 1).sense(at).channel) == {0, 1, 2, 3, 4}
    assert set(spec(mask_deg=40.0).build("gnss", 1).sense(at).channel) == {0, 1, 3, 4}
    weak = spec(lock=43.5).build("gnss", 1).sense(at)
    assert set(weak.channel) == {1, 3, 4}
    assert len(weak.dropped) == 4


def test_two_frequencies_have_no_ionosphere_and_more_noise():
    one, two = (spec(frequencies=k).build("gnss", 1).sense(tap()) for k in (1, 2))
    np.testing.assert_allclose(two.sigma / one.sigma, [[2.588, 1.0]] * 25, rtol=1e-3)
    clear = spec(frequencies=2).ideal().build("gnss", 1)
    with_it = spec(frequencies=1).ideal().build("gnss", 1)
    difference = with_it.sense(tap()).value[:, 0] - clear.sense(tap()).value[:, 0]
    np.testing.assert_allclose(difference, with_it.sight(tap()).ionosphere.ravel(), rtol=0, atol=1e-6)


@pytest.mark.parametrize("grade", GRADES)
def test_the_clock_wanders_as_its_grade(grade):
    at, given = tap(2, still=True, every=100.0), spec(oscillator=grade, clock_bias_m=0.0)
    block = given.blocks()[0]
    values = np.array([given.build("gnss", seed).block("clock", at.time)[1] for seed in range(400)])
    np.testing.assert_allclose(values.std(axis=0), np.sqrt(np.diag(block.covariance(100.0))), rtol=0.1)
    assert not spec(oscillator=grade).ideal().blocks()[0].varies


def test_many_blocks_give_the_same_bits():
    whole, parts = spec().build("gnss", 7).sense(tap(30)), spec().build("gnss", 7)
    full = tap(30)
    pieces = []
    for k in range(0, 30, 7):
        rows = slice(k, k + 7)
        pieces.append(parts.sense(TapStates(
            full.time[rows], full.position[rows], full.velocity[rows], full.attitude[rows], full.angular_rate[rows],
            full.water_velocity[rows],
        )))  # fmt: skip
    np.testing.assert_array_equal(np.concatenate([p.value for p in pieces]), whole.value)
    np.testing.assert_array_equal(np.concatenate([p.side for p in pieces]), whole.side)


def test_satellites_are_chosen_by_the_waters():
    waters = {k: v for k, v in TABLE.items() if k != "satellites"} | {"latitude_deg": 54.0, "longitude_deg": 7.9}
    both = GnssRaw.from_toml(waters).channels()
    assert {name[0] for name in both} == {"G", "E"}
    assert len(both) > 12
    assert set(GnssRaw.from_toml(waters | {"systems": ["beidou"]}).channels()).isdisjoint(both)
    high = GnssRaw.from_toml(waters | {"mask_deg": 30.0, "span_s": 0.0}).channels()
    assert set(high) < set(both)


def test_the_digest_of_a_scenario_depends_on_its_navigation_file(tmp_path):
    path = tmp_path / "nav.rnx"
    digests = []
    for text in (SHIPPED.read_text(), SHIPPED.read_text().replace("2.035847865045e-04", "2.035847865046e-04")):
        path.write_text(text)
        scenario = raw_gnss()
        other = GnssRaw.from_toml(TABLE | {"navigation": str(path)})
        digests.append(scenario.model_copy(update={"instruments": {"gnss": other}}).content_hash())
    assert digests[0] != digests[1]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"satellites": ["G99"]}, r"there is no ephemeris of 'G99' in 2023-03-12-noon\.rnx"),
        ({"satellites": []}, r"latitude_deg and longitude_deg of the waters are missing"),
        ({"epoch": "yesterday"}, r"epoch = 'yesterday' should be a GPS time from 1980 on, like '2023-03-12T12:00:00'"),
        ({"navigation": "absent.rnx"}, r"navigation = 'absent.rnx': cannot be read: No such file"),
        ({"satellites": [], "latitude_deg": 54.0, "longitude_deg": 8.0, "epoch": "2023-03-14T12:00:00"},
         r"2023-03-12-noon.rnx: its ephemerides have reference times from day 0\.5.* should be another, or the file"),
        ({"satellites": [], "latitude_deg": 54.0, "longitude_deg": 8.0, "mask_deg": 89.9},
         r"no satellite rises above mask_deg = 89.9"),
        ({"frequencies": 3}, r"frequencies"),
    ],
)  # fmt: skip
def test_a_wrong_table_gets_a_sentence(change, message):
    with pytest.raises(SpecError, match=message):
        spec(**change)


def test_the_sea_reflects_as_a_mirror_and_waves_weaken_it():
    """Against the closed form for one antenna at rest, and its vanishing under water and in a heavy sea."""
    table = TABLE | {"sea_reflection": 0.4, "sigma_pseudorange_m": 0.0, "sigma_range_rate_m_s": 0.0}
    time, still = np.arange(1.0, 601.0), np.zeros((600, 3))
    place = still + np.array([np.radians(54.0), np.radians(7.9), 12.0])
    tap = TapStates(time, place, still, still, still, still)
    with_sea, without = (GnssRaw.from_toml(table | c).build("gnss", 1) for c in ({}, {"sea_reflection": 0.0}))
    error = (with_sea.observe(tap) - without.observe(tap))[..., 0]
    height = 12.0 - with_sea.lever_arm[2]
    excess = 2.0 * height * np.sin(with_sea.sight(tap).elevation)
    phase = 2.0 * np.pi * excess / (299792458.0 / 1575.42e6) + np.pi
    share = 0.4 * np.cos(phase)
    wanted = np.where(
        np.abs(share * excess / (1.0 + share)) < np.abs(share * 0.05 * 299792458.0 / 1.023e6),
        share * excess / (1.0 + share), share * 0.05 * 299792458.0 / 1.023e6,
    )  # fmt: skip
    np.testing.assert_allclose(error, wanted, atol=1e-6)
    assert np.abs(error).max() > 1.0
    e = np.array([np.radians(5.0), np.radians(40.0)])
    _, calm = sea_reflection(np.array([12.0]), e, 0.4, 0.0)
    _, rough = sea_reflection(np.array([12.0]), e, 0.4, 2.0)
    np.testing.assert_allclose(calm, 0.4)
    np.testing.assert_allclose(rough[0], 0.4 * np.exp(-0.5 * (4.0 * np.pi * 0.5 * np.sin(e[0]) / 0.190293673) ** 2))
    assert rough[1] < 1e-6
    assert np.isinf(sea_reflection(np.array([-1.0]), e, 0.4, 0.0)[0]).all()
