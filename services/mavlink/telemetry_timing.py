"""Jitter of the telemetry and lag behind the real-time factor, for the final report."""

from itertools import pairwise

MAX_STEPS = 200_000  # recorded steps


class Pacing:
    """Wall time of each step of the telemetry."""

    def __init__(self, speed: float | None):
        """Create an empty record; `speed`: simulated seconds per second, None for as fast as possible."""
        self._speed = speed
        self._steps: list[tuple[float, float]] = []  # simulation time, wall time [s]

    def note(self, simulated: float, wall: float) -> None:
        """Record the simulation time and wall time [s] of a step."""
        if len(self._steps) < MAX_STEPS:
            self._steps.append((simulated, wall))

    def jitter(self) -> list[float]:
        """Return the deviations of the intervals between steps from the nominal ones [s], sorted."""
        speed = self._speed or 1.0
        return sorted(abs((b[1] - a[1]) - (b[0] - a[0]) / speed) for a, b in pairwise(self._steps))

    def behind(self) -> float:
        """Return the lag of the slowest step behind the fastest [s] of wall time."""
        if self._speed is None or not self._steps:
            return 0.0
        lags = [wall - simulated / self._speed for simulated, wall in self._steps]
        return max(lags) - min(lags)

    def report(self) -> str:
        """Return the line of the final report."""
        jitter = self.jitter()
        if self._speed is None or not jitter:
            return "telemetry: no real-time factor"
        median, p99 = (1e3 * jitter[int(share * (len(jitter) - 1))] for share in (0.5, 0.99))
        return (
            f"telemetry: jitter median {median:.1f} ms, p99 {p99:.1f} ms, worst {1e3 * jitter[-1]:.1f} ms; "
            f"at most {1e3 * self.behind():.0f} ms behind"
        )
