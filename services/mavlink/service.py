"""MAVLink process of a run: telemetry to ground stations, and their commands to the autopilot.

It is not part of the lock step: no service waits for it, and the flight continues when it dies. In a run with a
real-time factor, each estimate wakes it. It reads all other topics from the services' log packets, ten
per second, which stay in the queue until the next estimate.
"""

import os
import selectors
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from operator import itemgetter
from pathlib import Path
from typing import Any

from lapwing.cosim.config import user_module
from lapwing.cosim.diagram.multi_vehicle import members
from lapwing.cosim.executors.participant import Participant
from lapwing.cosim.transport.bus_keys import BATCH_KEY
from lapwing.cosim.transport.packets import unpack_log_packet
from lapwing.messages.topics import COMMAND_ACKS, ESTIMATE, OPERATOR, STATUS, template_topic
from lapwing.services.common.operator_inbox import OPERATOR_KEY
from lapwing.services.mavlink.adapter import EMPTY_SIZES
from lapwing.services.mavlink.link_server import LinkServer, Options
from lapwing.services.mavlink.links import for_vehicle_index
from lapwing.services.mavlink.signing import TIME_STAMPS, read_key, state_folder


class SocketWatch:
    """Thread that waits for data of endpoints; a context manager.

    Messages of the run cause most wake-ups of a link. With this thread the main thread waits for those only, which
    takes fewer system calls than a wait for both.

    Attributes:
        ready: True if a socket is ready, until `resume`.
    """

    def __init__(self, selector: selectors.BaseSelector, wake: Callable[[], None]):
        """Start the thread.

        Args:
            selector: selector of the sockets, which another thread reads.
            wake: called in this thread when a socket is ready, and not again before `resume`.
        """
        self._selector, self._wake = selector, wake
        self.ready = self._closed = False
        self._resume = threading.Event()
        self._end = os.eventfd(0, os.EFD_NONBLOCK)
        selector.register(self._end, selectors.EVENT_READ, lambda: None)
        self._thread = threading.Thread(target=self._run, name="sockets", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while True:
            self._selector.select()
            if self._closed:
                return
            self.ready = True
            self._wake()
            self._resume.wait()
            self._resume.clear()

    def resume(self) -> None:
        """Resume the wait; called after all ready sockets have been served."""
        self.ready = False
        self._resume.set()

    def __enter__(self) -> "SocketWatch":
        return self

    def __exit__(self, *_: object) -> None:
        self._closed = True
        os.eventfd_write(self._end, 1)
        self._resume.set()
        self._thread.join()
        self._selector.unregister(self._end)
        os.close(self._end)


WAIT = 0.05  # [s] longest wait
ALL = (OPERATOR, STATUS, COMMAND_ACKS, ESTIMATE)  # topics of which all messages are handled


def run(process: Participant, spec: Any) -> None:
    """Serve the links until the run has ended or this process is requested to stop; then print a report.

    Args:
        process: this process as a participant of the run.
        spec: its `ProcessSpec`.

    Raises:
        ValueError: a link cannot be opened.
    """
    config = process.config
    # Every message that wakes a process slows a run without real-time factor; log packets arrive often enough.
    immediate = process.speed is not None
    with ExitStack() as stack:
        servers = _open_servers(process, spec, stack)
        by_estimate_key = {
            ESTIMATE.zenoh_key(name, process.key_prefix): server for name, server in servers.items() if immediate
        }
        first_server, *others = servers.values()

        def serve() -> None:
            first_server.wait(0.0)
            for other in others:
                other.adapter.tick(time.monotonic())

        senders = process.participants.senders(BATCH_KEY, config.services)
        estimates = dict.fromkeys(by_estimate_key, process.participants.encoder_gid("autopilot"))
        log_packets = process.bus.receive(senders, deferred=True)
        first_source = process.bus.receive(estimates, deferred=True) if immediate else log_packets  # wakes this process
        process.join(serve)  # endpoints may connect while the others still load or compile
        sockets = stack.enter_context(SocketWatch(first_server.selector, first_source.wake))
        unfinished = set(config.services)  # services whose last log packet has not arrived
        while unfinished and not process.stopping:
            message = first_source.get_with_key(0.0 if sockets.ready else WAIT)
            if message is None or sockets.ready:
                serve()
                sockets.resume()
            while (message := message or log_packets.get_with_key(0.0)) is not None:
                name, time_ns, payload = message
                message = None
                if name in by_estimate_key:
                    if payload:
                        by_estimate_key[name].handle(ESTIMATE, time_ns, payload)
                elif payload:
                    _handle_log_packet(servers, payload, immediate, config.interval_ns)
                else:
                    unfinished.discard(name.rpartition("/")[2])
        process.confirm()
        for name, server in servers.items():
            for line in server.report():
                print(f"{name}: {line}" if others else line, flush=True)


def _open_servers(process: Participant, spec: Any, stack: ExitStack) -> dict[str, LinkServer]:
    """Open the links of all vehicles with an autopilot. Return the servers by vehicle name.

    Raises:
        ValueError: no vehicle has an autopilot, or a link cannot be opened.
    """
    config = process.config
    linked_members = [member for member in members(config) if "mavlink" in member.auxiliary]
    if not linked_members:
        raise ValueError("--mavlink: the scene has no autopilot; use a scene with [autopilot]")
    for module in {member.resolved["mavlink"].get("module") for member in linked_members} - {None}:
        user_module.load(module, config.modules)  # declares its messages
    key = read_key(Path(spec.mavlink_key)) if spec.mavlink_key else None
    log = Path(spec.log) if spec.log else None
    publish = process.bus.publisher(f"{process.key_prefix}/{OPERATOR_KEY}/{process.name}")
    servers: dict[str, LinkServer] = {}
    for i, member in enumerate(linked_members):
        urls = tuple(for_vehicle_index(url, i) for url in spec.mavlink)
        options = Options(urls, key, spec.insecure, log, state_folder() / TIME_STAMPS, process.speed)
        first = next(iter(servers.values()), None)
        server = LinkServer(member.auxiliary["mavlink"], options, lambda payload: publish(payload, 0), first)
        servers[member.vehicle] = stack.enter_context(server)
        for command in member.services["autopilot"].parameters.plan:  # the autopilot starts with it
            server.adapter.missions.store(command)
    return servers


def _handle_log_packet(servers: Mapping[str, LinkServer], payload: bytes, immediate: bool, interval_ns: int) -> None:
    """Handle all commands, acknowledgements and statuses of a log packet, and the newest message of other topics.

    A batch has messages of equal length, so a topic whose messages vary in length has several, which overlap in time.
    """
    *_, batches = unpack_log_packet(payload)
    ordered = []  # (tick, True for an estimate, which comes last, server, topic, payload)
    newest: dict[Any, int] = {}  # tick by topic
    for batch in batches:
        topic = template_topic(batch.topic)
        if topic is ESTIMATE and immediate:
            continue
        if batch.payloads.shape[1] <= EMPTY_SIZES.get(topic, 0):
            continue
        batch_servers = [servers[batch.topic.vehicle]] if batch.topic.vehicle else servers.values()
        if topic in ALL:
            for server in batch_servers:
                ordered += [
                    (int(tick), topic is ESTIMATE, server, topic, row)
                    for tick, row in zip(batch.ticks, batch.payloads, strict=True)
                ]
        elif batch.ticks[-1] >= newest.get(batch.topic, -1):
            newest[batch.topic] = int(batch.ticks[-1])
            for server in batch_servers:
                server.adapter.vehicle.put(topic, batch.payloads[-1].tobytes())
    ordered.sort(key=itemgetter(0, 1))
    for tick, _, server, topic, row in ordered:
        server.handle(topic, tick * interval_ns, row.tobytes())
