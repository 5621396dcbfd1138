"""Adapter on the real autopilot in one process: the vehicle flies as fast as possible with a connected station."""

from adapter_harness import Bench

from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.cosim.executors.single_process import KEPT_TICKS
from lapwing.messages.topics import COMMAND_ACKS, ESTIMATE, STATUS
from lapwing.services.mavlink.adapter import Adapter
from lapwing.services.process_table import create_all
from lapwing.services.scene_resolver import load, resolve

OPERATED = ["autopilot.accept_commands=true", "autopilot.follow_trajectory=false", "run.duration=1e4"]


class AutopilotBench(Bench):
    """Vehicle of a scene, its adapter, and connected stations."""

    period = 0.04

    def __init__(self, scene="hover", *overrides):
        config = resolve(load(scene, [*OPERATED, *overrides]))
        self.queue, self.stations = [], []
        self._interval_ns, self._ticks = config.interval_ns, round(self.period * config.rate)
        self.diagram = BlockDiagram(config, create_all(config, self._take_commands), KEPT_TICKS)
        self.adapter = Adapter(config.auxiliary["mavlink"], self.queue.append)

    def _take_commands(self, tick):
        commands = list(self.queue)
        self.queue.clear()
        return commands

    def station_of(self, kind):
        """Return a connected station."""
        station = kind(self)
        self.stations.append(station)
        return station

    @property
    def seconds(self):
        return self.diagram.tick * self._interval_ns * 1e-9

    def step(self, count=1):
        for _ in range(count):
            first = self.diagram.tick
            self.diagram.advance(first + self._ticks)
            pages = self.diagram.record_batches(first, first + self._ticks)
            for page in sorted(pages, key=lambda page: page.topic is ESTIMATE):  # the estimate advances the time
                newest = slice(None) if page.topic in (STATUS, COMMAND_ACKS) else slice(-1, None)
                for tick, payload in zip(page.ticks[newest], page.payloads[newest], strict=True):
                    self.adapter.handle(page.topic, int(tick) * self._interval_ns, payload.tobytes(), self.seconds)
            for station in self.stations:
                station.step()
