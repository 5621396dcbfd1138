"""Frame count of ArduPilot's servo packets: new, resent and skipped frames, and restarts.

ArduPilot sends a frame again, with the same count, if its answer does not come within about a second. Such a frame is
answered but does not step the plant. A lower count means that the program has started again.
"""

from enum import Enum, auto


class Frame(Enum):
    """Meaning of a frame count."""

    NEW = auto()  # answer with the state after a step
    RESENT = auto()  # answer with the last state again
    RESTARTED = auto()  # the program has started again; answer as to a new frame


class FrameSequence:
    """Classifies frame counts.

    Attributes:
        steps: new frames.
        resent: frames that came again.
        skipped: frames that never came.
        restarts: starts of the program after the first.
    """

    def __init__(self) -> None:
        """Create a sequence before its first frame."""
        self.steps = self.resent = self.skipped = self.restarts = 0
        self._last: int | None = None

    def restart(self) -> None:
        """Count a restart of the program; its next frame is new."""
        self.restarts += 1
        self._last = None

    def receive(self, count: int) -> Frame:
        """Count a frame and return its meaning."""
        last, self._last = self._last, count
        if last is not None and count == last:
            self.resent += 1
            return Frame.RESENT
        self.steps += 1
        if last is not None and (count - last) & 0xFFFFFFFF >= 1 << 31:
            self.restarts += 1
            return Frame.RESTARTED
        if last is not None:
            self.skipped += ((count - last) & 0xFFFFFFFF) - 1
        return Frame.NEW
