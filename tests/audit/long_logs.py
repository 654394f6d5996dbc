"""Long logs: ten million rows of a table in ten seconds of processor time; a long bag and NMEA log in little memory.

Each file is read in a process of its own, which says its processor time and by how much its memory has grown. A table
is held as a whole, with its text; of bags and sentences only the numbers are kept.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

__all__ = ["parts", "rows"]

_READ = """
import json, sys, time
from pathlib import Path
from simnav.log.files import FileSpec
from simnav.log.formats import rtklib  # the readers
from simnav.log.reader import READERS
path, form, sentence = Path(sys.argv[1]), sys.argv[2], sys.argv[3] or None
READERS.get(form)
def most():  # of this program; that of getrusage is of its parent, too
    return next(float(line.split()[1]) for line in open("/proc/self/status") if line.startswith("VmHWM"))
before, begun = most(), time.process_time()
rows = READERS.get(form).read(path, FileSpec(path=path.name, format=form), sentence)
after = most()
print(json.dumps({"rows": len(rows.table), "seconds": time.process_time() - begun, "grown": (after - before) / 1e3,
                  "size": path.stat().st_size / 1e6}))
"""


def _csv(path: Path, million: int = 10) -> None:
    """Time and six axes of an IMU."""
    values = np.random.default_rng(0).normal(size=(100_000, 6))
    block = "".join(f"{k:.2f}," + ",".join(f"{x:.6f}" for x in row) + "\n" for k, row in enumerate(values))
    with open(path, "w") as file:
        file.write("time,gx,gy,gz,ax,ay,az\n")
        for _ in range(10 * million):
            file.write(block)


def _nmea(path: Path, hours: int = 4) -> None:
    """Five sentences a second, two of them five times a second."""
    with open(path, "w") as file:
        for k in range(3600 * hours):
            clock = f"{12 + k // 3600:02d}:{k // 60 % 60:02d}:{k % 60:02d}"
            of_day = clock.replace(":", "")
            file.write(
                f"2024-05-01T{clock}.000Z $GPGGA,{of_day}.00,5427.{k % 10000:04d},N,01015.0000,E,1,09,0.9,3.0,M,44.0,"
                f"M,,\n2024-05-01T{clock}.000Z $GPVTG,54.7,T,,M,5.5,N,,K\n"
            )
            for j in range(5):
                file.write(f"2024-05-01T{clock}.{2 * j}00Z $HEHDT,{(5 * k + j) % 3600 / 10},T\n")
                file.write(f"2024-05-01T{clock}.{2 * j}00Z $TIROT,{j}.5,A\n")


def _bag(path: Path, size: float = 1e9) -> None:
    """Fixes beside pictures, which fill most of the bag."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    names = ("std_msgs/msg/Header", "builtin_interfaces/msg/Time", "sensor_msgs/msg/NavSatFix", "sensor_msgs/msg/Image")
    header, stamp, fix, image = (store.types[n] for n in names)
    status = store.types["sensor_msgs/msg/NavSatStatus"](status=0, service=1)
    picture = np.zeros(1_000_000, dtype=np.uint8)
    with Writer(path) as writer:
        fixes = writer.add_connection("/fix", fix.__msgtype__, typestore=store)
        pictures = writer.add_connection("/image", image.__msgtype__, typestore=store)
        for k in range(int(size / 1e6)):
            for j in range(20):
                head = header(seq=k, stamp=stamp(sec=k, nanosec=50_000_000 * j), frame_id="gps")
                place = fix(header=head, status=status, latitude=54.0, longitude=8.0, altitude=0.0,
                            position_covariance=np.zeros(9), position_covariance_type=2)  # fmt: skip
                writer.write(fixes, 10**9 * k + 50_000_000 * j, store.serialize_ros1(place, fix.__msgtype__))
            shown = image(
                header=head, height=1000, width=1000, encoding="mono8", is_bigendian=0, step=1000, data=picture
            )
            writer.write(pictures, 10**9 * k + 999_999_999, store.serialize_ros1(shown, image.__msgtype__))


#: What is read: how it is made, its format and sentence, and what is promised of seconds and megabytes.
CASES: Mapping[str, tuple[Callable[[Path], None], str, str, float | None, float | None]] = {
    "10 million rows of a table": (_csv, "csv", "", 10.0, None),
    "NMEA log of four hours": (_nmea, "nmea", "HDT", None, 60.0),
    "bag of 1 GB": (_bag, "rosbag", "/fix", None, 100.0),
}


def measured(make: Callable[[Path], None], form: str, sentence: str) -> dict[str, float]:
    """Rows, processor time [s], growth of the memory [MB] and size [MB]."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / ("long.bag" if form == "rosbag" else "long.txt")
        make(path)
        command = [sys.executable, "-c", _READ, str(path), form, sentence]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
    found: dict[str, float] = json.loads(done.stdout)
    return found


def parts() -> Mapping[str, Callable[[], Any]]:
    """One part a file."""
    return {name: partial(measured, *case[:3]) for name, case in CASES.items()}


def rows(found: Mapping[str, Any]) -> Iterator[tuple[str, str, str, bool]]:
    """A row for each promise."""
    for name, (_, _, _, seconds, megabytes) in CASES.items():
        f = found[name]
        figure = f"{f['size']:.0f} MB: {f['seconds']:.1f} s, +{f['grown']:.0f} MB"
        if seconds is not None:
            yield name, figure, f"below {seconds:g} s", f["seconds"] < seconds
        if megabytes is not None:
            yield name, figure, f"below {megabytes:g} MB", f["grown"] < megabytes
