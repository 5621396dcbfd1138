"""One conversation as bytes: messages to frames and back, numbered, checked and signed. pymavlink does the work."""

import hashlib
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from lapwing.services.mavlink.dialect import mavlink
from lapwing.services.mavlink.framing import frame

_YEAR_2015 = 1420070400  # [s] Unix time from which signatures count, in steps of 10 us
MIN_PASSPHRASE = 8  # characters of a passphrase


def read_key(path: Path) -> bytes:
    """The signing key of a passphrase in a file: its SHA-256 digest, as MAVProxy and QGroundControl make it.

    Raises:
        ValueError: the file cannot be read, or holds no passphrase.
    """
    try:
        text = path.read_text(encoding="utf-8").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f"--mavlink-key {path}: cannot be read: {getattr(error, 'strerror', 'not a text')}") from None
    if len(text) < MIN_PASSPHRASE or "\n" in text:
        raise ValueError(
            f"--mavlink-key {path}: expected one line with a passphrase of {MIN_PASSPHRASE} or more characters"
        )
    return hashlib.sha256(text.encode()).digest()


class Signature:
    """The key of a vehicle and what it has seen signed: shared by all its channels, so that none can be replayed to."""

    def __init__(self, key: bytes):
        self.state = mavlink.MAVLinkSigning()
        self.state.secret_key = key
        self.state.sign_outgoing = True
        self.state.timestamp = int((time.time() - _YEAR_2015) * 1e5)


class _Codec(mavlink.MAVLink):
    def check_signature(self, msgbuf: bytearray, srcSystem: int, srcComponent: int) -> bool:
        """As the library, but a forged time stamp does not shut out the endpoint whose name it bears."""
        times = self.signing.stream_timestamps
        stream = (msgbuf[-13], srcSystem, srcComponent)
        before = times.get(stream)
        if super().check_signature(msgbuf, srcSystem, srcComponent):
            return True
        if before is None:
            times.pop(stream, None)
        else:
            times[stream] = before
        return False


class Channel:
    """Frames of one endpoint."""

    def __init__(self, system: int, signature: Signature | None, datagrams: bool, counts: Counter[str]):
        """A channel that has not spoken yet.

        Args:
            system: the vehicle's own id; it speaks as the autopilot, component 1.
            signature: signs and checks, None for neither.
            datagrams: frames do not continue from one piece of bytes to the next.
            counts: what was refused, by reason.
        """
        self._codec = _Codec(None, system, mavlink.MAV_COMP_ID_AUTOPILOT1)
        self._codec.robust_parsing = True
        self._signs = signature is not None
        if signature:
            self._codec.signing = signature.state
        self._datagrams, self._counts = datagrams, counts

    def encode(self, message: Any) -> bytes:
        """The next frame; none, and counted, where a number of it is beyond a float of 32 bits."""
        codec = self._codec
        try:
            found = None if self._signs else frame(message, codec.seq, codec.srcSystem, codec.srcComponent)
            found = found or message.pack(codec)
        except OverflowError:
            self._counts["beyond what a message holds"] += 1
            return b""
        codec.seq = (codec.seq + 1) % 256
        return found

    def decode(self, data: bytes) -> Iterator[Any]:
        """The sound messages of a piece of bytes; counts the others."""
        codec = self._codec
        if self._datagrams:
            codec.buf, codec.buf_index, codec.expected_length = bytearray(), 0, mavlink.HEADER_LEN_V1 + 2
        found = codec.parse_char(data)
        while found is not None:
            kind = found.get_type()
            if kind == "BAD_DATA":
                self._counts[_reason(found.reason)] += 1
            elif kind.startswith("UNKNOWN_"):
                self._counts["unknown message"] += 1
            else:
                yield found
            found = codec.parse_char(b"")
        del codec.buf[: codec.buf_index]
        codec.buf_index = 0


def _reason(reason: str) -> str:
    if "signature" in reason:
        return "unsigned, forged or replayed"
    return "wrong checksum" if "CRC" in reason else "no MAVLink"
