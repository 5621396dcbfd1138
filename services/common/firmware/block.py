"""Python block that exchanges samples with a firmware, and writes its outputs to the port of `hold`."""

import math
import time
from collections.abc import Callable
from typing import Any, NamedTuple

from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.cosim.diagram.tick_schedule import LATCHED, InputPort, Port
from lapwing.services.common.firmware.hold import COMMAND, FirmwareCommand
from lapwing.services.common.firmware.link import FirmwareError, FirmwareOutput, Link, Waits
from lapwing.services.common.firmware.setup import FirmwareSetup
from lapwing.services.common.text_table import TextTable

NO_MISSION = 1  # MISSION_STATE of MAVLink
NO_ITEM = 65535


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


def status_text(output: FirmwareOutput) -> StatusText:
    """Return the texts of an output."""
    return StatusText(output.mode, output.text, output.arming_blockers)


class FirmwareBlock:
    """Python block that steps a link every `period` ticks."""

    def __init__(
        self, name: str, setup: FirmwareSetup, inputs: tuple[InputPort, ...], create: Callable[[FirmwareSetup], Link]
    ):
        """Create the block; `create` is the class of the link."""
        self.name, self.inputs = f"{name}.link", inputs
        self._setup = setup
        self._link: Any = create(setup)
        self._zero = FirmwareCommand((0.0,) * len(setup.order))
        self.outputs = (Port(COMMAND, self._zero, LATCHED),)
        self.status_texts = TextTable([StatusText()])
        self._last_output: FirmwareOutput | None = None
        self._waits: Waits = lambda text: None
        self._opened = False
        self._cpu = self._own_cpu = 0.0  # [s] before the first exchange

    def bind(self, graph: BlockDiagram) -> None:
        """Store the diagram."""
        self._graph = graph

    def open(self, waits: Waits) -> None:
        """Connect to the firmware, before the first tick."""
        self._waits, self._opened = waits, True
        self._link.open(waits)
        self._cpu, self._own_cpu = self._link.cpu(), time.process_time()

    def close(self) -> None:
        """Close the connection."""
        if self._opened:
            self._link.close()
        self._opened = False

    @property
    def reports(self) -> dict[str, str]:
        """Entries of the log's metadata."""
        report, cpu = self._link.report, self._link.cpu()
        if self._opened and cpu > 0.0:
            report.cpu, report.own_cpu = cpu - self._cpu, time.process_time() - self._own_cpu
        result = {"firmware": str(report)}
        if report.notes:
            result["firmware_notes"] = "; ".join(report.notes)
        if not report.reproducible:
            result["reproducible"] = f"no: {report.firmware} has no lock step"
        return result

    def on_tick(self, tick: int) -> int:
        """Exchange samples and outputs at `tick`. Return the tick of the next exchange."""
        if not self._opened:
            self.open(self._waits)
        graph, report = self._graph, self._link.report
        start = time.perf_counter()
        output = self._link.step(tick, lambda port: graph.latest(port, tick), self._waits)
        report.wall += time.perf_counter() - start
        report.steps += 1
        if output != self._last_output:
            graph.put(COMMAND, tick, self._command(tick, output))
            self._last_output = output
        return tick + self._setup.period

    def _command(self, tick: int, output: FirmwareOutput) -> FirmwareCommand:
        values = output.outputs
        if len(values) < len(self._setup.order) or not all(map(math.isfinite, values)):
            at = f"at t = {tick * self._setup.interval:.3f} s"
            raise FirmwareError(f"{self._setup.firmware}: invalid motor outputs {values} {at}; check its motor setup")
        duty = tuple(min(max(values[i], 0.0), 1.0) for i in self._setup.order) if output.armed else self._zero.duty
        text_id, attitude = self.status_texts.number(status_text(output)), output.attitude_reference
        return FirmwareCommand(duty, output.armed, output.landed, output.finished, text_id, attitude)
