"""Live feed of a multi-process run: new steps and events for displays."""

from collections.abc import Callable, Iterable, Sequence

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.multi_vehicle import members
from lapwing.cosim.diagram.topic_encoder import RecordBatch
from lapwing.cosim.processes.run_monitor import RunMonitor
from lapwing.messages.topics import EVENTS
from lapwing.runs.log_events import event_messages
from lapwing.studies.flight_data import FlightData
from lapwing.studies.flight_events import Event
from lapwing.studies.live_flight import LiveFlight, new_events

Shows = Callable[[Sequence[FlightData], Sequence[list[Event]]], None]


class LiveFeed:
    """Tells of each step of a run; events also go out on their topic, for viewers that are processes of the run."""

    def __init__(self, setup: RunConfig, shows: Iterable[Shows] = ()):
        """Prepare the feed of a run; each of `shows` receives the steps of all vehicles with their events."""
        self._flights, self._after = [LiveFlight(member) for member in members(setup)], -1.0
        self._services, self._shows = set(setup.services), tuple(shows)

    def observe(self, watch: RunMonitor) -> None:
        """Publish and show the new part of a run; at its end, end the events for viewers, who wait for that."""
        watch.listen = self._take
        self._observe(watch)
        if watch.complete:  # again and again: a message to viewers may be dropped
            for flight in self._flights:
                watch.publish(EVENTS.name.format(vehicle=flight.vehicle), watch.time_ns, b"")

    def _observe(self, watch: RunMonitor) -> None:
        if not watch.reporting_services >= self._services:
            return
        steps = [step for flight in self._flights if (step := flight.step(watch.time_ns)) is not None]
        if len(steps) < len(self._flights):  # the plant publishes all vehicles at once, or none
            return
        happened = [new_events(step, self._after) for step in steps]
        self._after = float(steps[0].truth.times[-1])
        for step, events in zip(steps, happened, strict=True):
            for time_ns, payload in event_messages(events):
                watch.publish(EVENTS.name.format(vehicle=step.vehicle), time_ns, payload)
        for show in self._shows:
            show(steps, happened)

    def _take(self, pages: list[RecordBatch]) -> None:
        for flight in self._flights:
            flight.take(pages)
