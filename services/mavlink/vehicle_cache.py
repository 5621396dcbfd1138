"""Newest state of the vehicle: all messages that it publishes, decoded on demand.

Events are numbered and stored for receivers that have missed one (MAVLink guide, "Events Interface").
"""

import math
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from lapwing.dynamics.geodesy import Home
from lapwing.dynamics.vector import Vec3
from lapwing.messages import Status, nanoseconds
from lapwing.messages.topics import ESTIMATE, STATUS, TRUTH, Topic
from lapwing.services.common.mavlink.dialect import mavlink, message_class
from lapwing.services.common.mavlink.frames import Quaternion, saturate, swap_attitude
from lapwing.services.common.mavlink.geo_coordinates import Datum
from lapwing.services.mavlink import firmware
from lapwing.services.mavlink.fast_conversions import angles, geodetic
from lapwing.services.mavlink.vehicle_description import VehicleDescription

CAPACITY = 100  # events that can be sent again
ROUND = 1 << 16  # modulus of the sequence numbers
ARGUMENTS = 40  # [bytes] of a message
ALL = 0  # destination of an event for all receivers
RESET = 1  # MAV_EVENT_CURRENT_SEQUENCE_FLAGS_RESET: the numbers have restarted
UNAVAILABLE = 0  # MAV_EVENT_ERROR_REASON_UNAVAILABLE


class EventLog:
    """Last `CAPACITY` events by sequence number."""

    def __init__(self) -> None:
        self.sequence = 0  # sequence number of the last event
        self._events: deque[tuple[int, Any]] = deque(maxlen=CAPACITY)  # (sequence number, message)

    def current(self) -> Any:
        """Return CURRENT_EVENT_SEQUENCE, by which a station detects missing events."""
        return message_class("CURRENT_EVENT_SEQUENCE")(self.sequence, 0 if self._events else RESET)

    def add(self, number: int, level: int, arguments: bytes, time_ms: int) -> list[Any]:
        """Append an event. Return the messages that report it.

        Args:
            number: event id.
            level: severity, both external and internal.
            arguments: encoded arguments.
            time_ms: time since the start [ms].
        """
        announcement = [] if self._events else [self.current()]
        self.sequence = (self.sequence + 1) % ROUND
        padded = list(arguments.ljust(ARGUMENTS, b"\0"))
        message = message_class("EVENT")(ALL, ALL, number, time_ms, self.sequence, level << 4 | level, padded)
        self._events.append((self.sequence, message))
        return [*announcement, message]

    def replies(self, first: int, last: int, address: tuple[int, int]) -> Iterator[Any]:
        """Yield the events of a range of sequence numbers; for a missing one, the number of the next.

        Args:
            first: sequence number.
            last: sequence number; may be lower than `first`, since numbers wrap around.
            address: system and component of the requesting endpoint.
        """
        count = (last - first) % ROUND + 1
        stored = dict(self._events)

        def error_message(number: int) -> Any:
            oldest = min(stored, key=lambda sequence: (sequence - number) % ROUND, default=self.sequence)
            return message_class("RESPONSE_EVENT_ERROR")(*address, number, oldest, UNAVAILABLE)

        if count > CAPACITY:
            yield error_message(first)
        for k in range(max(0, count - CAPACITY), count):
            number = (first + k) % ROUND
            yield stored.get(number) or error_message(number)


_MOTION_END = 18  # values of a header and a motion: encapsulation, time (2), frame (2), pose (7), velocities (6)
ON_GROUND = Status(landed=True)  # before the vehicle has published a status


class NedMotion:
    """Position and motion of the vehicle in MAVLink's frames: NED, FRD, degrees.

    Attributes:
        time_ns: simulation time of the motion [ns].
        position_world: position in the world frame [m].
        position_ned: position from the local origin [m].
        velocity_ned: velocity [m/s].
        omega_frd: angular velocity [rad/s].
        attitude: quaternion of FRD in NED.
        angles: roll, pitch, yaw [rad] from NED to FRD.
        geodetic: latitude [deg], longitude [deg], altitude [m].
    """

    __slots__ = (
        "angles", "attitude", "geodetic", "omega_frd", "position_ned", "position_world", "time_ns", "velocity_ned",
    )  # fmt: skip

    def __init__(self, message: Any, payload: bytes, home: Home, standing_height: float):
        """Convert an encoded message with header, pose, velocity and angular velocity: the estimate or the truth.

        The values are read without decoding the message: a link converts an estimate every 20 ms, each time with cold
        caches, so that every function call and object adds time.
        """
        values = message.layouts.unpack(payload)
        _, seconds, nanoseconds, _, _, x, y, z, q_x, q_y, q_z, q_w, u, v, w, p, q, r = values[:_MOTION_END]
        self.time_ns = seconds * 1_000_000_000 + nanoseconds
        self.position_world: Vec3 = (x, y, z)
        self.position_ned: Vec3 = (y, x, standing_height - z)
        self.velocity_ned: Vec3 = (v, u, -w)
        self.omega_frd: Vec3 = (p, -q, -r)
        self.attitude: Quaternion = swap_attitude((q_w, q_x, q_y, q_z))
        self.angles: Vec3 = angles(self.attitude)
        self.geodetic: Vec3 = geodetic(home, self.position_world)


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


