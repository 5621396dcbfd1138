"""Repetition of offboard setpoints and stick positions in fast runs, until their sender is also late in wall time.

The autopilot counts COM_OF_LOSS_T and COM_RC_LOSS_T in simulation time. In a run faster than real time, they would
pass in a fraction of it in wall time: at five times real time a pause of 0.2 s loses 1 s.
"""

from collections.abc import Callable, Sequence

from lapwing.services.mavlink.clock import Clock, Instant
from lapwing.services.mavlink.command_queue import CommandQueue

INTERVAL = 200_000_000  # [ns] of simulation time between two repetitions


class SetpointKeeper:
    """Keeper of the newest setpoint of a sender, which repeats it."""

    def __init__(self, clock: Clock, commands: CommandQueue, timeout: Callable[[], float]):
        """Create a keeper without a setpoint; `timeout` returns the time [s] after which setpoints are lost."""
        self._clock, self._commands, self._timeout = clock, commands, timeout
        self._newest: tuple[str, str, Sequence[float], Instant] | None = None
        self._next = 0  # [ns] of the next repetition

    def hold(self, kind: str, source: str, values: Sequence[float]) -> None:
        """Store a setpoint that was just sent."""
        self._newest = kind, source, values, self._clock.now
        self._next = self._clock.now.time_ns + INTERVAL

    def step(self) -> None:
        """Repeat the setpoint unless, at the current speed, its loss would then occur later than by wall time."""
        if self._newest is None or self._clock.now.time_ns < self._next:
            return
        kind, source, values, received = self._newest
        now, timeout = self._clock.now, self._timeout()
        simulated, wall = (now.time_ns - received.time_ns) * 1e-9, now.wall - received.wall
        if not wall * (1.0 + timeout / simulated) <= timeout:  # NaN: the vehicle has no time-out
            self._newest = None
            return
        self._next = now.time_ns + INTERVAL
        self._commands.put(kind, source, values=values)
