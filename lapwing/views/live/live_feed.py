"""Live feed of a multi-process run: new steps and events for displays."""

from collections.abc import Callable, Iterable, Sequence
from operator import itemgetter

import numpy as np

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.multi_vehicle import members
from lapwing.cosim.diagram.topic_encoder import RecordBatch
from lapwing.cosim.processes.run_monitor import RunMonitor
from lapwing.flights.flight_data import IN_SPACE, FlightData
from lapwing.flights.flight_events import Event
from lapwing.flights.flight_provenance import Origin
from lapwing.flights.log_events import event_messages
from lapwing.flights.topic_view import TopicView
from lapwing.messages.topic_columns import history
from lapwing.messages.topics import (
    COMMAND_ACKS,
    DEPTH_IMAGE,
    ESTIMATE,
    EVENTS,
    LASER_SCAN,
    POINT_CLOUD,
    STATUS,
    TRUTH,
    Topic,
    template_topic,
)
from lapwing.services.common.event_kinds import KINDS

Display = Callable[[Sequence[FlightData], Sequence[list[Event]]], None]


class LiveFeed:
    """Feed of the steps and events of a run; it also publishes the events for viewers on the bus."""

    def __init__(self, config: RunConfig, displays: Iterable[Display] = ()):
        """Prepare the feed of a run; each of `displays` receives the steps of all vehicles with their events."""
        self._flights, self._after = [LiveFlight(member) for member in members(config)], -1.0
        self._services, self._displays = set(config.services), tuple(displays)

    def observe(self, watch: RunMonitor) -> None:
        """Publish and show the new part of a run. At its end, publish the end of the events."""
        watch.on_batches = self._take
        self._observe(watch)
        if watch.complete:  # repeatedly, because messages to viewers may be dropped
            for flight in self._flights:
                watch.publish(EVENTS.name.format(vehicle=flight.vehicle), watch.time_ns, b"")

    def _observe(self, watch: RunMonitor) -> None:
        if not watch.reporting_services >= self._services:
            return
        steps = [step for flight in self._flights if (step := flight.step(watch.time_ns)) is not None]
        if len(steps) < len(self._flights):  # the plant publishes all vehicles at once, or none
            return
        for step in steps:
            step.others = tuple(other for other in steps if other is not step)
        events_of_step = [new_events(step, self._after) for step in steps]
        self._after = watch.time_ns * 1e-9  # all messages up to it have arrived; the truth may end earlier
        for step, events in zip(steps, events_of_step, strict=True):
            for time_ns, payload in event_messages(events):
                watch.publish(EVENTS.name.format(vehicle=step.vehicle), time_ns, payload)
        for show in self._displays:
            show(steps, events_of_step)

    def _take(self, pages: list[RecordBatch]) -> None:
        for flight in self._flights:
            flight.add(pages)


TOPICS = (*IN_SPACE, STATUS, COMMAND_ACKS, ESTIMATE, LASER_SCAN, POINT_CLOUD, DEPTH_IMAGE)


class LiveFlight:
    """Buffer of a run's messages, which the services may deliver in any order."""

    def __init__(self, config: RunConfig):
        """Create from the run configuration of one vehicle before the run (see
        `lapwing.cosim.diagram.multi_vehicle.members` for a fleet)."""
        self._config, self.vehicle = config, config.vehicle
        self._pending: dict[Topic, list[tuple[int, bytes]]] = {topic: [] for topic in TOPICS}  # time [ns], payload

    def add(self, pages: Iterable[RecordBatch]) -> None:
        """Add record batches of a service."""
        interval = self._config.interval_ns
        for page in pages:
            topic = template_topic(page.topic)
            if topic in self._pending and page.topic.vehicle in ("", self._config.vehicle):
                rows = zip(page.ticks, page.payloads, strict=True)
                self._pending[topic] += [(int(k) * interval, row.tobytes()) for k, row in rows]
                self._pending[topic].sort(key=itemgetter(0))  # messages of different lengths are in different batches

    def step(self, until_ns: int) -> FlightData | None:
        """Return the new samples up to `until_ns` [ns], and before them the newest of the previous step.

        Return None without new ground truth.
        """
        if sum(time_ns <= until_ns for time_ns, _ in self._pending[TRUTH]) < 2:
            return None
        views: dict[str, TopicView] = {}
        for topic, messages in self._pending.items():
            now = [message for message in messages if message[0] <= until_ns]
            if now:
                times, payloads = zip(*now, strict=True)
                columns = history(topic.message, payloads)
                views[topic.name.removeprefix("{vehicle}/")] = TopicView(np.array(times, np.int64), columns)
                del messages[: len(now) - 1]  # the newest is the first of the next step
        return FlightData(views, Origin.of_config(self._config))


def new_events(flight: FlightData, after: float) -> list[Event]:
    """Return the events of a step after the time `after` [s]."""
    before = round(after, 9)  # like the times of events
    return [event for event in flight.occurrences if event.time > before and not KINDS[event.kind].afterwards]
