"""Recordings from rosbag2 folders or single files (SQLite or MCAP), read by rosbags.

Messages are selected by type: those of ROS (ENU, FLU; REP 103), MAVROS, and PX4 (NED, FRD). Of several topics of one
type, the one with most messages that carries data is used. A bag with the motors of several vehicles needs the name of
one: the first part of its topics.
"""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lapwing.flights.log_import.channels import Channels, to_recording
from lapwing.flights.log_import.log_conventions import LogError, out_of_range, parsing, shares
from lapwing.flights.log_import.message_columns import NumberRows
from lapwing.flights.log_import.recording import ELLIPSOID, RESTART, Masks, Recording, Series
from lapwing.flights.log_import.source_checks import check_twist
from lapwing.flights.log_import.source_choice import Choices
from lapwing.flights.log_import.ulog_flight import RESETS, VALID, flags_of
from lapwing.flights.rotation_arrays import rotate, unit

RC_OUT = "mavros_msgs/msg/RCOut"
COMMANDS = ("setpoint", "target", "goal", "reference", "desired", "command")  # parts of the names of commanded poses


def _xyz(v: Any) -> list[float]:
    return [v.x, v.y, v.z]


def _wxyz(q: Any) -> list[float]:
    return [q.w, q.x, q.y, q.z]


def _odometry(m: Any) -> list[float]:
    twist = m.twist.twist
    return [*_xyz(m.pose.pose.position), *_wxyz(m.pose.pose.orientation), *_xyz(twist.linear), *_xyz(twist.angular)]


FIELDS: dict[str, Callable[[Any], Any]] = {  # values of each message by type
    "nav_msgs/msg/Odometry": _odometry,  # velocity in the axes of child_frame_id
    "geometry_msgs/msg/PoseStamped": lambda m: [*_xyz(m.pose.position), *_wxyz(m.pose.orientation)],
    "sensor_msgs/msg/Imu": lambda m: [*_xyz(m.angular_velocity), *_xyz(m.linear_acceleration)],
    "sensor_msgs/msg/BatteryState": lambda m: [m.voltage, abs(m.current)],
    "sensor_msgs/msg/NavSatFix": lambda m: [m.latitude, m.longitude, m.altitude, m.status.status],
    "sensor_msgs/msg/FluidPressure": lambda m: [m.fluid_pressure],
    "sensor_msgs/msg/MagneticField": lambda m: _xyz(m.magnetic_field),
    "sensor_msgs/msg/Range": lambda m: [m.range, m.min_range, m.max_range],
    "actuator_msgs/msg/Actuators": lambda m: m.normalized,
    RC_OUT: lambda m: shares(np.asarray(m.channels, float)),
    "px4_msgs/msg/ActuatorMotors": lambda m: m.control,
    "px4_msgs/msg/VehicleAttitude": lambda m: m.q,
    "px4_msgs/msg/VehicleLocalPosition": lambda m: [m.x, m.y, m.z, m.vx, m.vy, m.vz],
    "px4_msgs/msg/SensorCombined": lambda m: [*m.gyro_rad, *m.accelerometer_m_s2],
    "px4_msgs/msg/BatteryStatus": lambda m: [m.voltage_v, m.current_a],
}

FLAGS = {  # fields of PX4's messages that express doubts and resets
    "px4_msgs/msg/VehicleAttitude": RESETS["attitude"],
    "px4_msgs/msg/VehicleLocalPosition": tuple(
        flag for table in (VALID, RESETS) for name in ("position", "velocity") for flag in table[name]
    ),
}
MOTORS = ("px4_msgs/msg/ActuatorMotors", "actuator_msgs/msg/Actuators", RC_OUT)
_EXPECTED = ("a file of messages of ROS 2", "a folder with metadata.yaml and its messages")
POSES = ("nav_msgs/msg/Odometry", "geometry_msgs/msg/PoseStamped")
WORLD = ("map", "odom", "world", "earth", "enu", "local_origin", "local_origin_enu", "odom_enu", "map_enu")
DIRECTIONS = {  # by a part of the name of a range sensor's topic or frame
    "down": "down", "bottom": "down", "ground": "down", "nadir": "down", "front": "forward", "forward": "forward",
    "up": "up", "top": "up", "left": "aside", "right": "aside", "back": "aside", "rear": "aside", "side": "aside",
}  # fmt: skip


