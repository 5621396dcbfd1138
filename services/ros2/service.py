"""The process that is a node of a ROS 2 graph: what the services publish goes out, commands come in.

It is not part of the lock step: no service waits for it, and the flight continues when it ends.
"""

from typing import Any

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.multi_vehicle import members
from lapwing.cosim.executors.participant import POLL, Participant
from lapwing.cosim.processes.run_monitor import MONITOR
from lapwing.messages import OperatorInput, header
from lapwing.messages.topics import EVENTS, of_vehicle
from lapwing.services.common.last_events import LastEvents
from lapwing.services.common.operator_inbox import OPERATOR_KEY
from lapwing.services.ros2.commands import Commands
from lapwing.services.ros2.node import Node


def run(process: Participant, given: Any) -> None:
    """Publish until the flight has ended, or until asked to stop; then say what came in.

    Raises:
        ValueError: the graph cannot be joined.
    """
    setup = process.setup
    topics, authors = {}, {}
    for name in setup.services:
        for topic in process.create_service(name).topics:
            topics[process.key(topic)] = topic
            authors[process.key(topic)] = process.participants.encoder_gid(name)
    given_to = {topic: commands for commands in _commands(setup) for topic in commands.messages}
    operate = process.bus.publisher(f"{process.key_prefix}/{OPERATOR_KEY}/{process.name}")
    with Node(given.ros2, given.ros2_router, given.insecure) as node:
        for topic in topics.values():
            node.declare(topic.key(setup.vehicle), topic.message.type_name)
        events = {EVENTS.zenoh_key(name, process.key_prefix): of_vehicle(EVENTS, name) for name in setup.vehicles}
        for topic in events.values():
            node.declare(topic.key(), topic.message.type_name)
        asked = node.subscribe({topic: commands.messages[topic] for topic, commands in given_to.items()})
        watcher = dict.fromkeys(events, process.participants.gid(MONITOR))  # the run monitor publishes events
        published = process.bus.receive(authors | watcher)
        process.join()
        flying = set(topics)  # topics that have not come to their end
        topics |= events
        ends = LastEvents(events)
        while ends.await_more(bool(flying)) and not process.stopping:
            while arrived := asked.get():
                commands = given_to[arrived[0]]
                for command in commands.read(*arrived):
                    operate(OperatorInput(header(0, commands.vehicle), (command,)).encode(), 0)
            news = published.get_with_key(POLL)
            if news is None:
                continue
            key, time_ns, payload = news
            if payload:
                node.put(topics[key].key(setup.vehicle), time_ns, payload)
            else:
                flying.discard(key)
                ends.take(key)
        process.confirm()
    for commands in dict.fromkeys(given_to.values()):
        if report := commands.report():
            print(report if setup.vehicle else f"{commands.vehicle}: {report}", flush=True)


def _commands(setup: RunConfig) -> list[Commands]:
    """Return the conversions of all vehicles with `autopilot.accept_commands`."""
    steered = [member for member in members(setup) if "autopilot" in member.services]
    return [Commands(member.vehicle) for member in steered if member.services["autopilot"].parameters.operator]
