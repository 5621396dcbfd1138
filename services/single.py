"""All services in one process: the same steps and the same bytes as over the network, without the network."""

import time
from collections import deque
from collections.abc import Callable
from typing import Any

from messages.topics import Topic
from services.lockstep import Service, execution_order, published
from services.outside import Operator, joined, nobody
from services.recorder.collate import Collator
from services.recorder.service import Sink, Writing
from services.scene import Scene
from services.sections import Exchange, Vehicle, period

LOOK = 0.2  # [s] of wall time between two looks at the run


class _Port:
    """An input of a service: when a message is due on it, and those that have come."""

    def __init__(self, decode: Callable[[bytes], Any], every: int, delay: int):
        self.decode, self.every, self.delay = decode, every, delay
        self.arrived: deque[bytes] = deque()

    def take(self, tick: int) -> Any:
        stamp = tick - self.delay
        if stamp < 0 or stamp % self.every:
            return None
        return self.decode(self.arrived.popleft())


def run_single(
    scene: Scene,
    services: dict[str, Service],
    writer: Sink,
    speed: float | None,
    observe: Callable[[int, dict[Topic, bytes]], bool],
    operator: Operator = nobody,
    last: int | None = None,
) -> None:
    """Fly `scene` to its end.

    Args:
        scene: what to fly.
        services: its lock-step services by name.
        writer: the log, or whatever takes its messages.
        speed: simulated seconds per second, None for as fast as it goes.
        observe: called now and then with the time [ns] and the newest payload of each topic; says
            whether to stop.
        operator: who speaks to the external inputs.
        last: the tick after which to stop, None for the end of the run.
    """
    interval = scene[Exchange].interval_ns
    collator = Collator(scene, published(services.values()))
    writing = Writing(writer, collator, scene[Vehicle].name, interval)
    consumers: dict = {topic: [] for topic in published(services.values())}
    outside = [(i.topic, period(scene, i.topic)) for service in services.values() for i in service.inputs if i.external]
    plan = []
    for name in execution_order(services):
        service = services[name]
        ports = [_Port(i.topic.message.decode, period(scene, i.topic), i.delay) for i in service.inputs]
        for needed, port in zip(service.inputs, ports, strict=True):
            consumers[needed.topic].append(port.arrived)
        plan.append((service.step, ports))

    def give(tick: int, topic: Topic, message: Any) -> None:
        payload = message.encode()
        for arrived in consumers[topic]:
            arrived.append(payload)
        collator.add(topic, tick, payload)

    owner = next(service for service in services.values() if hasattr(service, "finished"))
    started = next_look = time.perf_counter()
    tick = 0
    while not owner.finished and (last is None or tick <= last):
        if speed is not None:
            time.sleep(max(0.0, started + tick * interval * 1e-9 / speed - time.perf_counter()))
        for topic, every in outside:
            if tick % every == 0:
                give(tick, topic, joined(tick * interval, operator(tick)))
        for step, ports in plan:
            for topic, message in step(tick, *[port.take(tick) for port in ports]):
                give(tick, topic, message)
        writing.write_complete()
        if time.perf_counter() >= next_look:
            next_look += LOOK
            if observe(tick * interval, writing.newest):
                return
        tick += 1
    observe((tick - 1) * interval, writing.newest)
