"""A set-up as a message, which participants of a run ask one another for."""

import zlib

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.config.serialise import to_json

LARGEST = 1 << 26  # [bytes] of its text; the largest have some millions


def pack(setup: RunConfig) -> bytes:
    """A message that needs no fragments."""
    return zlib.compress(to_json(setup).encode())


def unpack(message: bytes) -> str:
    """The set-up's text; a program of somebody else's may send it as it is.

    Raises:
        ValueError: it is no text, or unpacks to more than `LARGEST`.
    """
    if message.startswith(b"{"):
        return message.decode()
    unpacking = zlib.decompressobj()
    try:
        text = unpacking.decompress(message, LARGEST)
    except zlib.error as error:
        raise ValueError(f"no set-up: {error}") from None
    if not unpacking.eof:
        raise ValueError(f"no set-up: cut short, or larger than {LARGEST} bytes")
    return text.decode()
