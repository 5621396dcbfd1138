"""Digest of all deterministic messages of a run: equal digests mean bit-for-bit equal messages."""

import hashlib
import struct

import numpy as np

_ENTRY = struct.Struct("<qQ")  # time [ns], payload length
_FOLD = 4096  # parts collected per topic before hashing: one long update is faster than many short ones


class Digest:
    """Running BLAKE2b hash per topic over (time, length, payload), joined over the topics in order of their names.

    The order of messages within a topic counts; that of different topics does not, since it differs between processes.
    """

    def __init__(self) -> None:
        self._parts: dict[str, list[bytes]] = {}
        self._hashes: dict[str, hashlib.blake2b] = {}

    def update(self, topic: str, time_ns: int, payload: bytes) -> None:
        """Add one message of a topic."""
        parts = self._parts.get(topic)
        if parts is None:
            parts = self._open(topic)
        parts += (_ENTRY.pack(time_ns, len(payload)), payload)
        if len(parts) >= _FOLD:
            self._fold(topic)

    def update_batch(self, topic: str, times_ns: np.ndarray, payloads: np.ndarray) -> None:
        """Add n messages of a topic that have the same size, as n calls of `update` do.

        Args:
            topic: name of the topic.
            times_ns: times [ns], int64, shape (n,).
            payloads: uint8, shape (n, size).

        Raises:
            ValueError: the numbers of times and payloads differ.
        """
        n, size = payloads.shape
        if len(times_ns) != n:
            raise ValueError(f"{topic}: {len(times_ns)} times for {n} payloads")
        if not n:
            return
        entries = np.empty((n, _ENTRY.size + size), np.uint8)
        entries[:, :8] = np.ascontiguousarray(times_ns, "<i8")[:, None].view(np.uint8)
        entries[:, 8:16] = np.frombuffer(size.to_bytes(8, "little"), np.uint8)
        entries[:, 16:] = payloads
        if topic in self._parts:
            self._fold(topic)
        else:
            self._open(topic)
        self._hashes[topic].update(entries.reshape(-1).data)

    def hexdigest(self) -> str:
        """Return the digest so far: 32 hexadecimal digits."""
        total = hashlib.blake2b(digest_size=16)
        for topic in sorted(self._hashes):
            self._fold(topic)
            name = topic.encode()
            total.update(len(name).to_bytes(4, "little") + name + self._hashes[topic].digest())
        return total.hexdigest()

    def _open(self, topic: str) -> list[bytes]:
        self._hashes[topic] = hashlib.blake2b(digest_size=32)
        parts: list[bytes] = []
        self._parts[topic] = parts
        return parts

    def _fold(self, topic: str) -> None:
        self._hashes[topic].update(b"".join(self._parts[topic]))
        self._parts[topic].clear()
