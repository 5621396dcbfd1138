"""Flights written in the format of each autopilot, by an encoding of their own, come back as the same recording."""

import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from flight_recordings import BATTERY, real_flights
from scipy.spatial.transform import Rotation

from lapwing.studies.flight_data import FlightData
from lapwing.studies.flight_import.open_flight import open_flight
from lapwing.studies.flight_import.recording import Recording
from lapwing.studies.flight_import.rotation_arrays import conjugate, product, rotation_vector

INTERVAL, SAMPLES = 0.01, 400
GRAVITY = 9.80665
ENU_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
FLU_FRD = np.diag([1.0, -1.0, -1.0])


@pytest.fixture(scope="module")
def flight() -> Recording:
    """A smooth turn in all axes whose rates, specific force and velocity belong to its attitude and position."""
    t = INTERVAL * np.arange(SAMPLES)
    angles = np.column_stack([0.8 * t, 0.3 * np.sin(2.0 * t), 0.2 * np.cos(1.5 * t)])  # yaw, pitch, roll
    turn = Rotation.from_euler("ZYX", angles)
    h = 1e-5
    ahead = Rotation.from_euler(
        "ZYX", np.column_stack([0.8 * (t + h), 0.3 * np.sin(2 * (t + h)), 0.2 * np.cos(1.5 * (t + h))])
    )
    omega = (turn.inv() * ahead).as_rotvec() / h
    position = np.column_stack([1.0 + 0.5 * t, 2.0 * np.sin(t), 3.0 + 0.2 * t**2])
    velocity = np.column_stack([0.5 + 0.0 * t, 2.0 * np.cos(t), 0.4 * t])
    acceleration = np.column_stack([0.0 * t, -2.0 * np.sin(t), 0.4 + 0.0 * t])
    force = turn.inv().apply(acceleration + np.array([0.0, 0.0, GRAVITY]))
    duty = 0.5 + 0.1 * np.column_stack([np.sin(t + k) for k in range(4)])
    return Recording(
        "flight", INTERVAL, position, turn.as_quat()[:, [3, 0, 1, 2]], velocity, omega, force, duty * BATTERY,
        np.full(SAMPLES, BATTERY), np.ones(SAMPLES, bool),
    )  # fmt: skip


def ned(flight):
    """Quantities in NED and FRD, by rotation matrices."""
    world = ENU_NED @ Rotation.from_quat(flight.attitude[:, [1, 2, 3, 0]]).as_matrix() @ FLU_FRD
    turn = Rotation.from_matrix(world)
    return {
        "position": flight.position @ ENU_NED.T,
        "velocity": flight.velocity @ ENU_NED.T,
        "quaternion": turn.as_quat()[:, [3, 0, 1, 2]],
        "euler": turn.as_euler("ZYX")[:, ::-1],
        "omega": flight.omega @ FLU_FRD,
        "force": flight.specific_force @ FLU_FRD,
        "duty": flight.motor_voltage / BATTERY,
    }


DATAFLASH = {  # message: (type, format characters, field names)
    "PARM": (64, "QNf", "TimeUS,Name,Value"),
    "IMU": (65, "QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ"),
    "XKF1": (66, "QBfffffffff", "TimeUS,C,Roll,Pitch,Yaw,VN,VE,VD,PN,PE,PD"),
    "XKQ": (67, "QBffff", "TimeUS,C,Q1,Q2,Q3,Q4"),
    "RCOU": (68, "QHHHH", "TimeUS,C1,C2,C3,C4"),
    "BAT": (69, "QBff", "TimeUS,Inst,Volt,Curr"),
    "GPS": (70, "QBIHLLf", "TimeUS,I,GMS,GWk,Lat,Lng,Alt"),
    "MSG": (71, "QZ", "TimeUS,Message"),
}
PACKED = {"Q": "Q", "N": "16s", "f": "f", "B": "B", "H": "H", "I": "I", "L": "i", "Z": "64s"}


