"""Frame count of ArduPilot's servo packets: new, resent and skipped frames, and restarts.

ArduPilot sends a frame again, with the same count, if its answer does not arrive within about a second. Such a frame is
answered but does not step the plant. A lower count means that the program has restarted.
"""

from enum import Enum, auto

import numpy as np

ANY = -1  # no frame has arrived since the program started


class Frame(Enum):
    """Meaning of a frame count."""

    NEW = auto()  # answer with the state after a step
    RESENT = auto()  # answer with the last state again
    RESTARTED = auto()  # the program has restarted; answer as for a new frame


class FrameSequence:
    """Classifier of frame counts.

    Attributes:
        next: (1,) count of the next frame, ANY before the first; compiled code increments it for each
            frame in order.
        resent: frames received again.
        skipped: frames never received.
        restarts: restarts of the program.
    """

    def __init__(self) -> None:
        """Create a sequence before its first frame."""
        self.resent = self.skipped = self.restarts = 0
        self.next = np.full(1, ANY)

    def restart(self) -> None:
        """Count a restart of the program; its next frame is new."""
        self.restarts += 1
        self.next[0] = ANY

    def receive(self, count: int) -> Frame:
        """Count a frame and return its meaning."""
        expected, self.next[0] = int(self.next[0]), count + 1
        if expected == ANY:
            return Frame.NEW
        ahead = (count - expected) & 0xFFFFFFFF
        if ahead == 0xFFFFFFFF:
            self.resent += 1
            return Frame.RESENT
        if ahead >= 1 << 31:
            self.restarts += 1
            return Frame.RESTARTED
        self.skipped += ahead
        return Frame.NEW
