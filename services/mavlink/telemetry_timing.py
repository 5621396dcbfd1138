"""How evenly the telemetry leaves, and how far the run falls behind its pace: measured, and told at the end."""

from itertools import pairwise

MAX_STEPS = 200_000  # that are remembered


class Pacing:
    """When each step of the telemetry has left."""

    def __init__(self, speed: float | None):
        """`speed`: simulated seconds per second that are kept, None for as fast as it goes."""
        self._speed = speed
        self._steps: list[tuple[float, float]] = []  # simulation time, wall time [s]

    def note(self, simulated: float, wall: float) -> None:
        """A step of simulation time has left at this wall time [s]."""
        if len(self._steps) < MAX_STEPS:
            self._steps.append((simulated, wall))

    def jitter(self) -> list[float]:
        """How much later or earlier than due after the one before each step left [s], in order of size."""
        speed = self._speed or 1.0
        return sorted(abs((b[1] - a[1]) - (b[0] - a[0]) / speed) for a, b in pairwise(self._steps))

    def behind(self) -> float:
        """By how much the slowest moment lay behind the fastest [s of wall time]."""
        if self._speed is None or not self._steps:
            return 0.0
        lags = [wall - simulated / self._speed for simulated, wall in self._steps]
        return max(lags) - min(lags)

    def report(self) -> str:
        """A line for people."""
        jitter = self.jitter()
        if self._speed is None or not jitter:
            return "telemetry: no pace to be kept"
        median, p99 = (1e3 * jitter[int(share * (len(jitter) - 1))] for share in (0.5, 0.99))
        return (
            f"telemetry: jitter median {median:.1f} ms, p99 {p99:.1f} ms, worst {1e3 * jitter[-1]:.1f} ms; "
            f"at most {1e3 * self.behind():.0f} ms behind"
        )
