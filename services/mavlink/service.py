"""The MAVLink link of a run: telemetry to ground stations, their commands to the autopilot.

It takes no part in the lock step: nobody waits for it, and when it dies the flight goes on. In real time it subscribes
to what it shows at once; all else it reads from the services' batches, which wakes nobody up for a message.
"""

from pathlib import Path
from typing import Any

from cosim.bundle import unpack_batch
from cosim.keys import BATCH_KEY
from cosim.process import Process
from messages.topics import COMMAND_ACKS, ESTIMATE, OPERATOR, STATUS
from services.common.operator import OPERATOR_KEY
from services.mavlink.channel import read_key
from services.mavlink.hub import Hub
from services.mavlink.options import Options

AT_ONCE = (ESTIMATE, STATUS, COMMAND_ACKS)


def run(process: Process, given: Any) -> None:
    """Serve the links until the flight has ended, or until asked to stop; then say how it went.

    Raises:
        ValueError: a link cannot be opened.
    """
    setup = process.setup
    description = setup.beside.get("mavlink")
    if description is None:
        raise ValueError("--mavlink: nobody steers in this scene; expected one with [autopilot]")
    key = read_key(given.mavlink_key) if given.mavlink_key else None
    options = Options(given.mavlink, key, given.insecure, Path(given.log) if given.log else None, process.speed)
    # A run as fast as it goes is slowed by every message that wakes somebody; the batches come often enough for it.
    at_once = AT_ONCE if process.speed else ()
    topics = {process.key(topic): topic for topic in at_once}
    put = process.bus.publisher(f"{process.key_prefix}/{OPERATOR_KEY}")
    with Hub(description, options, lambda payload: put(payload, 0)) as hub:
        for command in setup.services["autopilot"].parameters.plan:  # the autopilot begins with it
            hub.adapter.missions.hold(command)
        arrived = process.bus.subscribe(*topics, f"{process.key_prefix}/{BATCH_KEY}/*", notify=hub.wake)
        process.join()
        flying = True
        while flying and not process.stopping:
            hub.wait()
            while flying and (news := arrived.get_with_key(timeout=0.0)) is not None:
                name, time_ns, payload = news
                flying = bool(payload)
                if flying and name in topics:
                    hub.take(topics[name], time_ns, payload)
                elif flying:
                    _take_batch(hub, payload, at_once, setup.interval_ns)
        for line in hub.report():
            print(line, flush=True)


def _take_batch(hub: Hub, payload: bytes, at_once: tuple, interval_ns: int) -> None:
    """Every command and, where they do not come at once, every status and answer; of all else the newest."""
    _, pages = unpack_batch(payload)
    for page in pages:
        if page.topic is OPERATOR or (page.topic in AT_ONCE and not at_once):
            chosen = range(len(page.ticks))
        elif page.topic not in AT_ONCE:
            chosen = range(len(page.ticks) - 1, len(page.ticks))
        else:
            continue
        for i in chosen:
            hub.take(page.topic, int(page.ticks[i]) * interval_ns, page.payloads[i].tobytes())
