"""Recordings from ULog files of PX4, read by pyulog.

PX4's axes are NED and FRD. Motor outputs are PWM pulses or shares of full throttle; they become volts by the battery's.
"""

from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from lapwing.studies.flight_import.channels import FLU, Channels, to_recording
from lapwing.studies.flight_import.recording import Recording, Series
from lapwing.studies.flight_import.rotation_arrays import from_ned_frd, ned_to_enu

PULSE_LOW, PULSE_SPAN = 1000.0, 1000.0  # [us] of a PWM output
GAUSS = 1e-4  # [T]
HIGHEST_HPA = 2000.0  # pressures below are in hPa
HEADER_SIZE = 16
DEFINITIONS = (b"B", b"F", b"I", b"M", b"P", b"Q")  # types of messages before the logged data
DATA_BEGINS = (b"A", b"L", b"C")
MAPPED = {
    "vehicle_attitude", "vehicle_local_position", "vehicle_angular_velocity", "sensor_combined", "actuator_motors",
    "actuator_outputs", "battery_status", "vehicle_gps_position", "sensor_gps", "vehicle_air_data", "sensor_baro",
    "vehicle_magnetometer", "sensor_mag", "distance_sensor", "differential_pressure",
}  # fmt: skip


def read_ulog_flight(path: Path) -> Recording:
    """Read a ULog file.

    Raises:
        ValueError: no ULog file, or a topic is missing that a flight needs.
    """
    from pyulog import ULog

    try:
        _check_definitions(path)
        with redirect_stdout(StringIO()), redirect_stderr(StringIO()):  # pyulog prints what it finds damaged
            log = ULog(str(path))
    except OSError as error:
        raise ValueError(f"{path}: cannot be read: {(error.strerror or str(error)).lower()}") from None
    except Exception:  # pyulog raises what its parser runs into
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

    def three(topic: str, field: str) -> Series | None:
        return series(topic, *(f"{field}[{k}]" for k in range(3)))

    def moved(source: Series | None, change: Any) -> Series | None:
        return source and Series(source.time, change(source.values), source.dropped)

    channels.attitude = moved(series("vehicle_attitude", *(f"q[{k}]" for k in range(4))), from_ned_frd)
    channels.position = moved(series("vehicle_local_position", "x", "y", "z"), ned_to_enu)
    channels.velocity = moved(series("vehicle_local_position", "vx", "vy", "vz"), ned_to_enu)
    rates = three("vehicle_angular_velocity", "xyz") or three("sensor_combined", "gyro_rad")
    channels.omega = moved(rates, lambda v: v * FLU)
    channels.specific_force = moved(three("sensor_combined", "accelerometer_m_s2"), lambda v: v * FLU)
    channels.battery = series("battery_status", "voltage_v", "current_a")
    channels.duty = _duty(topics, series, channels)
    channels.readings = _readings(series, three)
    return to_recording(
        path, channels, "actuator_motors, actuator_outputs", "vehicle_angular_velocity, sensor_combined"
    )


def _check_definitions(path: Path) -> None:
    """Raise ValueError if a message before the logged data is cut or of no known type: pyulog may not return then."""
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
        source = series("actuator_motors", *used) if used else None
        return source and Series(source.time, np.nan_to_num(source.values), source.dropped)
    if "actuator_outputs" not in topics:
        return None
    data = topics["actuator_outputs"]
    outputs = [f"output[{k}]" for k in range(int(np.max(data.get("noutputs", 0))))]
    used = [name for name in outputs if name in data and np.ptp(data[name]) > 0.0] or ["output[0]"]
    channels.notes.append("motor commands from actuator_outputs")
    source = series("actuator_outputs", *used)
    if source is None:
        return None
    pulses = source.values.max() > 2.0
    return Series(source.time, (source.values - PULSE_LOW) / PULSE_SPAN if pulses else source.values, source.dropped)


def _readings(series: Any, three: Any) -> dict[str, Series]:
    """Sensors, each from the topic that the estimator used where there is one, else from the driver's."""

    def scaled(source: Series | None, *factors: float) -> Series | None:
        return source and Series(source.time, source.values * factors)

    def gps(topic: str) -> Series | None:  # degrees and metres were integers until PX4 1.14
        return series(topic, "latitude_deg", "longitude_deg", "altitude_msl_m") or scaled(
            series(topic, "lat", "lon", "alt"), 1e-7, 1e-7, 1e-3
        )

    driver = series("sensor_baro", "pressure")
    if driver and np.median(driver.values) < HIGHEST_HPA:  # hPa until PX4 1.13
        driver = scaled(driver, 100.0)
    field = three("vehicle_magnetometer", "magnetometer_ga") or series("sensor_mag", "x", "y", "z")
    field = field or three("sensor_combined", "magnetometer_ga")  # until PX4 1.7
    raw = [f"{name}[{k}]" for name in ("gyro_rad", "accelerometer_m_s2") for k in range(3)]
    result = {
        "imu": scaled(series("sensor_combined", *raw), *FLU, *FLU),
        "gps": gps("vehicle_gps_position") or gps("sensor_gps"),
        "baro": series("vehicle_air_data", "baro_pressure_pa") or driver,
        "mag": scaled(field, *FLU * GAUSS),
        "rangefinder": series("distance_sensor", "current_distance"),
        "airspeed": series("differential_pressure", "differential_pressure_pa")
        or series("differential_pressure", "differential_pressure_raw_pa"),
    }
    return {name: s for name, s in result.items() if s is not None}
