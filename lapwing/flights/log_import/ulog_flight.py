"""Recordings from ULog files of PX4, read by pyulog.

PX4's axes are NED and FRD. Motor outputs are PWM pulses or throttles; the battery voltage converts them to volts.
"""

from contextlib import redirect_stderr, redirect_stdout
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from lapwing.flights.log_import.channels import Channels, to_recording
from lapwing.flights.log_import.log_conventions import FIX, direction, out_of_range, parsing, shares
from lapwing.flights.log_import.recording import ELLIPSOID, LONGEST_GAP, SEA_LEVEL, Recording, Series
from lapwing.flights.log_import.source_choice import Choices
from lapwing.services.common.ports import IMUS

GAUSS = 1e-4  # [T]
HIGHEST_HPA = 2000.0  # pressures below are in hPa
HEADER_SIZE = 16
DEFINITIONS = (b"B", b"F", b"I", b"M", b"P", b"Q")  # types of messages before the logged data
DATA_BEGINS = (b"A", b"L", b"C")
ARMED = 2.0  # vehicle_status.arming_state


VALID = {  # flags of vehicle_local_position that its fields need
    "position": ("xy_valid", "z_valid"), "velocity": ("v_xy_valid", "v_z_valid"),
}  # fmt: skip
RESETS = {  # counters of the estimator's resets by topic and quantity
    "position": ("xy_reset_counter", "z_reset_counter"),
    "velocity": ("vxy_reset_counter", "vz_reset_counter"),
    "attitude": ("quat_reset_counter",),
}


def read_ulog_flight(path: Path, choices: Choices = Choices()) -> Recording:  # noqa: B008
    """Read a ULog file.

    Raises:
        ValueError: the file is not a ULog file, or a required topic is missing.
    """
    from pyulog import ULog

    with parsing(path, "ULog file", "a .ulg file of PX4"):
        _check_definitions(path)
        with redirect_stdout(StringIO()), redirect_stderr(StringIO()):  # pyulog prints messages on damaged data
            log = ULog(str(path))
    topics = _Topics(log)
    firmware = "px4" if log.msg_info_dict.get("sys_name") == "PX4" else ""  # Lapwing writes such files, too
    channels = Channels(dropouts=topics.dropouts, firmware=firmware)
    every, vector, offer = topics.every, topics.vector, channels.offer
    offer("attitude", every("vehicle_attitude", *(f"q[{k}]" for k in range(4)), quantity="attitude", frame="NED FRD"))
    for quantity, fields in (("position", ("x", "y", "z")), ("velocity", ("vx", "vy", "vz"))):
        offer(quantity, every("vehicle_local_position", *fields, quantity=quantity, frame="NED", datum="local origin"))
    for quantity, topic, field in (
        ("omega", "vehicle_angular_velocity", "xyz"), ("omega", "sensor_combined", "gyro_rad"),
        ("specific_force", "sensor_combined", "accelerometer_m_s2"),
    ):  # fmt: skip
        offer(quantity, vector(topic, field, frame="FRD"))
    offer("battery", every("battery_status", "voltage_v", "current_a"))
    offer("duty", _duty(topics))
    offer("setpoint", _setpoint(topics))
    offer("attitude_setpoint", _attitude_setpoint(topics))
    _offer_readings(channels, topics)
    channels.unknown = topics.unread
    return to_recording(
        path, channels, "actuator_motors, actuator_outputs", "vehicle_angular_velocity, sensor_combined", choices
    )


class _Topics:
    """Topics of a log as series.

    Attributes:
        dropouts: spans [s] in which the logger lost messages.
    """

    def __init__(self, log: Any):
        self._log = log
        self._instances: dict[str, list[tuple[int, dict[str, Any]]]] = {}
        for data in sorted(log.data_list, key=lambda each: each.multi_id):
            self._instances.setdefault(data.name, []).append((data.multi_id, data.data))
        self._read: set[str] = set()
        self.dropouts = [
            (begin, begin + 1e-3 * mark.duration)
            for mark in log.dropouts
            if (begin := (mark.timestamp - log.start_timestamp) * 1e-6) >= 0.0
        ]

    def columns(self, topic: str) -> list[tuple[int, dict[str, Any]]]:
        """Return number and columns of each instance of a topic."""
        self._read.add(topic)
        return self._instances.get(topic, [])

    @property
    def unread(self) -> tuple[str, ...]:
        """Names of the topics that nothing has read."""
        return tuple(sorted(set(self._instances) - self._read))

    def every(self, topic: str, *fields: str, quantity: str = "", **labels: Any) -> list[Series]:
        """Return the fields of each instance of a topic that has them all."""
        result = []
        several = len(self.columns(topic)) > 1
        for number, data in self.columns(topic):
            if "timestamp" in data and all(f in data for f in fields):
                time = (data["timestamp"].astype(np.int64) - self._log.start_timestamp) * 1e-6
                values = np.column_stack([data[f].astype(float) for f in fields])
                doubts, resets = flags_of(data, quantity)
                instance = number if several or number else None
                result.append(Series.of(time, values, doubts, resets, source=topic, instance=instance, **labels))
        return result

    def vector(self, topic: str, field: str, **labels: Any) -> list[Series]:
        """Return an array of three of each instance."""
        return self.every(topic, *(f"{field}[{k}]" for k in range(3)), **labels)

    def first(self, topic: str, *fields: str, **labels: Any) -> Series | None:
        """Return the fields of the first instance, None if there is none."""
        return next(iter(self.every(topic, *fields, **labels)), None)


