"""Recordings from ULog files of PX4, read by pyulog.

PX4's axes are NED and FRD. Motor outputs are PWM pulses or throttles; the battery voltage converts them to volts.
"""

from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from lapwing.dynamics.input_file import unreadable
from lapwing.studies.flight_import.channels import FLU, Channels, to_recording
from lapwing.studies.flight_import.recording import Recording, Series, convert
from lapwing.studies.rotation_arrays import from_euler, from_ned_frd, ned_to_enu, to_euler, unit

PULSE_LOW, PULSE_SPAN = 1000.0, 1000.0  # [us] of a PWM output
GAUSS = 1e-4  # [T]
HIGHEST_HPA = 2000.0  # pressures below are in hPa
HEADER_SIZE = 16
DEFINITIONS = (b"B", b"F", b"I", b"M", b"P", b"Q")  # types of messages before the logged data
DATA_BEGINS = (b"A", b"L", b"C")
MAPPED = {
    "vehicle_attitude", "vehicle_local_position", "vehicle_angular_velocity", "sensor_combined", "actuator_motors",
    "actuator_outputs", "battery_status", "vehicle_gps_position", "sensor_gps", "vehicle_air_data", "sensor_baro",
    "vehicle_magnetometer", "sensor_mag", "distance_sensor", "differential_pressure", "trajectory_setpoint",
    "vehicle_local_position_setpoint", "vehicle_attitude_setpoint", "vehicle_optical_flow", "vehicle_status",
    "vehicle_land_detected", "actuator_armed",
}  # fmt: skip
ARMED = 2.0  # vehicle_status.arming_state


def read_ulog_flight(path: Path) -> Recording:
    """Read a ULog file.

    Raises:
        ValueError: the file is not a ULog file, or a required topic is missing.
    """
    from pyulog import ULog

    try:
        _check_definitions(path)
        with redirect_stdout(StringIO()), redirect_stderr(StringIO()):  # pyulog prints messages on damaged data
            log = ULog(str(path))
    except OSError as error:
        raise unreadable(path, error, "a .ulg file of PX4") from None
    except Exception:  # pyulog raises exceptions of many types
        raise ValueError(f"{path}: is not a readable ULog file; expected a .ulg file of PX4") from None
    topics: dict[str, dict[str, Any]] = {}
    for data in log.data_list:
        topics.setdefault(data.name, data.data)
    for name in ("vehicle_attitude", "vehicle_local_position"):
        if name not in topics:
            raise ValueError(f"{path}: topic {name} is missing; set SDLOG_PROFILE to its default and fly again")
    channels = Channels(unknown=tuple(sorted(set(topics) - MAPPED)))

    def series(topic: str, *fields: str) -> Series | None:
        data = topics.get(topic, {})
        if not all(f in data for f in fields) or "timestamp" not in data:
            return None
        time = (data["timestamp"].astype(np.int64) - log.start_timestamp) * 1e-6
        return Series.of(time, np.column_stack([data[f].astype(float) for f in fields]))

    def vector(topic: str, field: str) -> Series | None:
        return series(topic, *(f"{field}[{k}]" for k in range(3)))

    channels.attitude = convert(series("vehicle_attitude", *(f"q[{k}]" for k in range(4))), from_ned_frd)
    channels.position = convert(series("vehicle_local_position", "x", "y", "z"), ned_to_enu)
    channels.velocity = convert(series("vehicle_local_position", "vx", "vy", "vz"), ned_to_enu)
    rates = vector("vehicle_angular_velocity", "xyz") or vector("sensor_combined", "gyro_rad")
    channels.omega = convert(rates, lambda v: v * FLU)
    channels.specific_force = convert(vector("sensor_combined", "accelerometer_m_s2"), lambda v: v * FLU)
    channels.battery = series("battery_status", "voltage_v", "current_a")
    channels.duty = _duty(topics, series, channels)
    channels.setpoint = _setpoint(series, vector)
    channels.attitude_setpoint = _attitude_setpoint(series)
    channels.readings = _readings(series, vector)
    if (status := _status(series)) is not None:
        channels.readings["status"] = status
    return to_recording(
        path, channels, "actuator_motors, actuator_outputs", "vehicle_angular_velocity, sensor_combined"
    )


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


def _duty(topics: dict[str, dict[str, Any]], series: Any, channels: Channels) -> Series | None:
    """Return the fractions of full throttle of the motors in use."""
    if "actuator_motors" in topics:
        data = topics["actuator_motors"]
        used = [f for f in data if f.startswith("control[") and np.isfinite(data[f]).any()]
        channels.notes.append("motor commands from actuator_motors")
        return convert(series("actuator_motors", *used), np.nan_to_num) if used else None
    if "actuator_outputs" not in topics:
        return None
    data = topics["actuator_outputs"]
    outputs = [f"output[{k}]" for k in range(int(np.max(data.get("noutputs", 0))))]
    used = [name for name in outputs if name in data and np.ptp(data[name]) > 0.0] or ["output[0]"]
    channels.notes.append("motor commands from actuator_outputs")
    return convert(series("actuator_outputs", *used), lambda v: (v - PULSE_LOW) / PULSE_SPAN if v.max() > 2.0 else v)


