"""Lapwing logs of recordings: the topics of a simulated flight, for the commands that read logs."""

import math
from pathlib import Path
from typing import Any

import numpy as np

from lapwing.cosim.log import LogWriter
from lapwing.messages.topics import ACTUATORS, BATTERY, IMU, TRUTH
from lapwing.messages.types import (
    Actuators,
    BatteryState,
    Header,
    Imu,
    Point,
    Pose,
    Quaternion,
    Time,
    Vector3,
    VehicleState,
)
from lapwing.studies.flight_import.recording import Recording

VEHICLE = "drone1"
FRAME = "world"
SPINNING = 0.05  # share of the highest motor voltage above which motors count as armed


def write_log(path: Path, flight: Recording, source: str, unknown: tuple[str, ...] = ()) -> None:
    """Write a recording as a log. Invalid samples are left out of the motion's topics, and their number is recorded.

    Args:
        path: of the log.
        flight: what to write.
        source: name of the file that it was imported from.
        unknown: topics of the source without a counterpart.
    """
    about = {
        "scene": flight.name,
        "mode": "imported",
        "vehicle": VEHICLE,
        "imported_from": source,
        "invalid_samples": str(int((~flight.valid).sum())),
        "faults": ", ".join(f"{cause}: {count}" for cause, count in flight.faults.items()),
        "notes": "; ".join(flight.notes),
        "unknown_topics": ", ".join(unknown),
    }
    acceleration = np.gradient(flight.velocity, flight.interval, axis=0)
    highest = max(float(np.nanmax(flight.motor_voltage, initial=0.0)), 1e-9)
    with LogWriter(path, about, {}) as log:
        for k in range(len(flight)):
            time_ns = round(k * flight.interval * 1e9)
            header = Header(Time(time_ns // 1_000_000_000, time_ns % 1_000_000_000), FRAME)
            volts = tuple(flight.motor_voltage[k].tolist())
            messages: list[tuple[Any, Any]] = []
            if flight.valid[k]:
                pose = Pose(Point(*flight.position[k].tolist()), _quaternion(flight.attitude[k]))
                motion = VehicleState(
                    header=header, pose=pose, velocity=_vector(flight.velocity[k]),
                    angular_velocity=_vector(flight.omega[k]), acceleration=_vector(acceleration[k]),
                    motor_voltage=volts,
                )  # fmt: skip
                messages.append((TRUTH, motion))
                if np.isfinite(flight.specific_force[k]).all():
                    rates, force = _vector(flight.omega[k]), _vector(flight.specific_force[k])
                    messages.append((IMU, Imu(header=header, angular_velocity=rates, linear_acceleration=force)))
                messages.append((ACTUATORS, Actuators(header, volts, max(volts) > SPINNING * highest)))
            if k % 10 == 0 and math.isfinite(flight.battery_voltage[k]):
                battery = BatteryState(header=header, voltage=float(flight.battery_voltage[k]), present=True)
                messages.append((BATTERY, battery))
            for topic, message in messages:
                log.write(topic.key(VEHICLE), type(message), message.encode(), time_ns)


def _vector(values: np.ndarray) -> Vector3:
    return Vector3(*values.tolist())


def _quaternion(wxyz: np.ndarray) -> Quaternion:
    w, x, y, z = wxyz.tolist()
    return Quaternion(x, y, z, w)
