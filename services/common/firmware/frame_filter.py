"""Selection of MAVLink frames by message id, before they are decoded.

A firmware sends hundreds of messages a second; decoding all took three times as long as the plant (PX4, onboard link).
"""

from collections.abc import Collection

V1, V2 = 0xFE, 0xFD
MOST = 256  # message ids in `dropped`
_SIGNED, _SIGNATURE, _CHECKSUM = 0x01, 13, 2  # incompatibility flag; [bytes]


class FrameFilter:
    """Filter that passes frames of selected messages of a byte stream; the decoder verifies checksums.

    Attributes:
        dropped: message ids of frames that did not pass; they may include a few that garbage resembles.
    """

    def __init__(self, numbers: Collection[int]):
        """Create a filter that passes the message ids `numbers`."""
        self._numbers, self.dropped = frozenset(numbers), set[int]()
        self._rest = b""

    def select(self, data: bytes) -> bytes:
        """Return the selected frames that `data` completes; bytes outside of frames are dropped."""
        data, result = self._rest + data, []
        at, end = 0, len(data)
        while at < end:
            if data[at] not in (V1, V2):
                at += 1
                continue
            head, id_at, id_size = (10, 7, 3) if data[at] == V2 else (6, 5, 1)
            if at + head > end:
                break
            length = head + data[at + 1] + _CHECKSUM
            if data[at] == V2 and data[at + 2] & _SIGNED:
                length += _SIGNATURE
            if at + length > end:
                break
            number = int.from_bytes(data[at + id_at : at + id_at + id_size], "little")
            if number in self._numbers:
                result.append(data[at : at + length])
            elif len(self.dropped) < MOST:
                self.dropped.add(number)
            at += length
        self._rest = data[at:]
        return b"".join(result)
