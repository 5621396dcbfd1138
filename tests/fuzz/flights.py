"""Flight logs of other programs, read by `lapwing import`; the seeds are short flights."""

import struct
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from lapwing.flights.log_import.column_mapping import load_mapping
from lapwing.flights.log_import.csv_flight import from_columns, read_csv_flight
from lapwing.flights.log_import.dataflash_flight import read_dataflash_flight
from lapwing.flights.log_import.tlog_flight import read_tlog_flight
from lapwing.flights.log_import.ulog_flight import read_ulog_flight
from lapwing.flights.log_import.usd_log import read_usd_log
from lapwing.services.common.mavlink.dialect import mavlink
from tests.fuzz.memory_file import memory_file
from tests.fuzz.target import Target

SAMPLES = 150
INTERVAL = 0.01  # [s]
BATTERY = 3.9  # [V]
TIMES = 1.0 + INTERVAL * np.arange(SAMPLES)  # [s]


def _reader(name: str, read: Callable[[Path], Any], seed: bytes) -> Target:
    return Target(lambda data: read(memory_file(data, name)), (seed,))


def csv() -> Target:
    names = "t,px,py,pz,qx,qy,qz,qw,vx,vy,vz,imu_acc_x,imu_acc_y,imu_acc_z,imu_gyro_x,imu_gyro_y,imu_gyro_z"
    lines = [f"{names},motor_motor_m1,motor_motor_m2,motor_motor_m3,motor_motor_m4,pwr_pm_vbat"]
    lines += [f"{t:.2f},0,0,{t:.2f},0,0,0,1,0,0,1,0,0,1,0.01,0,0,3e4,3e4,3e4,3e4,{BATTERY}" for t in TIMES]
    read = partial(read_csv_flight, mapping=load_mapping("nanobench"))
    return _reader("a.csv", read, "\n".join(lines).encode())


def ulog() -> Target:
    """Subset of PX4's ULog: formats, subscriptions and data (docs.px4.io, ULog file format)."""
    topics: dict[str, tuple[str, Callable[[float], tuple[float, ...]]]] = {
        "vehicle_attitude": ("float[4] q", lambda t: (1.0, 0.0, 0.0, 0.0)),
        "vehicle_local_position": (
            "float x;float y;float z;float vx;float vy;float vz",
            lambda t: (0.0, 0.0, -t, 0.0, 0.0, -1.0),
        ),
        "vehicle_angular_velocity": ("float[3] xyz", lambda t: (0.01, 0.0, 0.0)),
        "sensor_combined": ("float[3] gyro_rad;float[3] accelerometer_m_s2", lambda t: (0.0, 0.0, 0.0, 0.0, 0.0, -9.8)),
        "actuator_motors": ("float[12] control", lambda t: (0.5,) * 4 + (0.0,) * 8),
        "battery_status": ("float voltage_v;float current_a", lambda t: (BATTERY, 1.0)),
    }

    def message(kind: bytes, body: bytes) -> bytes:
        return struct.pack("<H", len(body)) + kind + body

    seed = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0) + message(b"B", bytes(40))
    for name, (fields, _) in topics.items():
        seed += message(b"F", f"{name}:uint64_t timestamp;{fields};".encode())
    for number, name in enumerate(topics):
        seed += message(b"A", struct.pack("<BH", 0, number) + name.encode())
    for t in TIMES:
        for number, (_, values) in enumerate(topics.values()):
            row = values(t)
            seed += message(b"D", struct.pack(f"<HQ{len(row)}f", number, round(t * 1e6), *row))
    return _reader("a.ulg", read_ulog_flight, seed)


