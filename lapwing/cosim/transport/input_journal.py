"""How a service that was killed takes its place again: it steps once more through all that it had been given.

A service is a pure function of what it is given. So its journal, a file that outlives its process, holds just that,
tick by tick, with a checksum of the bundle that it gave; the process that is started in its place reads it and is where
the other one was. What was on its way when a process was killed is lost on both sides: every service of such a run
holds its newest bundles, and whoever misses one asks for it.

A journal is a record for each tick: the tick (int64), the length of what follows (uint32), the CRC-32 of the bundle
(uint32), then all that was given: time [ns] (int64), length (uint32) and bytes of each.
"""

import os
import struct
import threading
from collections import deque
from collections.abc import Callable, Iterator
from typing import NamedTuple
from zlib import crc32

from lapwing.cosim.run_errors import LockStepError

REPLY = 1 << 20  # [bytes] of bundles that are given again at once
NOTHING = (-1, b"")  # stands in a journal for a message that had not come

_TICK = struct.Struct("<qII")
_GIVEN = struct.Struct("<qI")

Given = tuple[int, bytes]
"""Time [ns] and payload of a message."""


class Journal:
    """All that a service has been given, tick by tick."""

    def __init__(self, name: str, descriptor: int):
        """Of the service `name`, in an open file that its launcher keeps."""
        self._name, self._file = name, descriptor
        self._given: list[bytes] = []  # of the present tick
        self._again: deque[Given] | None = None  # of the tick that is stepped again
        self._told = 0  # checksum of its bundle

    def take(self, get: Callable[[], Given]) -> Given:
        """What `get` gives; at a tick that is stepped again, what it gave then.

        Raises:
            LockStepError: the service asks for more than it did then.
        """
        if self._again is None:
            found = get()
            self._given += (_GIVEN.pack(found[0], len(found[1])), found[1])
            return found
        if not self._again:
            raise self._other("asks for something else")
        return self._again.popleft()

    def write(self, tick: int, bundle: bytes) -> None:
        """End a tick, before anybody hears of what came of it.

        Args:
            tick: that was stepped.
            bundle: that the service gives at it, empty where there is none.

        Raises:
            ValueError: the disk is full.
            LockStepError: it was stepped again, and another bundle came of it.
        """
        told = crc32(bundle)
        if self._again is not None:
            if self._again or told != self._told:
                raise self._other(f"gives something else at tick {tick}")
            return
        body = b"".join(self._given)
        self._given.clear()
        record = _TICK.pack(tick, len(body), told) + body
        try:
            while record:
                record = record[os.write(self._file, record) :]
        except OSError as error:
            raise ValueError(f"{self._name}: its journal cannot be written: {error.strerror}") from None

    def recall(self) -> Iterator[int]:
        """The ticks that were stepped before; until the next one is asked for, `take` gives what was given at it."""
        end = 0
        with os.fdopen(os.dup(self._file), "rb") as file:
            file.seek(0)
            while len(head := file.read(_TICK.size)) == _TICK.size:
                tick, size, self._told = _TICK.unpack(head)
                body = file.read(size)
                if len(body) < size:  # it was killed while it wrote
                    break
                end += len(head) + size
                self._again = deque(_unpack(body))
                yield tick
        self._again = None
        os.ftruncate(self._file, end)
        os.lseek(self._file, end, os.SEEK_SET)

    def _other(self, what: str) -> LockStepError:
        why = "a part of it is not a function of what it is given alone, and cannot be started again"
        return LockStepError(f"{self._name}: {what} when it is stepped again: {why}")


class Held:
    """The newest bundles of a service."""

    def __init__(self, most: int):
        """So many."""
        self._bundles: deque[Given] = deque(maxlen=most)
        self._lock = threading.Lock()  # whoever asks is answered from another thread

    def add(self, payload: bytes, time_ns: int) -> None:
        """Hold a bundle, before it is published; an empty one is the last."""
        with self._lock:
            self._bundles.append((time_ns, payload))

    def since(self, text: str) -> bytes:
        """For `Refilled`: bundles from a time [ns] on, which is given as text; the first ones where they are many."""
        time_ns, found = int(text), []
        with self._lock:
            for bundle in reversed(self._bundles):
                if bundle[0] < time_ns and bundle[1]:
                    break
                found.append(bundle)
        answer = bytearray()
        for stamp, payload in reversed(found):
            if len(answer) > REPLY:
                break
            answer += _GIVEN.pack(stamp, len(payload)) + payload
        return bytes(answer)


class Refilled:
    """The bundles of a service as they come; those that were lost on the way are asked for."""

    def __init__(self, come: Callable[[float], Given | None], ask: Callable[[str], bytes | None]):
        """Of a service.

        Args:
            come: gives the next that comes of itself, None after so many seconds.
            ask: gives what `Held.since` of the service gives, None where it is not there.
        """
        self._come, self._ask = come, ask
        self._again: deque[Given] = deque()

    def get(self, timeout: float, due_ns: int) -> Given | None:
        """The bundle of the instant `due_ns`, the last one if it is empty; None after `timeout` seconds.

        Where the service no longer has that bundle it is a later one.
        """
        while True:
            found = self._again.popleft() if self._again else self._come(timeout)
            if found is None:
                self._again.extend(self._held(due_ns))
                if not self._again:
                    return None
                continue
            time_ns, payload = found
            if time_ns < due_ns and payload:
                continue  # it was given again
            if time_ns <= due_ns:
                return found
            held = self._held(due_ns)
            if not held or held[0][0] > due_ns:
                return found
            self._again = deque(held)

    def _held(self, due_ns: int) -> list[Given]:
        return list(_unpack(self._ask(str(due_ns)) or b""))


class LogProgress(NamedTuple):
    """How far a log is: all messages before these ticks are there."""

    handed: int  # of one service
    recorded: int  # of all

    def pack(self) -> bytes:
        """The two ticks as bytes, which `unpack` reads."""
        return _PROGRESS.pack(*self)

    @classmethod
    def unpack(cls, answer: bytes) -> "LogProgress":
        """The progress in the bytes that `pack` has made."""
        return cls(*_PROGRESS.unpack(answer))


_PROGRESS = struct.Struct("<qq")


def _unpack(data: bytes) -> Iterator[Given]:
    place = 0
    while place < len(data):
        time_ns, size = _GIVEN.unpack_from(data, place)
        place += _GIVEN.size
        yield time_ns, data[place : place + size]
        place += size
