"""Times of arming, take-off and landing."""

from lapwing.messages import Status


class FlightTimes:
    """Simulation times [ns] of arming, take-off and landing of the last flight; 0: not yet."""

    def __init__(self) -> None:
        self.armed_ns = self.takeoff_ns = self.landing_ns = 0
        self.number = 0  # number of flights, including the current one
        self._before = Status(landed=True)

    def update(self, status: Status, time_ns: int) -> None:
        """Update with a newer status of the autopilot and its simulation time [ns]."""
        before, self._before = self._before, status
        if status.armed and not before.armed:
            self.armed_ns, self.takeoff_ns, self.landing_ns = time_ns, 0, 0
            self.number += 1
        if before.landed and not status.landed:
            self.takeoff_ns, self.landing_ns = time_ns, 0
        if status.landed and not before.landed:
            self.landing_ns = time_ns
