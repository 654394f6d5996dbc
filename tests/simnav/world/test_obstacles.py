"""Obstacles: blocked and reflected ways against closed forms for one wall, a bridge and a corner."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.geometry.earth import displace
from simnav.spec import SpecError
from simnav.world.obstacles import Obstacle, Obstacles

LATITUDE, LONGITUDE = 53.54, 9.98
ORIGIN = np.array([np.radians(LATITUDE), np.radians(LONGITUDE), 0.0])
#: A wall of 1 m thickness, 200 m long, 20 m high, 40 m to the north.
QUAY = {"name": "quay", "corners_m": [[40.0, -100.0], [40.0, 100.0], [41.0, 100.0], [41.0, -100.0]], "top_m": 20.0}
DECK = {"name": "bridge", "corners_m": [[-10.0, -50.0], [-10.0, 50.0], [10.0, 50.0], [10.0, -50.0]],
        "bottom_m": 30.0, "top_m": 32.0}  # fmt: skip


def scene(*obstacles, **changes):
    table = {"latitude_deg": LATITUDE, "longitude_deg": LONGITUDE, "obstacle": list(obstacles)} | changes
    return Obstacles.from_toml(table).build("obstacles", 1)


def paths(of, place, elevation_deg, azimuth_deg, velocity=(0.0, 0.0, 0.0)):
    """Of one antenna at north, east, height, with directions in degrees."""
    north, east, height = place
    position = displace(ORIGIN, np.array([[north, east, -height]]))
    directions = (np.radians(np.atleast_2d(np.asarray(a, dtype=float))) for a in (elevation_deg, azimuth_deg))
    found = of.paths(position, np.array([velocity]), *directions)
    return found.blocked[0], found.excess[0], found.excess_rate[0]


def test_a_wall_hides_what_is_lower_than_its_edge():
    edge = np.degrees(np.arctan2(20.0 - 5.0, 40.0))
    blocked, _, _ = paths(scene(QUAY), (0.0, 0.0, 5.0), [edge - 0.1, edge + 0.1, 10.0, 10.0], [0.0, 0.0, 180.0, 60.0])
    assert blocked.tolist() == [True, False, False, True]
    side = np.degrees(np.arctan2(100.0, 40.0))
    blocked, _, _ = paths(scene(QUAY), (0.0, 0.0, 5.0), [5.0, 5.0], [side - 0.5, side + 0.5])
    assert blocked.tolist() == [True, False]


def test_the_excess_path_of_one_wall():
    """2 d cos(elevation) cos(azimuth from the normal), as long as the mirror point is on the wall."""
    elevation, azimuth = np.array([10.0, 15.0, 19.0, 25.0, 15.0]), np.array([180.0, 200.0, 160.0, 180.0, 0.0])
    _, excess, _ = paths(scene(QUAY), (0.0, 0.0, 5.0), elevation, azimuth)
    wanted = 2.0 * 40.0 * np.cos(np.radians(elevation)) * np.cos(np.radians(azimuth - 180.0))
    # The ray meets the wall 40 / (cos(e) cos(a)) further, by tan(e) higher: at 25 degrees above its edge.
    assert np.isinf(excess[3:]).all()
    np.testing.assert_allclose(excess[:3], wanted[:3], rtol=1e-9)


def test_the_mirror_as_a_mirror():
    """The way over the wall to a far satellite minus the direct way, by points."""
    satellite = 2e7 * np.array([-0.9, 0.3, 0.25])
    antenna = np.array([3.0, -20.0, 4.0])
    elevation = np.degrees(np.arcsin(satellite[2] / np.linalg.norm(satellite)))
    azimuth = np.degrees(np.arctan2(satellite[1], satellite[0]))
    _, excess, _ = paths(scene(QUAY), antenna, [elevation], [azimuth])
    image = np.array([80.0 - antenna[0], antenna[1], antenna[2]])
    wanted = np.linalg.norm(satellite - image) - np.linalg.norm(satellite - antenna)
    assert excess[0] == pytest.approx(wanted, abs=1e-3)


def test_the_rate_of_the_excess_is_its_derivative():
    of, velocity, h = scene(QUAY), np.array([1.5, 2.0, 0.0]), 0.01
    ends = [paths(of, velocity * sign * h + [0.0, 0.0, 5.0], [15.0], [200.0])[1][0] for sign in (1.0, -1.0)]
    _, _, rate = paths(of, (0.0, 0.0, 5.0), [15.0], [200.0], velocity)
    assert rate[0] == pytest.approx((ends[0] - ends[1]) / (2.0 * h), abs=1e-5)


def test_under_a_bridge():
    """Hidden is what is above its deck: 10 m to the north and south of it, 25 m higher than the antenna."""
    edge = np.degrees(np.arctan2(25.0, 10.0))
    blocked, _, _ = paths(
        scene(DECK), (0.0, 0.0, 5.0), [89.0, edge + 1.0, edge - 5.0, edge - 5.0], [0.0, 0.0, 0.0, 180.0]
    )
    assert blocked.tolist() == [True, True, False, False]
    blocked, _, _ = paths(scene(DECK), (0.0, 0.0, 40.0), [89.0, 10.0], [0.0, 0.0])
    assert not blocked.any()


def test_a_reflection_that_is_itself_hidden():
    shed = {"name": "shed", "corners_m": [[20.0, -5.0], [20.0, 5.0], [25.0, 5.0], [25.0, -5.0]], "top_m": 20.0}
    _, excess, _ = paths(scene(QUAY, shed), (0.0, 0.0, 5.0), [10.0], [180.0])
    near = 2.0 * 20.0 * np.cos(np.radians(10.0))
    assert excess[0] == pytest.approx(near, rel=1e-9)  # by the shed, which hides the quay behind it
    behind = {
        "name": "ship",
        "corners_m": [[-60.0, -50.0], [-60.0, 50.0], [-50.0, 50.0], [-50.0, -50.0]],
        "top_m": 40.0,
    }
    blocked, excess, _ = paths(scene(QUAY, behind), (0.0, 0.0, 5.0), [20.0], [180.0])
    assert blocked[0]
    assert np.isinf(excess[0]) or excess[0] > 0.0


def test_the_order_of_the_corners_does_not_matter():
    turned = QUAY | {"corners_m": QUAY["corners_m"][::-1]}
    for one, other in zip(
        *(paths(scene(q), (0.0, 0.0, 5.0), [10.0, 5.0], [190.0, 20.0]) for q in (QUAY, turned)), strict=True
    ):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize(
    ("obstacle", "message"),
    [
        (QUAY | {"top_m": -1.0}, r"obstacle 'quay': top_m = -1 should be above bottom_m = 0"),
        (QUAY | {"corners_m": [[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]}, r"its corners_m lie on a line"),
    ],
)
def test_an_obstacle_that_is_none(obstacle, message):
    with pytest.raises(SpecError, match=message):
        scene(obstacle)


def test_an_antenna_within_an_obstacle():
    with pytest.raises(SpecError, match=r"the antenna is within the obstacle 'quay', 40\.5 m north and 0\.0 m east"):
        paths(scene(QUAY), (40.5, 0.0, 5.0), [10.0], [0.0])


def test_a_rectangle_is_a_polygon():
    """Centre, length, width and heading, turned by 30 degrees."""
    box = Obstacle.from_toml({"centre_m": [10.0, 20.0], "size_m": [8.0, 4.0], "heading_deg": 30.0, "top_m": 5.0})
    c, s = np.cos(np.pi / 6.0), np.sin(np.pi / 6.0)
    ahead, right = np.array([c, s]), np.array([-s, c])
    signs = ((1, 1), (-1, 1), (-1, -1), (1, -1))
    wanted = [4.0 * a * ahead + 2.0 * b * right for a, b in signs]
    np.testing.assert_allclose(box.outline() - [10.0, 20.0], wanted)


@pytest.mark.parametrize("given", [{"centre_m": [0.0, 0.0]}, {"size_m": [1.0, 1.0]}, {}])
def test_an_obstacle_has_one_form(given):
    with pytest.raises(SpecError, match="it has either corners_m, or centre_m and size_m"):
        scene({"name": "shed", "top_m": 5.0} | given)
