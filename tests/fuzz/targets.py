"""What reads bytes from outside: each target takes any bytes, and refuses them with a ValueError or not at all."""

import atexit
import shutil
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cosim.bundle import pack_batch, unpack_batch
from cosim.log import LogReader, LogWriter
from cosim.serialise import from_json, to_json
from cosim.wire import Page
from messages import PoseStamped, attachment
from messages.topics import POSE
from messages.types import TYPES
from services import table
from services.common import parameter_file, plan
from services.mavlink.adapter import Adapter
from services.mavlink.dialect import mavlink
from services.mavlink.resolve import describe

SCENES = Path("scenes")


class Target(NamedTuple):
    """Something that reads, and what it reads when all is well."""

    read: Callable[[bytes], object]
    seeds: tuple[bytes, ...]


@cache
def _folder() -> Path:
    made = Path(tempfile.mkdtemp(prefix="fuzz-"))
    atexit.register(shutil.rmtree, made, ignore_errors=True)
    return made


def _file(data: bytes, name: str) -> Path:
    path = _folder() / name
    path.write_bytes(data)
    return path


def cdr() -> Target:
    classes = list(TYPES.values())

    def read(data: bytes) -> None:
        classes[data[0] % len(classes) if data else 0].decode(data[1:])

    return Target(read, tuple(bytes([k]) + cls().encode() for k, cls in enumerate(classes)))


def batches() -> Target:
    poses = np.frombuffer(2 * PoseStamped().encode(), np.uint8).reshape(2, -1)
    return Target(unpack_batch, (pack_batch([Page(POSE, np.array([0, 5]), poses)], 7), pack_batch([], 3)))


def attachments() -> Target:
    def read(data: bytes) -> None:
        attachment.time_and_gid(data)
        attachment.unpack(data)

    return Target(read, (attachment.pack(1, 2, bytes(16)),))


def set_ups() -> Target:
    setup = to_json(table.resolve(table.load("gyrostat_blocked")))
    return Target(lambda data: from_json(data.decode()), (setup.encode(), to_json((1.0, {"a": [None]})).encode()))


def link() -> Target:
    adapter = Adapter(describe(table.load("hover")), lambda command: None)
    codec = mavlink.MAVLink(None, 255, 190)
    seeds = [mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3).pack(codec)]
    seeds.append(mavlink.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0).pack(codec))
    seeds.append(mavlink.MAVLink_param_set_message(1, 1, b"MIS_TAKEOFF_ALT", 2.5, 9).pack(codec))

    def read(data: bytes) -> None:
        endpoint = adapter.connect(True, True, lambda sent: None)
        adapter.receive(endpoint, data)
        adapter.disconnect(endpoint)

    return Target(read, tuple(seeds))


def scenes() -> Target:
    def read(data: bytes) -> None:
        table.parse(SCENES / "fuzz.toml", data.decode())

    return Target(read, tuple((SCENES / f"{name}.toml").read_bytes() for name in ("hover", "gyrostat_blocked")))


def plans() -> Target:
    seeds = tuple(path.read_bytes() for path in sorted((SCENES / "plans").glob("*.plan")))
    waypoints = b"QGC WPL 110\n0\t1\t0\t16\t0\t0\t0\t0\t47.0\t8.0\t5.0\t1\n1\t0\t3\t22\t0\t0\t0\t0\t47.0\t8.0\t9.0\t1\n"
    return Target(lambda data: plan.read(_file(data, "a.plan")), (*seeds, waypoints))


def parameters() -> Target:
    text = b"# Onboard parameters\n1\t1\tMPC_XY_VEL_MAX\t3.5\t9\nMIS_TAKEOFF_ALT 2.5\n"
    return Target(lambda data: parameter_file.read(_file(data, "a.params")), (text,))


def logs() -> Target:
    path = _folder() / "seed.mcap"
    with LogWriter(path, {"scene": "none"}, {"a.txt": b"text"}) as writer:
        for k in range(3):
            writer.write("/drone1/pose", PoseStamped, PoseStamped().encode(), k * 1_000_000)

    def read(data: bytes) -> None:
        with LogReader(_file(data, "a.mcap")) as log:
            for _ in log.messages():
                pass

    return Target(read, (path.read_bytes(),))


TARGETS = {make.__name__: make for make in (cdr, batches, attachments, set_ups, link, scenes, plans, parameters, logs)}
