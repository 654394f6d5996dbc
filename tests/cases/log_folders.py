"""Folders as other systems write them, a few kB each, all of one simulated voyage whose truth is known.

    python -m tests.cases.log_folders FOLDER

writes them, to try ``simnav log inspect FOLDER/ardusub --run`` and the others.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from simnav.geometry.rotation import dcm_from_rpy, quaternion_from_dcm
from simnav.leaderboard.results.formats import write
from simnav.recording import Recording
from simnav.scenario import parse
from simnav.source import record
from tests.cases.autopilots import dataflash, ulog
from tests.cases.tiny_log import write_csv

__all__ = ["FOLDERS", "VOYAGE", "main", "voyage"]

VOYAGE = """
name = "example-voyage"
version = 1
title = "a voyage whose log other systems wrote"
duration_s = 60.0

[start]
latitude_deg = 54.3
longitude_deg = 10.1
speed_m_s = 3.0

[initial_error]
position_m = [1.0, 1.0, 2.0]
velocity_m_s = [0.1, 0.1, 0.1]
attitude_deg = [0.5, 0.5, 2.0]

[vessel]
kind = "ship"
turn_rate_deg_s = 4.0

[[manoeuvre]]
kind = "zigzag"
angle_deg = 50.0
duration_s = 60.0

[sea]
significant_height_m = 0.5
peak_period_s = 5.0
direction_deg = 70.0

[instruments.imu]
rate_hz = 10.0

[instruments.imu.gyroscope]
bias_deg_h = 10.0
random_walk_deg_sqrt_h = 0.3

[instruments.imu.accelerometer]
bias_ug = 1000.0
random_walk_ug_sqrt_hz = 100.0

[instruments.gnss]
kind = "gnss_position"
rate_hz = 1.0
sigma_m = [0.8, 0.8, 1.5]

[instruments.gnss_velocity]
rate_hz = 1.0
sigma_m_s = 0.1

[instruments.dvl]
rate_hz = 2.0
sigma_m_s = 0.02

[instruments.gyrocompass]
rate_hz = 2.0
sigma_deg = 0.5

