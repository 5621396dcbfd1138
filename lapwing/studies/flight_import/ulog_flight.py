"""Recordings from ULog files of PX4, read by pyulog.

PX4's axes are NED and FRD. Motor outputs are PWM pulses or shares of full throttle; they become volts by the battery's.
"""

from pathlib import Path
from typing import Any

import numpy as np
from scipy.ndimage import median_filter

from lapwing.studies.flight_import.recording import Recording
from lapwing.studies.flight_import.rotation_arrays import body_rate, from_ned_frd, unit
from lapwing.studies.flight_import.time_alignment import time_offset

RATE = 100.0  # [Hz] of the recording
LONGEST_HOLD = 0.5  # [s] between two messages of a topic over which samples count as valid
PULSE_LOW, PULSE_SPAN = 1000.0, 1000.0  # [us] of a PWM output
MAPPED = {
    "vehicle_attitude": "attitude",
    "vehicle_local_position": "position and velocity",
    "vehicle_angular_velocity": "rates",
    "sensor_combined": "rates and specific force",
    "actuator_motors": "motor commands",
    "actuator_outputs": "motor commands",
    "battery_status": "battery voltage and power",
}


def read_ulog_flight(path: Path) -> tuple[Recording, tuple[str, ...]]:
    """Read a ULog file; return the recording and the names of the topics that have no counterpart.

    Raises:
        ValueError: no ULog file, or a topic is missing that a flight needs.
    """
    from pyulog import ULog

    try:
        log = ULog(str(path))
    except OSError as error:
        raise ValueError(f"{path}: cannot be read: {(error.strerror or str(error)).lower()}") from None
    except Exception:  # pyulog raises what its parser runs into
        raise ValueError(f"{path}: is not a readable ULog file; expected a .ulg file of PX4") from None
    topics: dict[str, Any] = {}
    for data in log.data_list:
        if data.name not in topics:
            topics[data.name] = data.data
    for name in ("vehicle_attitude", "vehicle_local_position"):
        if name not in topics:
            raise ValueError(f"{path}: topic {name} is missing; set SDLOG_PROFILE to its default and fly again")
    if not {"actuator_motors", "actuator_outputs"} & set(topics):
        raise ValueError(f"{path}: no motor outputs (actuator_motors, actuator_outputs); log them and fly again")
    times = {name: (data["timestamp"] - log.start_timestamp) * 1e-6 for name, data in topics.items()}
    begin = max(times[name][0] for name in ("vehicle_attitude", "vehicle_local_position"))
    end = min(times[name][-1] for name in ("vehicle_attitude", "vehicle_local_position"))
    if end - begin < 1.0:
        raise ValueError(f"{path}: attitude and position overlap for {max(end - begin, 0.0):.1f} s; expected a flight")
    grid = np.arange(begin, end, 1.0 / RATE)
    valid = np.ones(len(grid), bool)

    def sampled(topic: str, *fields: str) -> np.ndarray:
        at = times[topic]
        right = np.clip(np.searchsorted(at, grid), 1, len(at) - 1)
        valid[:] &= at[right] - at[right - 1] <= LONGEST_HOLD
        return np.column_stack([np.interp(grid, at, topics[topic][f].astype(float)) for f in fields])

    quaternion = np.column_stack([topics["vehicle_attitude"][f"q[{k}]"] for k in range(4)]).astype(float)
    flips = np.cumprod(np.where(np.r_[1.0, np.sum(quaternion[1:] * quaternion[:-1], axis=1)] < 0.0, -1.0, 1.0))
    for k in range(4):
        topics["vehicle_attitude"][f"q[{k}]"] = quaternion[:, k] * flips
    attitude = from_ned_frd(unit(sampled("vehicle_attitude", *(f"q[{k}]" for k in range(4)))))
    position = sampled("vehicle_local_position", "y", "x", "z") * [1.0, 1.0, -1.0]
    velocity = sampled("vehicle_local_position", "vy", "vx", "vz") * [1.0, 1.0, -1.0]
    flu = np.array([1.0, -1.0, -1.0])
    force = np.full((len(grid), 3), np.nan)
    if "sensor_combined" in topics:
        force = sampled("sensor_combined", *(f"accelerometer_m_s2[{k}]" for k in range(3))) * flu
    if "vehicle_angular_velocity" in topics:
        omega = sampled("vehicle_angular_velocity", *(f"xyz[{k}]" for k in range(3))) * flu
    elif "sensor_combined" in topics:
        omega = sampled("sensor_combined", *(f"gyro_rad[{k}]" for k in range(3))) * flu
    else:
        raise ValueError(f"{path}: no rates (vehicle_angular_velocity, sensor_combined); log them and fly again")
    battery, power = np.full(len(grid), np.nan), np.full(len(grid), np.nan)
    if "battery_status" in topics and len(times["battery_status"]) > 1:
        volts = sampled("battery_status", "voltage_v", "current_a")
        battery, power = median_filter(volts[:, 0], 31, mode="nearest"), volts[:, 0] * volts[:, 1]
    duty, source = _duty(topics, sampled)
    notes = [f"motor commands from {source}"]
    if not np.isfinite(battery).all():
        notes.append("no battery voltage: motor voltages are shares of the full voltage")
    lag, score = time_offset(body_rate(attitude, np.full(len(grid), 1.0 / RATE)), omega, valid, 1.0 / RATE)
    notes.append(f"gyroscope {1e3 * lag:+.0f} ms against attitude, correlation {score:.2f}")
    finite = np.isfinite(np.column_stack([position, velocity, attitude, omega, duty])).all(axis=1)
    faults = {"gap in a topic": int((~valid).sum()), "not finite": int((~finite).sum())}
    voltage = duty * np.where(np.isfinite(battery), battery, 1.0)[:, None]
    recording = Recording(
        path.stem, 1.0 / RATE, position, attitude, velocity, omega, force, voltage, battery, valid & finite, power,
        {cause: count for cause, count in faults.items() if count}, tuple(notes),
    )  # fmt: skip
    return recording, tuple(sorted(set(topics) - set(MAPPED)))


def _duty(topics: dict[str, Any], sampled: Any) -> tuple[np.ndarray, str]:
    """Shares of full throttle of the motors in use, and the topic that they come from."""
    if "actuator_motors" in topics:
        fields = [f for f in topics["actuator_motors"] if f.startswith("control[")]
        used = [f for f in fields if np.isfinite(topics["actuator_motors"][f]).any()]
        return np.clip(np.nan_to_num(sampled("actuator_motors", *used)), 0.0, 1.0), "actuator_motors"
    data = topics["actuator_outputs"]
    count = int(np.max(data["noutputs"]))
    used = [f"output[{k}]" for k in range(count) if np.ptp(data[f"output[{k}]"]) > 0.0] or ["output[0]"]
    values = sampled("actuator_outputs", *used)
    scale = (values - PULSE_LOW) / PULSE_SPAN if values.max() > 2.0 else values
    return np.clip(scale, 0.0, 1.0), "actuator_outputs"
