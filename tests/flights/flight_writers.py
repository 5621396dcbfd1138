"""Writers of a recording in the format of each autopilot, independent of the readers."""

import struct

import numpy as np
from flight_recordings import BATTERY
from scipy.spatial.transform import Rotation

INTERVAL, SAMPLES = 0.01, 400
GRAVITY = 9.80665
ENU_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
FLU_FRD = np.diag([1.0, -1.0, -1.0])


def ned(flight):
    """Return quantities in NED and FRD, by rotation matrices."""
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
PACKED = {"b": "b", "Q": "Q", "N": "16s", "f": "f", "B": "B", "H": "H", "I": "I", "L": "i", "Z": "64s"}


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
        if name == "GPS":  # angles in text logs are in degrees
            texts[4:6] = (f"{v * 1e-7:.7f}" for v in values[4:6])
        lines.append(", ".join([name, *texts]))
    path.write_text("\n".join(lines) + "\n")


BOOT = 5.0  # [s] since boot, of a telemetry log's first message


def telemetry(v, k):
    """Return the messages of sample k of a telemetry log."""
    from pymavlink.dialects.v20 import common as mavlink

    ms = round(1e3 * BOOT) + 10 * k
    us = 1000 * ms
    pulse = [int(x) for x in np.round(1000.0 + 1000.0 * v["duty"][k])]
    return [
        mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3),
        mavlink.MAVLink_attitude_quaternion_message(ms, *v["quaternion"][k], *v["omega"][k]),
        mavlink.MAVLink_local_position_ned_message(ms, *v["position"][k], *v["velocity"][k]),
        mavlink.MAVLink_highres_imu_message(us, *v["force"][k], *v["omega"][k], 0.2, 0.0, 0.4, 950.0, 0, 0, 20, 63),
        mavlink.MAVLink_servo_output_raw_message(us % 2**32, 0, *pulse, 0, 0, 0, 0),
        mavlink.MAVLink_sys_status_message(0, 0, 0, 0, round(BATTERY * 1e3), 200, 50, 0, 0, 0, 0, 0, 0),
        mavlink.MAVLink_gps_raw_int_message(us, 3, 473977420, 85455940, 488000, 100, 100, 0, 0, 9),
    ]


def host_clock(k):
    """Return the error of the ground station's clock at a sample [s]."""
    return 0.0


def write_tlog(path, flight):
    from pymavlink.dialects.v20 import common as mavlink

    v = ned(flight)
    link = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
    station = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
    with path.open("wb") as file:
        for k in range(len(flight)):
            stamp = struct.pack(">Q", 1_700_000_005_000_000 + 10_000 * k + round(1e6 * host_clock(k)))
            for message in telemetry(v, k):
                file.write(stamp + message.pack(link))
            file.write(stamp + mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3).pack(station))