[instruments.speed_log]
rate_hz = 1.0
sigma_m_s = 0.1
"""

#: 2026-05-01 10:00 UTC.
_EPOCH = 1777629600.0
_FLIP = np.array([1.0, -1.0, -1.0])
#: North, east, down to east, north, up.
_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


@cache
def voyage() -> Recording:
    """The voyage."""
    return record(parse(VOYAGE, source="voyage"), 1)


def _parts() -> SimpleNamespace:
    """What the files are made of: SI units, body axes forward, starboard, down."""
    found = voyage()
    data, aids = found.data, found.data.aids
    time = data.truth.time
    second = np.isclose(time % 1.0, 0.0) | np.isclose(time % 1.0, 1.0)
    assert data.imu is not None
    return SimpleNamespace(
        imu=data.imu, truth=data.truth, time=time, second=second, position=data.truth.position,
        velocity=data.truth.velocity, attitude=data.truth.attitude, dcm=dcm_from_rpy(data.truth.attitude),
        **{name: aids[name] for name in ("gnss", "gnss_velocity", "dvl", "gyrocompass", "speed_log")},
    )  # fmt: skip


def ardusub(folder: Path) -> None:
    """An ArduSub log: IMU, GPS, attitude and position of the autopilot, depth."""
    p = _parts()
    formats = {
        130: ("IMU", "QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ"),
        131: ("GPS", "QBBIHBcLLefffB", "TimeUS,I,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ,U"),
        132: ("ATT", "Qffffff", "TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw"),
        133: ("POS", "QLLff", "TimeUS,Lat,Lng,Alt,RelHomeAlt"),
        134: ("MSG", "QZ", "TimeUS,Message"),
    }
    rows: list[tuple[float, int, tuple[Any, ...]]] = [(0.0, 134, (b"ArduSub V4.5",))]
    for t, w, f in zip(p.imu.time, p.imu.angular_rate, p.imu.specific_force, strict=True):
        for i, noise in ((0, 0.0), (1, 0.001)):
            rows.append((t, 130, (i, *(w + noise), *f)))
    for t, place in zip(p.gnss.time, p.gnss.value, strict=True):
        lat, lon = (round(float(np.degrees(x) * 1e7)) for x in place[:2])
        rows.append((t, 131, (0, 3, 0, 2400, 12, 90, lat, lon, round(100 * place[2]), 3.0, 0.0, 0.0, 1)))
    for t, a, place in zip(p.time[p.second], p.attitude[p.second], p.position[p.second], strict=True):
        roll, pitch, yaw = np.degrees(a)
        rows.append((t, 132, (0.0, roll, 0.0, pitch, 0.0, yaw % 360.0)))
        lat, lon = (round(float(np.degrees(x) * 1e7)) for x in place[:2])
        rows.append((t, 133, (lat, lon, place[2], 0.0)))
    rows.sort(key=lambda r: r[0])
    content = dataflash(formats, ((n, (round(1e6 * (100.0 + t)), *values)) for t, n, values in rows))
    (folder / "00000012.BIN").write_bytes(content)


def px4(folder: Path) -> None:
    """A PX4 log: IMU, GNSS, and the attitude of the autopilot as a quaternion."""
    p = _parts()
    topics = {
        "sensor_combined": "uint64_t timestamp;float[3] gyro_rad;uint32_t gyro_integral_dt;float[3] accelerometer_m_s2;"
        "uint32_t accelerometer_integral_dt;",
        "sensor_gps": "uint64_t timestamp;double latitude_deg;double longitude_deg;double altitude_msl_m;"
        "float vel_n_m_s;float vel_e_m_s;float vel_d_m_s;uint8_t fix_type;",
        "vehicle_attitude": "uint64_t timestamp;float[4] q;",
        "vehicle_global_position": "uint64_t timestamp;double lat;double lon;float alt;",
    }
    rows: list[tuple[float, str, tuple[Any, ...]]] = []
    for t, w, f in zip(p.imu.time, p.imu.angular_rate, p.imu.specific_force, strict=True):
        rows.append((t, "sensor_combined", (*w, 100000, *f, 100000)))
    for t, place, v in zip(p.gnss.time, p.gnss.value, p.gnss_velocity.value, strict=True):
        rows.append((t, "sensor_gps", (*np.degrees(place[:2]), place[2], *v, 3)))
    for t, a, place in zip(p.time[p.second], p.dcm[p.second], p.position[p.second], strict=True):
        rows.append((t, "vehicle_attitude", tuple(quaternion_from_dcm(a))))
        rows.append((t, "vehicle_global_position", (*np.degrees(place[:2]), place[2])))
    rows.sort(key=lambda r: r[0])
    content = ulog(topics, ((n, (round(1e6 * (20.0 + t)), *values)) for t, n, values in rows))
    (folder / "10_00_00.ulg").write_bytes(content)


def _ros(store: Any, p: SimpleNamespace) -> Iterator[tuple[str, str, float, Any]]:
    """Topic, type, time and message: an IMU with an orientation, a fix, and a velocity, in the axes of REP 103."""
    kinds = store.types

    def header(t: float, frame: str) -> Any:
        stamp = kinds["builtin_interfaces/msg/Time"](int(_EPOCH + t), int(1e9 * ((_EPOCH + t) % 1.0)))
        keys = {"stamp": stamp, "frame_id": frame}
        fields = kinds["std_msgs/msg/Header"].__dataclass_fields__
        return kinds["std_msgs/msg/Header"](**({"seq": 0} if "seq" in fields else {}), **keys)

    vector, turn = kinds["geometry_msgs/msg/Vector3"], kinds["geometry_msgs/msg/Quaternion"]
    none = np.zeros(9)
    dcm = [np.interp(p.imu.time, p.time, c) for c in np.unwrap(p.attitude, axis=0).T]
    quaternion = quaternion_from_dcm(_ENU @ dcm_from_rpy(np.stack(dcm, axis=-1)) * _FLIP)
    samples = zip(p.imu.time, p.imu.angular_rate * _FLIP, p.imu.specific_force * _FLIP, quaternion, strict=True)
    for t, w, f, q in samples:
        yield (
            "/imu/data",
            "sensor_msgs/msg/Imu",
            t,
            kinds["sensor_msgs/msg/Imu"](
                header(t, "imu"), turn(q[1], q[2], q[3], q[0]), none, vector(*w), none, vector(*f), none
            ),
        )
    status = kinds["sensor_msgs/msg/NavSatStatus"](status=0, service=1)
    for t, place in zip(p.gnss.time, p.gnss.value, strict=True):
        yield (
            "/fix",
            "sensor_msgs/msg/NavSatFix",
            t,
            kinds["sensor_msgs/msg/NavSatFix"](
                header(t, "gps"), status, *map(float, np.degrees(place[:2])), float(place[2]), none, 0
            ),
        )
    for t, v in zip(p.gnss_velocity.time, p.gnss_velocity.value @ _ENU.T, strict=True):
        twist = kinds["geometry_msgs/msg/Twist"](vector(*v), vector(0.0, 0.0, 0.0))
        yield (
            "/vel",
            "geometry_msgs/msg/TwistStamped",
            t,
            kinds["geometry_msgs/msg/TwistStamped"](header(t, "gps"), twist),
        )


def ros_bag(folder: Path) -> None:
    """A bag of ROS 1."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    with Writer(folder / "survey.bag") as writer:
        known: dict[str, Any] = {}
        for topic, kind, t, message in sorted(_ros(store, _parts()), key=lambda m: m[2]):
            if topic not in known:
                known[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(known[topic], int(1e9 * (_EPOCH + t)), store.serialize_ros1(message, kind))


def mcap(folder: Path) -> None:
    """An MCAP file of ROS 2."""
    from mcap.writer import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    with open(folder / "survey.mcap", "wb") as stream:
        writer = Writer(stream)
        writer.start()
        known: dict[str, int] = {}
        for topic, kind, t, message in sorted(_ros(store, _parts()), key=lambda m: m[2]):
            if topic not in known:
                text = store.generate_msgdef(kind, ros_version=2)[0]
                schema = writer.register_schema(kind, "ros2msg", text.encode())
                known[topic] = writer.register_channel(topic, "cdr", schema)
            stamp = int(1e9 * (_EPOCH + t))
            writer.add_message(known[topic], stamp, bytes(store.serialize_cdr(message, kind)), stamp)
        writer.finish()


def kf_gins(folder: Path) -> None:
    """The text files of KF-GINS: increments of the IMU, fixes, and the truth."""
    p = _parts()
    week, rate = 2400.0, 10.0
    tow = 100_000.0
    increments = np.hstack([p.imu.angular_rate, p.imu.specific_force]) / rate
    places = p.gnss.value * (180.0 / np.pi, 180.0 / np.pi, 1.0)
    truth = p.position[p.second] * (180.0 / np.pi, 180.0 / np.pi, 1.0)
    n = len(truth)
    write_csv(folder / "imu.txt", "", [tow + p.imu.time, *increments.T], " ")
    sigma = np.tile([0.8, 0.8, 1.5], (len(places), 1))
    write_csv(folder / "gnss.txt", "", [tow + p.gnss.time, *places.T, *sigma.T], " ")
    write_csv(folder / "truth.nav", "", [np.full(n, week), tow + p.time[p.second], *truth.T, *p.velocity[p.second].T,
                                         *np.degrees(p.attitude[p.second]).T], " ")  # fmt: skip


def phone(folder: Path) -> None:
    """A phone that lies flat with its top ahead, as phyphox writes it: axes starboard, forward, up."""
    p = _parts()
    axes = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    sensors = ("Accelerometer", p.imu.specific_force, "m/s^2"), ("Gyroscope", p.imu.angular_rate, "rad/s")
    for name, values, unit in sensors:
        header = ",".join(f'"{c} ({unit})"' for c in "XYZ")
        write_csv(folder / f"{name}.csv", f'"Time (s)",{header}', [p.imu.time, *(values @ axes.T).T])
    places = p.gnss.value * (180.0 / np.pi, 180.0 / np.pi, 1.0)
    speed = np.hypot(*p.gnss_velocity.value[:, :2].T)
    course = np.degrees(np.arctan2(p.gnss_velocity.value[:, 1], p.gnss_velocity.value[:, 0])) % 360.0
    write_csv(
        folder / "Location.csv",
        '"Time (s)","Latitude (°)","Longitude (°)","Height (m)","Velocity (m/s)","Direction (°)",'
        '"Horizontal Accuracy (m)","Vertical Accuracy (m)"',
        [p.gnss.time, *places.T, speed, course, np.full(len(speed), 3.0), np.full(len(speed), 5.0)],
    )


def nmea(folder: Path) -> None:
    """Sentences of NMEA 0183."""
    write("recording", "nmea", voyage(), folder / "bridge.nmea")


def export(folder: Path) -> None:
    """What `simnav export --truth` writes."""
    write("recording", "csv", voyage(), folder)


#: Every kind of folder, by its name.
FOLDERS: Mapping[str, Callable[[Path], None]] = {
    "ardusub": ardusub, "px4": px4, "ros-bag": ros_bag, "mcap": mcap, "kf-gins": kf_gins, "phone": phone, "nmea": nmea,
    "export": export,
}  # fmt: skip


def main() -> None:
    """Write all folders."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("folder", type=Path)
    for name, make in FOLDERS.items():
        target = parser.parse_args().folder / name
        target.mkdir(parents=True, exist_ok=True)
        make(target)
        print(f"{target}: {sum(f.stat().st_size for f in target.iterdir()) / 1000:.0f} kB")


if __name__ == "__main__":
    main()
