"""Recordings from rosbag2 folders or single files (SQLite or MCAP), read by rosbags.

Messages are selected by type: those of ROS (ENU, FLU; REP 103), MAVROS, and PX4 (NED, FRD). Of several topics of one
type, the one with most messages is used. A bag with the motors of several vehicles needs the name of one: the first
part of its topics.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from lapwing.studies.flight_import.channels import FLU, Channels, to_recording
from lapwing.studies.flight_import.message_columns import NumberRows, RowLengthError
from lapwing.studies.flight_import.recording import Recording, Series, convert
from lapwing.studies.rotation_arrays import from_ned_frd, ned_to_enu, rotate, unit

PULSE_LOW, PULSE_SPAN = 1000.0, 1000.0  # [us]
RC_OUT = "mavros_msgs/msg/RCOut"
COMMANDS = ("setpoint", "target", "goal", "reference", "desired", "command")  # parts of the names of commanded poses


def _xyz(v: Any) -> list[float]:
    return [v.x, v.y, v.z]


def _wxyz(q: Any) -> list[float]:
    return [q.w, q.x, q.y, q.z]


def _odometry(m: Any) -> list[float]:
    return [*_xyz(m.pose.pose.position), *_wxyz(m.pose.pose.orientation), *_xyz(m.twist.twist.linear)]


FIELDS: dict[str, Callable[[Any], Any]] = {  # values of each message by type
    "nav_msgs/msg/Odometry": _odometry,  # velocity in body axes
    "geometry_msgs/msg/PoseStamped": lambda m: [*_xyz(m.pose.position), *_wxyz(m.pose.orientation)],
    "sensor_msgs/msg/Imu": lambda m: [*_xyz(m.angular_velocity), *_xyz(m.linear_acceleration)],
    "sensor_msgs/msg/BatteryState": lambda m: [m.voltage, abs(m.current)],
    "sensor_msgs/msg/NavSatFix": lambda m: (
        [m.latitude, m.longitude, m.altitude] if m.status.status >= 0 else [np.nan] * 3
    ),
    "sensor_msgs/msg/FluidPressure": lambda m: [m.fluid_pressure],
    "sensor_msgs/msg/MagneticField": lambda m: _xyz(m.magnetic_field),
    "sensor_msgs/msg/Range": lambda m: [m.range],
    "actuator_msgs/msg/Actuators": lambda m: m.normalized,
    RC_OUT: lambda m: (np.asarray(m.channels, float) - PULSE_LOW) / PULSE_SPAN,
    "px4_msgs/msg/ActuatorMotors": lambda m: m.control,
    "px4_msgs/msg/VehicleAttitude": lambda m: m.q,
    "px4_msgs/msg/VehicleLocalPosition": lambda m: [m.x, m.y, m.z, m.vx, m.vy, m.vz],
    "px4_msgs/msg/SensorCombined": lambda m: [*m.gyro_rad, *m.accelerometer_m_s2],
    "px4_msgs/msg/BatteryStatus": lambda m: [m.voltage_v, m.current_a],
}

MOTORS = ("px4_msgs/msg/ActuatorMotors", "actuator_msgs/msg/Actuators", RC_OUT)
_EXPECTED = ("a file of messages of ROS 2", "a folder with metadata.yaml and its messages")
POSES = ("nav_msgs/msg/Odometry", "geometry_msgs/msg/PoseStamped")


def read_rosbag_flight(path: Path, vehicle: str | None = None) -> Recording:
    """Read a rosbag2.

    Args:
        path: path of the folder, or of a file with the ending .mcap or .db3.
        vehicle: namespace of the vehicle, required if the bag has the motors of several.

    Raises:
        ValueError: rosbags is not installed, the path is not a rosbag2, a required message is missing, or the
            vehicle is ambiguous or unknown.
    """
    series, unknown = _series(path, vehicle)
    channels = Channels(unknown=unknown)

    def part(name: str, columns: slice, change: Callable[[np.ndarray], np.ndarray] = np.asarray) -> Series | None:
        return convert(series.get(name), lambda v: change(v[:, columns]))

    ros, px4 = "sensor_msgs/msg/", "px4_msgs/msg/"
    pose = "nav_msgs/msg/Odometry" if "nav_msgs/msg/Odometry" in series else "geometry_msgs/msg/PoseStamped"
    vehicle, imu = f"{px4}VehicleLocalPosition", f"{px4}SensorCombined"
    channels.position = part(pose, slice(0, 3)) or part(vehicle, slice(0, 3), ned_to_enu)
    channels.attitude = part(pose, slice(3, 7)) or part(f"{px4}VehicleAttitude", slice(0, 4), from_ned_frd)
    if (odometry := series.get("nav_msgs/msg/Odometry")) is not None:
        body = rotate(unit(odometry.values[:, 3:7]), odometry.values[:, 7:10])
        channels.velocity = Series(odometry.time, body, odometry.dropped)
    else:
        channels.velocity = part(vehicle, slice(3, 6), ned_to_enu)
    channels.omega = part(f"{ros}Imu", slice(0, 3)) or part(imu, slice(0, 3), lambda v: v * FLU)
    channels.specific_force = part(f"{ros}Imu", slice(3, 6)) or part(imu, slice(3, 6), lambda v: v * FLU)
    channels.battery = part(f"{ros}BatteryState", slice(0, 2)) or part(f"{px4}BatteryStatus", slice(0, 2))
    for name in MOTORS:
        if (source := series.get(name)) is not None:
            used = np.isfinite(source.values).any(axis=0)
            if name == RC_OUT:
                used &= np.ptp(source.values, axis=0) > 0.0  # servos at rest and unused channels do not change
            if not used.any():
                continue
            channels.duty = Series(source.time, np.nan_to_num(source.values[:, used]), source.dropped)
            channels.notes.append(f"motor commands from {name}")
            break
    everything = slice(None)
    readings = {
        "imu": part(f"{ros}Imu", slice(0, 6)) or part(imu, slice(0, 6), lambda v: v * np.tile(FLU, 2)),
        "gps": part(f"{ros}NavSatFix", everything),
        "baro": part(f"{ros}FluidPressure", everything),
        "mag": part(f"{ros}MagneticField", everything),
        "rangefinder": part(f"{ros}Range", everything),
    }
    channels.readings = {name: s for name, s in readings.items() if s is not None}
    motors = "px4_msgs/ActuatorMotors, actuator_msgs/Actuators, mavros_msgs/RCOut"
    return to_recording(path, channels, motors, "sensor_msgs/Imu, px4_msgs/SensorCombined")


def _series(path: Path, vehicle: str | None) -> tuple[dict[str, Series], tuple[str, ...]]:
    """Return values by message type, and the topics without a counterpart."""
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise ValueError(f"{path}: a rosbag2 needs rosbags; install lapwing[rosbag]") from None
    rows: dict[str, NumberRows] = {}
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.LATEST)) as bag:
            largest: dict[str, Any] = {}
            inside = _prefix(path, [(c.topic, c.msgtype) for c in bag.connections], vehicle)
            for connection in bag.connections:
                if not connection.topic.startswith(inside):
                    continue
                kind = connection.msgtype
                if any(part in connection.topic.lower() for part in COMMANDS) and kind in POSES:
                    continue
                if kind in FIELDS and connection.msgcount > (largest[kind].msgcount if kind in largest else 0):
                    largest[kind] = connection
            unknown = sorted({c.topic for c in bag.connections} - {c.topic for c in largest.values()})
            for connection, received, raw in bag.messages(list(largest.values())):
                message: Any = bag.deserialize(raw, connection.msgtype)
                values = FIELDS[connection.msgtype](message)
                rows.setdefault(connection.msgtype, NumberRows()).append((_time(message, received), *values))
    except VehicleError:
        raise
    except RowLengthError:
        raise ValueError(f"{path}: a topic's arrays change their length; record the flight again") from None
    except Exception:  # rosbags raises exceptions of many types
        raise ValueError(f"{path}: is not a readable rosbag2; expected {_EXPECTED[path.is_dir()]}") from None
    tables = {kind: numbers.to_array() for kind, numbers in rows.items()}
    series = {kind: Series.of(table[:, 0], table[:, 1:]) for kind, table in tables.items() if table.shape[1] > 1}
    return series, tuple(unknown)


class VehicleError(ValueError):
    """Vehicle that is ambiguous or not in the bag."""


def _prefix(path: Path, topics: list[tuple[str, str]], vehicle: str | None) -> str:
    """Return the beginning of the vehicle's topics, given pairs (topic, type)."""
    namespaces = sorted({topic.split("/")[1] for topic, kind in topics if kind in MOTORS})
    several = any(
        len({topic.split("/")[1] for topic, kind in topics if kind == one and topic.count("/") > 1}) > 1
        for one in MOTORS
    )
    if vehicle is None and not several:
        return "/"
    if vehicle is None:
        raise VehicleError(f"{path}: has several vehicles: {', '.join(namespaces)}; choose one with --vehicle")
    if vehicle not in namespaces:
        names = ", ".join(namespaces) or "none"
        raise VehicleError(f"--vehicle {vehicle}: has no motor outputs in {path}; use one of {names}")
    return f"/{vehicle}/"


def _time(message: Any, received: int) -> float:
    """Return the time stamp of the message [s], or its reception time."""
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    if stamp is not None and (stamp.sec or stamp.nanosec):
        return float(stamp.sec) + 1e-9 * stamp.nanosec
    own = getattr(message, "timestamp", 0)
    return float(own) * 1e-6 if own else received * 1e-9