def dataflash_rows(flight):
    v = ned(flight)
    outputs = {1: 35, 2: 33, 3: 34, 4: 36}  # motor 1 is on output 2, motor 2 on 3, motor 3 on 1
    for n, function in outputs.items():
        yield "PARM", (0, f"SERVO{n}_FUNCTION".encode(), float(function))
    yield "PARM", (0, b"MOT_PWM_MIN", 1100.0)
    yield "PARM", (0, b"MOT_PWM_MAX", 1900.0)
    yield "MSG", (0, b"hello")
    for k in range(len(flight)):
        us = round(k * INTERVAL * 1e6) + 5_000_000
        yield "IMU", (us, 0, *v["omega"][k], *v["force"][k])
        yield "IMU", (us, 1, *(9.0 * v["omega"][k]), *v["force"][k])
        yield "XKF1", (us, 0, 0.0, 0.0, 0.0, *v["velocity"][k], *v["position"][k])
        yield "XKQ", (us, 0, *v["quaternion"][k])
        pulse = np.round(1100.0 + 800.0 * v["duty"][k]).astype(int)
        yield "RCOU", (us, pulse[2], pulse[0], pulse[1], pulse[3])
        yield "BAT", (us, 0, BATTERY, 2.0)
        if k % 20 == 0:
            yield "GPS", (us, 0, 100_000_000 + 10 * k, 2300, 473977420, 85455940, 488.0)


def write_bin(path, flight):
    out = bytearray()
    for name, (number, characters, fields) in {
        "FMT": (128, "BBnNZ", "Type,Length,Name,Format,Columns"),
        **DATAFLASH,
    }.items():
        size = 89 if name == "FMT" else 3 + struct.calcsize("<" + "".join(PACKED[c] for c in characters))
        out += b"\xa3\x95\x80" + struct.pack(
            "<BB4s16s64s", number, size, name.encode(), characters.encode(), fields.encode()
        )
    for name, values in dataflash_rows(flight):
        number, characters, _ = DATAFLASH[name]
        out += b"\xa3\x95" + bytes([number]) + struct.pack("<" + "".join(PACKED[c] for c in characters), *values)
    path.write_bytes(out)


def write_text(path, flight):
    lines = ["FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns"]
    lines += [f"FMT, {n}, 50, {name}, {c}, {fields}" for name, (n, c, fields) in DATAFLASH.items()]
    for name, values in dataflash_rows(flight):
        texts = [v.decode() if isinstance(v, bytes) else str(v) for v in values]
        if name == "GPS":  # text logs have degrees
            texts[4:6] = (f"{v * 1e-7:.7f}" for v in values[4:6])
        lines.append(", ".join([name, *texts]))
    path.write_text("\n".join(lines) + "\n")


def write_tlog(path, flight):
    from pymavlink.dialects.v20 import common as mavlink

    v = ned(flight)
    link = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
    station = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
    with path.open("wb") as file:
        for k in range(len(flight)):
            ms, us = 5000 + 10 * k, 5_000_000 + 10_000 * k
            pulse = [int(x) for x in np.round(1000.0 + 1000.0 * v["duty"][k])]
            messages = [
                mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3),
                mavlink.MAVLink_attitude_quaternion_message(ms, *v["quaternion"][k], *v["omega"][k]),
                mavlink.MAVLink_local_position_ned_message(ms, *v["position"][k], *v["velocity"][k]),
                mavlink.MAVLink_highres_imu_message(
                    us, *v["force"][k], *v["omega"][k], 0.2, 0.0, 0.4, 950.0, 0, 0, 20, 63
                ),
                mavlink.MAVLink_servo_output_raw_message(us, 0, *pulse, 0, 0, 0, 0),
                mavlink.MAVLink_sys_status_message(0, 0, 0, 0, round(BATTERY * 1e3), 200, 50, 0, 0, 0, 0, 0, 0),
                mavlink.MAVLink_gps_raw_int_message(us, 3, 473977420, 85455940, 488000, 100, 100, 0, 0, 9),
            ]
            stamp = struct.pack(">Q", 1_700_000_000_000_000 + us)
            for message in messages:
                file.write(stamp + message.pack(link))
            file.write(stamp + mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3).pack(station))