def dataflash() -> Target:
    """Subset of ArduPilot's log: each message type is declared by an FMT message."""
    types = {
        "FMT": (128, "BBnNZ", "BB4s16s64s", "Type,Length,Name,Format,Columns"),
        "IMU": (65, "QBffffff", "QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ"),
        "XKF1": (66, "QBfffffffff", "QBfffffffff", "TimeUS,C,Roll,Pitch,Yaw,VN,VE,VD,PN,PE,PD"),
        "XKQ": (67, "QBffff", "QBffff", "TimeUS,C,Q1,Q2,Q3,Q4"),
        "RCOU": (68, "QHHHH", "QHHHH", "TimeUS,C1,C2,C3,C4"),
        "BAT": (69, "QBff", "QBff", "TimeUS,Inst,Volt,Curr"),
        "PARM": (64, "QNf", "Q16sf", "TimeUS,Name,Value"),
    }
    seed = b""

    def put(name: str, *values: Any) -> bytes:
        return b"\xa3\x95" + bytes([types[name][0]]) + struct.pack("<" + types[name][2], *values)

    for name, (number, characters, packed, columns) in types.items():
        size = 3 + struct.calcsize("<" + packed)
        seed += put("FMT", number, size, name.encode(), characters.encode(), columns.encode())
    for k in range(4):
        seed += put("PARM", 0, b"SERVO%d_FUNCTION" % (k + 1), 33.0 + k)
    for t in TIMES:
        us = round(t * 1e6)
        seed += put("IMU", us, 0, 0.01, 0.0, 0.0, 0.0, 0.0, -9.8) + put("XKF1", us, 0, *(0.0,) * 5, -1.0, 0.0, 0.0, -t)
        seed += put("XKQ", us, 0, 1.0, 0.0, 0.0, 0.0) + put("RCOU", us, *(1500,) * 4) + put("BAT", us, 0, BATTERY, 1.0)
    return _reader("a.bin", read_dataflash_flight, seed)


def tlog() -> Target:
    link, seed = mavlink.MAVLink(None, 1, 1), b""
    for t in TIMES:
        ms, us = round(t * 1e3), round(t * 1e6)
        messages = (
            mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3),
            mavlink.MAVLink_attitude_quaternion_message(ms, 1.0, 0.0, 0.0, 0.0, 0.01, 0.0, 0.0),
            mavlink.MAVLink_local_position_ned_message(ms, 0.0, 0.0, -t, 0.0, 0.0, -1.0),
            mavlink.MAVLink_highres_imu_message(us, 0.0, 0.0, -9.8, *(0.0,) * 6, 950.0, 0, 0, 20, 63),
            mavlink.MAVLink_servo_output_raw_message(us, 0, *(1500 + ms % 90,) * 4, 0, 0, 0, 0),
            mavlink.MAVLink_sys_status_message(0, 0, 0, 0, round(BATTERY * 1e3), 200, 50, 0, 0, 0, 0, 0, 0),
        )
        stamp = struct.pack(">Q", 1_700_000_000_000_000 + us)
        seed += b"".join(stamp + message.pack(link) for message in messages)
    return _reader("a.tlog", read_tlog_flight, seed)


def usd() -> Target:
    """Logs of the Crazyflie's deck (format 2 of the firmware's uSD log)."""
    names = [f"stateEstimate.{n}" for n in ("x", "y", "z", "qw", "qx", "qy", "qz", "vx", "vy", "vz")]
    names += [f"{sensor}.{axis}" for sensor in ("gyro", "acc") for axis in "xyz"] + ["pm.vbat"]
    motors = [f"motor.m{k}" for k in (1, 2, 3, 4)]
    seed = b"\xbc" + struct.pack("<HHH", 2, 1, 7) + b"fixedFrequency\0" + struct.pack("<H", len(names) + len(motors))
    seed += b"".join(f"{n}(f)\0".encode() for n in names) + b"".join(f"{n}(H)\0".encode() for n in motors)
    for t in TIMES:
        values = (0.0, 0.0, t, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.5, 0.0, 0.0, 0.0, 0.0, 1.0, BATTERY)
        seed += struct.pack("<HQ17f4H", 7, round(t * 1e6), *values, *(30000,) * 4)
    mapping = load_mapping("crazyflie_usd")
    return _reader("a.usd", lambda path: from_columns(path, read_usd_log(path), mapping), seed + b"\1\2\3\4")