class _Topic(NamedTuple):
    """Messages of one topic.

    Attributes:
        name: name of the topic.
        time: times [s], shape (n,).
        values: values by `FIELDS`, then those of `FLAGS`, shape (n, k).
        frame: frame of the first message's header.
        child: its `child_frame_id`.
    """

    name: str
    time: np.ndarray
    values: np.ndarray
    frame: str
    child: str

    def series(self, columns: slice, doubts: Masks = (), resets: Masks = (), frame: str = "") -> Series:
        """Return some columns as a series."""
        labels = {"source": self.name, "frame": frame or self.frame}
        return Series.of(self.time, self.values[:, columns], doubts, resets, **labels)

    def flagged(self, quantity: str, columns: slice, kind: str) -> Series:
        """Return a quantity of PX4 with the doubts and resets of its flags."""
        flags = dict(zip(FLAGS[kind], self.values.T[-len(FLAGS[kind]) :], strict=True))
        known = {name: column for name, column in flags.items() if np.isfinite(column).all()}
        return self.series(columns, *flags_of(known, quantity), frame="NED FRD" if quantity == "attitude" else "NED")


def read_rosbag_flight(path: Path, vehicle: str | None = None, choices: Choices = Choices()) -> Recording:  # noqa: B008
    """Read a rosbag2.

    Args:
        path: path of the folder, or of a file with the ending .mcap or .db3.
        vehicle: namespace of the vehicle, required if the bag has the motors of several.
        choices: choices of the user.

    Raises:
        ValueError: rosbags is not installed, the path is not a rosbag2, a required message is missing, the vehicle is
            ambiguous or unknown, or the velocity of an odometry contradicts its position.
    """
    topics, unknown, notes = _topics(path, vehicle)
    channels = Channels(unknown=unknown, notes=notes)
    offer = channels.offer

    def part(kind: str, columns: slice, **labels: Any) -> list[Series]:
        return [topic.series(columns, **labels) for topic in topics.get(kind, ())]

    odometry = topics.get("nav_msgs/msg/Odometry", [])
    for kind in POSES:
        offer("position", part(kind, slice(0, 3)))
        offer("attitude", (t.series(slice(3, 7), frame=f"{t.frame} {t.child}".strip()) for t in topics.get(kind, ())))
    offer("velocity", (_velocity(path, topic, choices.twist_frame) for topic in odometry[:1]))
    px4_position, px4_attitude = "px4_msgs/msg/VehicleLocalPosition", "px4_msgs/msg/VehicleAttitude"
    for topic in topics.get(px4_position, ()):
        for quantity, columns in (("position", slice(0, 3)), ("velocity", slice(3, 6))):
            if quantity == "position" or not odometry:
                offer(quantity, [topic.flagged(quantity, columns, px4_position)])
    for topic in topics.get(px4_attitude, ()):
        offer("attitude", [topic.flagged("attitude", slice(0, 4), px4_attitude)])
    imu, px4_imu = "sensor_msgs/msg/Imu", "px4_msgs/msg/SensorCombined"
    for quantity, columns in (("omega", slice(0, 3)), ("specific_force", slice(3, 6)), ("imu", slice(0, 6))):
        offer(quantity, [*part(imu, columns), *part(px4_imu, columns, frame="FRD")])
    body = [topic.series(slice(10, 13), frame=topic.child) for topic in odometry if not _is_world(topic)]
    offer("omega", (s for s in body if s.values.any()))
    for kind in ("sensor_msgs/msg/BatteryState", "px4_msgs/msg/BatteryStatus"):
        offer("battery", part(kind, slice(0, 2)))
    for kind in MOTORS:
        for topic in topics.get(kind, ()):
            used = np.isfinite(topic.values).any(axis=0)
            if kind == RC_OUT:
                used &= np.ptp(topic.values, axis=0) > 0.0  # servos at rest and unused channels do not change
            if used.any():
                duty = Series.of(topic.time, np.nan_to_num(topic.values[:, used]), source=topic.name)
                channels.notes += [f"motor commands from {kind}"] if "duty" not in channels.sources else []
                offer("duty", [duty])
    for topic in topics.get("sensor_msgs/msg/NavSatFix", ()):
        fix = topic.series(slice(0, 3), [("no fix", topic.values[:, 3] < 0)])
        offer("gps", [replace(fix, datum=ELLIPSOID)])
    offer("baro", part("sensor_msgs/msg/FluidPressure", slice(0, 1)))
    offer("mag", part("sensor_msgs/msg/MagneticField", slice(0, 3)))
    for topic in topics.get("sensor_msgs/msg/Range", ()):
        words = re.split(r"[^a-z]+", f"{topic.name} {topic.frame}".lower())
        direction = next((DIRECTIONS[word] for word in words if word in DIRECTIONS), "")
        offer("rangefinder", [replace(topic.series(slice(0, 1), [out_of_range(*topic.values.T)]), frame=direction)])
    motors = "px4_msgs/ActuatorMotors, actuator_msgs/Actuators, mavros_msgs/RCOut"
    return to_recording(path, channels, motors, "sensor_msgs/Imu, px4_msgs/SensorCombined", choices)


