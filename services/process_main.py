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
ANSWER_TIMEOUT = 60.0  # [s] for the command of a ROS 2 node in lock step
LONGEST = 15  # [characters] limit of a process's name


class ProcessSpec(NamedTuple):
    """Specification of a process of a run."""

    name: str
    config: RunConfig
    peers: dict[str, str]  # endpoint of every participant
    key_prefix: str  # first part of all Zenoh keys of the run
    secret: str = ""  # secret of a run on one machine (lapwing.cosim.access.publisher_ids)
    speed: float | None = None  # simulated seconds per second; None for as fast as possible
    core: int | None = None  # processor core shared by the services with Gauss-Seidel coupling
    log: str = ""  # path of the recorder's log
    sources: dict[str, str] | None = None  # texts of the scene's files by name, for the log
    mode: str = "multi-process"  # mode of the run, for the log
    open: tuple[str, ...] = ()  # endpoints for clients
    mavlink: tuple[str, ...] = ()  # URLs of links
    mavlink_key: str = ""  # path of a passphrase file
    foxglove: str = ""  # address for viewers
    ros2: int | None = None  # ROS_DOMAIN_ID of a graph
    ros2_router: str = ""  # HOST:PORT of its router
    insecure: bool = False  # accept unsigned commands from other machines
    external: dict[str, str] | None = None  # endpoints of external services by name
    keys: str = ""  # folder of certificates
    realtime: bool = False  # services of the lock step run in the scheduler's real-time class
    with_parent: bool = False  # ends when standard input closes


def write_spec(spec: ProcessSpec, stream: IO[bytes]) -> None:
    """Write the specification of a process; the stream stays open."""
    data = to_json(spec).encode()
    stream.write(_LENGTH.pack(len(data)) + data)
    stream.flush()


def read_spec() -> ProcessSpec:
    """Read the specification of this process from standard input."""
    text = _read(_LENGTH.unpack(_read(_LENGTH.size))[0]).decode()
    modules = json.loads(text)["config"]["resolved"].get("modules", {})  # the run configuration may name their classes
    user_module.install(modules)
    result: Any = from_json(text, modules)
    return result


def _read(size: int) -> bytes:
    data = b""
    while len(data) < size:
        part = os.read(0, min(1 << 20, size - len(data)))
        if not part:
            raise SystemExit(1)  # the launcher has exited
        data += part
    return data


def run_participant(spec: ProcessSpec) -> ExitCode:
    """Run a participant to the end of the run. Return COMPLETED, or TERMINATED after SIGTERM.

    Raises:
        ValueError: invalid input, which the user can correct.
        LockStepError: the lock step cannot continue.
    """
    from lapwing.cosim.access import private_sockets
    from lapwing.cosim.access.publisher_ids import PublisherIds
    from lapwing.cosim.executors.lockstep import run_encoder, run_lockstep
    from lapwing.cosim.executors.participant import Participant, Stopped
    from lapwing.cosim.transport.bus import ZenohBus
    from lapwing.cosim.transport.session_settings import CHILD_LINKS, mesh
    from lapwing.services import process_table
    from lapwing.services.security import door_settings, settings

    config, encoded = spec.config, process_table.service_of_encoder(spec.name)
    entry = process_table.entry(encoded or spec.name)
    participants = PublisherIds(spec.key_prefix, spec.secret, tuple(spec.external or ()))
    listen, connect = mesh(spec.name, spec.peers)
    if spec.with_parent:
        links = {} if spec.external else CHILD_LINKS
        security = door_settings(spec.name, spec.key_prefix, spec.keys) if spec.open else links
    else:
        security = settings(config, spec.name, spec.key_prefix, spec.keys)
    endpoints, gid = [*listen, *spec.open], participants.gid(spec.name)
    with ZenohBus(endpoints, connect, entry.mode, gid, security, awaits=False) as bus:
        watched = MONITOR in spec.peers and not spec.with_parent
        others = [
            *process_table.required_processes(config, spec.external or ()),
            *([MONITOR] if MONITOR in spec.peers else []),
        ]
        if spec.with_parent:  # the run begins when each auxiliary process has opened its links
            others += [name for name in process_table.optional() if name in spec.peers]
        # processes of one launcher have the same run configuration; an external service may have another
        compares = others if not spec.with_parent else [encoded] if encoded else []
        pace = (spec.speed, spec.core, compares, spec.realtime)
        process = Participant(spec.name, config, bus, participants, others, *pace)
        process.create_service = partial(process_table.create, config)
        if spec.with_parent:
            process.stop_with_parent(spec.peers[spec.name])
        elif watched:
            process.stop_without(MONITOR)
        try:
            if encoded:
                run_encoder(process, process_table.create(config, encoded))
            elif entry.lock_step:
                waits = spec.ros2 is not None and config.resolved.get("ros2", {}).get("lock_step", False)
                operators = _operator_commands(process, waits) if spec.name == "autopilot" else {}
                service = process_table.create(config, spec.name, operators)
                owns_time, log = spec.name == process_table.CLOCK_OWNER, Path(spec.log) if spec.log else None
                run_lockstep(process, service, owns_time, process_table.RECORDER, log)
            else:
                entry.service().run(process, spec)
        except Stopped:
            if process.abandoned:
                raise LockStepError(f"{spec.name}: {process.abandoned} left before the end of the run") from None
            if process.terminated:
                return ExitCode.TERMINATED
    if process.orphaned:
        private_sockets.remove(spec.peers[spec.name])
    return ExitCode.COMPLETED


def import_ahead(names: Iterable[str]) -> None:
    """Import the modules of these processes, for example before the scene is read."""
    import lapwing.cosim.executors.lockstep  # noqa: F401 (for a fork to inherit)
    from lapwing.services import process_table

    for name in names:
        process_table.entry(process_table.service_of_encoder(name) or name).service()


def _operator_commands(process: Any, waits: bool) -> dict[str, Any]:
    """Return a source of operator commands by vehicle, for those of MAVLink, ROS 2 and the page of the run monitor."""
    from lapwing.services.common.operator_inbox import OPERATOR_KEY, AnsweredInbox, OperatorInbox
    from lapwing.services.process_table import MAVLINK, ROS2

    get = process.bus.receive(process.participants.senders(OPERATOR_KEY, [MAVLINK, ROS2, MONITOR])).get
    vehicles, mailbox = process.config.vehicles, OperatorInbox(process.config.vehicles, lambda: get(0.0))
    if waits:
        period = process.config.rate // process.config.resolved["rates"]["commands"]
        wait = partial(process.wait_for_outside, get, ANSWER_TIMEOUT)
        mailbox = AnsweredInbox(vehicles, wait, process.config.interval_ns, period)
    return {vehicle: partial(mailbox.take, vehicle) for vehicle in vehicles}


def main(name: str) -> None:
    """Run the participant that standard input specifies; `name` is imported before the specification is read."""
    from lapwing.cosim.processes import relax_gc
    from lapwing.services.common import foreign_code

    relax_gc()
    with suppress(OSError):  # name in `ps` and `top`, on systems that support it
        Path("/proc/self/comm").write_text(name[:LONGEST])
    import_ahead([name])
    try:
        with foreign_code.permission(True):  # the command that starts this process has checked it
            code = run_participant(read_spec())
    except (ValueError, BusError, LockStepError) as error:
        code = error.EXIT_CODE if isinstance(error, LockStepError) else ExitCode.REJECTED
        print(f"lapwing: {' '.join(str(error).split())}", file=sys.stderr)
    raise SystemExit(int(code))


if __name__ == "__main__":
    main(sys.argv[1])
