"""Reader of logs, including truncated ones and those of other versions, whose message types it compares."""

from bisect import bisect_left
from collections.abc import Iterable, Iterator
from operator import attrgetter, itemgetter
from pathlib import Path
from typing import Self

import numpy as np

from lapwing.cosim.config.provenance import package_version
from lapwing.cosim.log.mcap_contents import Contents
from lapwing.cosim.log.mcap_writer import DETERMINISTIC
from lapwing.dynamics.input_file import check_regular, unreadable
from lapwing.messages import message_class
from lapwing.messages.digest import Digest
from lapwing.messages.parse import PRIMITIVES, Definition, parse
from lapwing.messages.topic_columns import ColumnBuilder, TopicColumns
from lapwing.messages.types import DEFINITIONS, TYPES

_BAR = "=" * 80  # between the types of a schema, as in ROS 2
_HEAD = "MSG: "


def first_type_difference(type_name: str, text: str) -> str:
    """Return the first difference between a recorded and the current definition as text; "" if both are compatible.

    Comments, constants and defaults are not part of a message. An unknown type has no difference.

    Args:
        type_name: full name, "sensor_msgs/msg/Imu".
        text: recorded definition, in the schema encoding `ros2msg`.
    """
    if type_name not in TYPES or not text.strip() or text == TYPES[type_name].schema_text:
        return ""
    try:
        recorded = _fields(type_name, _definitions(type_name, text))
    except (ValueError, LookupError):
        return "has a definition that cannot be read"
    current = _fields(type_name, DEFINITIONS)
    for current_field, recorded_field in zip([*current, ("", "")], [*recorded, ("", "")], strict=False):
        if current_field != recorded_field:
            expected, result = (
                " ".join(field).strip() or "no more fields" for field in (current_field, recorded_field)
            )
            return f"has {result} where this version has {expected}"
    return ""


def _definitions(type_name: str, text: str) -> dict[str, Definition]:
    """Return the types of a schema by full name."""
    result = {}
    for k, part in enumerate(text.replace("\r", "").split(f"{_BAR}\n")):
        name, content = type_name, part
        if k:
            head, _, content = part.partition("\n")
            package, _, short = head.removeprefix(_HEAD).strip().partition("/")
            name = f"{package}/msg/{short.removeprefix('msg/')}"
        result[name] = parse(name, content)
    return result


def _fields(type_name: str, definitions: dict[str, Definition], prefix: str = "") -> list[tuple[str, str]]:
    """Return type and dotted name of all leaf fields of a type; types with equal layouts count as one."""
    result = []
    for field in definitions[type_name].fields:
        array = "" if field.length is None else f"[{field.length or ''}]"
        if field.nested:
            result += _fields(field.base, definitions, f"{prefix}{field.name}{array}.")
        else:
            result.append((_NAMES.get(PRIMITIVES.get(field.base, ""), field.base) + array, f"{prefix}{field.name}"))
    return result


_NAMES = {layout: name for name, layout in PRIMITIVES.items() if name not in ("byte", "char")}


_FOREVER = 1 << 64
_time, _place = itemgetter(0), itemgetter(0, 1)


