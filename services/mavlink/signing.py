"""MAVLink 2 signing: the key, and persistent time stamps, so that recorded frames cannot be replayed.

MAVLink guide, "Message Signing": an accepted frame has a later time stamp than every frame accepted before on the same
stream (link id, system, component), and time stamps are kept in persistent storage.
"""

import hashlib
import os
import sqlite3
import time
from pathlib import Path

from lapwing.dynamics.input_file import read_text
from lapwing.services.common.mavlink.dialect import mavlink

TIME_STAMPS = "mavlink_time_stamps.sqlite"
MIN_PASSPHRASE = 8  # [characters]
_YEAR_2015 = 1420070400  # [s] Unix time at time stamp 0
_TICKS = 1e5  # [1/s] time stamps
_LOCK_TIMEOUT = 5.0  # [s] until another process has written its time stamp

Stream = tuple[int, int, int]  # link id, system, component


def read_key(path: Path) -> bytes:
    """Return the signing key of a passphrase file: its SHA-256 digest, as in MAVProxy and QGroundControl.

    Raises:
        ValueError: the file cannot be read, or holds no passphrase.
    """
    try:
        text = read_text(path).strip()
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", "not a text")
        raise ValueError(f"--mavlink-key {path}: cannot be read: {reason}; expected a text file") from None
    if len(text) < MIN_PASSPHRASE or "\n" in text:
        raise ValueError(
            f"--mavlink-key {path}: expected one line with a passphrase of {MIN_PASSPHRASE} or more characters"
        )
    return hashlib.sha256(text.encode()).digest()


def state_folder() -> Path:
    """Return the folder of persistent user state of the XDG base directory specification."""
    return Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state") / "lapwing"


class TimeStampStore:
    """Newest accepted time stamp of each stream of a key and vehicle, in a file that several processes may share."""

    def __init__(self, path: Path, key: bytes, system: int):
        """Open the file, or create it for the user alone.

        Args:
            path: file name.
            key: signing key, of which only a digest is stored.
            system: system id of the vehicle.

        Raises:
            ValueError: the file cannot be written.
        """
        self._owner = hashlib.sha256(key).hexdigest()[:16], system
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            os.close(os.open(path, os.O_RDWR | os.O_CREAT, 0o600))
            self._database = sqlite3.connect(path, timeout=_LOCK_TIMEOUT, isolation_level=None)
            self._database.execute("PRAGMA journal_mode = WAL")  # a write takes microseconds
            self._database.execute("PRAGMA synchronous = OFF")  # survives the end of the process, not a power cut
            self._database.execute(
                "CREATE TABLE IF NOT EXISTS streams (owner TEXT, vehicle INTEGER, link INTEGER, system INTEGER,"
                " component INTEGER, time_stamp INTEGER, PRIMARY KEY (owner, vehicle, link, system, component))"
            )
        except (OSError, sqlite3.Error) as error:
            reason = getattr(error, "strerror", None) or error
            raise ValueError(
                f"--mavlink-key: time stamps cannot be stored in {path}: {reason}; set XDG_STATE_HOME to a folder "
                "that can be written"
            ) from None

    def set_system(self, system: int) -> None:
        """Use the streams of another system id of the vehicle."""
        self._owner = self._owner[0], system

    def load(self) -> dict[Stream, int]:
        """Return the newest time stamp by stream."""
        rows = self._database.execute(
            "SELECT link, system, component, time_stamp FROM streams WHERE owner = ? AND vehicle = ?", self._owner
        )
        return {(link, system, component): time_stamp for link, system, component, time_stamp in rows}

    def put(self, stream: Stream, time_stamp: int) -> None:
        """Store the time stamp of an accepted frame; a later one of another process stays."""
        self._database.execute(
            "INSERT INTO streams VALUES (?, ?, ?, ?, ?, ?) ON CONFLICT DO UPDATE"
            " SET time_stamp = max(time_stamp, excluded.time_stamp)",
            (*self._owner, *stream, time_stamp),
        )

    def close(self) -> None:
        """Close the file."""
        self._database.close()


class Signature:
    """Key of a vehicle and the time stamps of its streams, shared by all its channels."""

    def __init__(self, key: bytes, store: TimeStampStore | None = None):
        """Start with the stored time stamps, or without any."""
        self.state = mavlink.MAVLinkSigning()
        self.state.secret_key = key
        self.state.sign_outgoing = True
        self._store = store
        if store:
            self.state.stream_timestamps = store.load()
        self.state.timestamp = max([_now(), *self.state.stream_timestamps.values()])

    def advance(self) -> None:
        """Advance the vehicle's time stamp to the clock; new streams at most one minute older are accepted."""
        self.state.timestamp = max(self.state.timestamp, _now())

    def accept(self, stream: Stream) -> None:
        """Store the time stamp of the frame of a stream that has just been accepted."""
        if self._store:
            self._store.put(stream, self.state.stream_timestamps[stream])

    def set_system(self, system: int) -> None:
        """Store the time stamps under another system id of the vehicle, so that frames cannot be replayed to it."""
        if self._store:
            times = self.state.stream_timestamps
            self._store.set_system(system)
            for stream, time_stamp in self._store.load().items():
                times[stream] = max(time_stamp, times.get(stream, 0))
            for stream, time_stamp in times.items():
                self._store.put(stream, time_stamp)

    def close(self) -> None:
        """Close the store."""
        if self._store:
            self._store.close()


def _now() -> int:
    return int((time.time() - _YEAR_2015) * _TICKS)