def flags_of(data: dict[str, Any], quantity: str) -> tuple[list[tuple[str, np.ndarray]], list[tuple[str, np.ndarray]]]:
    """Return the doubts and resets that the fields of a topic's instance express about a quantity."""
    doubts = [(f"{flag} 0", data[flag] == 0) for flag in VALID.get(quantity, ()) if flag in data]
    if quantity in ("gps", "gps_velocity") and "fix_type" in data:
        doubts.append(("no fix", data["fix_type"] < FIX))
    if quantity == "gps_velocity" and "vel_ned_valid" in data:
        doubts.append(("vel_ned_valid 0", data["vel_ned_valid"] == 0))
    if quantity == "rangefinder":
        if "signal_quality" in data:
            doubts.append(("signal quality 0", data["signal_quality"] == 0))
        if {"min_distance", "max_distance"} <= set(data):
            doubts.append(out_of_range(*(data[f"{name}_distance"] for name in ("current", "min", "max"))))
    resets = [
        (
            f"{counter.removesuffix('_counter').replace('_', ' ')}",
            np.diff(data[counter], prepend=data[counter][:1]) != 0,
        )
        for counter in RESETS.get(quantity, ())
        if counter in data
    ]
    return doubts, resets


def _check_definitions(path: Path) -> None:
    """Raise ValueError if a message before the logged data is truncated or of unknown type: pyulog may hang."""
    data, at = path.read_bytes(), HEADER_SIZE
    while at < len(data):
        if at + 3 > len(data):
            raise ValueError("cut message")
        size, kind = int.from_bytes(data[at : at + 2], "little"), data[at + 2 : at + 3]
        if kind in DATA_BEGINS:
            return
        if kind not in DEFINITIONS or at + 3 + size > len(data):
            raise ValueError("damaged message")
        at += 3 + size


def _duty(topics: _Topics) -> list[Series]:
    """Return the fractions of full throttle of the motors in use, of each instance."""
    result = []
    for number, data in topics.columns("actuator_motors"):
        used = [f for f in data if f.startswith("control[") and np.isfinite(data[f]).any()]
        sources = topics.every("actuator_motors", *used) if used else []
        result += [replace(s, values=np.nan_to_num(s.values)) for s in sources if s.instance in (None, number)]
    for number, data in topics.columns("actuator_outputs"):
        outputs = [f"output[{k}]" for k in range(int(np.max(data.get("noutputs", 0))))]
        used = [name for name in outputs if name in data and np.ptp(data[name]) > 0.0] or ["output[0]"]
        sources = topics.every("actuator_outputs", *used)
        result += [replace(s, values=_shares(s.values)) for s in sources if s.instance in (None, number)]
    return result


def _shares(outputs: np.ndarray) -> np.ndarray:
    """Convert pulses [us] to shares, which other outputs are already."""
    return shares(outputs) if outputs.max(initial=0.0) > 2.0 else outputs


def _setpoint(topics: _Topics) -> list[Series]:
    """Return desired position, velocity, acceleration, yaw and yaw rate, NED."""
    result = []
    for topic in ("trajectory_setpoint", "vehicle_local_position_setpoint"):  # single fields until PX4 1.13
        single = (("x", "y", "z"), ("vx", "vy", "vz"), ("acc_x", "acc_y", "acc_z"))
        names = ("position", "velocity", "acceleration")
        position, velocity, acceleration = (
            next(iter(topics.vector(topic, name) or topics.every(topic, *others)), None)
            for name, others in zip(names, single, strict=True)
        )
        heading = topics.first(topic, "yaw", "yawspeed")
        if position is not None and velocity is not None and heading is not None:
            unset = np.full((len(position.time), 3), np.nan)
            vectors = (position.values, velocity.values, acceleration.values if acceleration else unset)
            result.append(replace(position, values=np.column_stack([*vectors, heading.values]), frame="NED"))
    return result


def _attitude_setpoint(topics: _Topics) -> list[Series | None]:
    """Return the desired attitude as a quaternion, or as angles where a quaternion is not set."""
    topic = "vehicle_attitude_setpoint"
    quaternion = topics.first(topic, *(f"q_d[{k}]" for k in range(4)), frame="NED FRD")
    euler = topics.first(topic, "roll_body", "pitch_body", "yaw_body", frame="NED FRD")
    return [quaternion if quaternion is not None and np.linalg.norm(quaternion.values, axis=1).all() else euler]


