"""One service of a scene by itself: a test puts what it takes and reads what it says."""

from typing import Any

from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.cosim.scene import Scene
from lapwing.messages.topics import Topic
from lapwing.services.process_table import create
from lapwing.services.scene_resolver import resolve

KEPT_TICKS = 16


class Alone:
    """A service on rows of its own; an input that nobody puts is zero."""

    def __init__(self, scene: Scene, name: str):
        self.setup = resolve(scene)
        self.graph = BlockDiagram(self.setup, [create(self.setup, name)], KEPT_TICKS)
        self._delays = {taken.port: taken.delay for taken in self.setup.services[name].inputs}

    def step(self, **given: Any) -> None:
        """Step the next tick; `given` are the values of the inputs that are due at it, by port."""
        tick = self.graph.tick
        for port, value in given.items():
            if tick >= self._delays[port]:
                self.graph.put(port, tick - self._delays[port], value)
        self.graph.advance(tick + 1)

    def value(self, port: str) -> Any:
        """The newest value of a port."""
        return self.graph.latest(port, self.graph.tick - 1)

    def message(self, topic: Topic) -> Any:
        """The message of a topic of the last tick, None where it had none."""
        tick = self.graph.tick - 1
        result = [page.payloads[-1].tobytes() for page in self.graph.record_batches(tick, tick + 1, [topic], keep=True)]
        return topic.message.decode(result[-1]) if result else None
