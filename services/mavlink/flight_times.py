"""When the vehicle was armed, took off and landed."""

from lapwing.messages import Status


class FlightTimes:
    """When the last flight was armed, took off and landed: simulation time [ns], 0 for what has not happened."""

    def __init__(self) -> None:
        self.armed_ns = self.takeoff_ns = self.landing_ns = 0
        self.number = 0  # of flights so far, the present one included
        self._before = Status(landed=True)

    def update(self, status: Status, time_ns: int) -> None:
        """Take in a newer status of the autopilot and its simulation time [ns]."""
        before, self._before = self._before, status
        if status.armed and not before.armed:
            self.armed_ns, self.takeoff_ns, self.landing_ns = time_ns, 0, 0
            self.number += 1
        if before.landed and not status.landed:
            self.takeoff_ns, self.landing_ns = time_ns, 0
        if status.landed and not before.landed:
            self.landing_ns = time_ns
