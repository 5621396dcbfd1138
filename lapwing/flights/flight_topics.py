"""Recorded topics of a flight, its reference and the errors from it."""

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np

from lapwing.cosim.config.run_config import RunConfig
from lapwing.dynamics.config_error import ConfigError
from lapwing.flights import tracking
from lapwing.flights.flight_provenance import Origin
from lapwing.flights.topic_view import TopicView
from lapwing.messages.digest import Digest
from lapwing.messages.topics import Topic, topic_named


class FlightTopics:
    """Topics of one vehicle's flight, by name without that of the vehicle.

    Attributes:
        origin: log or run configuration, with the log's metadata.
        vehicle: name of the vehicle.
    """

    def __init__(self, topics: Mapping[str, TopicView], origin: Origin):
        """Create from topics by name without that of the vehicle: "ground_truth", "gps/fix", "clock"."""
        self.origin, self.vehicle = origin, origin.vehicle
        self._topics = dict(topics)

    @property
    def config(self) -> RunConfig:
        """Run configuration; `config.resolved["vehicle"]["mass"]` is a value of the scene that has flown.

        Raises:
            ValueError: the log has no run configuration, or one that this version cannot read.
        """
        return self.origin.config

    @property
    def metadata(self) -> dict[str, str]:
        """Metadata of the log: scene, seed, mode, version, digest and more."""
        return self.origin.metadata

    @cached_property
    def digest(self) -> str:
        """Digest of the deterministic messages: that of the log ("" if its end is missing), or of the topics."""
        if self.origin.recorded:
            return self.metadata.get("digest", "")
        digest = Digest()
        for name in self.topics:
            topic = topic_of(name)
            if topic.recorded and topic.deterministic:
                for time_ns, payload in self.topic(name).payloads():
                    digest.update(topic.key(self.vehicle), time_ns, payload)
        return digest.hexdigest()

    @cached_property
    def truth(self) -> TopicView:
        """True state: position, orientation, velocity, angular_velocity, acceleration, rotor_speed, wind, ..."""
        return self.topic("ground_truth")

    @cached_property
    def setpoint(self) -> TopicView:
        """Setpoint that the autopilot follows: position, velocity, acceleration, yaw, phase."""
        return self.topic("setpoint")

    @cached_property
    def actuators(self) -> TopicView:
        """Commands of the autopilot: motor_voltage [V], thrust [N], attitude_reference [rad], armed."""
        return self.topic("actuators")

    @cached_property
    def estimate(self) -> TopicView:
        """State estimate and its standard deviations: position, position_std, velocity, ..."""
        return self.topic("estimate")

    @cached_property
    def status(self) -> TopicView:
        """Status of the autopilot: phase, armed, landed, finished, warnings."""
        return self.topic("status")

    @property
    def topics(self) -> list[str]:
        """Names of all topics."""
        return sorted(self._topics)

    def topic(self, name: str) -> TopicView:
        """Return a topic by name without that of the vehicle, for example "gps/fix".

        Raises:
            ValueError: the topic does not exist; the message lists the topics.
        """
        if name not in self._topics:
            raise ValueError(str(ConfigError.unknown(self.origin.source, "topic", name, self.topics)))
        return self._topics[name]

    def has(self, topic: str) -> bool:
        """Return True if the flight has this topic."""
        return topic in self._topics

    def times(self, topic: str) -> np.ndarray:
        """Return the simulation times of a topic [s], shape (n,)."""
        return self.topic(topic).times

    def column(self, topic: str, field: str) -> np.ndarray:
        """Return a field of a topic by its name, "position", "pose.position.x" or "thrust", shape (n,) or (n, k).

        Raises:
            ValueError: the topic does not exist, or not all messages have this field.
        """
        return self.topic(topic)[field]

    def to_dataframe(self, topic: str = "ground_truth") -> Any:
        """Return a topic as a pandas DataFrame: a column per number or text, times [s] as index.

        Raises:
            ImportError: pandas is not installed.
        """
        try:
            import pandas
        except ImportError:
            raise ImportError("to_dataframe: pandas is not installed; pip install lapwing[dataframe]") from None
        view = self.topic(topic)
        return pandas.DataFrame(view.flat(), index=pandas.Index(view.times, name="time"))


def topic_of(name: str) -> Topic:
    """Return the topic of a name without that of the vehicle. Raise ValueError if there is none."""
    try:
        return topic_named(f"{{vehicle}}/{name}")
    except ValueError:
        return topic_named(name)


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
