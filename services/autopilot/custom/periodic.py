"""Python block with user code that runs periodically."""

from abc import ABC, abstractmethod

from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.services.autopilot.service_config import CustomCode


class PeriodicBlock(ABC):
    """Block that calls user code at multiples of its period."""

    _code: CustomCode

    def bind(self, graph: BlockDiagram) -> None:
        """Store the diagram."""
        self._graph = graph

    def on_tick(self, tick: int) -> int:
        """Call the user code if it is due at `tick`. Return the tick of the next wake-up."""
        every = self._code.every
        if tick % every == 0:
            self._call_user_code(tick)
        return tick - tick % every + every

    @abstractmethod
    def _call_user_code(self, tick: int) -> None:
        """Call the user code with the inputs at `tick` and write its output."""
