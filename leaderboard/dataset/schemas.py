"""The columns of the tables of a data set, with their units: SI units and radians."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pyarrow as pa

__all__ = ["FORCE", "IMU_ERROR", "RATE", "TRUTH_ATTITUDE", "TRUTH_CURRENT", "TRUTH_POSITION",
           "TRUTH_VELOCITY", "byte_streams", "dictionaries", "schemas"]  # fmt: skip

RATE = tuple(f"angular_rate_{axis}_rad_s" for axis in "xyz")
FORCE = tuple(f"specific_force_{axis}_m_s2" for axis in "xyz")
IMU_ERROR = tuple(f"fault_error_{name}" for name in (*RATE, *FORCE))
TRUTH_POSITION = ("latitude_rad", "longitude_rad", "height_m")
TRUTH_VELOCITY = tuple(f"velocity_{axis}_m_s" for axis in ("north", "east", "down"))
TRUTH_ATTITUDE = ("roll_rad", "pitch_rad", "yaw_rad")
TRUTH_CURRENT = tuple(f"current_{axis}_m_s" for axis in ("north", "east", "down"))

_START = ("position", "velocity", "attitude")


def schemas(told: bool) -> Mapping[str, pa.Schema]:
    """The schema of each table of a voyage.

    Parameters
    ----------
    told : bool
        With truth and labels, as of all splits but ``test``.
    """
    import pyarrow as pa

    text, words = pa.string(), pa.dictionary(pa.int32(), pa.string())
    whole, double, single = pa.int32(), pa.float64(), pa.float32()
    doubles, singles, mask = pa.list_(double), pa.list_(single), pa.uint32()

    def each(names: Sequence[str], kind: pa.DataType) -> list[tuple[str, pa.DataType]]:
        return [(name, kind) for name in names]

    first = [("voyage", whole)]
    voyages = [*first, ("seed", pa.int64()), *each(("duration_s", "step_s"), double), ("datasheets", text),
               ("start_time_s", double), *each([f"start_{n}" for n in (*_START, "covariance")], doubles)]  # fmt: skip
    imu = [*first, ("time_s", double), ("interval_s", double), *each((*RATE, *FORCE), single)]
    aids = [*first, ("instrument", words), ("channel", words), ("time_s", double), ("arrival_s", double),
            ("value", doubles), ("side", doubles)]  # fmt: skip
    if not told:
        return {name: pa.schema(columns) for name, columns in (("voyages", voyages), ("imu", imu), ("aids", aids))}
    truth = [*first, ("time_s", double), *each(TRUTH_POSITION, double),
             *each((*TRUTH_VELOCITY, *TRUTH_ATTITUDE, *RATE, *TRUTH_CURRENT), single)]  # fmt: skip
    missing = [*first, ("instrument", words), ("channel", words), ("time_s", double)]
    voyages += [*each(("faults", "draws", "actual"), text), *each([f"initial_{n}" for n in _START], doubles)]
    imu += [("faults", mask), *each(IMU_ERROR, single)]
    aids += [("faults", mask), ("fault_error", singles), ("sigma", singles), ("time_of_validity_s", double)]
    tables = {"voyages": voyages, "imu": imu, "aids": aids, "truth": truth, "missing": missing}
    return {name: pa.schema(columns) for name, columns in tables.items()}


def dictionaries(schema: pa.Schema) -> list[str]:
    """The columns with few values, which Parquet stores once each."""
    return [f.name for f in schema if f.name in ("voyage", "instrument", "channel", "interval_s", "faults")]


def byte_streams(schema: pa.Schema) -> list[str]:
    """The columns of other floating-point numbers: their bytes are stored apart, which makes the files smaller."""
    import pyarrow as pa

    found = []
    for field in schema:
        values = field.type.value_type if pa.types.is_list(field.type) else field.type
        if pa.types.is_floating(values) and field.name != "interval_s":
            found.append(f"{field.name}.list.element" if values is not field.type else field.name)
    return found