def write_usd(path, flight):
    names = ["stateEstimate.x", "stateEstimate.y", "stateEstimate.z", "stateEstimate.qw", "stateEstimate.qx",
             "stateEstimate.qy", "stateEstimate.qz", "stateEstimate.vx", "stateEstimate.vy", "stateEstimate.vz",
             "gyro.x", "gyro.y", "gyro.z", "acc.x", "acc.y", "acc.z", "pm.vbat"]  # fmt: skip
    motors = [f"motor.m{k}" for k in (1, 2, 3, 4)]
    out = b"\xbc" + struct.pack("<HHH", 2, 1, 7) + b"fixedFrequency\0" + struct.pack("<H", len(names) + 4)
    out += b"".join(f"{n}(f)\0".encode() for n in names) + b"".join(f"{n}(H)\0".encode() for n in motors)
    for k in range(len(flight)):
        values = [*flight.position[k], *flight.attitude[k], *flight.velocity[k], *np.degrees(flight.omega[k]),
                  *(flight.specific_force[k] / GRAVITY), BATTERY]  # fmt: skip
        duty = [round(65535 * v / BATTERY) for v in flight.motor_voltage[k]]
        out += struct.pack("<HQ17f4H", 7, 900 + round(k * INTERVAL * 1e6), *values, *duty)
    path.write_bytes(out + b"\x01\x02\x03\x04")


