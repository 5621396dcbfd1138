"""Entry point of a process of a run: `python -m lapwing.services.process_main NAME`, or a fork that calls `main`.
The process reads its specification from standard input, where the launcher writes it."""

import json
import os
import struct
import sys
from collections.abc import Iterable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import IO, Any, NamedTuple

from lapwing.cosim.config import user_module
from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.config.serialise import from_json, to_json
from lapwing.cosim.processes.run_monitor import MONITOR
from lapwing.cosim.run_errors import BusError, ExitCode, LockStepError

_LENGTH = struct.Struct("<Q")
LONGEST = 15  # characters that the system keeps of a process's name


class ProcessSpec(NamedTuple):
    """Specification of a process of a run."""

    name: str
    setup: RunConfig
    peers: dict[str, str]  # endpoint of every participant
    key_prefix: str  # key prefix
    secret: str = ""  # of a run on one machine (lapwing.cosim.access.publisher_ids)
    speed: float | None = None  # simulated seconds per second, None for as fast as it goes
    core: int | None = None  # core that all services of a sequential lock step share
    log: str = ""  # path of the recorder's log
    sources: dict[str, str] | None = None  # the files that were resolved, for the log; text by name
    mode: str = "multi-process"  # of the run, for the log
    open: tuple[str, ...] = ()  # endpoints for clients
    mavlink: tuple[str, ...] = ()  # URLs of links
    mavlink_key: str = ""  # path of a passphrase
    foxglove: str = ""  # address for viewers
    ros2: int | None = None  # ROS_DOMAIN_ID of a graph
    ros2_router: str = ""  # HOST:PORT of its router
    insecure: bool = False  # unsigned commands from other machines are taken
    external: dict[str, str] | None = None  # endpoints of external services by name
    keys: str = ""  # path of a folder of certificates
    realtime: bool = False  # services of the lock step run in the scheduler's real-time class
    with_parent: bool = False  # ends when standard input closes


def write_spec(given: ProcessSpec, stream: IO[bytes]) -> None:
    """Write what a process is given; the stream stays open."""
    data = to_json(given).encode()
    stream.write(_LENGTH.pack(len(data)) + data)
    stream.flush()


def read_spec() -> ProcessSpec:
    """Read what this process is given, from standard input."""
    text = _read(_LENGTH.unpack(_read(_LENGTH.size))[0]).decode()
    modules = json.loads(text)["setup"]["resolved"].get("modules", {})  # the set-up may name their classes
    user_module.install(modules)
    result: Any = from_json(text, modules)
    return result


def _read(size: int) -> bytes:
    data = b""
    while len(data) < size:
        part = os.read(0, min(1 << 20, size - len(data)))
        if not part:
            raise SystemExit(1)  # the launcher is gone
        data += part
    return data


def run_participant(given: ProcessSpec) -> ExitCode:
    """Run a participant to the end of the run. Return COMPLETED, or TERMINATED after SIGTERM.

    Raises:
        ValueError: for a reason that the user can fix.
        LockStepError: the lock step cannot continue.
    """
    from lapwing.cosim.access import private_sockets
    from lapwing.cosim.access.publisher_ids import PublisherIds
    from lapwing.cosim.executors.lockstep import run_encoder, run_lockstep
    from lapwing.cosim.executors.participant import Participant, Stopped
    from lapwing.cosim.transport.bus import ZenohBus, mesh
    from lapwing.services import process_table
    from lapwing.services.security import door_settings, settings

    setup, encoded = given.setup, process_table.encoded_service(given.name)
    entry = process_table.entry(encoded or given.name)
    participants = PublisherIds(given.key_prefix, given.secret, tuple(given.external or ()))
    listen, connect = mesh(given.name, given.peers)
    if given.with_parent:
        security = door_settings(given.name, given.key_prefix, given.keys) if given.open else {}
    else:
        security = settings(setup, given.name, given.key_prefix, given.keys)
    endpoints, gid = [*listen, *given.open], participants.gid(given.name)
    with ZenohBus(endpoints, connect, entry.mode, gid, security, awaits=False) as bus:
        watched = MONITOR in given.peers and not given.with_parent
        others = [
            *process_table.required_processes(setup, given.external or ()),
            *([MONITOR] if MONITOR in given.peers else []),
        ]
        if given.with_parent:  # the run begins when each auxiliary process has opened its links
            others += [name for name in process_table.optional() if name in given.peers]
        # processes of one launcher have the same run configuration; an external service may have another
        compares = others if not given.with_parent else [encoded] if encoded else []
        pace = (given.speed, given.core, compares, given.realtime)
        process = Participant(given.name, setup, bus, participants, others, *pace)
        process.create_service = partial(process_table.create, setup)
        if given.with_parent:
            process.stop_with_parent(given.peers[given.name])
        elif watched:
            process.stop_without(MONITOR)
        try:
            if encoded:
                run_encoder(process, process_table.create(setup, encoded))
            elif entry.lock_step:
                operators = _heard(process) if given.name == "autopilot" else {}
                service = process_table.create(setup, given.name, operators)
                run_lockstep(process, service, given.name == process_table.CLOCK_OWNER, process_table.RECORDER)
            else:
                entry.service().run(process, given)
        except Stopped:
            if process.abandoned:
                raise LockStepError(f"{given.name}: {process.abandoned} is gone before the run has ended") from None
            if process.terminated:
                return ExitCode.TERMINATED
    if process.orphaned:
        private_sockets.remove(given.peers[given.name])
    return ExitCode.COMPLETED


def import_ahead(names: Iterable[str]) -> None:
    """Import what processes of these names will need, which may be before the scene is read."""
    import lapwing.cosim.executors.lockstep  # noqa: F401 (for a fork to inherit)
    from lapwing.services import process_table

    for name in names:
        process_table.entry(process_table.encoded_service(name) or name).service()


def _heard(process: Any) -> dict[str, Any]:
    """Return the received operator commands by vehicle, from the processes that send any."""
    from lapwing.services.common.operator_inbox import OPERATOR_KEY, OperatorInbox
    from lapwing.services.process_table import MAVLINK, ROS2

    get = process.bus.receive(process.participants.senders(OPERATOR_KEY, [MAVLINK, ROS2])).get
    mailbox = OperatorInbox(process.setup.vehicles, lambda: get(0.0))
    return {vehicle: partial(mailbox.take, vehicle) for vehicle in process.setup.vehicles}


def main(name: str) -> None:
    """Run the participant that standard input specifies, most likely with this name."""
    from lapwing.cosim.processes.gc_tuning import relax_gc
    from lapwing.services.common import foreign_code

    relax_gc()
    foreign_code.allow(True)  # the command that starts this process has checked it
    with suppress(OSError):  # what `ps` and `top` call it, where the system has that
        Path("/proc/self/comm").write_text(name[:LONGEST])
    import_ahead([name])
    try:
        code = run_participant(read_spec())
    except (ValueError, BusError, LockStepError) as error:
        code = error.EXIT_CODE if isinstance(error, LockStepError) else ExitCode.REJECTED
        print(f"lapwing: {' '.join(str(error).split())}", file=sys.stderr)
    raise SystemExit(int(code))


if __name__ == "__main__":
    main(sys.argv[1])
