"""Selection of MAVLink frames by message id, before they are decoded.

A firmware sends hundreds of messages a second; decoding all took three times as long as the plant (PX4, onboard link).
"""

from collections.abc import Collection

V1, V2 = 0xFE, 0xFD
_SIGNED, _SIGNATURE, _CHECKSUM = 0x01, 13, 2  # flag; [bytes]


MOST = 256  # message ids in `dropped`


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
            magic = data[at]
            if magic not in (V1, V2):
                at += 1
                continue
            head = 10 if magic == V2 else 6
            if at + head > end:
                break
            length = head + data[at + 1] + _CHECKSUM
            if magic == V2 and data[at + 2] & _SIGNED:
                length += _SIGNATURE
            if at + length > end:
                break
            number = data[at + 7] | data[at + 8] << 8 | data[at + 9] << 16 if magic == V2 else data[at + 5]
            if number in self._numbers:
                result.append(data[at : at + length])
            elif len(self.dropped) < MOST:
                self.dropped.add(number)
            at += length
        self._rest = data[at:]
        return b"".join(result)
