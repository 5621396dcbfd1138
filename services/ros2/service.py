"""ROS 2 node of a run: publishes the messages of the services, and receives commands.

It is not part of the lock step: no service waits for it, and the flight continues when it ends. With `ros2.lock_step`
the run begins when a node publishes a command topic, and the autopilot waits for its answers (`AnsweredInbox`).
"""

import math
import time
from typing import Any

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.multi_vehicle import members
from lapwing.cosim.executors.participant import POLL, Participant
from lapwing.cosim.processes.run_monitor import MONITOR
from lapwing.messages import OperatorInput, header
from lapwing.messages.topics import EVENTS, of_vehicle
from lapwing.services.common.operator_inbox import OPERATOR_KEY, accepts_commands
from lapwing.services.ros2.commands import Commands
from lapwing.services.ros2.node import Node

BRIEF = 0.001  # [s] between two looks for answers of nodes in lock step


def run(process: Participant, spec: Any) -> None:
    """Publish until the run has ended or this process is requested to stop; then print a report.

    Args:
        process: this process as a participant of the run.
        spec: its `ProcessSpec`.

    Raises:
        ValueError: no vehicle can be commanded in lock step, or the node cannot reach or open a Zenoh router.
    """
    config = process.config
    topics, senders = {}, {}
    for name in config.services:
        for topic in process.create_service(name).topics:
            topics[process.key(topic)] = topic
            senders[process.key(topic)] = process.participants.encoder_gid(name)
    commands_by_topic = {topic: commands for commands in _commands(config) for topic in commands.messages}
    lock_step = config.resolved.get("ros2", {}).get("lock_step", False)
    if lock_step and not commands_by_topic:
        raise ValueError("ros2.lock_step: no vehicle accepts commands; expected autopilot.accept_commands = true")
    operate = process.bus.publisher(f"{process.key_prefix}/{OPERATOR_KEY}/{process.name}")
    with Node(spec.ros2, spec.ros2_router, spec.insecure) as node:
        for topic in topics.values():
            node.declare(topic.key(config.vehicle), topic.message.type_name)
        events = {EVENTS.zenoh_key(name, process.key_prefix): of_vehicle(EVENTS, name) for name in config.vehicles}
        for topic in events.values():
            node.declare(topic.key(), topic.message.type_name)
        subscription = node.subscribe(
            {topic: commands.messages[topic] for topic, commands in commands_by_topic.items()}
        )
        event_senders = dict.fromkeys(events, process.participants.gid(MONITOR))  # the run monitor publishes events
        published = process.bus.receive(senders | event_senders)
        published_elsewhere = node.publishers()

        def commander(seconds: float) -> bool | None:
            """Return True if another node publishes a command, None if none does within `seconds`."""
            if any(topic in commands_by_topic for topic in published_elsewhere.copy()):
                return True
            time.sleep(seconds)
            return None

        if lock_step:
            process.wait_for_outside(
                commander,
                math.inf,
                lambda: f"a ROS 2 node that publishes commands, for example {next(iter(commands_by_topic))}",
            )
        process.join()
        unfinished = set(topics)  # topics that have not ended
        topics |= events
        open_events = set(events) if MONITOR in process.others else set()  # they end after the flight
        while (unfinished or open_events) and not process.stopping:
            while received := subscription.get():
                commands = commands_by_topic[received[0]]
                stamp = commands.stamp(*received) if lock_step else 0
                operate(OperatorInput(header(0, commands.vehicle), commands.read(*received)).encode(), stamp)
            message = published.get_with_key(BRIEF if lock_step else POLL)
            if message is None:
                continue
            key, time_ns, payload = message
            if payload:
                node.put(topics[key].key(config.vehicle), time_ns, payload)
            else:
                unfinished.discard(key)
                open_events.discard(key)
        process.confirm()
    for commands in dict.fromkeys(commands_by_topic.values()):
        if report := commands.report():
            print(report if config.vehicle else f"{commands.vehicle}: {report}", flush=True)


def _commands(config: RunConfig) -> list[Commands]:
    """Return the conversions of all vehicles with `autopilot.accept_commands`."""
    return [Commands(member.vehicle) for member in members(config) if accepts_commands(member)]
