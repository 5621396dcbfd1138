"""The MAVLink link of a run: telemetry to ground stations, their commands to the autopilot.

It is not part of the lock step: no service waits for it, and the flight continues when it dies. In a run with a
real-time factor a subscription to the estimate wakes it up; all other topics it reads from the services' log packets,
ten per second.
"""

import time
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from lapwing.cosim.config import user_module
from lapwing.cosim.diagram.multi_vehicle import members
from lapwing.cosim.executors.participant import Participant
from lapwing.cosim.transport.bus_keys import BATCH_KEY
from lapwing.cosim.transport.packets import unpack_log_packet
from lapwing.messages.topics import COMMAND_ACKS, ESTIMATE, OPERATOR, STATUS, of_all
from lapwing.services.common.operator_inbox import OPERATOR_KEY
from lapwing.services.mavlink.link_options import Options
from lapwing.services.mavlink.link_server import LinkServer
from lapwing.services.mavlink.links import for_vehicle_index
from lapwing.services.mavlink.signing import TIME_STAMPS, read_key, state_folder

ALL = (OPERATOR, STATUS, COMMAND_ACKS, ESTIMATE)  # of which no message is left out


def run(process: Participant, given: Any) -> None:
    """Serve the links until the flight has ended, or until asked to stop; then say how it went.

    Raises:
        ValueError: a link cannot be opened.
    """
    setup = process.setup
    flown = [member for member in members(setup) if "mavlink" in member.auxiliary]
    if not flown:
        raise ValueError("--mavlink: the scene has no autopilot; use a scene with [autopilot]")
    for module in {member.resolved["mavlink"].get("module") for member in flown} - {None}:
        user_module.load(module, setup.modules)  # declares its messages
    key = read_key(Path(given.mavlink_key)) if given.mavlink_key else None
    time_stamps = state_folder() / TIME_STAMPS
    log = Path(given.log) if given.log else None
    # Every message that wakes a process slows a run without real-time factor; log packets arrive often enough.
    at_once = process.speed is not None
    put = process.bus.publisher(f"{process.key_prefix}/{OPERATOR_KEY}/{process.name}")
    with ExitStack() as stack:
        hubs: dict[str, LinkServer] = {}
        for i, member in enumerate(flown):
            urls = tuple(for_vehicle_index(url, i) for url in given.mavlink)
            options = Options(urls, key, given.insecure, log, time_stamps, process.speed)
            first = next(iter(hubs.values()), None)
            hub = LinkServer(member.auxiliary["mavlink"], options, lambda payload: put(payload, 0), first)
            hubs[member.vehicle] = stack.enter_context(hub)
            for command in member.services["autopilot"].parameters.plan:  # the autopilot begins with it
                hub.adapter.missions.hold(command)
        woken = {ESTIMATE.zenoh_key(name, process.key_prefix): hub for name, hub in hubs.items() if at_once}
        leading, *others = hubs.values()

        def wait() -> None:
            leading.wait()
            for other in others:
                other.adapter.tick(time.monotonic())

        senders = process.participants.senders(BATCH_KEY, setup.services)
        estimates = dict.fromkeys(woken, process.participants.encoder_gid("autopilot"))
        estimated = process.bus.receive(estimates, notify=leading.wake)
        arrived = process.bus.receive(senders, notify=None if estimates else leading.wake)
        process.join(wait)  # endpoints may connect while the others still load or compile
        flying = set(setup.services)  # those whose last batch has not come
        while flying and not process.stopping:
            wait()
            while flying and (news := estimated.get_with_key(0.0) or arrived.get_with_key(0.0)) is not None:
                name, time_ns, payload = news
                if name in woken:
                    if payload:
                        woken[name].take(ESTIMATE, time_ns, payload)
                elif payload:
                    _take_batch(hubs, payload, at_once, setup.interval_ns)
                else:
                    flying.discard(name.rpartition("/")[2])
        process.confirm()
        for name, hub in hubs.items():
            for line in hub.report():
                print(f"{name}: {line}" if others else line, flush=True)


def _take_batch(hubs: Mapping[str, LinkServer], payload: bytes, at_once: bool, interval_ns: int) -> None:
    """Handle all commands, acknowledgements and statuses of a log packet, and the newest message of other topics."""
    *_, pages = unpack_log_packet(payload)
    for page in pages:
        topic = of_all(page.topic)
        if topic is ESTIMATE and at_once:
            continue
        chosen = range(0 if topic in ALL else len(page.ticks) - 1, len(page.ticks))
        for hub in [hubs[page.topic.vehicle]] if page.topic.vehicle else hubs.values():
            for i in chosen:
                hub.take(topic, int(page.ticks[i]) * interval_ns, page.payloads[i].tobytes())
