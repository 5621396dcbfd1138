"""Reading a log, also one that was cut short."""

from bisect import bisect_right
from collections.abc import Iterable, Iterator
from operator import itemgetter
from pathlib import Path
from typing import Self

import numpy as np

from cosim.log.container import DETERMINISTIC
from cosim.log.contents import Contents
from messages import message_class
from messages.digest import Digest
from messages.history import History, history

_FOREVER = 1 << 64
_time = itemgetter(0)


class LogReader:
    """Reads one log, also one whose writer was killed; a context manager.

    Attributes:
        metadata: of the record `lapwing`; empty in other tools' logs.
        attachments: file name to contents.
        complete: False if the file has no end (its writer was killed); it then ends with its last whole chunk.

    Raises:
        ValueError: the file is missing or no MCAP file; from `messages` and `digest`, also if a chunk is damaged.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        try:
            self._file = open(self.path, "rb")  # noqa: SIM115 (closed in close)
        except OSError as fault:
            raise ValueError(f"{self.path}: cannot read the log: {fault.strerror}") from None
        try:
            self._contents = Contents(self.path, self._file)
        except BaseException:
            self._file.close()
            raise
        self.metadata = self._contents.metadata
        self.attachments = self._contents.attachments
        self.complete = self._contents.complete

    def topics(self) -> dict[str, str]:
        """Full type name of each topic, in order of the topics' names."""
        channels = sorted(self._contents.channels.values(), key=lambda channel: channel.topic)
        return {channel.topic: self._contents.schemas[channel.schema_id] for channel in channels}

    def messages(
        self, topics: Iterable[str] | None = None, start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[tuple[str, str, int, bytes]]:
        """Messages in order of time, and of writing within the same time.

        Args:
            topics: only these; None: all.
            start_ns: the first instant [ns]; None: the log's.
            end_ns: the first instant left out [ns]; None: to the end.

        Yields:
            topic, full type name, simulation time [ns], payload.

        Raises:
            ValueError: the log has no such topic, or a chunk is damaged.
        """
        labels = self._labels(topics)
        first, last = start_ns or 0, _FOREVER if end_ns is None else end_ns
        chunks = [c for c in self._contents.chunks if c.end_ns >= first and c.start_ns < last and c.may_hold(labels)]
        horizons = [_FOREVER]  # earliest time in all the chunks that follow
        for chunk in reversed(chunks[1:]):
            horizons.append(min(horizons[-1], chunk.start_ns))
        waiting: list[tuple[int, int, bytes]] = []
        for chunk in chunks:
            waiting += (m for m in self._contents.read_chunk(chunk.offset, labels) if first <= m[0] < last)
            waiting.sort(key=_time)  # stable: equal times keep the order of writing
            ready = bisect_right(waiting, horizons.pop(), key=_time)
            for time_ns, channel_id, payload in waiting[:ready]:
                yield *labels[channel_id], time_ns, payload
            del waiting[:ready]

    def history(self, topic: str) -> tuple[np.ndarray, History]:
        """A whole topic as columns.

        Returns:
            simulation times [ns], int64, shape (n,), in order; the messages' columns by dotted field name.

        Raises:
            ValueError: the log has no such topic, its type is not one of ours, or a chunk or message is damaged.
        """
        return self.histories([topic])[topic]

    def histories(self, topics: Iterable[str] | None = None) -> dict[str, tuple[np.ndarray, History]]:
        """The same of several topics (None: all), reading the file only once.

        Raises:
            ValueError: as `history`.
        """
        labels = self._labels(topics)
        classes = {topic: message_class(type_name) for topic, type_name in labels.values()}
        times: dict[str, list[int]] = {topic: [] for topic in classes}
        payloads: dict[str, list[bytes]] = {topic: [] for topic in classes}
        for topic, _, time_ns, payload in self.messages(list(classes)):
            times[topic].append(time_ns)
            payloads[topic].append(payload)
        return {
            topic: (np.array(times[topic], np.int64), history(classes[topic], payloads[topic])) for topic in classes
        }

    def deterministic_topics(self) -> set[str]:
        """The topics that enter the digest."""
        return {c.topic for c in self._contents.channels.values() if c.metadata.get(DETERMINISTIC) != "false"}

    def digest(self) -> str:
        """Digest of the deterministic messages, computed anew; equals `metadata["digest"]` of an intact log."""
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
        """Topic and type of the channels of these topics, None: of all."""
        names = self.topics()
        wanted = set(names if topics is None else topics)
        if wanted - set(names):
            missing = ", ".join(sorted(wanted - set(names)))
            raise ValueError(f"{self.path}: the log has no topic {missing}; it has {', '.join(names)}")
        return {i: (c.topic, names[c.topic]) for i, c in self._contents.channels.items() if c.topic in wanted}
