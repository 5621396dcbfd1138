"""Live flight of a vehicle: new samples as a separate flight, and their events."""

from collections.abc import Iterable

import numpy as np

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.topic_encoder import RecordBatch
from lapwing.messages.topic_columns import history
from lapwing.messages.topics import DEPTH_IMAGE, ESTIMATE, LASER_SCAN, POINT_CLOUD, STATUS, Topic, template_topic
from lapwing.services.common.event_kinds import KINDS
from lapwing.studies.flight_data import IN_SPACE, FlightData
from lapwing.studies.flight_events import Event
from lapwing.studies.flight_provenance import Origin
from lapwing.studies.topic_view import TopicView

TOPICS = (*IN_SPACE, STATUS, ESTIMATE, LASER_SCAN, POINT_CLOUD, DEPTH_IMAGE)


class LiveFlight:
    """Buffer of a run's messages, which the services may deliver in any order."""

    def __init__(self, setup: RunConfig):
        """Create from the run configuration of one vehicle before the run (see
        `lapwing.cosim.diagram.multi_vehicle.members` for a fleet)."""
        self._setup, self.vehicle = setup, setup.vehicle
        self._pending: dict[Topic, list[tuple[int, bytes]]] = {topic: [] for topic in TOPICS}  # time [ns], payload

    def add(self, pages: Iterable[RecordBatch]) -> None:
        """Add record batches of a service."""
        interval = self._setup.interval_ns
        for page in pages:
            topic = template_topic(page.topic)
            if topic in self._pending and page.topic.vehicle in ("", self._setup.vehicle):
                rows = zip(page.ticks, page.payloads, strict=True)
                self._pending[topic] += [(int(k) * interval, row.tobytes()) for k, row in rows]

    def step(self, until_ns: int) -> FlightData | None:
        """Return the new samples up to `until_ns` [ns], and before them the newest of the previous step.

        Return None without new ground truth.
        """
        views: dict[str, TopicView] = {}
        for topic, messages in self._pending.items():
            now = [message for message in messages if message[0] <= until_ns]
            if now:
                times, payloads = zip(*now, strict=True)
                columns = history(topic.message, payloads)
                views[topic.name.removeprefix("{vehicle}/")] = TopicView(np.array(times, np.int64), columns)
                del messages[: len(now) - 1]  # the newest is the first of the next step
        if "ground_truth" not in views or len(views["ground_truth"]) < 2:
            return None
        return FlightData(views, Origin.of_setup(self._setup))


def new_events(flight: FlightData, after: float) -> list[Event]:
    """Return the events of a step after the time `after` [s]."""
    return [event for event in flight.events if event.time > after and not KINDS[event.kind].afterwards]
