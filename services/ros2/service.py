"""The process that is a node of a ROS 2 graph: what the services publish goes out, commands come in.

It takes no part in the lock step: nobody waits for it, and when it ends the flight goes on.
"""

from typing import Any

from cosim.process import POLL, Process
from cosim.watch import WATCHER
from messages import OperatorInput
from messages.topics import EVENTS
from services.common.operator import OPERATOR_KEY
from services.processes import create
from services.ros2.commands import Commands
from services.ros2.node import Node


def run(process: Process, given: Any) -> None:
    """Publish until the flight has ended, or until asked to stop; then say what came in.

    Raises:
        ValueError: the graph cannot be joined.
    """
    setup = process.setup
    topics, authors = {}, {}
    for name in setup.services:
        for topic in create(setup, name).topics:
            topics[process.key(topic)] = topic
            authors[process.key(topic)] = process.participants.author(name)
    commands = Commands(setup.vehicle)
    operate = process.bus.publisher(f"{process.key_prefix}/{OPERATOR_KEY}/{process.name}")
    with Node(given.ros2, given.ros2_router, given.insecure) as node:
        for topic in topics.values():
            node.declare(topic.key(setup.vehicle), topic.message.type_name)
        events = process.key(EVENTS)  # of who watches the run
        node.declare(EVENTS.key(setup.vehicle), EVENTS.message.type_name)
        asked = node.subscribe(commands.messages if _takes_commands(setup) else {})
        published = process.bus.receive(authors | {events: process.participants.mark(WATCHER)})
        process.join()
        flying = set(topics)  # topics that have not come to their end
        topics[events] = EVENTS
        while flying and not process.stopping:
            while arrived := asked.get():
                for command in commands.read(*arrived):
                    operate(OperatorInput(commands=(command,)).encode(), 0)
            news = published.get_with_key(POLL)
            if news is None:
                continue
            key, time_ns, payload = news
            if payload:
                node.put(topics[key].key(setup.vehicle), time_ns, payload)
            else:
                flying.discard(key)
    if report := commands.report():
        print(report, flush=True)


def _takes_commands(setup: Any) -> bool:
    """Whether the scene lets others command: `autopilot.operator`."""
    return "autopilot" in setup.services and setup.services["autopilot"].parameters.operator