class VehicleCache:
    """Vehicle for its links: description, simulation time, and the newest message of each topic."""

    def __init__(self, description: VehicleDescription):
        """Create the cache of a vehicle that has published nothing yet."""
        self.description = description
        self.firmware = firmware.get(description.firmware)
        self.address = description.system_id, mavlink.MAV_COMP_ID_AUTOPILOT1  # present system and component id
        self.time_ns = 0
        self.flight = FlightTimes()
        self.events = EventLog()
        self.report_requests = 0  # number of requests for arming blockers, including that of each new station
        latitude, longitude, height = description.home
        # GPS_GLOBAL_ORIGIN for ground stations: [1e-7 deg], [1e-7 deg], [mm]
        altitude = height + description.standing_height
        self.origin = saturate(latitude * 1e7, 32), saturate(longitude * 1e7, 32), saturate(altitude * 1e3, 32)
        self.mission: Callable[[], Sequence[Any]] = lambda: ()  # mission items as uploaded by endpoints
        self.parameter: Callable[[str], float] = lambda name: math.nan  # value of a parameter; NaN if there is none
        self._home_heading, self._armed = 0.0, False
        self._payloads: dict[Topic, bytes] = {}
        self._decoded: dict[Topic, Any] = {}
        self._motions: dict[Topic, NedMotion] = {}

    def put(self, topic: Topic, payload: bytes) -> None:
        """Store a newer encoded message of a topic."""
        self._payloads[topic] = payload
        self._decoded.pop(topic, None)
        self._motions.pop(topic, None)
        if topic is STATUS:
            status = self.status
            self._armed = status.armed
            self.flight.update(status, nanoseconds(status.header.stamp))
        elif topic is ESTIMATE and not self._armed and (estimate := self.estimate):
            self._home_heading = estimate.angles[2]

    def get(self, topic: Topic) -> Any:
        """Return the newest message of a topic. Return None before the first."""
        if topic not in self._decoded:
            if topic not in self._payloads:
                return None
            self._decoded[topic] = topic.message.decode(self._payloads[topic])
        return self._decoded[topic]

    def _motion(self, topic: Topic) -> NedMotion | None:
        if topic not in self._motions:
            payload = self._payloads.get(topic)
            if payload is None:
                return None
            description = self.description
            self._motions[topic] = NedMotion(topic.message, payload, description.home, description.standing_height)
        return self._motions[topic]

    @property
    def estimate(self) -> NedMotion | None:
        """Estimated motion."""
        return self._motion(ESTIMATE)

    @property
    def truth(self) -> NedMotion | None:
        """True motion."""
        return self._motion(TRUTH)

    @property
    def status(self) -> Status:
        """Newest status of the autopilot."""
        return self.get(STATUS) or ON_GROUND

    @property
    def home_world(self) -> Vec3:
        """Home in the world frame [m]: the body frame's origin at the time of arming."""
        x, y, ground = self.status.home
        return x, y, ground + self.description.standing_height

    @property
    def home_heading(self) -> float:
        """Heading [rad] from north, clockwise, at arming; the current heading before that."""
        return self._home_heading

    @property
    def datum(self) -> Datum:
        """Reference of latitudes, longitudes and altitudes in messages."""
        return Datum(self.description.home, self.home_world[2], self.description.standing_height)

    @property
    def boot_ms(self) -> int:
        """Time since the start [ms], modulo 2^32."""
        return self.time_ns // 1_000_000 & 0xFFFFFFFF

    @property
    def boot_us(self) -> int:
        """Time since the start [us]."""
        return self.time_ns // 1000