def _setpoint(series: Any, vector: Any) -> Series | None:
    """Return desired position, velocity, acceleration, yaw and yaw rate in the columns of `Recording.setpoint`."""
    for topic in ("trajectory_setpoint", "vehicle_local_position_setpoint"):  # single fields until PX4 1.13
        position = vector(topic, "position") or series(topic, "x", "y", "z")
        velocity = vector(topic, "velocity") or series(topic, "vx", "vy", "vz")
        acceleration = vector(topic, "acceleration") or series(topic, "acc_x", "acc_y", "acc_z")
        heading_ned = series(topic, "yaw", "yawspeed")
        if position is not None and velocity is not None and heading_ned is not None:
            unset = np.full((len(position.time), 3), np.nan)
            accelerations = acceleration.values if acceleration else unset
            vectors = [ned_to_enu(v) for v in (position.values, velocity.values, accelerations)]
            yaw, yaw_rate = heading_ned.values.T
            heading = np.arctan2(np.cos(yaw), np.sin(yaw))  # from east, counterclockwise
            return Series(position.time, np.column_stack([*vectors, heading, -yaw_rate]), position.dropped)
    return None


def _attitude_setpoint(series: Any) -> Series | None:
    """Return desired roll, pitch and yaw of FLU axes in ENU."""
    topic = "vehicle_attitude_setpoint"
    quaternion = series(topic, *(f"q_d[{k}]" for k in range(4)))
    euler = series(topic, "roll_body", "pitch_body", "yaw_body")
    if quaternion is not None and np.linalg.norm(quaternion.values, axis=1).all():
        return convert(quaternion, lambda v: to_euler(from_ned_frd(unit(v))))
    return convert(euler, lambda v: to_euler(from_ned_frd(from_euler(v))))


def _optical_flow(series: Any) -> Series | None:
    """Return the rates of flow and body [rad/s] about body x and y, and the distance [m]."""
    topic = "vehicle_optical_flow"
    flow = series(topic, "pixel_flow[0]", "pixel_flow[1]", "delta_angle[0]", "delta_angle[1]", "distance_m")
    span = series(topic, "integration_timespan_us")
    if flow is None or span is None:
        return None
    rates = flow.values[:, :4] * [1.0, -1.0, 1.0, -1.0] / (span.values * 1e-6)
    return Series(flow.time, np.column_stack([rates, flow.values[:, 4]]), flow.dropped)


def _status(series: Any) -> Series | None:
    """Return armed, landed, failsafe and navigation state at all times at which one of them is logged."""
    state = series("vehicle_status", "arming_state", "failsafe", "nav_state")
    if state is None:
        return None
    armed, landed = series("actuator_armed", "armed"), series("vehicle_land_detected", "landed")
    time = np.unique(np.concatenate([s.time for s in (state, armed, landed) if s is not None]))
    time = time[time >= state.time[0]]

    def latest(source: Series, column: int) -> np.ndarray:
        return source.values[np.maximum(np.searchsorted(source.time, time, side="right") - 1, 0), column]

    columns = [
        latest(armed, 0) if armed else latest(state, 0) == ARMED,
        latest(landed, 0) if landed else np.zeros(len(time)),
        latest(state, 1), latest(state, 2),
    ]  # fmt: skip
    return Series.of(time, np.column_stack(columns))


def _readings(series: Any, vector: Any) -> dict[str, Series]:
    """Return the readings of each sensor, from the estimator's topic if the log has it, otherwise from the driver's."""

    def scale(source: Series | None, *factors: float) -> Series | None:
        return convert(source, lambda v: v * factors)

    def gps(topic: str) -> Series | None:  # degrees and metres were integers until PX4 1.14
        return series(topic, "latitude_deg", "longitude_deg", "altitude_msl_m") or scale(
            series(topic, "lat", "lon", "alt"), 1e-7, 1e-7, 1e-3
        )

    def gps_velocity(topic: str) -> Series | None:
        return convert(series(topic, "vel_n_m_s", "vel_e_m_s", "vel_d_m_s"), ned_to_enu)

    driver = series("sensor_baro", "pressure")
    if driver and np.median(driver.values) < HIGHEST_HPA:  # hPa until PX4 1.13
        driver = scale(driver, 100.0)
    field = vector("vehicle_magnetometer", "magnetometer_ga") or series("sensor_mag", "x", "y", "z")
    field = field or vector("sensor_combined", "magnetometer_ga")  # until PX4 1.7
    raw = [f"{name}[{k}]" for name in ("gyro_rad", "accelerometer_m_s2") for k in range(3)]
    result = {
        "imu": scale(series("sensor_combined", *raw), *FLU, *FLU),
        "gps": gps("vehicle_gps_position") or gps("sensor_gps"),
        "gps_velocity": gps_velocity("vehicle_gps_position") or gps_velocity("sensor_gps"),
        "baro": series("vehicle_air_data", "baro_pressure_pa") or driver,
        "mag": scale(field, *FLU * GAUSS),
        "rangefinder": series("distance_sensor", "current_distance"),
        "optical_flow": _optical_flow(series),
        "airspeed": series("differential_pressure", "differential_pressure_pa")
        or series("differential_pressure", "differential_pressure_raw_pa"),
    }
    return {name: s for name, s in result.items() if s is not None}
