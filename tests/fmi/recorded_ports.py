"""Samples of all ports of a scene, from the diagram that `lapwing run --mode single-process` executes."""

import random
from collections.abc import Iterator
from typing import Any

import numpy as np

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.services import scene_resolver
from lapwing.services.process_table import create, create_all


def scene_config(name: str, **overrides: Any) -> RunConfig:
    return scene_resolver.resolve(scene_resolver.load(name, [f"{key}={value}" for key, value in overrides.items()]))


class RecordedPorts:
    """A run with every sample of every port kept."""

    def __init__(self, config: RunConfig):
        self.config = config
        ports = {port.name for service in config.services.values() for port in service.ports}
        self.diagram = BlockDiagram(config, create_all(config), 1, full_history=ports)
        self.diagram.advance(config.last_tick + 1)
        self.ticks = self.diagram.tick

    def sample(self, port: str, tick: int) -> np.ndarray | None:
        """Return the row of a port at a tick, None if none is due."""
        period = self.config.port(port).period
        if tick < 0 or tick % period:
            return None
        return np.ascontiguousarray(self.diagram.row(port, tick))

    def latest(self, port: str, tick: int) -> np.ndarray:
        """Return the newest row of a port that is not after a tick; zeros before the first."""
        period = self.config.port(port).period
        row = self.diagram.row(port, max(tick, 0) - max(tick, 0) % period)
        return np.ascontiguousarray(row) if tick >= 0 else np.zeros_like(row)

    def all_ticks(self) -> Iterator[int]:
        return iter(range(self.ticks))


class DrivenService(RecordedPorts):
    """A service of a scene under random inputs, where the autopilot is a program that does not run here."""

    def __init__(self, config: RunConfig, name: str):
        self.config, rng = config, random.Random(1)
        service = create(config, name)
        own = {port.name for block in service.blocks for port in block.outputs}
        read = {i.port for block in service.blocks for i in block.inputs} - own
        self.diagram = BlockDiagram(config, [service], 1, full_history=own | read)
        for tick in range(config.last_tick + 1):
            for port in sorted(read):
                if tick % self.diagram.ports[port].period == 0:
                    self.diagram.put(port, tick, _random(self.diagram.ports[port].example, rng))
            self.diagram.advance(tick + 1)
        self.ticks = self.diagram.tick


def _random(example: Any, rng: random.Random) -> Any:
    """Return a tree of the types of `example`: volts, and booleans that are true."""
    if isinstance(example, tuple):
        return tuple(_random(item, rng) for item in example)
    return type(example)(rng.uniform(0.0, 8.0)) if not isinstance(example, bool) else True
