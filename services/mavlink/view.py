"""The newest word on everything the vehicle publishes, decoded when somebody asks."""

from functools import cached_property
from typing import Any

from dynamics.geodesy import Home, enu_to_geodetic
from dynamics.vector import Vec3
from messages import nanoseconds
from messages.topics import ESTIMATE, TRUTH, Topic
from services.mavlink.frames import Quaternion, euler, swap_attitude, swap_body, swap_world

HOME = Home()


class Motion:
    """Where the vehicle is and how it moves, as MAVLink says it: NED, FRD, degrees."""

    def __init__(self, message: Any):
        """From a message with pose, velocity and angular velocity: the estimate or the truth."""
        self.stamp = message.header.stamp
        p, q, v, w = message.pose.position, message.pose.orientation, message.velocity, message.angular_velocity
        self.position_world: Vec3 = (p.x, p.y, p.z)
        self.position_ned = swap_world(self.position_world)
        self.velocity_ned = swap_world(tuple(v))
        self.omega_frd = swap_body(tuple(w))
        self.attitude: Quaternion = swap_attitude((q.w, q.x, q.y, q.z))

    @cached_property
    def time_ns(self) -> int:
        """Simulation time that it holds for."""
        return nanoseconds(self.stamp)

    @cached_property
    def angles(self) -> Vec3:
        """Roll, pitch, yaw [rad] from NED to FRD."""
        return euler(self.attitude)

    @cached_property
    def geodetic(self) -> Vec3:
        """Latitude [deg], longitude [deg], altitude [m]."""
        return enu_to_geodetic(HOME, self.position_world)


class View:
    """Newest message of each topic."""

    def __init__(self) -> None:
        self._payloads: dict[Topic, bytes] = {}
        self._decoded: dict[Topic, Any] = {}
        self._motions: dict[Topic, Motion] = {}

    def put(self, topic: Topic, payload: bytes) -> None:
        """A newer message of a topic."""
        self._payloads[topic] = payload
        self._decoded.pop(topic, None)
        self._motions.pop(topic, None)

    def get(self, topic: Topic) -> Any:
        """The newest message, None before the first."""
        if topic not in self._decoded:
            if topic not in self._payloads:
                return None
            self._decoded[topic] = topic.message.decode(self._payloads[topic])
        return self._decoded[topic]

    def motion(self, topic: Topic = ESTIMATE) -> Motion | None:
        """The newest estimate (or TRUTH) in MAVLink's terms."""
        if topic not in self._motions:
            message = self.get(topic)
            if message is None:
                return None
            self._motions[topic] = Motion(message)
        return self._motions[topic]

    @property
    def truth(self) -> Motion | None:
        """The newest true state."""
        return self.motion(TRUTH)
