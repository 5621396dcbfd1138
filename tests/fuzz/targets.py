"""Readers of external bytes: each accepts any bytes, or rejects them with a ValueError."""

from pathlib import Path

import numpy as np

from lapwing.cosim.config import serialise
from lapwing.cosim.config.serialise import from_json, to_json
from lapwing.cosim.diagram.topic_encoder import RecordBatch
from lapwing.cosim.log import LogReader, LogWriter
from lapwing.cosim.transport.packets import pack_log_packet, unpack_log_packet
from lapwing.messages import PoseStamped, attachment
from lapwing.messages.topics import POSE
from lapwing.messages.types import TYPES
from lapwing.services import scene_resolver
from lapwing.services.autopilot import parameter_file
from lapwing.services.common.plans import plan_file
from lapwing.services.foxglove.origin_gate import rejection_reason
from tests.fuzz.flights import csv, dataflash, tlog, ulog, usd
from tests.fuzz.memory_file import memory_file
from tests.fuzz.sockets import frames, link, page, requests, websocket
from tests.fuzz.target import Target

SCENES = Path("lapwing/scenes")
SMALL_SCENES = (  # faster to read than the shipped files
    b"""run = { duration = 2.0 }
vehicle.airframe = 'hexacopter'
effects = { gravity = {}, rotor_thrust = {} }
autopilot = { gains = "tuned", estimator = "ground_truth" }
trajectory.phase = [{ name = "up", z = { kind = "ramp", to = 1e1, rate = 1 } }]
""",
    b"""run.duration = 2
[vehicle]
airframe = "delivery_drone"
[effects.random_wind_force]
mean = [3.0, 1.0, 0]
[sensors.imu]
preset = "mpu6000"
[autopilot]
gains = "tuned"
estimator = "ground_truth"
[[trajectory.phase]]
name = "wait"
duration = 1.0
""",
    b"""run.duration = 2
[vehicle]
model = "gyrostat"
[gyrostat]
inertia = [500.0, 5e2, 1000.0]
initial_rate = [0.0, 1e-3, 0.1]
""",
)


def cdr() -> Target:
    classes = list(TYPES.values())

    def read(data: bytes) -> None:
        classes[data[0] % len(classes) if data else 0].decode(data[1:])

    return Target(read, tuple(bytes([k]) + cls().encode() for k, cls in enumerate(classes)))


def batches() -> Target:
    poses = np.frombuffer(2 * PoseStamped().encode(), np.uint8).reshape(2, -1)
    return Target(
        unpack_log_packet,
        (pack_log_packet([RecordBatch(POSE, np.array([0, 5]), poses)], 0, 7), pack_log_packet([], 0, 3)),
    )


def attachments() -> Target:
    return Target(attachment.time_and_gid, (attachment.pack(1, 2, bytes(16)),))


def set_ups() -> Target:
    config = to_json(scene_resolver.resolve(scene_resolver.load("gyrostat_blocked")))
    return Target(lambda data: from_json(data.decode()), (config.encode(), to_json((1.0, {"a": [None]})).encode()))


def scenes() -> Target:
    def read(data: bytes) -> None:
        scene_resolver.parse(SCENES / "fuzz.toml", data.decode())

    return Target(read, SMALL_SCENES)


def plans() -> Target:
    seeds = tuple(path.read_bytes() for path in sorted((SCENES / "plans").glob("*.plan")))
    waypoints = b"QGC WPL 110\n0\t1\t0\t16\t0\t0\t0\t0\t40.7\t14.7\t5\t1\n1\t0\t3\t22\t0\t0\t0\t0\t40.7\t14.7\t9\t1\n"
    return Target(lambda data: plan_file.read(memory_file(data, "a.plan")), (*seeds, waypoints))


def parameters() -> Target:
    text = b"# Onboard parameters\n1\t1\tMPC_XY_VEL_MAX\t3.5\t9\nMIS_TAKEOFF_ALT 2.5\n"
    return Target(lambda data: parameter_file.read(memory_file(data, "a.params")), (text,))


def logs() -> Target:
    path = memory_file(b"", "seed.mcap")
    with LogWriter(path, {"scene": "none"}, {"a.txt": b"text"}) as writer:
        for k in range(3):
            writer.write("/drone1/pose", PoseStamped, PoseStamped().encode(), k * 1_000_000)

    def read(data: bytes) -> None:
        with LogReader(memory_file(data, "a.mcap")) as log:
            for _ in log.messages():
                pass

    return Target(read, (path.read_bytes(),))


def overrides() -> Target:
    texts = (
        b"airframe.mass.total=2.5", b'sensors.imu.preset="bmi088"', b"sensors.imu={preset='mpu6000'}",
        b"trajectory.phase.0.duration=3.0", b"effects.random_wind_force={mean=[1.0, 2, 0]}", b"run.duration=1e1",
    )  # fmt: skip
    scene = SMALL_SCENES[1].decode()

    def read(data: bytes) -> None:
        scene_resolver.parse(SCENES / "fuzz.toml", scene, [data.decode()])

    return Target(read, texts)


def set_up_messages() -> Target:
    config = scene_resolver.resolve(scene_resolver.load("gyrostat_blocked"))
    return Target(serialise.decompress, (serialise.compress(config),))


def origins() -> Target:
    """Requests to the access check of the Foxglove server."""
    request = b"GET / HTTP/1.1\r\nHost: 127.0.0.1:8765\r\nOrigin: https://app.foxglove.dev\r\n\r\n"
    return Target(lambda data: rejection_reason(data, "127.0.0.1"), (request,))


TARGETS = {
    make.__name__: make
    for make in (
        *(cdr, batches, attachments, set_ups, scenes, plans, parameters, logs),
        *(overrides, set_up_messages, csv, ulog, dataflash, tlog, usd),
        *(link, frames, page, origins, requests, websocket),
    )
}