def write_usd(path, flight, version=2):
    names = ["stateEstimate.x", "stateEstimate.y", "stateEstimate.z", "stateEstimate.qw", "stateEstimate.qx",
             "stateEstimate.qy", "stateEstimate.qz", "stateEstimate.vx", "stateEstimate.vy", "stateEstimate.vz",
             "gyro.x", "gyro.y", "gyro.z", "acc.x", "acc.y", "acc.z", "pm.vbat"]  # fmt: skip
    motors = [f"motor.m{k}" for k in (1, 2, 3, 4)]
    out = (
        bytearray(b"\xbc")
        + struct.pack("<HHH", version, 1, 7)
        + b"fixedFrequency\0"
        + struct.pack("<H", len(names) + 4)
    )
    out += b"".join(f"{n}(f)\0".encode() for n in names) + b"".join(f"{n}(H)\0".encode() for n in motors)
    for k in range(len(flight)):
        values = [*flight.position[k], *flight.attitude[k], *flight.velocity[k], *np.degrees(flight.omega[k]),
                  *(flight.specific_force[k] / GRAVITY), BATTERY]  # fmt: skip
        duty = [round(65535 * v / BATTERY) for v in flight.motor_voltage[k]]
        clock, ticks = {1: ("I", 1e3), 2: ("Q", 1e6)}[version]
        out += struct.pack(f"<H{clock}17f4H", 7, 900 + round(k * INTERVAL * ticks), *values, *duty)
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
    message_types = types.types
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        kinds = {"/odom": "nav_msgs/msg/Odometry", "/imu": "sensor_msgs/msg/Imu",
                 "/motors": "actuator_msgs/msg/Actuators", "/battery": "sensor_msgs/msg/BatteryState",
                 "/note": "std_msgs/msg/String"}  # fmt: skip
        connections = {topic: writer.add_connection(topic, kind, typestore=types) for topic, kind in kinds.items()}
        vector, quaternion = message_types["geometry_msgs/msg/Vector3"], message_types["geometry_msgs/msg/Quaternion"]
        body = Rotation.from_quat(flight.attitude[:, [1, 2, 3, 0]]).inv().apply(flight.velocity)
        nine, many = np.zeros(9), np.zeros(36)
        empty, cells = np.zeros(0), np.zeros(0, np.float32)
        for k in range(len(flight)):
            ns = 1_700_000_000_000_000_000 + round(k * INTERVAL * 1e9)
            header = message_types["std_msgs/msg/Header"](
                message_types["builtin_interfaces/msg/Time"](ns // 10**9, ns % 10**9), "map"
            )
            w, x, y, z = flight.attitude[k]
            pose = message_types["geometry_msgs/msg/Pose"](
                message_types["geometry_msgs/msg/Point"](*flight.position[k]), quaternion(x, y, z, w)
            )
            twist = message_types["geometry_msgs/msg/Twist"](vector(*body[k]), vector(0.0, 0.0, 0.0))
            odometry = message_types["nav_msgs/msg/Odometry"](
                header, "base", message_types["geometry_msgs/msg/PoseWithCovariance"](pose, many),
                message_types["geometry_msgs/msg/TwistWithCovariance"](twist, many),
            )  # fmt: skip
            rates, force = vector(*flight.omega[k]), vector(*flight.specific_force[k])
            imu = message_types["sensor_msgs/msg/Imu"](
                header, quaternion(0.0, 0.0, 0.0, 1.0), nine, rates, nine, force, nine
            )
            motors = message_types["actuator_msgs/msg/Actuators"](
                header, empty, empty, flight.motor_voltage[k] / BATTERY
            )
            battery = message_types["sensor_msgs/msg/BatteryState"](
                header, BATTERY, 20.0, -2.0, 0.0, 0.0, 0.0, 0.5, 0, 0, 0, True, cells, cells, "", "",
            )  # fmt: skip
            for topic, message in {"/odom": odometry, "/imu": imu, "/motors": motors, "/battery": battery}.items():
                writer.write(connections[topic], ns, types.serialize_cdr(message, kinds[topic]))
        note = types.serialize_cdr(message_types["std_msgs/msg/String"]("hello"), kinds["/note"])
        writer.write(connections["/note"], ns, note)


ULOG = {  # fields by topic besides the time stamp, PX4 1.14
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
    v = ned(flight)
    acceleration = np.gradient(v["velocity"], INTERVAL, axis=0)
    yaw = v["euler"][:, 2]
    makers = {
        "trajectory_setpoint": lambda k: [*v["position"][k], *v["velocity"][k], *acceleration[k], yaw[k], -0.8],
        "vehicle_attitude_setpoint": lambda k: v["quaternion"][k],
        "vehicle_rates_setpoint": lambda k: v["omega"][k],
        "sensor_gps": lambda k: v["velocity"][k],
        "vehicle_optical_flow": lambda k: (0.01, 0.02, 0.03, 0.04, 0.05, 2.0, 10_000),
        "vehicle_status": lambda k: (2 if k >= ARMED else 1, 3, 0),
        "vehicle_land_detected": lambda k: (k < ALOFT,),
    }
    codes = {"vehicle_optical_flow": "6fI", "vehicle_status": "3B", "vehicle_land_detected": "B"}
    topics = [(name, 0, ULOG[name], codes.get(name, f"{len(make(0))}f"), make) for name, make in makers.items()]
    return write_ulog_topics(path, flight, topics)


def write_ulog_topics(path, flight, topics=(), marks=(), lost=()):
    """Write the motion of a flight, and other topics, as a ULog file.

    Args:
        topics: (name, instance, fields, code of `struct`, function of the sample that returns the values, None for no
            message) each; one with the name of a topic of the motion replaces it.
        marks: (sample, duration [ms]) of each dropout mark.
        lost: samples without messages.
    """

    def message(kind, content):
        return struct.pack("<HB", len(content), ord(kind)) + content

    v = ned(flight)
    motion = {
        "vehicle_attitude": lambda k: v["quaternion"][k],
        "vehicle_local_position": lambda k: [*v["position"][k], *v["velocity"][k]],
        "sensor_combined": lambda k: [*v["omega"][k], *v["force"][k]],
        "actuator_motors": lambda k: v["duty"][k],
        "battery_status": lambda k: [BATTERY, 2.0],
    }
    replaced = {name for name, *_ in topics}
    written = [(name, 0, ULOG[name], f"{len(make(0))}f", make) for name, make in motion.items() if name not in replaced]
    written += topics
    formats = {name: fields for name, _, fields, *_ in written}
    out = bytearray(b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0))
    out += b"".join(message("F", f"{t}:uint64_t timestamp;{f}".encode()) for t, f in formats.items())
    out += b"".join(message("A", struct.pack("<BH", n, k) + t.encode()) for k, (t, n, *_) in enumerate(written))
    for k in range(len(flight)):
        stamp = struct.pack("<Q", round(k * INTERVAL * 1e6) + 5_000_000)
        for number, (*_, code, make) in enumerate(written):
            if k not in lost and (row := make(k)) is not None:
                out += message("D", struct.pack("<H", number) + stamp + struct.pack(f"<{code}", *row))
        out += b"".join(message("O", struct.pack("<H", duration)) for sample, duration in marks if sample == k)
    path.write_bytes(out)
    return path


WRITERS = {
    "f.ulg": write_ulog,
    "f.bin": write_bin,
    "f.log": write_text,
    "f.tlog": write_tlog,
    "log07": write_usd,
    "bag": write_rosbag,
}
