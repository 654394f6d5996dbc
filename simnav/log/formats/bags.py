"""Bags of ROS 1 and ROS 2, and MCAP files: the messages of one topic as a table (an extra: rosbags, mcap).

``sentence`` of a channel, or ``options = { topic = "/imu" }`` of the file, names the topic. Columns are the numbers in
a message, by their path: ``linear_acceleration.x``, ``position_covariance_1``. Times are those at which messages were
recorded (``clock = "logger"``) or those in their header (``clock = "sentence"``).
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from simnav.log.files import FileSpec
from simnav.log.formats.unfinished_mcap import messages_in_order, summary_of
from simnav.log.growing import GrowingTable
from simnav.log.kept import kept
from simnav.log.reader import Rows, register_reader
from simnav.log.table import LogError, Table
from simnav.spec import closest
from simnav.watchers import tell

__all__ = ["topics_of"]

#: Longer arrays in a message (images, point clouds) are left out.
_LONGEST = 64
_DEEPEST = 8
#: After so many messages it is told how far the file has been read.
_TOLD = 2000


@register_reader("rosbag", title="a bag")
def read_bag(path: Path, file: FileSpec, sentence: str | None, talker: str | None) -> Rows:
    """See the module."""
    return _rows(path, file, sentence, "rosbag")


@register_reader("mcap", title="an MCAP file")
def read_mcap(path: Path, file: FileSpec, sentence: str | None, talker: str | None) -> Rows:
    """See the module."""
    return _rows(path, file, sentence, "mcap")


def _rows(path: Path, file: FileSpec, sentence: str | None, form: str) -> Rows:
    topic = sentence or file.options.get("topic")
    if form == "mcap" and path.is_dir():
        raise LogError(f"{path}: it is a folder; a bag of ROS 2 in a folder is read with format = 'rosbag'")
    table = _table(path, form, None if topic is None else str(topic))
    clock = "header" if file.clock == "sentence" else "recorded"
    if clock not in table.columns:
        raise LogError(f"{table.source}: its messages have no stamp in a header; say clock = 'logger'")
    return Rows(table, table.column(clock)[1], clock)


@kept(16, folders=True)
def _table(path: Path, form: str, topic: str | None) -> Table:
    messages = _mcap(path, topic) if form == "mcap" else _bag(path, topic)
    rows = GrowingTable()
    try:
        for stamp, message in messages:
            row: dict[str, float] = {"recorded": 1e-9 * stamp, **dict(_numbers("", message, 0))}
            if "header.stamp.sec" in row:
                row["header"] = row["header.stamp.sec"] + 1e-9 * row.get("header.stamp.nanosec", 0.0)
            elif "timestamp.sec" in row:
                row["header"] = row["timestamp.sec"] + 1e-9 * row.get("timestamp.nsec", 0.0)
            elif "timestamp.seconds" in row:
                row["header"] = row["timestamp.seconds"] + 1e-9 * row.get("timestamp.nanos", 0.0)
            rows.add(row, len(rows) + 1)
    except (LogError, FileNotFoundError):
        raise
    except (MemoryError, Exception) as error:
        text = " ".join(str(error).split())[:100]
        raise LogError(
            f"{path}: message {len(rows) + 1} cannot be read ({type(error).__name__}: {text or 'no more is known'}); "
            "the file is damaged or cut off"
        ) from None
    if not rows:
        raise LogError(f"{path}: the topic {topic!r} has no messages")
    return rows.table(f"{path} ({topic})")


def topics_of(path: Path, form: str) -> list[str]:
    """The topics of a file of the format ``rosbag`` or ``mcap``.

    Raises
    ------
    LogError
        If it cannot be read.
    """
    try:
        if form == "mcap":
            import mcap.reader  # noqa: F401  # that it is missing is told below

            return _topics(path, summary_of(path))
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore

        with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
            return sorted({c.topic for c in reader.connections})
    except ImportError as error:
        raise LogError(
            f"{path}: needs the library {(error.name or '').partition('.')[0]}: pip install 'simnav[logs]'"
        ) from None
    except LogError:
        raise
    except Exception as error:
        if "index looks damaged" in str(error):
            raise LogError(
                f"{path}: the bag has no whole index, since its recorder did not end well; repair it by 'rosbag "
                "reindex' of ROS"
            ) from None
        raise LogError(f"{path}: its topics cannot be read ({' '.join(str(error).split())[:100]})") from None


def _topics(path: Path, summary: Any) -> list[str]:
    if summary is None:
        return sorted({channel.topic for _, channel, _ in messages_in_order(path)})
    return sorted({c.topic for c in summary.channels.values()})


def _choose(path: Path, topic: str | None, topics: list[str]) -> str:
    if topic is None:
        raise LogError(f"{path}: say which topic (sentence); there are: {', '.join(sorted(topics)) or 'none'}")
    if topic not in topics:
        raise LogError(f"{path}: there is no topic {topic!r}{closest(topic, topics)}")
    return topic


def _bag(path: Path, topic: str | None) -> Iterator[tuple[int, Any]]:
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise LogError(f"{path}: format = 'rosbag' needs the library rosbags: pip install 'simnav[logs]'") from None
    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        chosen = _choose(path, topic, sorted({c.topic for c in reader.connections}))
        connections = [c for c in reader.connections if c.topic == chosen]
        total = sum(c.msgcount for c in connections)
        for number, (connection, stamp, raw) in enumerate(reader.messages(connections=connections), 1):
            if number % _TOLD == 0:
                tell(path, number, total)
            yield stamp, reader.deserialize(raw, connection.msgtype)


def _mcap(path: Path, topic: str | None) -> Iterator[tuple[int, Any]]:
    try:
        from mcap.reader import make_reader
    except ImportError:
        raise LogError(f"{path}: format = 'mcap' needs the library mcap: pip install 'simnav[logs]'") from None
    decode: dict[int, Any] = {}
    summary = summary_of(path)
    chosen, total = _choose(path, topic, _topics(path, summary)), 0
    messages: Iterator[tuple[Any, Any, Any]]
    with open(path, "rb") as stream:
        if summary is None:
            messages = (m for m in messages_in_order(path) if m[1].topic == chosen)
        else:
            counts = summary.statistics.channel_message_counts if summary.statistics else {}
            total = sum(counts.get(c.id, 0) for c in summary.channels.values() if c.topic == chosen)
            messages = make_reader(stream).iter_messages(topics=[chosen])
        for number, (schema, channel, message) in enumerate(messages, 1):
            if total and number % _TOLD == 0:
                tell(path, number, total)
            if channel.id not in decode:
                decode[channel.id] = _decoder(path, channel, schema)
            yield message.log_time, decode[channel.id](message.data)


def _decoder(path: Path, channel: Any, schema: Any) -> Any:
    """A function from the bytes of a message to an object, for the encodings that are known."""
    if channel.message_encoding == "json":
        return json.loads
    if channel.message_encoding == "cdr" and schema is not None and schema.encoding == "ros2msg":
        try:
            from rosbags.typesys import Stores, get_types_from_msg, get_typestore
        except ImportError:
            raise LogError(f"{path}: messages of ROS 2 need the library rosbags: pip install 'simnav[logs]'") from None
        store = get_typestore(Stores.ROS2_HUMBLE)
        name = schema.name if schema.name.count("/") == 2 else schema.name.replace("/", "/msg/")
        if name not in store.types:
            text = schema.data.decode().split("=" * 80)[0]
            store.register(get_types_from_msg(text, name))
        return lambda raw: store.deserialize_cdr(raw, name)
    if channel.message_encoding == "protobuf" and schema is not None and schema.encoding == "protobuf":
        return _of_protobuf(path, schema)
    raise LogError(
        f"{path}: messages of the topic {channel.topic!r} are encoded as {channel.message_encoding!r}; read are "
        "'json', 'cdr' (ROS 2) and 'protobuf'"
    )


def _of_protobuf(path: Path, schema: Any) -> Callable[[bytes], dict[str, Any]]:
    """A function from the bytes of a message to its fields; the schema is a set of file descriptors."""
    try:
        from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
    except ImportError:
        raise LogError(f"{path}: messages of protobuf need the library protobuf: pip install 'simnav[logs]'") from None
    pool = descriptor_pool.DescriptorPool()
    for file in descriptor_pb2.FileDescriptorSet.FromString(schema.data).file:
        pool.Add(file)
    made = message_factory.GetMessageClass(pool.FindMessageTypeByName(schema.name))
    return lambda raw: _fields(made.FromString(raw))


def _fields(message: Any) -> dict[str, Any]:
    """The fields of a message of protobuf, those with default values too; text and bytes stay as they are."""
    found: dict[str, Any] = {}
    for field in message.DESCRIPTOR.fields:
        value = getattr(message, field.name)
        repeated = isinstance(value, Sequence) and not isinstance(value, (str, bytes))
        if field.message_type is None:
            found[field.name] = list(value) if repeated else value
        elif hasattr(value, "DESCRIPTOR"):
            found[field.name] = _fields(value) if message.HasField(field.name) else {}
        elif hasattr(value, "__len__") and len(value) <= _LONGEST:
            found[field.name] = [_fields(one) if hasattr(one, "DESCRIPTOR") else one for one in value]
    return found


def _numbers(name: str, value: Any, depth: int) -> Iterator[tuple[str, float]]:
    """The numbers in a message, with their paths."""
    if isinstance(value, (bool, int, float, np.number)):
        yield name, float(value)
    elif isinstance(value, (np.ndarray, list, tuple)):
        if len(value) <= _LONGEST and depth < _DEEPEST:
            for i, inner in enumerate(value):
                yield from _numbers(f"{name}_{i + 1}", inner, depth + 1)
    elif depth < _DEEPEST:
        fields = value if isinstance(value, dict) else getattr(value, "__dict__", {})
        for key, inner in fields.items():
            if not str(key).startswith("__"):
                yield from _numbers(f"{name}.{key}" if name else str(key), inner, depth + 1)