def _optical_flow(topics: _Topics) -> list[Series]:
    """Return the rates of flow and body [rad/s] about body x and y, and the distance [m], of each instance."""
    fields = ("pixel_flow[0]", "pixel_flow[1]", "delta_angle[0]", "delta_angle[1]", "distance_m")
    result = []
    for flow in topics.every("vehicle_optical_flow", *fields, "integration_timespan_us", frame="FRD"):
        rates = flow.values[:, :4] / (flow.values[:, 5:] * 1e-6)
        result.append(replace(flow, values=np.column_stack([rates, flow.values[:, 4]])))
    return result


def _further_imus(topics: _Topics) -> list[Series]:
    """Return rates and specific force of the IMUs that `sensor_combined` does not have, if they are logged fast."""
    selection = topics.first("sensor_selection", "accel_device_id")
    gyroscopes = {s.instance: s for s in topics.every("sensor_gyro", "x", "y", "z", frame="FRD")}
    forces = topics.every("sensor_accel", "x", "y", "z", "device_id", frame="FRD")
    used = forces[:1] if selection is None else [selection]
    result = []
    for force in forces:
        rates = gyroscopes.get(force.instance)
        if rates is None or any(force.values[0, -1] in s.values[:, -1] for s in used):
            continue
        if len(rates.time) > 1 and np.median(np.diff(rates.time)) < LONGEST_GAP:
            values = np.hstack([rates.values, force.at(rates.time)[:, :3]])
            result.append(replace(rates, values=values, instance=None))
    return result


def _status(topics: _Topics) -> list[Series]:
    """Return armed, landed, failsafe and navigation state at all times at which one of them is logged."""
    state = topics.first("vehicle_status", "arming_state", "failsafe", "nav_state")
    if state is None:
        return []
    armed, landed = topics.first("actuator_armed", "armed"), topics.first("vehicle_land_detected", "landed")
    time = np.unique(np.concatenate([s.time for s in (state, armed, landed) if s is not None]))
    time = time[time >= state.time[0]]

    def latest(source: Series, column: int) -> np.ndarray:
        return source.values[np.maximum(np.searchsorted(source.time, time, side="right") - 1, 0), column]

    columns = [
        latest(armed, 0) if armed else latest(state, 0) == ARMED,
        latest(landed, 0) if landed else np.zeros(len(time)),
        latest(state, 1), latest(state, 2),
    ]  # fmt: skip
    return [Series.of(time, np.column_stack(columns), source="vehicle_status")]


def _offer_readings(channels: Channels, topics: _Topics) -> None:
    """Offer the readings of each sensor, those of the estimator's topic before those of the driver."""
    every, vector, offer = topics.every, topics.vector, channels.offer

    def scaled(sources: list[Series], *factors: float) -> list[Series]:
        return [replace(s, values=s.values * factors) for s in sources]

    raw = [f"{name}[{k}]" for name in ("gyro_rad", "accelerometer_m_s2") for k in range(3)]
    offer("imu", every("sensor_combined", *raw, frame="FRD"))
    for name, unit in zip(IMUS[1:], _further_imus(topics), strict=False):
        offer(name, [unit])
    for topic in ("vehicle_gps_position", "sensor_gps"):  # degrees and metres were integers until PX4 1.14
        for height, datum in (("ellipsoid", ELLIPSOID), ("msl", SEA_LEVEL)):
            labels = {"quantity": "gps", "datum": datum}
            former = "alt_ellipsoid" if height == "ellipsoid" else "alt"
            fixes = [
                *every(topic, "latitude_deg", "longitude_deg", f"altitude_{height}_m", **labels),
                *scaled(every(topic, "lat", "lon", former, **labels), 1e-7, 1e-7, 1e-3),
            ]
            offer("gps", [s for s in fixes if s.values[:, 2].any()])  # 0: not filled by the driver
        velocity = ("vel_n_m_s", "vel_e_m_s", "vel_d_m_s")
        offer("gps_velocity", every(topic, *velocity, quantity="gps_velocity", frame="NED"))
    offer("baro", every("vehicle_air_data", "baro_pressure_pa"))
    for driver in every("sensor_baro", "pressure"):
        in_hpa = np.median(driver.values) < HIGHEST_HPA  # until PX4 1.13
        offer("baro", scaled([driver], 100.0 if in_hpa else 1.0))
    fields = (
        vector("vehicle_magnetometer", "magnetometer_ga", frame="FRD"),
        every("sensor_mag", "x", "y", "z", frame="FRD"),
        vector("sensor_combined", "magnetometer_ga", frame="FRD"),  # until PX4 1.7
    )
    for field in fields:
        offer("mag", scaled(field, GAUSS))
    directions = {
        number: direction(data["orientation"][0]) if "orientation" in data else ""
        for number, data in topics.columns("distance_sensor")
    }
    for sensor in every("distance_sensor", "current_distance", quantity="rangefinder"):
        number = sensor.instance if sensor.instance is not None else next(iter(directions))
        offer("rangefinder", [replace(sensor, frame=directions[number])])
    offer("optical_flow", _optical_flow(topics))
    offer("airspeed", every("differential_pressure", "differential_pressure_pa"))
    offer("airspeed", every("differential_pressure", "differential_pressure_raw_pa"))
    offer("status", _status(topics))
