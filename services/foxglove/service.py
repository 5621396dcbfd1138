"""Foxglove server of a run: it reads the services' log packets, and no service waits for it."""

from typing import Any

from lapwing.cosim.executors.participant import POLL, Participant
from lapwing.cosim.processes.run_monitor import MONITOR
from lapwing.cosim.transport.bus_keys import BATCH_KEY
from lapwing.cosim.transport.packets import unpack_log_packet
from lapwing.messages.topics import EVENTS
from lapwing.services.foxglove.server import Server


def run(process: Participant, spec: Any) -> None:
    """Serve the topics and events of a run until it has ended or this process is requested to stop.

    Args:
        process: this process as a participant of the run.
        spec: its `ProcessSpec`.

    Raises:
        ValueError: the server cannot listen at the address.
    """
    config = process.config
    with Server(spec.foxglove, spec.insecure) as server:
        events = {EVENTS.zenoh_key(name, process.key_prefix): EVENTS.key(name) for name in config.vehicles}
        watcher = dict.fromkeys(events, process.participants.gid(MONITOR))
        subscription = process.bus.receive(process.participants.senders(BATCH_KEY, config.services) | watcher)
        for topic in events.values():
            server.declare(topic, EVENTS.message.type_name)
        for name in config.services:  # so that viewers subscribe before the flight begins
            for recorded in process.create_service(name).topics:
                server.declare(recorded.key(config.vehicle), recorded.message.type_name)
        process.join()
        unfinished = set(config.services)  # services whose last log packet has not arrived
        open_events = set(events) if MONITOR in process.others else set()  # they end after the flight
        while (unfinished or open_events) and not process.stopping:
            message = subscription.get_with_key(POLL)
            if message is None:
                continue
            key, time_ns, payload = message
            if not payload:
                unfinished.discard(key.rpartition("/")[2])
                open_events.discard(key)
                continue
            if key in events:
                server.log(events[key], time_ns, payload)
                continue
            messages = []
            for batch in unpack_log_packet(payload)[2]:
                topic = batch.topic.key(config.vehicle)
                server.declare(topic, batch.topic.message.type_name)
                times = batch.ticks * config.interval_ns
                messages += [(int(t), topic, p.tobytes()) for t, p in zip(times, batch.payloads, strict=True)]
            for time_ns, topic, content in sorted(messages, key=lambda m: m[0]):
                server.put(topic, time_ns, content)
        process.confirm()
