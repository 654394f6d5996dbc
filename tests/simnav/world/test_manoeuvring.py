"""Vessels with three degrees of freedom, against published figures, other programs and independent integration.

The reference figures of the Otter and of Remus 100 are those of PythonVehicleSimulator of T. I. Fossen (MIT licence,
github.com/cybergalactic/PythonVehicleSimulator, commit c717e07), at steps of 5 ms after a minute on a straight course;
those of the Mariner class are of the same author's Marine Systems Simulator (`mariner.m`, 15 knots).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from simnav.geometry.earth import relative_position
from simnav.scenario import load, parse
from simnav.simulation.simulator import Simulator, simulate
from simnav.simulation.steps import SteppedRuns
from simnav.spec import SpecError
from simnav.strapdown import integrate
from simnav.world import (
    AirFlow,
    Auv,
    Current,
    Ferry,
    Hold,
    Hull,
    ManoeuvringVessel,
    Start,
    Superstructure,
    SurfaceDrone,
    SurveyShip,
    Turn,
    Wind,
    Workboat,
    World,
)
from simnav.world.manoeuvring import dynamics
from simnav.world.manoeuvring.hull import coriolis, spheroid
from simnav.world.manoeuvring.sea_trials import turning_circle, zigzag
from simnav.world.wind import gust_spectrum
from tests.cases.steered import ends_of

VESSELS = {v.kind: v for v in (SurveyShip(), Ferry(), Workboat(), SurfaceDrone(), Auv())}
#: A speed of each, and a yaw rate that it can keep [rad/s].
CRUISE = {"survey_ship": (5.0, 0.004), "ferry": (1.5, 0.05), "workboat": (5.0, 0.08), "surface_drone": (1.5, 0.15),
          "auv": (1.8, 0.08)}  # fmt: skip
REFERENCE = {
    # speed, steering, duration: advance, transfer, tactical diameter, speed, yaw rate, diameter
    "surface_drone": ((1.643, 0.3, 100.0), (10.497, 8.085, 17.410, 1.602, 0.1852, 17.303)),
    "auv": ((2.009, 0.2, 120.0), (25.079, 21.213, 46.938, 1.986, 0.0844, 47.051)),
}
#: Overshoots of a 10 degree zigzag [deg], and times of reversal [s].
ZIGZAG = {
    "surface_drone": ([3.113, 3.717, 3.682, 3.700], [1.545, 5.265, 9.185, 13.105]),
    "auv": ([1.059, 0.871, 0.854, 0.863], [1.830, 5.645, 9.385, 13.125]),
}


@pytest.mark.parametrize("kind", REFERENCE)
def test_turning_circle_is_that_of_python_vehicle_simulator(kind: str):
    (speed, steering, duration), expected = REFERENCE[kind]
    c = turning_circle(VESSELS[kind].hull, speed, steering, duration=duration)
    found = c.advance, c.transfer, c.tactical_diameter, c.speed, c.turn_rate, c.diameter
    np.testing.assert_allclose(found, expected, rtol=0.05)
    left = turning_circle(VESSELS[kind].hull, speed, -steering, duration=duration)
    assert left.tactical_diameter == pytest.approx(c.tactical_diameter, rel=1e-9)
    assert left.drift == pytest.approx(c.drift, rel=1e-9)


@pytest.mark.parametrize("kind", ZIGZAG)
def test_zigzag_is_that_of_python_vehicle_simulator(kind: str):
    speed, steering = REFERENCE[kind][0][:2]
    z = zigzag(VESSELS[kind].hull, speed, np.radians(10.0), steering, duration=20.0, dt=0.005)
    overshoots, reversals = ZIGZAG[kind]
    n = len(z.overshoots)
    np.testing.assert_allclose(np.degrees(z.overshoots), overshoots[:n], rtol=0.1)
    np.testing.assert_allclose(z.reversals[:4], reversals, rtol=0.05)


def test_turning_circle_of_the_mariner_class():
    """At 15 knots with 15 degrees of rudder. The polynomial there is about that speed, ours goes with the speed."""
    angle = np.radians(15.0)
    c = turning_circle(VESSELS["survey_ship"].hull, 7.7175, angle - 90.0 / 278.0 * angle**3, duration=1500.0, dt=0.1)
    np.testing.assert_allclose((c.advance, c.transfer, c.tactical_diameter), (753.6, 553.1, 1273.5), rtol=0.1)
    assert c.speed == pytest.approx(6.55, rel=0.05)
    # A ship turns alike at all speeds that are low for its length.
    slow = turning_circle(VESSELS["survey_ship"].hull, 4.0, angle - 90.0 / 278.0 * angle**3, duration=2900.0, dt=0.2)
    assert slow.diameter == pytest.approx(c.diameter, rel=0.01)


def equations(kind: str):
    """The published equations of two vessels, as matrices of the velocities, and their forces at full steering."""
    if kind == "ferry":
        m = np.array([[2389.657, 0, 0], [0, 2533.911, 62.386], [0, 28.141, 5068.910]])

        def damping(u, v, r):
            return np.array(
                [
                    [27.632 + 110.064 * abs(u) + 13.965 * u * u, 0, 0],
                    [0, 52.947 + 116.486 * abs(v) + 1540.383 * abs(r) + 24.313 * v * v,
                     -24.732 - 572.141 * abs(v) + 115.457 * abs(r)],
                    [0, -3.524 + 0.832 * abs(v) - 336.827 * abs(r),
                     122.860 + 121.957 * abs(v) + 874.428 * abs(r)],
                ]
            )  # fmt: skip

        return m, damping, lambda n, s: np.array([1000.0 * n * n, 0.0, 900.0 * s])
    m = np.diag([3980.0, 3980.0, 19703.0])

    def boat(u, v, r):
        return np.diag([50.0 + 135.0 * abs(u), 200.0 + 2000.0 * abs(v), 1281.0 + 3224.0 * r * r])

    return m, boat, lambda n, s: np.array([13100.0 * n * n, -645.0 * s, 2580.0 * s])


@pytest.mark.parametrize("kind", ["ferry", "workboat"])
def test_equations_are_the_published_ones(kind: str):
    """The compiled equations against the matrices of the sources, integrated by another library."""
    m, damping, force = equations(kind)
    hull, n, s = VESSELS[kind].hull, 0.5, 0.4

    def change(t, nu):
        u, v, r = nu
        a, b = m[0, 0] * u, m[1, 1] * v + m[1, 2] * r
        c = np.array([[0, 0, -b], [0, 0, a], [b, -a, 0]])
        return np.linalg.solve(m, force(n, s) - c @ nu - damping(u, v, r) @ nu)

    exact = solve_ivp(change, (0.0, 20.0), [1.0, 0.3, 0.0], rtol=1e-10, atol=1e-12).y[:, -1]
    states = np.empty((401, 6))
    states[0] = 1.0, 0.3, 0.0, 0.0, n, s
    dynamics.trial(hull.vector, states, np.tile([n, s], (400, 1)), 0.05, np.zeros(2))
    np.testing.assert_allclose(states[-1, :3], exact, rtol=1e-6)


def test_added_mass_of_spheroids_is_that_of_the_tables():
    """H. Lamb, Hydrodynamics, 6th edition, table of article 115."""
    for ratio, along, across, turning in ((2.0, 0.209, 0.702, 0.240), (4.99, 0.059, 0.895, 0.701),
                                          (9.97, 0.021, 0.960, 0.883)):  # fmt: skip
        body, added = spheroid(ratio, 1.0, 1000.0)
        np.testing.assert_allclose(added / body, (along, across, turning), atol=3e-3)
        assert body[0] == pytest.approx(1000.0 * np.pi / 6.0 * ratio)


@pytest.mark.parametrize("kind", VESSELS)
def test_the_propeller_gives_the_thrust_that_is_asked_for(kind: str):
    h, u = VESSELS[kind].hull.vector.view(dynamics.HULL)[0], 0.5 * VESSELS[kind].hull.top_speed
    for n in (1.0, 0.7, -0.3):
        thrust = h.thrust * n * abs(n) + h.thrust_loss * abs(n) * u
        assert dynamics.propeller_for.function(h, thrust, u) == pytest.approx(n)
    assert dynamics.propeller_for.function(h, 1e9, u) == 1.0
    assert dynamics.propeller_for.function(h, -1e9, u) == h.astern


def test_coriolis_forces_do_no_work():
    m = np.array([[3.0, 0, 0], [0, 4.0, 0.5], [0, 0.7, 2.0]])
    u, v, r = 1.3, -0.4, 0.2
    products = {"vr": v * r, "rr": r * r, "ur": u * r, "uv": u * v}
    x, y, n = (sum(k * products[t] for t, k in terms.items()) for terms in coriolis(m).values())
    assert x * u + y * v + n * r == pytest.approx(0.0, abs=1e-12)


def test_cross_flow_drag_is_the_integral_of_the_strips():
    hull = Hull(
        np.diag([1.0, 1.0, 1.0]), {}, {}, {}, length=3.0, thrust=1.0, most_steering=1.0, moment=1.0, cross_flow=2.0
    )
    for v, r in ((0.5, 0.1), (0.1, 0.4), (0.0, -0.3)):
        y = -2.0 * quad(lambda x, v=v, r=r: (v + x * r) * abs(v + x * r), -1.5, 1.5, points=[-v / r])[0]
        n = -2.0 * quad(lambda x, v=v, r=r: x * (v + x * r) * abs(v + x * r), -1.5, 1.5, points=[-v / r])[0]
        states = np.array([[0.0, v, r, 0.0, 0.0, 0.0], np.zeros(6)])
        dynamics.trial(hull.vector, states, np.zeros((1, 2)), 1e-6, np.zeros(2))
        np.testing.assert_allclose((states[1, 1:3] - states[0, 1:3]) / 1e-6, (y, n), rtol=0.02, atol=1e-3)


def wind_force(speed: float, direction: float) -> np.ndarray:
    """Surge, sway and yaw acceleration of a hull of unit mass at rest, heading north."""
    tower = Superstructure(4.0, 10.0, 8.0, across=0.9, bow=0.5, stern=0.6, cross_force=0.4, centre=0.05)
    hull = Hull(np.eye(3), {}, {}, {}, length=8.0, thrust=1.0, most_steering=1.0, moment=1.0, superstructure=tower)
    h = hull.vector
    h.view(dynamics.HULL)["wind"] = AirFlow(Wind(speed=speed, direction=direction, gustiness=0.0), 1).mean
    states = np.zeros((2, 6))
    dynamics.trial(h, states, np.zeros((1, 2)), 1e-9, np.zeros(2))
    return states[1, :3] / 1e-9


def test_wind_forces_are_those_of_blendermann():
    """Ahead, astern and abeam the formulas are drag = density / 2 C A V^2; on the bow they are worked out by hand."""
    push = 0.5 * 1.225 * 100.0
    np.testing.assert_allclose(wind_force(10.0, 0.0)[:2], (-push * 0.5 * 4.0, 0.0), atol=1e-3)
    np.testing.assert_allclose(wind_force(10.0, np.pi)[:2], (push * 0.6 * 4.0, 0.0), atol=1e-3)
    side = -push * 0.9 * 10.0
    np.testing.assert_allclose(wind_force(10.0, np.pi / 2.0), (0.0, side, side * 0.05 * 8.0), atol=1e-3)
    np.testing.assert_allclose(wind_force(10.0, -np.pi / 2.0), (0.0, -side, -side * 0.05 * 8.0), atol=1e-3)
    angle = np.radians(30.0)
    below = 1.0 - 0.5 * 0.4 * (1.0 - 0.5 * 4.0 / 10.0 / 0.9) * np.sin(2.0 * angle) ** 2
    x, y = -push * 4.0 * 0.5 * np.cos(angle) / below, -push * 10.0 * 0.9 * np.sin(angle) / below
    np.testing.assert_allclose(
        wind_force(10.0, angle), (x, y, y * (0.05 - 0.18 * (angle - np.pi / 2)) * 8.0), rtol=1e-5
    )


def test_gusts_have_the_variance_of_their_spectrum():
    air = AirFlow(Wind(speed=12.0, direction=1.0), 3)
    frequency = np.geomspace(1 / 2400, 0.1, 4000)
    variance = np.trapezoid(gust_spectrum(12.0, frequency), frequency)
    assert 0.5 * np.sum((12.0 * air.gusts[:, 2]) ** 2) == pytest.approx(variance, rel=1e-3)
    at = air.velocity(np.zeros((20000, 3)), np.arange(20000.0))
    assert np.std(np.linalg.norm(at, axis=1)) == pytest.approx(np.sqrt(variance), rel=0.1)
    towards = np.degrees(np.arctan2(at[:, 1], at[:, 0])) % 360.0
    np.testing.assert_allclose(towards, np.degrees(1.0) + 180.0)


def world(kind: str, manoeuvres=(), **more) -> World:
    vessel, speed = VESSELS[kind], CRUISE[kind][0]
    where = {"depth": 10.0} if vessel.dives else {}
    start = Start(latitude=0.9, longitude=0.1, heading=0.5, speed=speed, **where)
    return World(start, vessel, manoeuvres, rate=20.0, seed=1, **more)


@pytest.mark.parametrize("kind", VESSELS)
def test_the_autopilot_keeps_course_and_turns_and_ideal_samples_integrate_back(kind: str):
    speed, rate = CRUISE[kind]
    turn = 1.0
    w = world(kind, [Hold(duration=20.0), Turn(angle=turn, rate=rate)], current=Current(speed=0.3, direction=2.0))
    begin = w.state()
    seconds = round(40.0 + 2.5 * turn / rate + 8.0 * VESSELS[kind].turn_time_constant)
    block = w.advance(float(seconds), {"here": np.arange(1.0, seconds + 1.0)})
    tap, end = block.taps["here"], w.state()
    assert np.abs(tap.attitude[:19, 2] - 0.5).max() < 1e-6
    assert end.attitude[0, 2] == pytest.approx(0.5 + turn, abs=np.radians(1.0))
    through = tap.velocity[:, :2] - tap.water_velocity[:, :2]
    psi = tap.attitude[:, 2]
    sway = through[:, 1] * np.cos(psi) - through[:, 0] * np.sin(psi)
    ahead = through[:, 0] * np.cos(psi) + through[:, 1] * np.sin(psi)
    assert np.abs(sway[:19]).max() < 1e-9
    # In a turn to starboard a hull moves to port, and it slows down.
    assert np.degrees(np.arctan2(sway, ahead)).min() < -2.0
    assert ahead[25:].min() < speed - 1e-3
    back = integrate(begin.position[0], begin.velocity[0], begin.attitude[0], block.imu)
    assert np.abs(relative_position(back.position[-1:], end.position[0])).max() < 1e-5


def test_a_current_carries_the_vessel_and_changes_nothing_else():
    still, carried = (
        world("workboat", [Turn(angle=2.0)]),
        world("workboat", [Turn(angle=2.0)], current=Current(speed=0.6)),
    )
    taps = [w.advance(40.0, {"here": np.arange(1.0, 41.0)}).taps["here"] for w in (still, carried)]
    np.testing.assert_allclose(taps[1].velocity - taps[0].velocity, np.tile([0.6, 0.0, 0.0], (40, 1)), atol=1e-6)


def test_wind_from_the_side_makes_leeway_that_a_log_along_the_bow_does_not_see():
    air = AirFlow(Wind(speed=10.0, direction=0.5 + np.pi / 2.0, gustiness=0.0), 1)
    w = world("workboat", air=air)
    tap = w.advance(120.0, {"here": np.arange(1.0, 121.0)}).taps["here"]
    psi = tap.attitude[:, 2]
    sway = tap.velocity[:, 1] * np.cos(psi) - tap.velocity[:, 0] * np.sin(psi)
    assert -1.0 < sway[-1] < -0.1  # the wind comes from starboard
    assert abs(psi[-1] - 0.5) < 1e-3  # and the autopilot holds the heading
    # Leeway in equilibrium: the drag of the hull against the wind and the rudder, which takes up the wind's moment.
    ahead, aside = 5.0, 10.0 + sway[-1]
    angle = np.arctan2(aside, ahead)
    below = 1.0 - 0.5 * 0.6 * (1.0 - 0.55 * 9.5 / 13.3 / 0.9) * np.sin(2.0 * angle) ** 2
    wind = 0.5 * 1.225 * (ahead**2 + aside**2) * 0.9 * 13.3 * np.sin(angle) / below
    rudder = wind * -0.18 * (angle - np.pi / 2.0) * 8.45 / 4.0
    drag = 200.0 * abs(sway[-1]) + 2000.0 * sway[-1] ** 2
    assert drag == pytest.approx(wind + rudder, rel=0.03)


HEAD = (
    'name = "a"\nversion = 1\ntitle = "a"\nduration_s = 40.0\n[start]\nlatitude_deg = 51.0\nlongitude_deg = 1.0\n'
    "speed_m_s = 1.4\n[instruments.imu]\nrate_hz = 20.0\n[instruments.gyrocompass]\nrate_hz = 2.0\nsigma_deg = 0.1\n"
    '[[manoeuvre]]\nkind = "turn"\nangle_deg = 60.0\n[sea]\nsignificant_height_m = 0.3\npeak_period_s = 4.0\n'
    '[surroundings.wind]\nspeed_m_s = 5.0\ndirection_deg = 300.0\n[vessel]\nkind = "ferry"\n'
)


def test_blocks_steps_and_closed_loop_give_the_same_numbers():
    scenario = parse(HEAD)
    whole = simulate(scenario, 5).data.aids["gyrocompass"].value
    simulator = Simulator(scenario, 5)
    parts = [simulator.advance(t).aids["gyrocompass"].value for t in (3.0, 4.0, 40.0)]
    np.testing.assert_array_equal(np.concatenate(parts), whole)
    runs = SteppedRuns(1)
    runs.begin(0, Simulator(scenario, 5))
    stepped = []
    for _ in range(40):
        runs.advance(np.ones(1, np.bool_))
        stepped += [m.value for m in runs.packet(0).aids]
    np.testing.assert_array_equal(np.stack(stepped), whole)


def test_closed_loop_and_guidance_steer_it():
    from simnav.estimators.learning.guidance import GuidanceEnv, LineOfSight

    scenario = parse(HEAD)
    ends = ends_of(scenario, (0.0, 40.0))
    assert np.hypot(*relative_position(ends[1][None], ends[0])[0, :2]) > 1.0
    guided = GuidanceEnv(scenario, reveal_truth=True)
    seen, _ = guided.reset(seed=1)
    pilot, over = LineOfSight(), False
    while not over:
        seen, _, _, over, info = guided.step(pilot(seen))
    assert np.isfinite(info["aside"])
    assert abs(info["aside"]) < 15.0


def test_the_hull_of_a_third_party_turns(plugins, tmp_path):
    """The barge of the guide."""
    plugin = f'plugins = ["{plugins}/barge.py"]\nduration_s'
    head = HEAD.replace('kind = "ferry"', 'kind = "barge"').replace("duration_s", plugin)
    (tmp_path / "barge.toml").write_text(head)
    scenario = load(tmp_path / "barge.toml")
    circle = turning_circle(scenario.craft.hull, 2.0, 0.3, duration=600.0)
    assert 20.0 < circle.tactical_diameter < 200.0
    assert np.isfinite(simulate(scenario, 1).data.truth.position).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("speed_m_s = 1.4", "speed_m_s = 9.0"), "start.speed_m_s = 9: a vessel of kind 'ferry' reaches 2.53 m/s"),
        (("speed_m_s = 1.4", "speed_m_s = 1.4\ndepth_m = 4.0"), "start.depth_m = 4: a vessel of kind 'ferry' floats"),
        (('kind = "turn"\nangle_deg = 60.0', 'kind = "dive"\ndepth_m = 5.0'), "a vessel of kind 'ferry' floats"),
        (("speed_m_s = 5.0", "speed_m_s = 500.0"), "surroundings.wind.speed_m_s"),
    ],
)
def test_what_a_vessel_cannot_do_is_refused(change: tuple[str, str], message: str):
    with pytest.raises(SpecError, match=message):
        parse(HEAD.replace(*change))


def test_a_hull_with_an_unknown_term_or_no_rudder_is_refused():
    good: dict[str, Any] = {
        "mass": np.eye(3),
        "surge": {},
        "sway": {},
        "yaw": {},
        "length": 2.0,
        "thrust": 1.0,
        "most_steering": 1.0,
    }
    with pytest.raises(ValueError, match="there is no term 'uw'"):
        Hull(**{**good, "sway": {"uw": 1.0}}, moment=1.0)
    with pytest.raises(ValueError, match="could not be steered"):
        Hull(**good)
    with pytest.raises(NotImplementedError, match="ManoeuvringVessel has no hull"):
        assert ManoeuvringVessel(kind="x").hull
