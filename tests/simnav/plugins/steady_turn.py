"""A ship that keeps its speed and its turn rate: a model of six states, in plain NumPy."""

from __future__ import annotations

import numpy as np

from simnav.estimators.models.general import GeneralModel
from simnav.geometry.earth import displace
from simnav.geometry.rotation import wrap_angle
from simnav.kinds import NavigationPoint
from simnav.types import Estimate

NORTH, EAST, HEADING, SPEED, TURN, ACCELERATION = range(6)
#: Noise density of turn rate [rad/s/sqrt(s)] and acceleration [m/s2/sqrt(s)], correlation time of both [s].
TURN_NOISE, ACCELERATION_NOISE, MEMORY = 0.01, 0.03, 10.0
#: Sigma of what the model takes for zero: sideways and vertical velocity [m/s], roll and pitch [rad].
ASIDE, HEEL = 0.3, 0.03


class SteadyTurn(GeneralModel):
    """North, east [m] from the start, heading [rad], speed [m/s], turn rate [rad/s], acceleration [m/s2]."""

    equations = ("position", "horizontal_position", "velocity", "heading", "water_speed")

    def initial(self, start, instruments):
        self.origin, P = start.position, start.covariance
        heading = start.attitude[2]
        along = np.array([np.cos(heading), np.sin(heading)])
        speed = along @ start.velocity[:2]
        variances = [P[0, 0], P[1, 1], P[8, 8], along @ P[3:5, 3:5] @ along, 0.01**2, 0.05**2]
        return np.array([0.0, 0.0, heading, speed, 0.0, 0.0]), np.diag(variances)

    def move(self, x, elapsed):
        north, east, heading, speed, turn, acceleration = x
        keep = np.exp(-elapsed / MEMORY)
        mean = speed + 0.5 * acceleration * elapsed
        middle = heading + 0.5 * turn * elapsed
        return np.array([
            north + mean * elapsed * np.cos(middle), east + mean * elapsed * np.sin(middle),
            heading + turn * elapsed, speed + acceleration * elapsed, turn * keep, acceleration * keep,
        ])  # fmt: skip

    def noise(self, x, elapsed):
        t, c, s = elapsed, np.cos(x[HEADING]), np.sin(x[HEADING])
        G = np.zeros((6, 2))  # of half the time's acceleration and turn rate
        G[[NORTH, EAST, SPEED, ACCELERATION], 1] = 0.5 * t * t * c, 0.5 * t * t * s, t, 1.0
        G[[HEADING, TURN], 0] = t, 1.0
        Q = G @ np.diag([TURN_NOISE**2 * t, ACCELERATION_NOISE**2 * t]) @ G.T
        Q[[NORTH, EAST], [NORTH, EAST]] += (0.1 * ASIDE) ** 2 * t
        return Q + np.diag([1e-6, 1e-6, 1e-9, 1e-6, 1e-9, 1e-8]) * t

    def difference(self, x, reference):
        error = x - reference
        error[HEADING] = wrap_angle(error[HEADING])
        return error

    def navigation(self, x, time):
        c, s = np.cos(x[HEADING]), np.sin(x[HEADING])
        dcm = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        position = displace(self.origin, np.array([x[NORTH], x[EAST], 0.0]))
        return NavigationPoint(time, position, dcm[:, 0] * x[SPEED], dcm, np.array([0.0, 0.0, x[TURN]]))

    def describe(self, x, time, covariance):
        point = self.navigation(x, time)
        G = np.zeros((9, 6))
        G[0, NORTH] = G[1, EAST] = G[8, HEADING] = 1.0
        G[3:5, SPEED], G[3:5, HEADING] = point.dcm[:2, 0], x[SPEED] * point.dcm[:2, 1]
        P = G @ covariance @ G.T + np.diag([0, 0, 1.0, ASIDE**2, ASIDE**2, ASIDE**2, HEEL**2, HEEL**2, 0])
        attitude = np.array([0.0, 0.0, wrap_angle(x[HEADING])])
        estimated = np.array([1, 1, 0, 1, 1, 0, 0, 0, 1], bool)
        return Estimate(time, point.position, point.velocity, attitude, P, estimated)
