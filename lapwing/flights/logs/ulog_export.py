"""Export of a flight as a ULog file with topics of PX4, for PlotJuggler, Flight Review and readers of real logs.

The file has what a vehicle can log: estimate, IMU, motor commands, battery and setpoints. A quantity that the autopilot
does not have, as it flies on the true state, is the true one.
"""

import struct
from pathlib import Path

import numpy as np

from lapwing.cosim.complete_file import complete_file
from lapwing.flights.flight_data import FlightData
from lapwing.flights.log_import.log_conventions import FLU
from lapwing.flights.rotation_arrays import from_ned_frd, from_xyzw, ned_to_enu, specific_force
from lapwing.messages.topics import ACTUATORS, BATTERY, ESTIMATE, IMU, SETPOINT, TRUTH

HEADER = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0)
FIELDS = {  # fields after the time stamp, PX4 1.14
    "vehicle_attitude": "float[4] q;",
    "vehicle_local_position": "float x;float y;float z;float vx;float vy;float vz;",
    "sensor_combined": "float[3] gyro_rad;float[3] accelerometer_m_s2;",
    "actuator_motors": "float[{}] control;",
    "battery_status": "float voltage_v;float current_a;",
    "trajectory_setpoint": "float[3] position;float[3] velocity;float[3] acceleration;float yaw;float yawspeed;",
}


def write_ulog(log: Path, path: Path) -> None:
    """Write the flight of the first vehicle of a log.

    Raises:
        ValueError: the log has no flight, or no motor commands.
    """
    flight = FlightData.read(log, only=(TRUTH, ACTUATORS, BATTERY, ESTIMATE, IMU, SETPOINT))
    if not flight.has("actuators"):
        raise ValueError(f"{log}: no motor outputs (topic actuators); use the log of a vehicle with motors")
    topics = _topics(flight)
    records = []
    for number, (time, values) in enumerate(topics.values()):
        kind = [("size", "<u2"), ("type", "S1"), ("id", "<u2"), ("stamp", "<u8"), ("values", "<f4", values.shape[1:])]
        table = np.empty(len(values), np.dtype(kind))
        table["size"], table["type"], table["id"] = table.dtype.itemsize - 3, b"D", number
        table["stamp"], table["values"] = np.round(1e6 * time), values
        records += [(int(row["stamp"]), number, row.tobytes()) for row in table]
    with complete_file(path) as file, file.open("wb") as out:
        out.write(HEADER)
        for name, (_, values) in topics.items():
            out.write(_message(b"F", f"{name}:uint64_t timestamp;{FIELDS[name].format(values.shape[1])}".encode()))
        for number, name in enumerate(topics):
            out.write(_message(b"A", struct.pack("<BH", 0, number) + name.encode()))
        out.writelines(row for _, _, row in sorted(records))


def _message(kind: bytes, content: bytes) -> bytes:
    return struct.pack("<Hc", len(content), kind) + content


def _topics(flight: FlightData) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return times [s] and values of each topic, NED and FRD."""
    state = "estimate" if flight.has("estimate") and len(flight.topic("estimate")) > 1 else "ground_truth"
    motion, truth = flight.topic(state), flight.topic("ground_truth")
    time = flight.times(state)
    if flight.has("imu") and len(flight.topic("imu")) > 1:
        imu, at = flight.topic("imu"), flight.times("imu")
        rate, force = imu.angular_velocity, imu.linear_acceleration
    else:
        at, rate = flight.times("ground_truth"), truth.angular_velocity
        force = specific_force(from_xyzw(truth.orientation), truth.acceleration)
    result = {
        "vehicle_attitude": (time, from_ned_frd(from_xyzw(motion.orientation))),  # its own inverse, as `ned_to_enu`
        "vehicle_local_position": (time, np.hstack([ned_to_enu(motion.position), ned_to_enu(motion.velocity)])),
        "sensor_combined": (at, np.hstack([rate * FLU, force * FLU])),
    }
    volts, commanded = np.asarray(flight.actuators.motor_voltage), flight.times("actuators")
    airframe = flight.origin.scene.get("airframe", {})  # none of an imported log
    full = np.full(len(volts), airframe.get("motor", {}).get("max_voltage") or np.nanmax(volts, initial=0.0) or 1.0)
    if flight.has("battery") and len(flight.topic("battery")):
        battery, measured = flight.topic("battery"), flight.times("battery")
        full = np.interp(commanded, measured, battery.voltage)
        result["battery_status"] = measured, np.column_stack([battery.voltage, -np.asarray(battery.current)])
    result["actuator_motors"] = commanded, volts / full[:, None]
    if flight.has("setpoint") and len(flight.setpoint):
        desired = flight.setpoint
        vectors = [ned_to_enu(v) for v in (desired.position, desired.velocity, desired.acceleration)]
        heading = np.arctan2(np.cos(desired.yaw), np.sin(desired.yaw))
        result["trajectory_setpoint"] = (
            flight.times("setpoint"), np.column_stack([*vectors, heading, -np.asarray(desired.yaw_rate)]),
        )  # fmt: skip
    return result