class LogReader:
    """Reader of one log, which may be truncated; a context manager.

    Attributes:
        metadata: content of the records `lapwing` and `lapwing_end`; empty for logs of other tools.
        attachments: contents by file name.
        complete: False if the file has no end (its writer was killed); it then ends with its last complete chunk.
        damaged: a line for each damaged chunk; with `skip_damaged` only.

    Raises:
        ValueError: the file is missing or not an MCAP file; from `messages` and `digest`, also if a chunk is damaged.
    """

    def __init__(self, path: str | Path, skip_damaged: bool = False) -> None:
        self.path = Path(path)
        try:
            check_regular(self.path)
            self._file = open(self.path, "rb")  # noqa: SIM115 (closed in close)
        except IsADirectoryError:
            raise ValueError(f"{self.path}: is a folder; expected a log (MCAP)") from None
        except OSError as error:
            raise unreadable(self.path, error, "a log of a flight (.mcap)") from None
        try:
            self._contents = Contents(self.path, self._file, skip_damaged)
        except BaseException:
            self._file.close()
            raise
        self.metadata, self.attachments = self._contents.metadata, self._contents.attachments
        self.complete, self.damaged = self._contents.complete, self._contents.damaged

    def topics(self) -> dict[str, str]:
        """Return the full type name of each topic, sorted by topic."""
        channels = sorted(self._contents.channels.values(), key=lambda channel: channel.topic)
        return {channel.topic: self._contents.schemas[channel.schema_id] for channel in channels}

    def check_topics(self, topics: Iterable[str] | None) -> set[str]:
        """Return the named topics; all for None.

        Raises:
            ValueError: the log has no such topic; names its topics.
        """
        names = self.topics()
        requested = set(names if topics is None else topics)
        if requested - set(names):
            missing = ", ".join(sorted(requested - set(names)))
            raise ValueError(f"{self.path}: the log has no topic {missing}; it has {', '.join(names)}")
        return requested

    def incompatible_types(self, topics: Iterable[str] | None = None) -> dict[str, str]:
        """Return the first difference of each topic's type from this version's, by topic; empty if there is none."""
        labels, channels = self._labels(topics), self._contents.channels
        texts = {topic: self._contents.definitions.get(channels[i].schema_id, "") for i, (topic, _) in labels.items()}
        result = {topic: first_type_difference(kind, texts[topic]) for topic, kind in labels.values()}
        return {
            topic: f"{dict(labels.values())[topic]} {difference}" for topic, difference in result.items() if difference
        }

    @property
    def versions(self) -> str:
        """Text that names this version and the version that wrote the log."""
        wrote = self.metadata.get("version")
        return f"Lapwing {package_version()}, got one of {f'Lapwing {wrote}' if wrote else 'another program'}"

    def check_versions(self, topics: Iterable[str] | None = None) -> None:
        """Raise ValueError if this version would read messages of these topics (None: any) wrongly.

        The message names the first topic, the difference of its type, and both versions.
        """
        for topic, difference in self.incompatible_types(topics).items():
            raise ValueError(f"{self.path}: {topic}: {difference}; expected a log of this version, {self.versions}")

    def messages(
        self, topics: Iterable[str] | None = None, start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[tuple[str, str, int, bytes]]:
        """Yield messages in order of time, and in order of writing within equal times.

        Args:
            topics: topics to read; None for all.
            start_ns: start time [ns]; None for that of the log.
            end_ns: end time (exclusive) [ns]; None for that of the log.

        Yields:
            topic, full type name, simulation time [ns], payload.

        Raises:
            ValueError: the log has no such topic, or a chunk is damaged.
        """
        labels = self._labels(topics)
        first, last = start_ns or 0, _FOREVER if end_ns is None else end_ns
        chunks = [c for c in self._contents.chunks if c.end_ns >= first and c.start_ns < last and c.may_hold(labels)]
        chunks.sort(key=attrgetter("start_ns"))
        horizons = [*(chunk.start_ns for chunk in chunks[1:]), _FOREVER][: len(chunks)]
        waiting: list[tuple[int, int, int, bytes]] = []  # time, offset of the chunk, channel, payload
        for chunk, horizon in zip(chunks, horizons, strict=True):
            for time_ns, channel, payload in self._contents.read_chunk(chunk.offset, labels):
                if first <= time_ns < last:
                    waiting.append((time_ns, chunk.offset, channel, payload))
            waiting.sort(key=_place)  # stable: equal times keep the order of writing
            ready = bisect_left(waiting, horizon, key=_time)
            for time_ns, _, channel, payload in waiting[:ready]:
                yield *labels[channel], time_ns, payload
            del waiting[:ready]

    def history(self, topic: str) -> tuple[np.ndarray, TopicColumns]:
        """Return all messages of a topic as columns.

        Returns:
            simulation times [ns], int64, shape (n,), in order; the messages' columns by dotted field name.

        Raises:
            ValueError: the log has no such topic, its type is unknown or of another version, or a chunk or message is
                damaged.
        """
        return self.histories([topic])[topic]

    def histories(self, topics: Iterable[str] | None = None) -> dict[str, tuple[np.ndarray, TopicColumns]]:
        """Return the columns of several topics (None: all), reading the file once. See `history` for the values.

        Raises:
            ValueError: see `history`.
        """
        labels = self._labels(topics)
        self.check_versions(topics)
        classes = {topic: message_class(type_name) for topic, type_name in labels.values()}
        builders = {topic: ColumnBuilder(message) for topic, message in classes.items()}
        for topic, _, time_ns, payload in self.messages(list(classes)):
            builders[topic].add(time_ns, payload)
        return {topic: builder.history() for topic, builder in builders.items()}

    def deterministic_topics(self) -> set[str]:
        """Return the topics that are part of the digest."""
        return {c.topic for c in self._contents.channels.values() if c.metadata.get(DETERMINISTIC) != "false"}

    def digest(self) -> str:
        """Compute the digest of the deterministic messages; that of an intact log equals `metadata["digest"]`."""
        digest = Digest()
        for topic, _, time_ns, payload in self.messages(self.deterministic_topics()):
            digest.update(topic, time_ns, payload)
        return digest.hexdigest()

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _labels(self, topics: Iterable[str] | None) -> dict[int, tuple[str, str]]:
        """Return topic and type of each channel of these topics (None: all)."""
        names, requested = self.topics(), self.check_topics(topics)
        return {i: (c.topic, names[c.topic]) for i, c in self._contents.channels.items() if c.topic in requested}
