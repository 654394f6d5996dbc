"""A small log with a known truth: a closed-form trajectory, its exact IMU samples, files in awkward axes and units."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np

from simnav.inverse_strapdown import increments
from simnav.scenario import parse

RATE, LENGTH, CLOCK = 50.0, 40.0, 5000.0

SCENARIO = """
name = "tiny-log"
version = 1
title = "a tiny log"
duration_s = 30.0

[initial_error]
position_m = [3.0, 3.0, 3.0]
velocity_m_s = [0.1, 0.1, 0.1]
attitude_deg = [0.1, 0.1, 1.0]

[log]
folder = "tiny"

[log.files.imu]
path = "imu{recording}.csv"
time = "stamp"
time_unit = "ms"

[log.files.truth]
path = "truth{recording}.csv"
time = "t"

[log.files.dvl]
path = "dvl{recording}.txt"
offset_s = 0.25

[log.imu]
file = "imu"
samples = "means"
angular_rate = ["gy", "gx", "-gz"]
angular_rate_unit = "deg_s"
specific_force = ["ay", "ax", "-az"]
specific_force_unit = "g"

[log.instruments.dvl]
file = "dvl"
columns = [2, -3, 4]
units = ["m_s", "m_s", "mm_s"]

[log.reference.position]
file = "truth"
columns = ["lat", "lon", "h"]
units = ["deg", "deg", "m"]

[log.reference.velocity]
file = "truth"
columns = ["vn", "ve", "-vu"]
units = "m_s"

[log.reference.attitude]
file = "truth"
columns = ["roll", "pitch", "yaw"]
units = "deg"

[instruments.imu]
rate_hz = 50.0

[instruments.dvl]
rate_hz = 1.0
sigma_m_s = 0.02
"""


def write_csv(path: Path, header: str, columns: list[np.ndarray], delimiter: str = ",") -> None:
    """Write a table with all digits."""
    rows = [delimiter.join(repr(float(x)) for x in row) for row in zip(*columns, strict=True)]
    path.write_text((header + "\n" if header else "") + "\n".join(rows) + "\n")


def make_log(folder: Path, recording: str = "1") -> SimpleNamespace:
    """Write one recording; return its truth."""
    folder.mkdir(exist_ok=True)
    time = np.arange(round(LENGTH * RATE) + 1) / RATE
    velocity = np.stack([2.0 * np.cos(0.05 * time), 2.0 * np.sin(0.05 * time), 0.1 * np.sin(0.1 * time)], axis=-1)
    attitude = np.stack(
        [0.05 * np.sin(0.4 * time), 0.03 * np.cos(0.3 * time), 0.05 * time + float(len(recording) - 1)], axis=-1
    )
    samples, position = increments(time, np.array([0.8, 0.2, -5.0]), velocity, attitude)
    degrees, g = np.degrees(samples.angular_rate), samples.specific_force / 9.80665
    # The file's axes are starboard, forward, up.
    write_csv(
        folder / f"imu{recording}.csv",
        "stamp,ax,ay,az,gx,gy,gz",
        [(CLOCK + samples.time) * 1e3, g[:, 1], g[:, 0], -g[:, 2], degrees[:, 1], degrees[:, 0], -degrees[:, 2]],
    )
    every = slice(0, None, round(RATE))
    where, v, a = position[every], velocity[every], np.degrees(attitude[every])
    write_csv(
        folder / f"truth{recording}.csv",
        "t,lat,lon,h,vn,ve,vu,roll,pitch,yaw",
        [CLOCK + time[every], *np.degrees(where[:, :2].T), where[:, 2], v[:, 0], v[:, 1], -v[:, 2], *a.T],
    )
    dvl = np.stack([1.0 + 0.01 * np.arange(39), np.full(39, -0.2), np.full(39, 0.05)], axis=-1)
    write_csv(folder / f"dvl{recording}.txt", "", [CLOCK + np.arange(39), dvl[:, 0], -dvl[:, 1], 1e3 * dvl[:, 2]], " ")
    return SimpleNamespace(time=time, position=position, velocity=velocity, attitude=attitude, samples=samples, dvl=dvl)


class TinyLog:
    """A folder with one recording, and the text of a scenario for it that tests may alter."""

    def __init__(self, root: Path):
        self.folder = root / "tiny"
        self.truth = make_log(self.folder)
        self.text = SCENARIO

    def replace(self, old: str, new: str) -> TinyLog:
        """Alter the scenario."""
        assert old in self.text
        self.text = self.text.replace(old, new)
        return self

    def add(self, text: str) -> TinyLog:
        """Append to the scenario."""
        self.text += text
        return self

    def scenario(self):
        """Parse it."""
        return parse(self.text, source="tiny.toml")

    def add_recording(self, recording: str) -> SimpleNamespace:
        """Write another recording."""
        return make_log(self.folder, recording)

    def edit(self, name: str, line: int, new: str | None) -> None:
        """Replace a line (from 1) of a file, or take it out."""
        path = self.folder / name
        lines = path.read_text().splitlines()
        lines[line - 1 : line] = [] if new is None else [new]
        path.write_text("\n".join(lines) + "\n")
