"""Changes of logs: addition of a topic to a complete log, recovery of a damaged one."""

import struct
from collections.abc import Sequence
from contextlib import closing, suppress
from io import FileIO
from pathlib import Path
from typing import Any, NamedTuple

from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.records import Channel, Schema
from mcap.summary import Summary
from mcap.writer import MCAP0_MAGIC

from lapwing.cosim.log.chunk import WrittenTopic, arrange, rows_of
from lapwing.cosim.log.log_reader import LogReader
from lapwing.cosim.log.log_writer import LogWriter
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


RECOVERED = "recovered"  # key in the metadata: the original file, and its defects


class RecoveryResult(NamedTuple):
    """Messages that `recover` has saved from a damaged log."""

    messages: int
    end_ns: int  # time of the last message
    damaged: tuple[str, ...]  # a line for each chunk that was left out
    digest: str  # digest of the recovered messages


def recover(path: Path, out: Path) -> RecoveryResult:
    """Write all complete chunks of a log into a new log, with index, digest and end.

    Raises:
        ValueError: `path` is not an MCAP log, is undamaged, or has other message types, or `out` cannot be written.
    """
    with LogReader(path, skip_damaged=True) as log:
        if log.complete and not log.damaged:
            raise ValueError(f"{path}: is complete and undamaged; no recovery is needed")
        log.check_versions()
        defects = "; ".join([*log.damaged, *([] if log.complete else ["it has no end"])])
        metadata = {key: value for key, value in log.metadata.items() if key != "digest"}
        deterministic, count, end_ns = log.deterministic_topics(), 0, 0
        try:
            with LogWriter(out, metadata | {RECOVERED: f"{path.name}: {defects}"}, dict(log.attachments)) as writer:
                for topic, kind, time_ns, payload in log.messages():
                    writer.write(topic, kind, payload, time_ns, topic in deterministic)
                    count, end_ns = count + 1, time_ns
        except ValueError:
            out.unlink(missing_ok=True)
            raise
        return RecoveryResult(count, end_ns, log.damaged, writer.metadata["digest"])
