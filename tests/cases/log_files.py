"""A small good file of every format of logs that simnav reads, made by other code than that which reads it."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from simnav.log.files import FileSpec
from simnav.log.reader import READERS, Rows
from simnav.satellites.rinex_navigation import read_navigation
from simnav.sensors.gnss_raw import SHIPPED
from tests.cases.autopilots import dataflash, ulog

__all__ = ["CASES", "OTHERS", "Case", "damaged", "mutated", "read"]

N = 12
T = np.arange(N, dtype=np.float64)
LATITUDE, LONGITUDE, HEIGHT = 54.0 + 1e-5 * T, 7.9 + 2e-5 * T, 0.1 * T


#: What is done to the content of each message before it is packed.
Change: TypeAlias = Callable[[bytes], bytes]


def _same(content: bytes) -> bytes:
    return content


class Case(NamedTuple):
    """How a file is made, and with which keys it is read.

    Attributes
    ----------
    ending : str
        Ending of its name.
    make : callable
        Gives the content.
    keys : mapping
        Keys of `FileSpec`.
    sentence : str or None
        What a channel names.
    form : str
        The format, where it is not the name of the case.
    inner : callable or None
        Makes the file with another content of its messages, but with right lengths and checksums around them.
    reads : callable or None
        Reads the file, where no registered reader does; gives what has a length.
    """

    ending: str
    make: Callable[[Path], None]
    keys: Mapping[str, Any] = {}
    sentence: str | None = None
    form: str = ""
    inner: Callable[[Path, Change], None] | None = None
    reads: Callable[[Path], Any] | None = None


def _text(text: str) -> Callable[[Path], None]:
    return lambda path: path.write_text(text) and None


def _rows(*columns: Any, separator: str = " ") -> str:
    return "".join(separator.join(repr(float(x)) for x in row) + "\n" for row in zip(*columns, strict=True))


def _nmea() -> str:
    lines = [
        "2014-08-01T00:00:00.5Z $GPGGA,000000.25,2230.0000,S,01745.6000,W,1,06,1.3,033.6,M,-002.6,M,,",
        "2014-08-01T00:00:00.6Z $GPVTG,210.0,T,,M,010.0,N,,K",
        "2014-08-01T00:00:00.7Z $HCHDG,98.3,0.5,E,12.6,W",
        "2014-08-01T00:00:00.8Z $PSXN,23,0.35,-1.74,218.26,0.58",
        "2014-08-01T00:00:00.9Z $PSIMSSB,000000.25,M23,A,,C,H,M,-100.10,50.50,200.20,1.436,N,,",
        "2014-08-01T00:00:01.0Z $PNORBT7,1406851200.75,1.234,-1.234,0.5,-0.1,0.02,0.004,23.45,23.4,23.5,23.6",
        "2014-08-01T00:00:01.5Z $GPGGA,000001.25,2230.0000,S,01745.6000,W,1,06,1.3,033.6,M,-002.6,M,,",
    ]
    return "\n".join(lines) + "\n"


def _pos() -> str:
    head = "% program   : rnx2rtkp\n%  GPST                  latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)\n"
    rows = []
    for k in range(N):
        place = f"{LATITUDE[k]:.9f} {LONGITUDE[k]:.9f} {HEIGHT[k]:.4f}"
        rows.append(f"2024/05/01 10:00:{k:02d}.000 {place} {1 + k % 2} 9 0.0{k + 10}")
    return head + "\n".join(rows) + "\n"


def _sbet(path: Path) -> None:
    zero = np.zeros(N)
    columns = [T, np.radians(LATITUDE), np.radians(LONGITUDE), HEIGHT, zero + 2.0, zero + 1.0, zero, zero, zero,
               zero + 1.0, zero + 0.3, zero, zero, zero - 9.8, zero, zero, zero]  # fmt: skip
    path.write_bytes(np.stack(columns, axis=1).astype("<f8").tobytes())


def _pd0(path: Path, change: Change = _same) -> None:
    content = b""
    for k in range(N):
        fixed = bytearray(59)
        fixed[25] = 2 << 3  # ship coordinates
        leader = bytearray(65)
        leader[0:2] = b"\x80\x00"
        leader[4:11] = bytes([24, 5, 1, 10, 0, k, 50])
        struct.pack_into("<3H2hHh", leader, 14, 1500, 123, 4500, -150, 250, 35, 1234)
        bottom = bytearray(85)
        bottom[0:2] = b"\x00\x06"
        struct.pack_into("<4H4h", bottom, 16, 2000, 2010, 2020, 2030, 100, -1500 if k else -32768, 20, 3)
        parts = [bytes(fixed), bytes(leader), bytes(bottom)]
        offsets, at = [], 6 + 2 * len(parts)
        for part in parts:
            offsets.append(at)
            at += len(part)
        body = change(struct.pack("<BB3H", 0, 3, *offsets) + b"".join(parts))[:60_000]
        body = struct.pack("<2sH", b"\x7f\x7f", 4 + len(body)) + body
        content += body + struct.pack("<H", sum(body) & 0xFFFF)
    path.write_bytes(content)


def _n2k() -> str:
    """Heading (magnetic, variation 0.0698 rad), water speed 3.24 m/s, position and, in frames of the bus, a fix."""
    fix = struct.pack("<BHIqqqBBBhhi", 7, 16297, 684005000, round(60.0051 * 1e16), round(23.5391 * 1e16), 2_430_000,
                      0x10, 0xFC, 11, 80, 160, 1500) + b"\x00"  # fmt: skip
    frames = [bytes([0xA0, len(fix)]) + fix[:6]]
    frames += [bytes([0xA0 + 1 + i // 7]) + fix[6 + i : 13 + i].ljust(7, b"\xff") for i in range(0, len(fix) - 6, 7)]
    lines = ["# made by hand"]
    for k in range(N):
        stamp = f"2014-08-15T19:00:{k:02d}.042Z"
        heading = struct.pack("<BHhhB", 255, 24294, 0x7FFF, 698, 0xFD)
        place = struct.pack("<ii", round(LATITUDE[k] * 1e7), round(LONGITUDE[k] * 1e7))
        speed = struct.pack("<BHHBH", 0, 324, 0xFFFF, 0, 0xFFFF)
        messages = [("127250", 36, heading), ("129025", 160, place), ("128259", 115, speed)]
        for pgn, source, data in [*messages, *(("129029", 160, f) for f in frames)]:
            lines.append(f"{stamp},2,{pgn},{source},255,{len(data)},{data.hex(',')}")
    return "\n".join(lines) + "\n"


def _n2k_others() -> str:
    messages = {
        "126992": struct.pack("<BBHI", 1, 0xF0, 16297, 684005000),
        "127251": struct.pack("<BiBBB", 1, 320_000, 255, 255, 255),
        "127252": struct.pack("<BhBHH", 1, -45, 255, 0xFFFF, 0xFFFF),
        "127257": struct.pack("<BhhhB", 1, 12000, -300, 150, 255),
        "127258": struct.pack("<BBHhH", 1, 0xF8, 16297, 698, 0xFFFF),
        "128267": struct.pack("<BIhB", 1, 2350, -500, 255),
        "129026": struct.pack("<BBHHH", 1, 0xFC, 24294, 324, 0xFFFF),
        "129033": struct.pack("<HIh", 16297, 684005000, 120),
    }
    lines = []
    for k in range(N):
        for pgn, data in messages.items():
            lines.append(f"2014-08-15T19:00:{k:02d}.042Z,2,{pgn},36,255,{len(data)},{data.hex(',')}")
    return "\n".join(lines) + "\n"


def _nmea_others() -> str:
    bodies = [
        "GPRMC,000000.25,A,2230.0000,S,01745.6000,W,10.0,210.0,010814,12.6,W,A",
        "GPGLL,2230.0000,S,01745.6000,W,000000.25,A,A",
        "GNGNS,000000.25,2230.0000,S,01745.6000,W,AN,11,0.9,33.6,-2.6,,",
        "GPGST,000000.25,1.0,2.0,1.5,30.0,1.2,1.3,2.5", "GPZDA,000000.25,01,08,2014,00,00", "HEHDT,98.3,T",
        "HCHDM,98.3,M", "HETHS,98.3,A", "TIROT,-12.5,A", "VWVHW,98.3,T,110.9,M,5.0,N,9.3,K",
        "VDVBW,5.0,0.2,A,5.1,0.1,A,0.1,A,0.1,A", "SDDPT,23.5,-0.5,100.0", "SDDBT,77.1,f,23.5,M,12.8,F", "YXMTW,25.3,C",
        "PASHR,000000.25,98.30,T,-0.35,1.74,0.05,0.02,0.02,0.1,1,0", "PRDID,-1.74,0.35,98.30",
        "PUHAW,UVH,-1.5,2.5,98.3", "PNORBT9,1406851200.75,1.234,-1.234,0.5,-0.1,0.02,0.004,23.45,23.4,23.5,23.6",
    ]  # fmt: skip
    lines = []
    for k in range(N):
        for body in bodies:
            total = 0
            for c in body:
                total ^= ord(c)
            lines.append(f"2014-08-01T00:00:{k:02d}.5Z ${body}*{total:02X}")
    return "\n".join(lines) + "\n"


def _navigation() -> str:
    """The first twelve ephemerides of the file that comes with simnav."""
    lines = SHIPPED.read_text().splitlines(keepends=True)
    begin = next(k for k, line in enumerate(lines) if line[60:].startswith("END OF HEADER")) + 1
    return "".join(lines[: begin + 12 * 8])


def _pd6() -> str:
    rows = []
    for k in range(N):
        rows += [
            ":SA, -1.50, +2.50, 45.00",
            f":TS,240501100000{k:02d},35.0,+12.3,  12.3,1500.0,  0",
            ":BI,    +10,    -20,     +5,     +1,A",
            f":BS,   -100,  +1500,    +20,{'A' if k else 'V'}",
            ":BE,   +300,  +1200,    -30,A",
            ":BD,       +1.00,      +2.00,       +0.10,  20.50,  0.00",
        ]
    return "\n".join(rows) + "\n"


def ubx(group: int, number: int, content: bytes) -> bytes:
    """A message of UBX, with its checksum."""
    body = struct.pack("<BBH", group, number, len(content)) + content
    a = b = 0
    for byte in body:
        a = (a + byte) & 255
        b = (b + a) & 255
    return b"\xb5\x62" + body + bytes((a, b))


def _pvt(k: int) -> bytes:
    head = struct.pack("<IH5BBIi", 295218000 + 1000 * k, 2024, 5, 1, 10, 0, k, 7, 25, 500_000_000)
    place = struct.pack("<4B4i", 3, 0x81, 0, 14, round(LONGITUDE[k] * 1e7), round(LATITUDE[k] * 1e7), 47_100, 3_100)
    return head + place + struct.pack("<2I5i2IH14x", 14, 22, 1500, -300, 20, 1530, 34_869_000, 50, 100_000, 152)


def _ubx(path: Path, change: Change = _same) -> None:
    content = b"$GNGGA,,,,,,0,,,,,,,,*56\r\n"
    for k in range(N):
        content += ubx(1, 7, change(_pvt(k)))
        tow = 295218500 + 1000 * k
        content += ubx(1, 5, change(struct.pack("<I4x3i3I", tow, 150_000, -50_000, 9_000_000, 1000, 1000, 20_000)))
    path.write_bytes(content)


def _ubx_others(path: Path, change: Change = _same) -> None:
    """A place with high precision, a velocity and a vector between antennas, after the date."""
    content = ubx(1, 7, _pvt(0))
    for k in range(N):
        tow = 295218000 + 1000 * k
        place = struct.pack("<4xI4i4b2I", tow, 79_000_000, 540_000_000, 47_100, 3_100, 12, -34, 5, 6, 140, 220)
        motion = struct.pack("<I3i2Ii2I", tow, 150, -30, 2, 153, 153, 34_869_000, 5, 100_000)
        vector = struct.pack("<4xI5i4b5I4xI", tow, 100, 50, -2, 112, 2_656_000, 1, 2, 3, 4, 10, 10, 10, 10, 5000, 0x137)
        for number, message in ((0x14, place), (0x12, motion), (0x3C, vector)):
            content += ubx(1, number, change(message))
    path.write_bytes(content)


def _rinex() -> str:
    def header(text: str, label: str) -> str:
        return f"{text:<60}{label}"

    lines = [
        header("     3.04           OBSERVATION DATA    M", "RINEX VERSION / TYPE"),
        header("G    3 C1C L1C S1C", "SYS / # / OBS TYPES"),
        header("E    1 C1C", "SYS / # / OBS TYPES"),
        header("  2024     5     1    10     0    0.5000000     GPS", "TIME OF FIRST OBS"),
        header("", "END OF HEADER"),
    ]
    for k in range(N):
        lines += [
            f"> 2024 05 01 10 00 {k:02d}.5000000  0  2",
            f"G05{22000000.125 + k:14.3f} 7{115000000.25:14.3f}18" + (f"{45.5:14.3f}" if k else ""),
            f"E11{24000000.5 + k:14.3f}",
        ]
    return "\n".join(lines) + "\n"


def _mat(path: Path) -> None:
    from scipy.io import savemat

    savemat(path, {"imu": {"t": T, "acc": np.tile([0.0, 0.1, -9.8], (N, 1))}, "name": "x", "scalar": 3.0})


def _hdf5(path: Path) -> None:
    import h5py

    with h5py.File(path, "w") as file:
        file["imu/t"], file["imu/acc"], file["note"] = T, np.tile([0.0, 0.1, -9.8], (N, 1)), "x"


def _parquet(path: Path) -> None:
    import pyarrow as pa
    from pyarrow import parquet

    stamps = pa.array([1_700_000_000_000_000 + int(1e6 * t) for t in T], pa.timestamp("us"))
    place = pa.array([{"lat": a, "lon": b} for a, b in zip(LATITUDE, LONGITUDE, strict=True)])
    parquet.write_table(pa.table({"stamp": stamps, "place": place, "mode": ["A"] * N}), path)


def _mcap(path: Path, change: Change = _same) -> None:
    from mcap.writer import Writer

    with open(path, "wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema("fix", "jsonschema", b"{}")
        channel = writer.register_channel("/fix", "json", schema)
        for k in range(N):
            message = {"timestamp": {"sec": k, "nsec": 500_000_000}, "latitude": LATITUDE[k], "covariance": [1.0, 2.0]}
            data = change(json.dumps(message).encode())
            writer.add_message(channel, 10**9 * k + 7 * 10**8, data, 10**9 * k)
        writer.finish()


def _protobuf(path: Path, change: Change = _same) -> None:
    """Messages with a stamp, a number that keeps its default, and a repeated field."""
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory, timestamp_pb2
    from mcap.writer import Writer

    file = descriptor_pb2.FileDescriptorProto(
        name="fix.proto", package="test", syntax="proto3", dependency=["google/protobuf/timestamp.proto"]
    )
    message = file.message_type.add(name="Fix")
    kinds = descriptor_pb2.FieldDescriptorProto
    message.field.add(name="timestamp", number=1, type=kinds.TYPE_MESSAGE, type_name=".google.protobuf.Timestamp")
    message.field.add(name="latitude", number=2, type=kinds.TYPE_DOUBLE)
    message.field.add(name="height", number=3, type=kinds.TYPE_DOUBLE)
    message.field.add(name="covariance", number=4, type=kinds.TYPE_DOUBLE, label=kinds.LABEL_REPEATED)
    stamp = descriptor_pb2.FileDescriptorProto()
    timestamp_pb2.DESCRIPTOR.CopyToProto(stamp)
    pool = descriptor_pool.DescriptorPool()
    for each in (stamp, file):
        pool.Add(each)
    fix = message_factory.GetMessageClass(pool.FindMessageTypeByName("test.Fix"))
    with open(path, "wb") as stream:
        writer = Writer(stream)
        writer.start()
        data = change(descriptor_pb2.FileDescriptorSet(file=[stamp, file]).SerializeToString())
        channel = writer.register_channel("/fix", "protobuf", writer.register_schema("test.Fix", "protobuf", data))
        for k in range(N):
            one = fix(latitude=LATITUDE[k], covariance=[1.0, 2.0])
            one.timestamp.seconds, one.timestamp.nanos = k, 500_000_000
            writer.add_message(channel, 10**9 * k, change(one.SerializeToString()), 10**9 * k)
        writer.finish()


def _cdr(path: Path, change: Change = _same) -> None:
    """A message of ROS 2 whose type the file defines."""
    from mcap.writer import Writer

    with open(path, "wb") as stream:
        writer = Writer(stream)
        writer.start()
        text = change(b"float64 latitude\nfloat64[3] sigma\nstring frame\n")
        channel = writer.register_channel("/fix", "cdr", writer.register_schema("own/msg/Fix", "ros2msg", text))
        for k in range(N):
            data = struct.pack("<4B4dI4s", 0, 1, 0, 0, LATITUDE[k], 1.0, 2.0, 3.0, 4, b"gps\0")
            writer.add_message(channel, 10**9 * k, change(data), 10**9 * k)
        writer.finish()


def _bag(path: Path, change: Change = _same) -> None:
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    names = ("std_msgs/msg/Header", "builtin_interfaces/msg/Time", "sensor_msgs/msg/NavSatFix")
    header, stamp, fix = (store.types[n] for n in names)
    status = store.types["sensor_msgs/msg/NavSatStatus"]
    with Writer(path) as writer:
        connection = writer.add_connection("/fix", fix.__msgtype__, typestore=store)
        for k in range(N):
            head = header(seq=k, stamp=stamp(sec=k, nanosec=500_000_000), frame_id="gps")
            message = fix(header=head, status=status(status=0, service=1),
                          latitude=LATITUDE[k], longitude=LONGITUDE[k],
                          altitude=HEIGHT[k],
                          position_covariance=np.arange(9.0), position_covariance_type=2)  # fmt: skip
            data = change(bytes(store.serialize_ros1(message, fix.__msgtype__)))
            writer.write(connection, 10**9 * (k + 1), data)


def _dataflash(path: Path) -> None:
    """Fixes of two receivers, and a text."""
    formats = {130: ("GPS", "QBBLLe", "TimeUS,I,Status,Lat,Lng,Alt"), 131: ("MSG", "QZ", "TimeUS,Message")}
    rows: list[tuple[int, tuple[Any, ...]]] = [(131, (0, b"ArduSub"))]
    for k in range(N):
        place = round(LATITUDE[k] * 1e7), round(LONGITUDE[k] * 1e7), round(HEIGHT[k] * 100)
        rows += [(130, (10**6 * k, i, 3, *place)) for i in (0, 1)]
    path.write_bytes(dataflash(formats, rows))


def _ulog(path: Path) -> None:
    """Fixes, with an array and a padding."""
    layout = "uint64_t timestamp;double latitude_deg;double longitude_deg;float[2] sigma;uint8_t fix_type;"
    rows = [("sensor_gps", (10**6 * k, LATITUDE[k], LONGITUDE[k], 1.0, 2.0, 3)) for k in range(N)]
    path.write_bytes(ulog({"sensor_gps": layout}, rows))


_ZERO = np.zeros(N)
_TABLE = "time,latitude,longitude,height\n" + _rows(T, LATITUDE, LONGITUDE, HEIGHT, separator=",")
_EUROC = "#timestamp [ns],wx,wy,wz,ax,ay,az\n" + _rows(1e9 * T, *[_ZERO] * 5, _ZERO - 9.8, separator=",")
#: A case for each format that comes with simnav.
CASES: Mapping[str, Case] = {
    "csv": Case(".csv", _text(_TABLE)),
    "nmea": Case(".nmea", _text(_nmea()), sentence="GGA"),
    "rtklib": Case(".pos", _text(_pos())),
    "tum": Case(".tum", _text(_rows(T, T, _ZERO, _ZERO, _ZERO, _ZERO, _ZERO + 0.6, _ZERO + 0.8))),
    "euroc": Case(".csv", _text(_EUROC)),
    "kf_gins": Case(".txt", _text(_rows(T, *[_ZERO] * 5, _ZERO - 9.8))),
    "sbet": Case(".out", _sbet),
    "pd0": Case(".pd0", _pd0, inner=_pd0),
    "pd6": Case(".txt", _text(_pd6())),
    "n2k": Case(".raw", _text(_n2k()), sentence="129025"),
    "ubx": Case(".ubx", _ubx, sentence="NAV-PVT", inner=_ubx),
    "rinex": Case(".obs", _text(_rinex()), sentence="G05"),
    "mat": Case(".mat", _mat, {"time": "imu.t"}),
    "hdf5": Case(".h5", _hdf5, {"time": "imu/t"}),
    "parquet": Case(".parquet", _parquet, {"time": "stamp"}),
    "dataflash": Case(".bin", _dataflash, sentence="GPS"),
    "ulog": Case(".ulg", _ulog, sentence="sensor_gps"),
    "mcap": Case(".mcap", _mcap, {"clock": "sentence"}, "/fix", inner=_mcap),
    "rosbag": Case(".bag", _bag, {"clock": "sentence"}, "/fix", inner=_bag),
}  # fmt: skip
#: Further contents of these formats, and files that simnav reads elsewhere.
OTHERS: Mapping[str, Case] = {
    "nmea, other sentences": Case(".nmea", _text(_nmea_others()), sentence="HDT", form="nmea"),
    "n2k, other messages": Case(".raw", _text(_n2k_others()), sentence="127257", form="n2k"),
    "ubx, other messages": Case(".ubx", _ubx_others, sentence="NAV-VELNED", form="ubx", inner=_ubx_others),
    "kf_gins, fixes": Case(".txt", _text(_rows(T, LATITUDE, LONGITUDE, HEIGHT, *[_ZERO + 0.1] * 3)),
                           {"options": {"content": "gnss"}}, form="kf_gins"),
    "mcap, protobuf": Case(".mcap", _protobuf, {"clock": "sentence"}, "/fix", "mcap", _protobuf),
    "mcap, ROS 2": Case(".mcap", _cdr, {}, "/fix", "mcap", _cdr),
    "rinex, navigation": Case(".rnx", _text(_navigation()), reads=lambda path: read_navigation(path).satellites()),
}  # fmt: skip


def read(form: str, path: Path, **keys: Any) -> Rows:
    """Read a file of a format, with the keys of its case."""
    case = CASES.get(form) or OTHERS[form]
    form = case.form or form
    reader = READERS.get(form)
    assert reader is not None
    return reader.read(path, FileSpec(path=path.name, format=form, **{**case.keys, **keys}), case.sentence)


def damaged(case: Case, path: Path, good: bytes, chance: Any) -> None:
    """Write a mutated file: its bytes, or those of one in five of its messages within right checksums."""
    if case.inner is None or chance.random() < 0.5:
        path.write_bytes(mutated(good, chance))
    else:
        case.inner(path, lambda content: mutated(content, chance) if chance.random() < 0.2 else content)


def mutated(content: bytes, chance: Any) -> bytes:
    """A content with one to three changes: bytes changed, doubled, cut out, or the end cut off."""
    data = bytearray(content)
    for _ in range(chance.randint(1, 3)):
        if not data:
            break
        at, kind = chance.randrange(len(data)), chance.randrange(6)
        length = chance.choice((1, 2, 8, 40))
        if kind == 0:
            data[at] = chance.randrange(256)
        elif kind == 1:
            data[at : at + length] = bytes(chance.choice((0, 255, 127)) for _ in range(length))
        elif kind == 2:
            del data[at : at + length]
        elif kind == 3:
            data[at:at] = data[max(0, at - 5 * length) : at]
        elif kind == 4:
            del data[at:]
        else:
            data[at : at + 1] = chance.choice(
                (b"nan", b"inf", b"-1e308", b"9" * 300, b",", b"\n", b"\x00", b"\xff\xfe", b'"')
            )
    return bytes(data)
