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

Display = Callable[[Sequence[FlightData], Sequence[list[Event]]], None]


class LiveFeed:
    """Feed of the steps and events of a run; it also publishes the events for viewers on the bus."""

    def __init__(self, setup: RunConfig, displays: Iterable[Display] = ()):
        """Prepare the feed of a run; each of `displays` receives the steps of all vehicles with their events."""
        self._flights, self._after = [LiveFlight(member) for member in members(setup)], -1.0
        self._services, self._displays = set(setup.services), tuple(displays)

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
        events_of_step = [new_events(step, self._after) for step in steps]
        self._after = float(steps[0].truth.times[-1])
        for step, events in zip(steps, events_of_step, strict=True):
            for time_ns, payload in event_messages(events):
                watch.publish(EVENTS.name.format(vehicle=step.vehicle), time_ns, payload)
        for show in self._displays:
            show(steps, events_of_step)

    def _take(self, pages: list[RecordBatch]) -> None:
        for flight in self._flights:
            flight.add(pages)
