"""Block that exchanges samples with a firmware in compiled code (`exchange`); its link handles all exceptions."""

import ctypes
from typing import Any

from lapwing.cosim.diagram.block_diagram import NEVER, BlockDiagram
from lapwing.cosim.diagram.compiled_block import Block, InputRing
from lapwing.cosim.processes.shared_core import SharedCore
from lapwing.cosim.run_errors import LockStepError
from lapwing.kernels.cell import Cell
from lapwing.services.common.firmware.block import FirmwareBlock, status_text
from lapwing.services.common.firmware.exchange import (
    ARMED,
    FINISHED,
    FIRST_START,
    LANDED,
    LAST_END,
    OPEN,
    POLL,
    STATUS_TEXT,
    WAITING,
    Shared,
    shared_memory,
)  # fmt: skip
from lapwing.services.common.firmware.hold import COMMAND
from lapwing.services.common.firmware.link import Waits

_PYTHON = ctypes.CFUNCTYPE(*(ctypes.c_int64,) * 4)


class ExchangeBlock(FirmwareBlock):
    """Block whose compiled code exchanges samples with the firmware; an `ExchangeLink` does the rest."""

    _shared: Shared | None = None
    _error: BaseException | None = None
    _core: SharedCore | None = None

    def bind(self, graph: BlockDiagram) -> None:
        """Replace this block by compiled code in the diagram."""
        self._graph, self._python = graph, _PYTHON(self._on_call)
        self._shared = shared_memory(self._setup, graph.ring(COMMAND), self._link.outputs, self._python)
        parameters = self._link.exchange(self._shared, self._ring)
        code = graph.prepare(Block(self.name, parameters, Cell(0)))
        graph.replace(graph.part(self.name), code)

    def open(self, waits: Waits) -> None:
        """Connect to the firmware, before the first tick."""
        self._core = SharedCore()
        super().open(waits)

    def close(self) -> None:
        """Close the connection."""
        if self._core:
            self._core.end()
        self._core = None
        super().close()

    def on_tick(self, tick: int) -> int:
        """Return NEVER: the compiled code has replaced this function."""
        return NEVER

    def failure(self, tick: int) -> Exception:
        """Return the error of `tick`. Raise an exception that interrupted the exchange."""
        assert self._error is not None
        if isinstance(self._error, LockStepError):
            return self._error
        raise self._error

    @property
    def reports(self) -> dict[str, str]:
        """Entries of the log's metadata."""
        if self._shared:
            report, seconds = self._link.report, self._shared.seconds
            report.steps, report.waiting = int(self._shared.steps[0]), float(seconds[WAITING])
            report.wall = float(seconds[LAST_END] - seconds[FIRST_START])
        return super().reports

    def _ring(self, port: str) -> InputRing:
        graph = self._graph
        return InputRing(graph.ports[port].like, graph.ring(port), graph.ports[port].period, 0)

    def _on_call(self, tick: int, reason: int, number: int) -> int:
        """Handle a call from compiled code. Return 0 to continue, 1 to end the run."""
        try:
            if reason == OPEN:
                if not self._opened:
                    self.open(self._waits)
                if self._core:  # not before, because the firmware and Lapwing's compilation use several cores
                    self._core.begin(self._link.pid)
                return 0
            if self._core and reason == POLL:
                self._core.update()
            output = self._link.handle_call(
                tick, reason, number, lambda port: self._graph.latest(port, tick), self._waits
            )
            if output is not None and self._shared:
                flags: Any = self._shared.flags
                flags[[ARMED, LANDED, FINISHED]] = output.armed, output.landed, output.finished
                flags[STATUS_TEXT] = self.status_texts.number(status_text(output))
        except BaseException as error:  # exceptions do not pass through compiled code; `failure` raises it
            self._error = error
            return 1
        return 0
