"""A part of the user's in Python that is asked at a rate of its own."""

from abc import ABC, abstractmethod

from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.services.autopilot.service_config import CustomCode


class PeriodicPart(ABC):
    """Asked at every tick of its period."""

    _code: CustomCode

    def bind(self, graph: BlockDiagram) -> None:
        """Read and write the rows of `graph`."""
        self._graph = graph

    def act(self, tick: int) -> int:
        """Ask the user's code at `tick`, if it is one of its own."""
        every = self._code.every
        if tick % every == 0:
            self._ask(tick)
        return tick - tick % every + every

    @abstractmethod
    def _ask(self, tick: int) -> None:
        """Hand the user's code what it is given at `tick`, and put down what it returns."""
