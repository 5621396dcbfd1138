"""Single service of a scene; a test sets its inputs and reads its outputs."""

from typing import Any

from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.cosim.scene import Scene
from lapwing.messages.topics import Topic
from lapwing.services.process_table import create
from lapwing.services.scene_resolver import resolve

KEPT_TICKS = 16


class Alone:
    """Service in a separate diagram; inputs without a value are zero."""

    def __init__(self, scene: Scene, name: str):
        self.config = resolve(scene)
        self.diagram = BlockDiagram(self.config, [create(self.config, name)], KEPT_TICKS)
        self._delays = {each.port: each.delay for each in self.config.services[name].inputs}

    def step(self, **given: Any) -> None:
        """Step the next tick; `given` has the values of its due inputs, by port."""
        tick = self.diagram.tick
        for port, value in given.items():
            if tick >= self._delays[port]:
                self.diagram.put(port, tick - self._delays[port], value)
        self.diagram.advance(tick + 1)

    def value(self, port: str) -> Any:
        """Return the newest value of a port."""
        return self.diagram.latest(port, self.diagram.tick - 1)

    def message(self, topic: Topic) -> Any:
        """Return the message of a topic in the last tick, or None."""
        tick = self.diagram.tick - 1
        result = [
            page.payloads[-1].tobytes() for page in self.diagram.record_batches(tick, tick + 1, [topic], keep=True)
        ]
        return topic.message.decode(result[-1]) if result else None
