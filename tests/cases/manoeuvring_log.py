"""A log with rich motion and a known truth: every stream can be told from the others, and altered in a scenario."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from simnav.geometry.earth import displace
from simnav.geometry.rotation import dcm_from_rpy, quaternion_from_dcm
from simnav.inverse_strapdown import increments
from tests.cases.tiny_log import write_csv

RATE = 50.0
#: Field of the Earth, north-east-down [nT].
FIELD = np.array([18000.0, 700.0, 46000.0])

SCENARIO = """
name = "manoeuvring-log"
version = 1
title = "a log with rich motion"
duration_s = 110.0

[initial_error]
position_m = [3.0, 3.0, 3.0]
velocity_m_s = [0.1, 0.1, 0.1]
attitude_deg = [0.1, 0.1, 1.0]

[log]
folder = "manoeuvring"

[log.files.imu]
path = "imu.csv"
time = "t"

[log.files.truth]
path = "truth.csv"
time = "t"

[log.files.aids]
path = "aids.csv"
time = "t"

[log.imu]
file = "imu"
angular_rate = ["gx", "gy", "gz"]
specific_force = ["ax", "ay", "az"]

[log.instruments.gnss]
file = "aids"
columns = ["lat", "lon", "h"]
units = ["deg", "deg", "m"]

[log.instruments.dvl]
file = "aids"
columns = ["vx", "vy", "vz"]
units = "m_s"

[log.instruments.compass]
file = "aids"
columns = ["hdg"]
units = "deg"

[log.instruments.speed_log]
file = "aids"
columns = ["stw"]
units = "m_s"

[log.instruments.depth]
file = "aids"
columns = ["depth"]

[log.instruments.magnetometer]
file = "aids"
columns = ["mx", "my", "mz"]
units = "nt"

[log.reference.position]
file = "truth"
columns = ["lat", "lon", "h"]
units = ["deg", "deg", "m"]

[log.reference.velocity]
file = "truth"
columns = ["vn", "ve", "vd"]
units = "m_s"

[log.reference.attitude]
file = "truth"
columns = ["roll", "pitch", "yaw"]
units = "deg"

[instruments.imu]
rate_hz = 50.0

[instruments.gnss]
kind = "gnss_position"
rate_hz = 1.0
sigma_m = 1.0
lever_arm_m = [1.0, -0.5, -3.0]

[instruments.dvl]
rate_hz = 1.0
sigma_m_s = 0.02

[instruments.compass]
kind = "gyrocompass"
rate_hz = 1.0
sigma_deg = 0.5

[instruments.speed_log]
rate_hz = 1.0
sigma_m_s = 0.1

[instruments.depth]
rate_hz = 1.0
sigma_m = 0.1

[instruments.magnetometer]
kind = "magnetic_field"
rate_hz = 1.0
sigma_nt = 100.0
field_nt = [18000.0, 700.0, 46000.0]
"""


def make_log(root: Path, length: float = 120.0, *, steady: bool = False) -> None:
    """Write the files; a steady vessel goes straight ahead at a constant speed, level."""
    folder = root / "manoeuvring"
    folder.mkdir(exist_ok=True)
    chance = np.random.default_rng(5)
    time = np.arange(round(length * RATE) + 1) / RATE
    sway = 0.0 if steady else 1.0
    yaw = 0.6 + sway * (0.9 * np.sin(0.045 * time) + 0.5 * np.sin(0.11 * time))
    roll, pitch = sway * 0.12 * np.sin(0.7 * time), sway * (0.07 * np.sin(0.55 * time + 1.0) + 0.03)
    ahead = 2.0 + sway * (0.8 * np.sin(0.06 * time) + 0.3 * np.sin(0.21 * time))
    aside, down = sway * 0.25 * np.sin(0.08 * time + 2.0), sway * 0.3 * np.sin(0.05 * time)
    velocity = np.stack(
        [ahead * np.cos(yaw) - aside * np.sin(yaw), ahead * np.sin(yaw) + aside * np.cos(yaw), down], -1
    )
    attitude = np.stack([roll, pitch, yaw], axis=-1)
    samples, position = increments(time, np.array([0.8, 0.2, -20.0]), velocity, attitude)
    rates = samples.angular_rate + np.radians(0.02) * chance.standard_normal(samples.angular_rate.shape)
    forces = samples.specific_force + 0.03 * chance.standard_normal(samples.specific_force.shape) + 0.02
    write_csv(folder / "imu.csv", "t,gx,gy,gz,ax,ay,az", [samples.time, *rates.T, *forces.T])
    second = slice(0, None, round(RATE))
    t, v, a, where = time[second], velocity[second], attitude[second], position[second]
    dcm = dcm_from_rpy(a)
    write_csv(folder / "truth.csv", "t,lat,lon,h,vn,ve,vd,roll,pitch,yaw,qw,qx,qy,qz",
              [t, *np.degrees(where[:, :2].T), where[:, 2], *v.T, *np.degrees(a.T),
               *quaternion_from_dcm(dcm).T])  # fmt: skip

    def noise(sigma: float, *shape: int) -> np.ndarray:
        return sigma * chance.standard_normal((len(t), *shape))

    body = np.einsum("nji,nj->ni", dcm, v) + noise(0.02, 3)
    fix = displace(where, dcm @ np.array([1.0, -0.5, -3.0]) + noise(1.0, 3))
    magnetic = np.einsum("nji,j->ni", dcm, FIELD) + noise(100.0, 3) + 800.0
    write_csv(
        folder / "aids.csv",
        "t,lat,lon,h,vx,vy,vz,hdg,stw,depth,mx,my,mz,cog",
        [t, *np.degrees(fix[:, :2].T), fix[:, 2], *body.T, np.degrees(a[:, 2] + noise(np.radians(0.5))) % 360.0,
         body[:, 0] + 0.2 + noise(0.1), noise(0.1) - where[:, 2], *magnetic.T,
         np.degrees(np.arctan2(v[:, 1], v[:, 0])) % 360.0],
    )  # fmt: skip
