"""Block that exchanges samples with a firmware by a link, and writes its outputs to the port of `hold`."""

import ctypes
import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from lapwing.cosim.diagram.block_diagram import NEVER, BlockDiagram
from lapwing.cosim.diagram.compiled_block import Block, InputRing
from lapwing.cosim.diagram.tick_schedule import LATCHED, InputPort, Port
from lapwing.cosim.processes.shared_core import SharedCore
from lapwing.cosim.run_errors import LockStepError
from lapwing.kernels.cell import Cell
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
from lapwing.services.common.firmware.firmware_config import FirmwareConfig
from lapwing.services.common.firmware.hold import COMMAND, FirmwareCommand
from lapwing.services.common.firmware.link import FirmwareOutput, Waits
from lapwing.services.common.firmware.program import FirmwareError
from lapwing.services.common.text_table import TextTable

NO_MISSION = 1  # MISSION_STATE of MAVLink
NO_ITEM = 65535
_PYTHON = ctypes.CFUNCTYPE(*(ctypes.c_int64,) * 4)


class StatusText(NamedTuple):
    """Texts and mission numbers of the status message, which the port refers to by an index."""

    mode: str = ""
    failsafe: str = ""
    arming_blockers: tuple[str, ...] = ()
    mission_current: int = 0
    mission_count: int = 0
    mission_reached: int = NO_ITEM
    mission_state: int = NO_MISSION
    offboard_available: bool = False
    home: tuple[float, float, float] = (0.0, 0.0, 0.0)


class FirmwareBlock:
    """Python block that steps a link every `period` ticks, or that compiled code (`exchange`) replaces."""

    def __init__(
        self, name: str, config: FirmwareConfig, inputs: tuple[InputPort, ...], link: Callable[[FirmwareConfig], Any]
    ):
        """Create the block; `link` is the class of the link."""
        self.name, self.inputs, self._config = f"{name}.link", inputs, config
        self._link = link(config)
        self._zero = FirmwareCommand((0.0,) * len(config.order))
        self.outputs = (Port(COMMAND, self._zero, LATCHED),)
        self.status_texts = TextTable([StatusText()])
        self._last_output: FirmwareOutput | None = None
        self._waits: Waits = lambda text: None
        self._opened = False
        self._cpu = self._own_cpu = 0.0  # [s] before the first exchange
        self._shared: Shared | None = None
        self._error: BaseException | None = None
        self._core: SharedCore | None = None

    def bind(self, diagram: BlockDiagram) -> None:
        """Store the diagram; replace this block by compiled code if its link has it."""
        self._diagram = diagram
        if not hasattr(self._link, "exchange"):
            return
        self._python = _PYTHON(self._on_call)
        self._shared = shared_memory(self._config, diagram.ring(COMMAND), self._python)
        code = diagram.prepare(Block(self.name, self._link.exchange(self._shared, self._ring), Cell(0)))
        diagram.replace(diagram.block(self.name), code)

    def _ring(self, port: str) -> InputRing:
        diagram = self._diagram
        return InputRing(diagram.ports[port].example, diagram.ring(port), diagram.ports[port].period, 0)

    def open(self, waits: Waits, log: Path | None = None) -> None:
        """Connect to the firmware, before the first tick; its output and logs are kept beside `log`."""
        if self._shared:
            self._core = SharedCore()
        self._waits, self._opened, self._link.log = waits, True, log
        self._link.open(waits)
        self._cpu, self._own_cpu = self._link.cpu(), time.process_time()

    def close(self) -> None:
        """Close the connection."""
        if self._core:
            self._core.end()
        self._core = None
        if self._opened:
            self._link.close()
        self._opened = False

    @property
    def reports(self) -> dict[str, str]:
        """Entries of the log's metadata."""
        report, cpu = self._link.report, self._link.cpu()
        if self._shared:
            seconds = self._shared.seconds
            report.steps, report.waiting = int(self._shared.steps[0]), float(seconds[WAITING])
            report.wall = float(seconds[LAST_END] - seconds[FIRST_START])
        if self._opened and cpu > 0.0:
            report.cpu, report.own_cpu = cpu - self._cpu, time.process_time() - self._own_cpu
        report.unrepeatable = self._link.unrepeatable
        result = {"firmware": str(report), "repeatable": f"no: {report.unrepeatable}" if report.unrepeatable else "yes"}
        if report.notes:
            result["firmware_notes"] = "; ".join(report.notes)
        if output := self._link.output:
            result["firmware_output"] = f"{report.firmware}: output in {output}, its logs beside it"
        return result

    def on_tick(self, tick: int) -> int:
        """Exchange samples and outputs at `tick`. Return the tick of the next exchange."""
        if self._shared:  # compiled code has replaced this function
            return NEVER
        if not self._opened:
            self.open(self._waits)
        report, start = self._link.report, time.perf_counter()
        output = self._link.step(tick, lambda port: self._diagram.latest(port, tick))
        report.wall += time.perf_counter() - start
        report.steps += 1
        if output != self._last_output:
            self._diagram.put(COMMAND, tick, self._command(tick, output))
            self._last_output = output
        return tick + self._config.period

    def _command(self, tick: int, output: FirmwareOutput) -> FirmwareCommand:
        values = output.outputs
        if len(values) < len(self._config.order) or not all(map(math.isfinite, values)):
            at = f"at t = {tick * self._config.interval:.3f} s"
            raise FirmwareError(f"{self._config.firmware}: invalid motor outputs {values} {at}; check its motor setup")
        duty = tuple(min(max(values[i], 0.0), 1.0) for i in self._config.order) if output.armed else self._zero.duty
        text_id, attitude = self._text_id(output), output.attitude_reference
        state = output.armed, output.landed, output.finished
        return FirmwareCommand(duty, *state, text_id, attitude, output.follows)

    def _text_id(self, output: FirmwareOutput) -> int:
        return self.status_texts.number(StatusText(output.mode, output.text, output.arming_blockers))

    def failure(self, tick: int) -> Exception:
        """Return the error of `tick`. Raise an exception that interrupted the compiled exchange."""
        assert self._error is not None
        if isinstance(self._error, LockStepError):
            return self._error
        raise self._error

    def _on_call(self, tick: int, reason: int, number: int) -> int:
        """Handle a call from compiled code. Return 0 to continue, 1 to end the run."""
        try:
            if reason == OPEN:
                if not self._opened:
                    self.open(self._waits)
                if self._core and (program := self._link.program):  # not before: compilation uses several cores
                    self._core.begin(program.pid, program.cores)
                return 0
            if self._core and reason == POLL:
                self._core.update()
            output = self._link.handle_call(tick, reason, number, lambda port: self._diagram.latest(port, tick))
            if output is not None and self._shared:
                flags: Any = self._shared.flags
                flags[[ARMED, LANDED, FINISHED]] = output.armed, output.landed, output.finished
                flags[STATUS_TEXT] = self._text_id(output)
        except BaseException as error:  # exceptions do not pass through compiled code; `failure` raises it
            self._error = error
            return 1
        return 0
