"""Options of the MAVLink links of a run."""

from pathlib import Path
from typing import NamedTuple


class Options(NamedTuple):
    """Options of the links of a vehicle."""

    urls: tuple[str, ...]
    key: bytes | None = None  # signs outgoing messages; messages without its signature are rejected
    insecure: bool = False  # True to accept commands from other machines without a key
    log: Path | None = None  # log that endpoints may download
    time_stamps: Path | None = None  # file that keeps the time stamps of signed frames
    speed: float | None = 1.0  # simulated seconds per second; None: as fast as possible
