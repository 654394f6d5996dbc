"""Raw observations beside obstacles: what is blocked is lost or late, and comes back at the same place."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.satellites.multipath import multipath_error
from simnav.sensors.gnss_raw import GnssRaw
from simnav.sensors.instrument import InstrumentError
from simnav.types import TapStates
from simnav.world.obstacles import Obstacles
from simnav.world.surroundings import Surroundings

HERE = (np.radians(54.0), np.radians(7.9), 0.0)
#: G28 is in the west at 56 degrees, E27 at 32, G11, G12 and E36 in the east at 34 to 41, E30 in the zenith.
TABLE = {
    "satellites": ["G11", "G12", "G28", "E27", "E30", "E36"], "sigma_pseudorange_m": 0.3,
    "sigma_range_rate_m_s": 0.05, "lever_arm_m": [0.0, 0.0, -10.0],
}  # fmt: skip
EAST, WEST, ZENITH = [0, 1, 5], [2, 3], [4]


def receiver(*walls, **changes):
    """An ideal receiver on a ship that lies at the origin of the map, with its antenna 10 m up."""
    table = {"latitude_deg": 54.0, "longitude_deg": 7.9, "obstacle": list(walls)}
    part = Obstacles.from_toml(table).build("obstacles", 1)
    made = GnssRaw.from_toml(TABLE | changes).ideal()
    return made.install("gnss", 1, Surroundings({"obstacles": part}))


def wall(east: float, top: float, length: float = 300.0) -> dict:
    """A wall from north to south."""
    half = 0.5 * length
    return {"corners_m": [[-half, east], [-half, east + 1.0], [half, east + 1.0], [half, east]], "top_m": top}


def tap(n: int = 2, velocity=(0.0, 0.0, 0.0), attitude=(0.0, 0.0, 0.0)) -> TapStates:
    still = np.zeros((n, 3))
    return TapStates(
        np.arange(n) * 1.0, still + HERE, still + velocity, still + attitude, np.zeros((n, 3)), np.zeros((n, 3))
    )


def readings(of, at: TapStates) -> dict[str, np.ndarray]:
    stream = of.sense(at)
    return {stream.channels[c]: stream.value[i] for i, c in enumerate(stream.channel) if stream.time[i] == 0.0}


def test_a_wall_alongside_takes_its_side_of_the_sky():
    """20 m off and 60 m high: it hides all in the east, and reflects the lower one in the west."""
    free, beside = readings(receiver(), tap()), readings(receiver(wall(20.0, 60.0)), tap())
    assert set(free) == set(TABLE["satellites"])
    assert set(beside) == {TABLE["satellites"][j] for j in WEST + ZENITH}
    here = receiver(wall(20.0, 60.0))
    seen = here.sight(tap())
    late = {j: 2.0 * 20.0 * np.cos(seen.elevation[0, j]) * -np.sin(seen.azimuth[0, j]) for j in WEST}
    for j in WEST:
        name = TABLE["satellites"][j]
        error = multipath_error(np.array([late[j]]), 0.5, 0.1)[0]
        assert abs(error) > 0.01
        # The flat map and the curved Earth differ by micrometres over 20 m, and the phase by no more.
        assert beside[name][0] - free[name][0] == pytest.approx(error, abs=0.02)


def test_a_signal_that_comes_only_by_a_reflection_is_late_by_its_detour():
    """A wall in the east hides G12; one in the west reflects it."""
    both = receiver(wall(20.0, 28.0), wall(-51.0, 300.0))
    free, found = readings(receiver(), tap()), readings(both, tap())
    seen = both.sight(tap())
    hidden = [j for j in EAST if np.tan(seen.elevation[0, j]) * 20.0 / np.sin(seen.azimuth[0, j]) < 18.0]
    assert hidden
    for j in hidden:
        name = TABLE["satellites"][j]
        # The reflected ray comes over the wall in the east: it has risen 100 m on its way.
        late = 2.0 * 50.0 * np.cos(seen.elevation[0, j]) * np.sin(seen.azimuth[0, j])
        assert found[name][0] - free[name][0] == pytest.approx(late, abs=1e-3)
        assert both.ratio(tap())[0, j] == pytest.approx(receiver().ratio(tap())[0, j] - 6.02, abs=0.01)


def test_the_rate_of_a_late_signal_follows_the_vessel():
    of, at = receiver(wall(20.0, 28.0), wall(-51.0, 300.0)), tap(velocity=(0.0, 1.5, 0.0))
    free, found, seen = readings(receiver(), at), readings(of, at), of.sight(at)
    late = [j for j in EAST if found[TABLE["satellites"][j]][0] - free[TABLE["satellites"][j]][0] > 20.0]
    assert late
    for j in late:
        name, rate = TABLE["satellites"][j], 2.0 * 1.5 * np.cos(seen.elevation[0, j]) * np.sin(seen.azimuth[0, j])
        assert found[name][1] - free[name][1] == pytest.approx(rate, abs=1e-4)


def test_shadows_of_the_vessel_turn_with_it():
    """A funnel on the starboard side, up to 45 degrees: with the bow to the north it hides the east."""
    of = receiver(shadows_deg=[[45.0, 135.0, 45.0]])
    east = {TABLE["satellites"][j] for j in EAST}
    assert set(readings(of, tap())) == set(TABLE["satellites"]) - east
    south = readings(of, tap(attitude=(0.0, 0.0, np.pi)))
    assert set(TABLE["satellites"]) - set(south) == {"E27"}
    heeled = readings(of, tap(attitude=(np.radians(40.0), 0.0, 0.0)))  # starboard down: the east is over the funnel
    assert east <= set(heeled)


def test_the_antenna_within_an_obstacle():
    with pytest.raises(InstrumentError, match=r"'gnss'.*the antenna is within the obstacle 'number 1'"):
        receiver(wall(-0.5, 60.0)).sense(tap())


def test_an_obstacle_over_all_of_the_sky():
    """There is no reading, and no error."""
    corners = [[-900.0, -900.0], [-900.0, 900.0], [900.0, 900.0], [900.0, -900.0]]
    roof = {"corners_m": corners, "bottom_m": 12.0, "top_m": 13.0}
    stream = receiver(roof).sense(tap())
    assert len(stream) == 0
    assert len(stream.dropped) == 12


def test_errors_by_reflections_are_labelled():
    """Each with its size; what is left of a reading of an ideal receiver is that of one without the wall."""
    beside, at = receiver(wall(20.0, 60.0)), tap()
    assert beside.own_label(60.0).kind == "reflection"
    assert receiver().own_label(60.0) is None or not receiver().sense(at).faults.any()
    beside.bit = 3
    stream, free = beside.sense(at), receiver().sense(at)
    assert set(stream.faults) == {0, 1 << 3}
    assert {TABLE["satellites"][c] for c in stream.channel[stream.faults != 0]} == {"G28", "E27"}
    same = free.places(stream.time, stream.channel)
    np.testing.assert_allclose(stream.value - stream.fault_error, free.value[same], rtol=0, atol=2e-3)
    assert (abs(stream.fault_error[stream.faults != 0, 0]) > 0.1).all()
