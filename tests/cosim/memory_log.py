"""Flights in this process with recorded messages in memory."""

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.cosim.diagram.topic_encoder import RecordBatch
from lapwing.cosim.executors.single_process import KEPT_TICKS, run_single
from lapwing.cosim.scene import Scene
from lapwing.flights.flight_data import FlightData
from lapwing.flights.flight_provenance import Origin
from lapwing.flights.topic_view import TopicView
from lapwing.messages.digest import Digest
from lapwing.messages.topic_columns import history
from lapwing.messages.topics import Topic
from lapwing.services.process_table import create_all
from lapwing.services.scene_resolver import resolve


class MemoryLog:
    """Recorded messages of a flight in memory, decoded on access, by topic name without the vehicle."""

    def __init__(self, config: RunConfig):
        self.config = config
        self._pages: dict[str, list[RecordBatch]] = {}
        self._topics: dict[str, Topic] = {}
        self._decoded: dict[str, list[Any]] = {}

    def write(self, pages: Iterable[RecordBatch], last: int) -> None:
        """Store the batches of some ticks; see `lapwing.cosim.log.log_sequencer.Recording.write`."""
        for page in pages:
            name = page.topic.name.removeprefix("{vehicle}/")
            self._topics[name] = page.topic
            self._pages.setdefault(name, []).append(page)
        self._decoded.clear()

    def finish(self) -> None:
        """Do nothing; see `lapwing.cosim.log.log_sequencer.Recording.finish`."""

    @property
    def topics(self) -> dict[str, Topic]:
        """Topics with messages, by name."""
        return dict(self._topics)

    def payloads(self, name: str) -> list[tuple[int, bytes]]:
        """Return (tick, payload) of each message of a topic, in order of ticks."""
        result = [
            (int(tick), payload.tobytes())
            for page in self._pages.get(name, ())
            for tick, payload in zip(page.ticks, page.payloads, strict=True)
        ]
        return sorted(result, key=lambda message: message[0])  # stable within a tick

    def messages(self, name: str) -> list[Any]:
        """Return the messages of a topic."""
        if name not in self._decoded:
            decode = self._topics[name].message.decode
            self._decoded[name] = [decode(payload) for _, payload in self.payloads(name)]
        return self._decoded[name]

    def times(self, name: str) -> np.ndarray:
        """Return the simulation times of a topic's messages [s], shape (n,)."""
        return np.array([tick for tick, _ in self.payloads(name)]) * self.config.interval_ns * 1e-9

    def column(self, name: str, value: Callable[[Any], Any]) -> np.ndarray:
        """Return `value(message)` for each message of a topic, shape (n,) or (n, k)."""
        return np.array([value(message) for message in self.messages(name)])

    @property
    def landed(self) -> bool:
        """True if the vehicle has landed."""
        views = {name: self.view(name) for name in ("ground_truth", "status")}
        return FlightData(views, Origin.of_config(self.config)).landed

    def view(self, name: str) -> TopicView:
        """Return a topic as columns."""
        ticks, payloads = zip(*self.payloads(name), strict=True)
        return TopicView(np.array(ticks) * self.config.interval_ns, history(self._topics[name].message, payloads))

    @property
    def digest(self) -> str:
        """Digest of the log."""
        digest = Digest()
        for name, topic in self._topics.items():
            for tick, payload in self.payloads(name):
                digest.update(topic.key(self.config.vehicle), tick * self.config.interval_ns, payload)
        return digest.hexdigest()


def fly(
    scene: Scene | RunConfig, operator: Callable[[int], Iterable[Any]] | None = None, last: int | None = None
) -> MemoryLog:
    """Fly a scene in this process, to the tick `last` or to its end; `operator` returns the commands until a tick."""
    config = scene if isinstance(scene, RunConfig) else resolve(scene)
    log = MemoryLog(config)
    run_single(BlockDiagram(config, create_all(config, operator), KEPT_TICKS), log, last=last)  # type: ignore[arg-type]
    return log
