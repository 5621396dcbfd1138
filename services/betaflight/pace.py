"""Wall-clock times of the packets to Betaflight, and their lateness and jitter."""

import time

from lapwing.kernels import math
from lapwing.services.common.firmware.link import LinkReport

LATE = 1.0  # intervals after its time at which a packet counts as late
FASTEST = 0.8  # shortest fraction of an interval between two packets


class Pace:
    """Pacing of packets in wall time, with statistics of its accuracy."""

    def __init__(self, report: LinkReport) -> None:
        """Store the report."""
        self._report = report
        self._next = self._sent = 0.0  # [s] of the wall clock
        self._count = self._sum = self._squares = 0.0  # of the times [s] between packets

    def wait(self, interval: float, rate: float) -> None:
        """Wait until `interval` [s] after the last packet; `rate`: simulation time per wall time."""
        now, report = time.monotonic(), self._report
        if self._sent == 0.0:
            self._next = now
        if now < self._next:
            time.sleep(self._next - now)
            now = time.monotonic()
        if now - self._next > LATE * interval:
            report.late += 1
        report.skew_max = max(report.skew_max, rate * (now - self._next))
        if self._sent > 0.0:
            self._add(now - self._sent)
        self._sent = now
        self._next = max(self._next + interval, now + FASTEST * interval)

    def _add(self, gap: float) -> None:
        """Add a time [s] between two packets to the statistics."""
        self._count, self._sum, self._squares = self._count + 1, self._sum + gap, self._squares + gap * gap
        mean = self._sum / self._count
        self._report.jitter = math.sqrt(max(0.0, self._squares / self._count - mean * mean))
