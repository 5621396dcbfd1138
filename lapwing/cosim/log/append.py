"""Addition of a topic to a complete log, after its other messages."""

import struct
from collections.abc import Sequence
from contextlib import closing, suppress
from io import FileIO
from pathlib import Path
from typing import Any

from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.records import Channel, Schema
from mcap.summary import Summary
from mcap.writer import MCAP0_MAGIC

from lapwing.cosim.log.chunk import WrittenTopic, arrange, rows_of
from lapwing.cosim.log.mcap_writer import DETERMINISTIC, Container
from lapwing.cosim.output_lock import lock_descriptor

_FOOTER = struct.Struct("<BQQQI")  # opcode, length, start of the summary, start of its offsets, checksum
_DATA_END = 13  # [bytes] size of the record before the summary


def append(path: Path, topic: str, message: Any, messages: Sequence[tuple[int, bytes]]) -> None:
    """Add a topic that is not part of the digest. If the log cannot be written, it stays unchanged.

    Args:
        path: path of the log.
        topic: name of a topic that the log does not have.
        message: message class.
        messages: time [ns] and payload of each message, in order.

    Raises:
        ValueError: the log is incomplete, has the topic, or cannot be written.
    """
    if not messages:
        return
    try:
        with path.open("rb") as file:
            summary = make_reader(file).get_summary()
        with path.open("r+b", buffering=0) as file:
            lock_descriptor(file.fileno(), path)
            _append(path, file, summary, topic, message, messages)
    except (McapError, struct.error) as fault:
        raise ValueError(f"{path}: is incomplete, no topic can be added: {fault}") from None
    except OSError as fault:
        raise ValueError(f"{path}: cannot write the log: {fault.strerror or fault}") from None


def _append(
    path: Path, file: FileIO, summary: Summary | None, topic: str, message: Any, messages: Sequence[tuple[int, bytes]]
) -> None:
    file.seek(-(_FOOTER.size + len(MCAP0_MAGIC)), 2)
    start = _FOOTER.unpack(file.read(_FOOTER.size))[2] - _DATA_END
    if summary is None or start < 0:
        raise ValueError(f"{path}: is incomplete, no topic can be added")
    if any(channel.topic == topic for channel in summary.channels.values()):
        raise ValueError(f"{path}: already has a topic {topic}")
    file.seek(start)
    before = file.read()
    known = {schema.name: schema.id for schema in summary.schemas.values()}
    new = message.type_name not in known
    schema_id = max(known.values(), default=0) + 1 if new else known[message.type_name]
    channel_id = max(summary.channels, default=0) + 1
    schema = Schema(data=message.schema_text.encode(), encoding="ros2msg", id=schema_id, name=message.type_name)
    marked = {DETERMINISTIC: "false"}
    channel = Channel(id=channel_id, topic=topic, message_encoding="cdr", metadata=marked, schema_id=schema_id)
    written = WrittenTopic(topic, channel_id, False)
    chunk = arrange(rows_of([(written, time_ns, payload) for time_ns, payload in messages]))
    try:
        with closing(Container.resume(file, summary, start)) as container:
            container.add_chunk([schema, channel] if new else [channel], chunk)
            container.finish()
    except OSError:
        with suppress(OSError):
            file.seek(start)
            file.write(before)
            file.truncate()
        raise
