"""The MAVLink link of a run: telemetry to ground stations, their commands to the autopilot.

It takes no part in the lock step: nobody waits for it, and when it dies the flight goes on. What it shows at once it
subscribes to; all else it reads from the services' journals, which wakes nobody up for a message.
"""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from messages.topics import ANSWERS, ESTIMATE, OPERATOR, STATUS
from services.journal import JOURNAL_KEY, entries
from services.outside import OPERATOR_KEY
from services.parameters import table
from services.process import Process
from services.sections import Exchange

if TYPE_CHECKING:
    from services.mavlink.hub import Options

AT_ONCE = (ESTIMATE, STATUS, ANSWERS)


def run(process: Process, options: "Options", given: Iterable[Any] = ()) -> None:
    """Serve the links until the flight has ended, or until asked to stop; then say how it went.

    `given` are the commands that the autopilot begins with: it may have taken them before this process is there.

    Raises:
        ValueError: a link cannot be opened.
    """
    # Every service's process imports this file; only this one needs MAVLink.
    from services.mavlink.hub import Hub
    from services.mavlink.vehicle import Vehicle

    interval = process.scene[Exchange].interval_ns
    # A run as fast as it goes is slowed by every message that wakes somebody; the journals come often enough for it.
    at_once = AT_ONCE if process.speed else ()
    topics = {process.key(topic): topic for topic in at_once}
    put = process.bus.publisher(f"{process.space}/{OPERATOR_KEY}")
    with Hub(Vehicle.of(process.scene), options, table(process.scene).values(), lambda payload: put(payload, 0)) as hub:
        for command in given:
            hub.adapter.missions.hold(command)
        arrived = process.bus.subscribe(*topics, f"{process.space}/{JOURNAL_KEY}/*", notify=hub.wake)
        process.join()
        flying = True
        while flying and not process.stopping:
            hub.wait()
            while flying and (news := arrived.get_with_key(timeout=0.0)) is not None:
                key, time_ns, payload = news
                flying = bool(payload)
                if topic := topics.get(key):
                    if flying:
                        hub.take(topic, time_ns, payload)
                    continue
                newest = {}
                for other, tick, words in entries(payload):
                    if other is OPERATOR or (other in AT_ONCE and not at_once):  # of these every one counts
                        hub.take(other, tick * interval, words)
                    elif other not in AT_ONCE:
                        newest[other] = tick, words
                for other, (tick, words) in newest.items():
                    hub.take(other, tick * interval, words)
        for line in hub.report():
            print(line, flush=True)