def _is_world(odometry: _Topic) -> bool:
    """Return True for an odometry whose velocity is in the axes of the world by its `child_frame_id`."""
    child = odometry.child.strip("/").lower()
    return bool(child) and (child in WORLD or child == odometry.frame.strip("/").lower())


def _velocity(path: Path, odometry: _Topic, axes: str) -> Series | None:
    """Return the velocity of an odometry in the world, None if it has none or `axes` is "none".

    By definition of the message, it is in the axes of `child_frame_id`, unless `axes` says "body" or "world".

    Raises:
        ValueError: the velocity contradicts the derivative of the position, and `axes` is "".
    """
    world = odometry.series(slice(7, 10), frame=odometry.frame)
    turn = unit(odometry.series(slice(3, 7)).values)
    body = replace(world, values=rotate(turn, world.values), frame=f"{odometry.child or 'body'} in {odometry.frame}")
    frame = axes or ("world" if _is_world(odometry) else "body")
    if frame == "none" or not world.values.any():
        return None
    candidates = {"body": body, "world": world}
    if not axes:
        check_twist(path, odometry.name, frame, candidates, odometry.series(slice(0, 3)))
    return candidates[frame]


def _topics(path: Path, vehicle: str | None) -> tuple[dict[str, list[_Topic]], tuple[str, ...], list[str]]:
    """Return the topics of each type, those with most messages first, those without a counterpart, and notes."""
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise ValueError(f"{path}: a rosbag2 needs rosbags; install lapwing[rosbag]") from None
    rows: dict[str, NumberRows] = {}
    frames: dict[str, tuple[str, str]] = {}
    with (
        parsing(path, "rosbag2", _EXPECTED[path.is_dir()]),
        AnyReader([path], default_typestore=get_typestore(Stores.LATEST)) as bag,
    ):
        inside = _prefix([(c.topic, c.msgtype) for c in bag.connections], vehicle)
        used = {
            c.topic: c.msgtype
            for c in sorted(bag.connections, key=lambda c: -c.msgcount)
            if c.topic.startswith(inside) and c.msgtype in FIELDS and not _is_command(c.topic, c.msgtype)
        }
        unknown = sorted({c.topic for c in bag.connections} - set(used))
        for connection, received, raw in bag.messages([c for c in bag.connections if c.topic in used]):
            message: Any = bag.deserialize(raw, connection.msgtype)
            values = FIELDS[connection.msgtype](message)
            flags = (float(getattr(message, flag, np.nan)) for flag in FLAGS.get(connection.msgtype, ()))
            times = _time(message, received), received * 1e-9
            rows.setdefault(connection.topic, NumberRows()).append((*times, *values, *flags))
            if connection.topic not in frames:
                frame = getattr(getattr(message, "header", None), "frame_id", "")
                frames[connection.topic] = frame, getattr(message, "child_frame_id", "")
    tables = {topic: numbers.to_array() for topic, numbers in rows.items()}
    overlap = not tables or max(t[0, 0] for t in tables.values()) < min(t[-1, 0] for t in tables.values())
    one_clock = overlap or np.ptp([np.median(t[:, 1] - t[:, 0]) for t in tables.values()]) < RESTART
    result: dict[str, list[_Topic]] = {}
    for topic, kind in used.items():
        if topic in tables and (table := tables[topic]).shape[1] > 2:
            time = table[:, 0 if one_clock else 1]
            result.setdefault(kind, []).append(_Topic(topic, time, table[:, 2:], *frames[topic]))
    notes = [] if one_clock else ["the stamps of the topics are of different clocks: times of reception are used"]
    return result, tuple(unknown), notes


def _is_command(topic: str, kind: str) -> bool:
    return kind in POSES and any(part in topic.lower() for part in COMMANDS)


def _prefix(topics: list[tuple[str, str]], vehicle: str | None) -> str:
    """Return the beginning of the vehicle's topics, given pairs (topic, type)."""
    namespaces = sorted({topic.split("/")[1] for topic, kind in topics if kind in MOTORS})
    several = any(
        len({topic.split("/")[1] for topic, kind in topics if kind == one and topic.count("/") > 1}) > 1
        for one in MOTORS
    )
    if vehicle is None and not several:
        return "/"
    if vehicle is None:
        raise LogError(f"has several vehicles: {', '.join(namespaces)}; choose one with --vehicle")
    if vehicle not in namespaces:
        names = ", ".join(namespaces) or "none"
        raise LogError(f"has no motor outputs of --vehicle {vehicle}; use one of {names}")
    return f"/{vehicle}/"


def _time(message: Any, received: int) -> float:
    """Return the time stamp of the message [s], or its reception time."""
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    if stamp is not None and (stamp.sec or stamp.nanosec):
        return float(stamp.sec) + 1e-9 * stamp.nanosec
    own = getattr(message, "timestamp", 0)
    return float(own) * 1e-6 if own else received * 1e-9
