"""Reference and tracking errors of a flight."""

from functools import cached_property

import numpy as np

from lapwing.flights import tracking
from lapwing.flights.flight_topics import FlightTopics
from lapwing.flights.topic_view import TopicView

AXES = tuple(tracking.AXES)


class FlightTracking(FlightTopics):
    """Topics of a flight, its reference, and the differences from it."""

    @cached_property
    def reference(self) -> np.ndarray:
        """Reference x, y, z [m], roll, pitch, yaw [rad] at the first n times of "ground_truth", shape (n, 6).

        The references of x, y, z and yaw are the setpoints; those of roll and pitch are the references of the inner
        loops. The run may have ended between two topics: n is the length of the shortest, 0 without a reference.
        """
        if not self._tracked:
            return np.empty((0, len(AXES)))
        position, roll_pitch, yaw = self._reference
        return np.column_stack([position, roll_pitch, yaw])

    @cached_property
    def _tracked(self) -> int:
        """Number of times of `reference`."""
        if not (self.has("setpoint") and self.has("actuators")):
            return 0
        return min(len(self.truth), len(self.setpoint), len(self.actuators))

    @property
    def _reference(self) -> tracking.Reference:
        n, setpoint = self._tracked, self.setpoint
        return tracking.Reference(setpoint.position[:n], self.actuators.attitude_reference[:n, :2], setpoint.yaw[:n])

    @cached_property
    def armed(self) -> np.ndarray:
        """True where the motors are armed, at the times of `reference`, shape (n,)."""
        n = self._tracked
        return self.actuators.armed[:n] if n else np.empty(0, dtype=bool)

    @cached_property
    def errors(self) -> dict[str, np.ndarray]:
        """Reference minus truth of each axis [m], [rad] while the motors are armed; empty without a reference."""
        n = len(self.reference)
        if n == 0:
            return {}
        result = tracking.errors(self.reference, self.truth.position[:n], self.truth.attitude[:n], self.armed)
        return dict(zip(AXES, result.T, strict=True))

    @cached_property
    def airborne(self) -> np.ndarray:
        """True where the motors are armed and no foot touches the ground, at the times of `reference`, shape (n,).

        After touch-down the setpoint sinks below the ground until the motors stop, which is no error of tracking.
        """
        contact = self.truth.ground_contact if "ground_contact" in self.truth.fields else False
        return self.armed & ~np.broadcast_to(contact, len(self.truth))[: self._tracked]

    def rmse_of(self, pose: TopicView) -> dict[str, float]:
        """Return the root-mean-square error in the air of each axis [m], [rad] of a pose topic."""
        n = self._tracked
        return tracking.rmse(self._reference, pose.position[:n], pose.attitude[:n], self.airborne)

    @cached_property
    def reach(self) -> tuple[float, float]:
        """Largest distance from the reference in the air, and overshoot beyond its extremes [m]."""
        n = self._tracked
        return tracking.reach(self.setpoint.position[:n], self.truth.position[:n], self.airborne)

    @cached_property
    def rmse(self) -> dict[str, float]:
        """Root-mean-square error of each axis [m], [rad]; empty without a reference."""
        return self.rmse_of(self.truth) if self._tracked else {}
