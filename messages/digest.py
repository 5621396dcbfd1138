"""One number for everything deterministic that a run published: equal digests mean equal bits."""

import hashlib
import struct

_ENTRY = struct.Struct("<qQ")  # time [ns], payload length
_FOLD = 4096  # parts kept per topic before they are hashed: one long update is cheaper than many short ones


class Digest:
    """Running BLAKE2b hash per topic over (time, length, payload), joined over the topics in order of their names.

    The order of messages within a topic counts; how topics interleave does not, since it differs between processes.
    """

    def __init__(self) -> None:
        self._parts: dict[str, list[bytes]] = {}
        self._hashes: dict[str, hashlib.blake2b] = {}

    def update(self, topic: str, time_ns: int, payload: bytes) -> None:
        """Add one message of a topic."""
        parts = self._parts.get(topic)
        if parts is None:
            parts = self._parts[topic] = []
            self._hashes[topic] = hashlib.blake2b(digest_size=32)
        parts += (_ENTRY.pack(time_ns, len(payload)), payload)
        if len(parts) >= _FOLD:
            self._fold(topic)

    def hexdigest(self) -> str:
        """The digest so far: 32 hexadecimal digits."""
        total = hashlib.blake2b(digest_size=16)
        for topic in sorted(self._hashes):
            self._fold(topic)
            name = topic.encode()
            total.update(len(name).to_bytes(4, "little") + name + self._hashes[topic].digest())
        return total.hexdigest()

    def _fold(self, topic: str) -> None:
        self._hashes[topic].update(b"".join(self._parts[topic]))
        self._parts[topic].clear()