def write_rosbag(path, flight):
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    types = get_typestore(Stores.ROS2_HUMBLE)
    types.register(
        get_types_from_msg(
            "std_msgs/Header header\nfloat64[] position\nfloat64[] velocity\nfloat64[] normalized\n",
            "actuator_msgs/msg/Actuators",
        )
    )
    made = types.types
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        kinds = {"/odom": "nav_msgs/msg/Odometry", "/imu": "sensor_msgs/msg/Imu",
                 "/motors": "actuator_msgs/msg/Actuators", "/battery": "sensor_msgs/msg/BatteryState",
                 "/note": "std_msgs/msg/String"}  # fmt: skip
        connections = {topic: writer.add_connection(topic, kind, typestore=types) for topic, kind in kinds.items()}
        vector, quaternion = made["geometry_msgs/msg/Vector3"], made["geometry_msgs/msg/Quaternion"]
        body = Rotation.from_quat(flight.attitude[:, [1, 2, 3, 0]]).inv().apply(flight.velocity)
        nine, many = np.zeros(9), np.zeros(36)
        empty, cells = np.zeros(0), np.zeros(0, np.float32)
        for k in range(len(flight)):
            ns = 1_700_000_000_000_000_000 + round(k * INTERVAL * 1e9)
            header = made["std_msgs/msg/Header"](made["builtin_interfaces/msg/Time"](ns // 10**9, ns % 10**9), "map")
            w, x, y, z = flight.attitude[k]
            pose = made["geometry_msgs/msg/Pose"](
                made["geometry_msgs/msg/Point"](*flight.position[k]), quaternion(x, y, z, w)
            )
            twist = made["geometry_msgs/msg/Twist"](vector(*body[k]), vector(0.0, 0.0, 0.0))
            odometry = made["nav_msgs/msg/Odometry"](
                header, "base", made["geometry_msgs/msg/PoseWithCovariance"](pose, many),
                made["geometry_msgs/msg/TwistWithCovariance"](twist, many),
            )  # fmt: skip
            rates, force = vector(*flight.omega[k]), vector(*flight.specific_force[k])
            imu = made["sensor_msgs/msg/Imu"](header, quaternion(0.0, 0.0, 0.0, 1.0), nine, rates, nine, force, nine)
            motors = made["actuator_msgs/msg/Actuators"](header, empty, empty, flight.motor_voltage[k] / BATTERY)
            battery = made["sensor_msgs/msg/BatteryState"](
                header, BATTERY, 20.0, -2.0, 0.0, 0.0, 0.0, 0.5, 0, 0, 0, True, cells, cells, "", "",
            )  # fmt: skip
            for topic, message in {"/odom": odometry, "/imu": imu, "/motors": motors, "/battery": battery}.items():
                writer.write(connections[topic], ns, types.serialize_cdr(message, kinds[topic]))
        note = types.serialize_cdr(made["std_msgs/msg/String"]("hello"), kinds["/note"])
        writer.write(connections["/note"], ns, note)


ULOG = {  # topic: fields beside the time stamp, of PX4 1.14
    "vehicle_attitude": "float[4] q;",
    "vehicle_local_position": "float x;float y;float z;float vx;float vy;float vz;",
    "sensor_combined": "float[3] gyro_rad;float[3] accelerometer_m_s2;",
    "actuator_motors": "float[4] control;",
    "battery_status": "float voltage_v;float current_a;",
    "trajectory_setpoint": "float[3] position;float[3] velocity;float[3] acceleration;float yaw;float yawspeed;",
    "vehicle_attitude_setpoint": "float[4] q_d;",
    "vehicle_rates_setpoint": "float roll;float pitch;float yaw;",
    "sensor_gps": "float vel_n_m_s;float vel_e_m_s;float vel_d_m_s;",
    "vehicle_optical_flow": "float[2] pixel_flow;float[3] delta_angle;float distance_m;"
    "uint32_t integration_timespan_us;",
    "vehicle_status": "uint8_t arming_state;uint8_t nav_state;uint8_t failsafe;",
    "vehicle_land_detected": "uint8_t landed;",
}
ARMED, ALOFT = 100, 150  # samples


def write_ulog(path, flight):
    """Write a ULog file; the setpoints are the flight itself."""

    def message(kind, content):
        return struct.pack("<HB", len(content), ord(kind)) + content

    v = ned(flight)
    acceleration = np.gradient(v["velocity"], INTERVAL, axis=0)
    yaw = v["euler"][:, 2]
    out = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0)
    out += b"".join(message("F", f"{t}:uint64_t timestamp;{f}".encode()) for t, f in ULOG.items())
    out += b"".join(message("A", struct.pack("<BH", 0, k) + t.encode()) for k, t in enumerate(ULOG))
    for k in range(len(flight)):
        rows = [
            v["quaternion"][k], [*v["position"][k], *v["velocity"][k]], [*v["omega"][k], *v["force"][k]], v["duty"][k],
            [BATTERY, 2.0], [*v["position"][k], *v["velocity"][k], *acceleration[k], yaw[k], -0.8],
            v["quaternion"][k], v["omega"][k], v["velocity"][k],
        ]  # fmt: skip
        stamp = struct.pack("<Q", round(k * INTERVAL * 1e6) + 5_000_000)
        for number, row in enumerate(rows):
            out += message("D", struct.pack("<H", number) + stamp + struct.pack(f"<{len(row)}f", *row))
        flow = struct.pack("<6fI", 0.01, 0.02, 0.03, 0.04, 0.05, 2.0, 10_000)
        status = struct.pack("<3B", 2 if k >= ARMED else 1, 3, 0)
        for number, content in enumerate((flow, status, struct.pack("<B", k < ALOFT)), len(rows)):
            out += message("D", struct.pack("<H", number) + stamp + content)
    path.write_bytes(out)


WRITERS = {
    "f.ulg": write_ulog,
    "f.bin": write_bin,
    "f.log": write_text,
    "f.tlog": write_tlog,
    "log07": write_usd,
    "bag": write_rosbag,
}


@pytest.mark.parametrize("name", WRITERS)
def test_format_returns_flight(tmp_path, flight, name):
    path = tmp_path / name
    WRITERS[name](path, flight)
    result = open_flight(path)
    n = len(result)
    assert n >= SAMPLES - 2
    assert result.valid.all()
    assert result.position == pytest.approx(flight.position[:n], abs=2e-3)
    error = rotation_vector(product(conjugate(flight.attitude[:n]), result.attitude))
    assert np.abs(error).max() < 1e-3
    assert result.velocity == pytest.approx(flight.velocity[:n], abs=2e-3)
    assert result.omega == pytest.approx(flight.omega[:n], abs=2e-3)
    assert result.specific_force == pytest.approx(flight.specific_force[:n], abs=2e-3)
    assert result.motor_voltage == pytest.approx(flight.motor_voltage[:n], abs=5e-3)
    assert result.battery_voltage == pytest.approx(np.full(n, BATTERY), abs=1e-3)


def test_ulog_setpoints_are_those_of_the_trajectory(tmp_path, flight):
    write_ulog(tmp_path / "f.ulg", flight)
    result = open_flight(tmp_path / "f.ulg")
    n = len(result)
    angles = Rotation.from_quat(flight.attitude[:n, [1, 2, 3, 0]]).as_euler("ZYX")[:, ::-1]
    assert result.setpoint[:, :3] == pytest.approx(flight.position[:n], abs=1e-5)
    assert result.setpoint[:, 3:6] == pytest.approx(flight.velocity[:n], abs=1e-5)
    assert result.setpoint[1:-1, 6:9] == pytest.approx(
        np.gradient(flight.velocity[:n], INTERVAL, axis=0)[1:-1], abs=1e-4
    )
    assert np.cos(result.setpoint[:, 9] - angles[:, 2]) == pytest.approx(np.ones(n), abs=1e-6)
    assert result.setpoint[:, 10] == pytest.approx(np.full(n, 0.8))
    assert result.attitude_setpoint[:, :2] == pytest.approx(angles[:, :2], abs=1e-5)
    assert result.readings["gps_velocity"].values[:n] == pytest.approx(flight.velocity[:n], abs=1e-5)
    assert result.readings["optical_flow"].values[0] == pytest.approx([1.0, -2.0, 3.0, -4.0, 2.0])
    assert result.unknown == ("vehicle_rates_setpoint",)


def test_setpoints_of_single_fields_are_read(tmp_path, flight, monkeypatch):
    single = {
        **ULOG,
        "trajectory_setpoint": "float x;float y;float z;float vx;float vy;float vz;float acc_x;float acc_y;float acc_z;"
        "float yaw;float yawspeed;",
    }
    write_ulog(tmp_path / "new.ulg", flight)
    monkeypatch.setitem(globals(), "ULOG", single)
    write_ulog(tmp_path / "old.ulg", flight)
    new, old = (open_flight(tmp_path / name).setpoint for name in ("new.ulg", "old.ulg"))
    assert np.array_equal(new, old)


def test_imported_setpoints_are_in_the_log(tmp_path, flight):
    write_ulog(tmp_path / "f.ulg", flight)
    done = run("import", tmp_path / "f.ulg", "--out", tmp_path / "f.mcap")
    assert done.returncode == 0, done.stderr
    assert "topics without a counterpart: vehicle_rates_setpoint\n" in done.stdout
    log = FlightData.read(tmp_path / "f.mcap")
    n = len(log.setpoint)
    assert log.setpoint.position == pytest.approx(flight.position[:n], abs=1e-5)
    assert np.cos(log.setpoint.yaw - log.truth.attitude[:, 2]) == pytest.approx(np.ones(n), abs=1e-6)
    assert max(log.rmse.values()) < 1e-5
    assert len(log.topic("gps/velocity")) >= n
    assert log.topic("optical_flow").flow[0] == pytest.approx([1.0, -2.0])
    status, at = log.status, np.arange(n)
    assert set(status.mode) == {"mission"}
    assert np.array_equal(status.armed[:n], at >= ARMED)
    assert np.array_equal(status.landed[:n], at < ALOFT)
    again = open_flight(tmp_path / "f.mcap")
    assert again.setpoint[1:, :3] == pytest.approx(flight.position[1 : len(again)], abs=1e-5)


def test_unknown_topics_are_listed(tmp_path, flight):
    write_bin(tmp_path / "f.bin", flight)
    assert open_flight(tmp_path / "f.bin").unknown == ("MSG",)


def test_betaflight_columns_become_si_quantities(tmp_path, flight):
    duty = 48.0 + 1999.0 * flight.motor_voltage / BATTERY
    columns = {
        "loopIteration": np.arange(SAMPLES), " time (us)": 1e4 * np.arange(SAMPLES),
        **{f" gyroADC[{k}]": np.degrees(flight.omega[:, k]) for k in range(3)},
        **{f" accSmooth[{k}]": 2048.0 * flight.specific_force[:, k] / GRAVITY for k in range(3)},
        **{f" motor[{k}]": duty[:, k] for k in range(4)},
        " vbatLatest (V)": flight.battery_voltage,
    }  # fmt: skip
    table = np.column_stack(list(columns.values()))
    path = tmp_path / "blackbox.csv"
    np.savetxt(path, table, "%.6f", ",", header=",".join(columns), comments="")
    result = open_flight(path, "betaflight")
    assert result.omega == pytest.approx(flight.omega, abs=1e-6)
    assert result.specific_force == pytest.approx(flight.specific_force, abs=1e-6)
    assert result.motor_voltage == pytest.approx(flight.motor_voltage, abs=1e-6)
    assert np.isnan(result.position).all()
    assert any("no position" in note for note in result.notes)


def run(*arguments):
    return subprocess.run([sys.executable, "-m", "lapwing", *map(str, arguments)], capture_output=True, text=True)


@pytest.mark.parametrize("name", ["f.bin", "f.tlog", "log07", "bag"])
def test_command_imports_format(tmp_path, flight, name):
    WRITERS[name](tmp_path / name, flight)
    done = run("import", tmp_path / name, "--out", tmp_path / "out.mcap")
    assert done.returncode == 0, done.stderr
    again = open_flight(tmp_path / "out.mcap")
    assert again.position == pytest.approx(flight.position[: len(again)], abs=2e-3)


@pytest.mark.parametrize("content", [b"", b"\xbc\x02\x00\xff", b"\xa3\x95\x80" + bytes(86), bytes(range(256)) * 20])
@pytest.mark.parametrize("name", ["f.bin", "f.log", "f.tlog", "log07"])
def test_damaged_file_is_rejected_in_one_line(tmp_path, name, content):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(ValueError, match=name) as raised:
        open_flight(path)
    assert "\n" not in str(raised.value)


def test_log_without_motor_outputs_is_rejected(tmp_path, flight, monkeypatch):
    rows = [row for row in dataflash_rows(flight) if row[0] != "RCOU"]
    monkeypatch.setitem(globals(), "dataflash_rows", lambda flight: iter(rows))
    write_bin(tmp_path / "f.bin", flight)
    with pytest.raises(ValueError, match="no motor outputs"):
        open_flight(tmp_path / "f.bin")


def test_ulog_of_real_vehicle_keeps_its_sensors():
    result = open_flight(Path(real_flights("ulog")) / "sample_log_small.ulg")
    assert {"gps", "baro", "mag", "airspeed"} <= set(result.readings)
    assert result.readings["gps"].values[0] == pytest.approx([63.417, 10.408, 66.8], abs=0.2)
    assert 25e-6 < np.linalg.norm(result.readings["mag"].values, axis=1).mean() < 65e-6


def test_crazyflie_log_of_real_vehicle_is_in_si_units(tmp_path):
    (tmp_path / "log10").write_bytes((real_flights("arpl_crazyflie") / "log10").read_bytes())
    result = open_flight(tmp_path / "log10")
    assert np.median(result.specific_force[:, 2]) == pytest.approx(GRAVITY, rel=0.03)
    assert result.interval == pytest.approx(1e-3, rel=0.05)
