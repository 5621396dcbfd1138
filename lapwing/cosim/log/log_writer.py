"""Writer of a log: single messages, or record batches."""

import time
from collections.abc import Callable, Iterable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from pathlib import Path
from typing import Any, Self

import numpy as np
from mcap.records import Channel, Schema

from lapwing.cosim.log.chunk import Rows, WrittenTopic, add_to_digest, arrange, rows, rows_of
from lapwing.cosim.log.mcap_writer import DETERMINISTIC, METADATA, METADATA_END, Container
from lapwing.cosim.output_lock import open_locked
from lapwing.messages import message_class
from lapwing.messages.digest import Digest

CHUNK_SIZE = 512 * 1024  # [bytes] limit of single messages in a chunk
FLUSH_PERIOD = 0.5  # [s] of wall time

Part = tuple[str, Any, np.ndarray, np.ndarray, np.ndarray]
"""Messages of a batch: topic, message class, times [ns] (n,), payloads (n, size) uint8 or (n,) records, order (n,)."""


class LogWriter:
    """Writer of one log; a context manager. A separate thread hashes, arranges, compresses and writes chunks.

    Record batches and single messages may be mixed; they are written in the order of the calls. Every batch is a chunk;
    single messages are collected into chunks of at most `CHUNK_SIZE` and 0.5 s of wall time. The same batches,
    attachments and metadata give the same bytes with the same version of zstd; wall time only determines which single
    messages share a chunk.

    Args:
        path: file to write; an existing file is replaced.
        metadata: content of the record `lapwing` at the start. Keys that are added to the attribute `metadata` later,
            and the key `digest`, are written into the record `lapwing_end`.
        attachments: contents by file name.
        on_wait: called twice a second while a chunk waits until the previous one is written.

    Raises:
        ValueError: another process is writing the file, or it cannot be written (then also from `write`,
            `write_batch`, `flush` and `close`).
    """

    def __init__(
        self,
        path: str | Path,
        metadata: dict[str, str],
        attachments: dict[str, bytes],
        on_wait: Callable[[], None] = lambda: None,
    ) -> None:
        self.path = Path(path)
        self.metadata = dict(metadata)
        self._about = dict(metadata)
        self._on_wait = on_wait
        self._failed = False  # a chunk could not be written
        self.waited = 0.0  # [s] for previous chunks to be written
        self._digest = Digest()
        self._topics: dict[str, WrittenTopic] = {}
        self._schemas: dict[str, int] = {}
        self._declarations: list[Schema | Channel] = []  # not in a chunk yet
        self._entries: list[tuple[WrittenTopic, int, bytes]] = []
        self._size = 0
        self._pending: Future | None = None
        try:
            self._file = open_locked(self.path)
        except OSError as error:
            raise self._error(error) from None
        try:
            self._container = Container(self._file)
            self._container.add_metadata(METADATA, self.metadata)
            for name, data in attachments.items():
                self._container.add_attachment(name, data)
        except OSError as error:
            self._file.close()
            raise self._error(error) from None
        self._worker = ThreadPoolExecutor(max_workers=1, thread_name_prefix="log")
        self._due = time.monotonic()  # the first message gets its own chunk: even a short log is readable

    def write(self, topic: str, message: Any, payload: bytes, time_ns: int, deterministic: bool = True) -> None:
        """Record one message.

        Args:
            topic: "/drone1/imu".
            message: message class, or full name of the type.
            payload: the encoded message.
            time_ns: simulation time [ns], not negative.
            deterministic: True to include it in the digest.

        Raises:
            ValueError: the time is negative, or the log cannot be written.
        """
        if time_ns < 0:
            raise ValueError(f"{topic}: time {time_ns} ns is negative")
        written = self._topics.get(topic) or self._declare(topic, message, deterministic)
        self._entries.append((written, time_ns, payload))
        self._size += len(payload)
        if self._size >= CHUNK_SIZE or time.monotonic() >= self._due:
            self._cut()

    def write_batch(self, parts: Iterable[Part]) -> None:
        """Record messages of the digest as one chunk, in ascending order over all parts.

        A topic has several parts if its messages differ in size; for equal orders, the earlier part is first. The
        arrays may be reused after the call. If the process is killed, the messages since the last call are lost.

        Raises:
            ValueError: arrays of different lengths, payloads of another type, shape or layout, or a negative time.
        """
        self._cut()
        if batch := [part for part in (self._rows(*part) for part in parts) if len(part.order)]:
            self._submit(lambda declarations: self._write_chunk(declarations, batch))

    def flush(self) -> None:
        """Write all recorded messages to the file. `write` does it every 0.5 s; call this if no message follows."""
        if self._failed:
            return
        self._cut()
        self._wait()

    @property
    def digest(self) -> str:
        """BLAKE2b digest of the deterministic messages so far, hexadecimal."""
        self.flush()
        return self._digest.hexdigest()

    def close(self) -> None:
        """Write the remaining messages, the metadata with the digest, and the summary; close the file.

        If a chunk could not be written, the file ends after the last complete chunk.

        Raises:
            ValueError: the log cannot be written.
        """
        if self._file.closed:
            return
        try:
            self.flush()
        finally:
            try:
                self._end()
            except OSError as error:
                if not self._failed:
                    raise self._error(error) from None
            finally:
                self._worker.shutdown()
                self._container.close()
                self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _end(self) -> None:
        self.metadata["digest"] = self._digest.hexdigest()
        added = {key: value for key, value in self.metadata.items() if key not in self._about}
        self._container.add_metadata(METADATA_END, added)
        self._container.finish()

    def _declare(self, topic: str, message: Any, deterministic: bool) -> WrittenTopic:
        """Create the channel of a topic, which the next chunk declares."""
        cls = message_class(message) if isinstance(message, str) else message
        if cls.type_name not in self._schemas:
            schema_id = self._schemas[cls.type_name] = len(self._schemas) + 1
            self._declarations.append(
                Schema(data=cls.schema_text.encode(), encoding="ros2msg", id=schema_id, name=cls.type_name)
            )
        written = self._topics[topic] = WrittenTopic(topic, len(self._topics) + 1, deterministic)
        self._declarations.append(
            Channel(
                id=written.channel_id,
                topic=topic,
                message_encoding="cdr",
                metadata={DETERMINISTIC: "true" if deterministic else "false"},
                schema_id=self._schemas[cls.type_name],
            )
        )
        return written

    def _rows(self, topic: str, message: Any, times_ns: np.ndarray, payloads: np.ndarray, order: np.ndarray) -> Rows:
        if payloads.ndim == 1 and payloads.dtype.names is not None:
            size = payloads.dtype.itemsize
            payloads = np.ascontiguousarray(payloads.view(f"V{size}")).view(np.uint8).reshape(len(payloads), size)
        if payloads.ndim != 2 or payloads.dtype != np.uint8:
            raise ValueError(
                f"{topic}: payloads are {payloads.dtype} {payloads.shape}, expected uint8 (n, size) or records (n,)"
            )
        if not times_ns.shape == order.shape == payloads.shape[:1]:
            raise ValueError(f"{topic}: {len(payloads)} payloads, times {times_ns.shape}, order {order.shape}")
        if (times_ns < 0).any():
            raise ValueError(f"{topic}: time {times_ns.min()} ns is negative")
        if len(payloads):
            message.layouts.measure(payloads[0].tobytes())  # rejects other layouts
        written = self._topics.get(topic) or self._declare(topic, message, True)
        return rows(written, times_ns, payloads, np.array(order, np.int64))

    def _cut(self) -> None:
        """Write the single messages as a chunk."""
        entries, self._entries, self._size = self._entries, [], 0
        self._due = time.monotonic() + FLUSH_PERIOD
        if entries:
            self._submit(lambda declarations: self._write_chunk(declarations, rows_of(entries)))

    def _submit(self, job: Callable[[list[Schema | Channel]], None]) -> None:
        """Submit a chunk to the worker after the previous one is written."""
        if self._failed:
            raise ValueError(f"{self.path}: {self.metadata['failure']}")
        declarations, self._declarations = self._declarations, []
        self._wait()
        self._pending = self._worker.submit(job, declarations)

    def _wait(self) -> None:
        pending, self._pending = self._pending, None
        if pending is not None:
            started = time.perf_counter()
            try:
                while not wait([pending], FLUSH_PERIOD).done:
                    self._on_wait()
                pending.result()
            except OSError as error:
                self._failed = True
                self.metadata["failure"] = _failure(error)
                raise self._error(error) from None
            self.waited += time.perf_counter() - started

    def _write_chunk(self, declarations: list[Schema | Channel], parts: list[Rows]) -> None:
        self._container.add_chunk(declarations, arrange(parts))
        add_to_digest(self._digest, parts)

    def _error(self, error: OSError) -> ValueError:
        return ValueError(f"{self.path}: {_failure(error)}")


def _failure(error: OSError) -> str:
    return f"cannot write the log: {error.strerror or error}"
