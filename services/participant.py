"""One process of a run: what it is given, and how it takes part. `python -m services.participant NAME` reads that from
standard input, as the launcher writes it."""

import json
import os
import struct
import sys
from typing import IO, Any, NamedTuple

from cosim import user_module
from cosim.serialise import from_json, to_json
from cosim.setup import Setup
from cosim.watch import WATCHER

_LENGTH = struct.Struct("<Q")


class Participation(NamedTuple):
    """What a process of a run is given."""

    name: str
    setup: Setup
    peers: dict[str, str]  # endpoint of every participant
    key_prefix: str  # key prefix
    speed: float | None = None  # simulated seconds per second, None for as fast as it goes
    core: int | None = None  # core that all services of a sequential lock step share
    log: str = ""  # path of the recorder's log
    sources: dict[str, str] | None = None  # the files that were resolved, for the log; text by name
    mode: str = "processes"  # of the run, for the log
    open: tuple[str, ...] = ()  # endpoints for clients
    mavlink: tuple[str, ...] = ()  # URLs of links
    mavlink_key: str = ""  # path of a passphrase
    insecure: bool = False  # unsigned commands from other machines are taken
    external: dict[str, str] | None = None  # endpoints of services that are programs of somebody else's, by name
    with_parent: bool = False  # ends when standard input closes


def hand_over(given: Participation, stream: IO[bytes]) -> None:
    """Write what a process is given; the stream stays open."""
    data = to_json(given).encode()
    stream.write(_LENGTH.pack(len(data)) + data)
    stream.flush()


def take_over() -> Participation:
    """Read what this process is given, from standard input."""
    text = _read(_LENGTH.unpack(_read(_LENGTH.size))[0]).decode()
    user_module.install(json.loads(text)["setup"]["resolved"].get("modules", {}))  # the set-up may name their classes
    found: Any = from_json(text)
    return found


def _read(size: int) -> bytes:
    data = b""
    while len(data) < size:
        part = os.read(0, min(1 << 20, size - len(data)))
        if not part:
            raise SystemExit(1)  # the launcher is gone
        data += part
    return data


def take_part(given: Participation) -> None:
    """Take part in a run to its end.

    Raises:
        ValueError: what the user can mend.
        LockStepError: the lock step cannot go on.
    """
    from cosim.bus import ZenohBus, mesh
    from cosim.lockstep import run_encoder, run_lockstep
    from cosim.process import Process, Stopped
    from services import processes

    setup, encoded = given.setup, processes.encoded(given.name)
    entry = processes.entry(encoded or given.name)
    listen, connect = mesh(given.name, given.peers)
    with ZenohBus([*listen, *given.open], connect, entry.mode) as bus:
        watched = WATCHER in given.peers and not given.with_parent
        others = [*processes.needed(setup, given.external or ()), *([WATCHER] if watched else [])]
        compares = not given.with_parent or bool(encoded)
        process = Process(given.name, setup, bus, given.key_prefix, others, given.speed, given.core, compares)
        if given.with_parent:
            process.end_with_parent()
        elif watched:
            process.end_with(WATCHER)
        try:
            if encoded:
                run_encoder(process, processes.create(setup, encoded))
            elif entry.lock_step:
                more = {"operator": _heard(process)} if given.name == "autopilot" else {}
                service = processes.create(setup, given.name, **more)
                run_lockstep(process, service, given.name == processes.TIME_OWNER)
            else:
                module = __import__(f"{entry.package}.service", fromlist=["run"])
                module.run(process, given)
        except Stopped:
            pass


def _heard(process: Any) -> Any:
    """The operator commands that have come on the bus."""
    from services.common.operator import OPERATOR_KEY, commands

    get = process.bus.subscribe(f"{process.key_prefix}/{OPERATOR_KEY}").get

    def heard(_: int) -> list[Any]:
        found: list[Any] = []
        while arrived := get(0.0):
            found += commands(arrived[1])
        return found

    return heard


def main() -> None:
    """Take part as the launcher says."""
    from cosim.bus import BusError
    from cosim.schedule import LockStepError

    try:
        take_part(take_over())
    except (ValueError, BusError) as error:
        _end(str(error), 2)
    except LockStepError as error:
        _end(str(error), 1)


def _end(message: str, code: int) -> None:
    print(f"lapwing: {' '.join(message.split())}", file=sys.stderr)
    raise SystemExit(code)


if __name__ == "__main__":
    main()
