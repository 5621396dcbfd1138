"""Options of the links of a run."""

from pathlib import Path
from typing import NamedTuple


class Options(NamedTuple):
    """The links of a vehicle, and who may command it over them."""

    urls: tuple[str, ...]
    key: bytes | None = None  # signs outgoing messages; messages without its signature are rejected
    insecure: bool = False  # commands are taken from other machines without a key
    log: Path | None = None  # that endpoints may download
    time_stamps: Path | None = None  # file that keeps the time stamps of signed frames
    speed: float | None = 1.0  # simulated seconds per second; None: as fast as it goes
