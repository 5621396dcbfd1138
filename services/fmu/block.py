"""Python block that steps one FMU at every tick."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.cosim.diagram.tick_schedule import InputPort, Port
from lapwing.cosim.run_errors import LockStepError
from lapwing.services.fmu.host_process import HostError, HostProcess
from lapwing.services.fmu.service_config import FmuConfig, own_port


class FmuBlock:
    """Passes inputs to an FMU, steps it to the tick, and overwrites columns of ports with its outputs."""

    def __init__(self, fmu: FmuConfig, outputs: Mapping[str, Port]):
        """Create the block.

        Args:
            fmu: configuration.
            outputs: port that it publishes, by the name of the port that is replaced, or its own port by its own name.
        """
        self.name = f"fmu.{fmu.name}"
        self.outputs = tuple(outputs.values())
        read = {each.port: fmu.delay for each in fmu.inputs}
        self.inputs = (
            *(InputPort(port, delay) for port, delay in read.items()),
            *(InputPort(port) for port, own in outputs.items() if port != own.name),
        )
        self._fmu, self._ports = fmu, {port: own.name for port, own in outputs.items()}
        self._where = f"services.{fmu.name}: {Path(fmu.path).name}"
        self._width = sum(each.port == own_port(fmu.name) for each in fmu.outputs)
        self._host: HostProcess | None = None

    def bind(self, graph: BlockDiagram) -> None:
        """Store the diagram; the process of the FMU starts at the first tick."""
        self._graph = graph
        self._interval = graph.setup.interval
        self._read = {each.port: max(1, graph.ports[each.port].period) for each in self._fmu.inputs}

    def on_tick(self, tick: int) -> int:
        """Step the FMU to `tick`.

        Raises:
            LockStepError: the FMU crashed, hung, reported an error, or has a non-finite output.
        """
        time = tick * self._interval
        try:
            if self._host is None:
                self._host = HostProcess(self._fmu)
            begin, step = ((tick - 1) * self._interval, self._interval) if tick else (0.0, -1.0)
            result = self._host.step(begin, step, self._inputs(tick))
        except HostError as error:
            raise LockStepError(f"{self._where}: {error} at t = {time:.3f} s") from None
        self._publish(tick, result, time)
        return tick + 1

    def _inputs(self, tick: int) -> list[float]:
        """Return columns of the newest samples of ports in the units of the FMU; zeros before the first."""
        graph, stamp = self._graph, tick - self._fmu.delay
        if stamp < 0:
            return [0.0] * len(self._fmu.inputs)
        rows = {port: graph.row(port, stamp - stamp % period) for port, period in self._read.items()}
        return [float(rows[each.port][each.column]) * each.factor for each in self._fmu.inputs]

    def _publish(self, tick: int, result: Sequence[float], time: float) -> None:
        """Write the ports that are due, with the outputs of the FMU in their columns."""
        graph, rows = self._graph, {}
        for port, own in self._ports.items():
            if port == own:
                rows[port] = np.zeros(self._width)
            elif tick % graph.ports[port].period == 0:
                rows[port] = np.array(graph.row(port, tick))
        for each, value in zip(self._fmu.outputs, result, strict=True):
            if not math.isfinite(value):
                raise LockStepError(f"{self._where}: output {each.element.variable} is {value} at t = {time:.3f} s")
            if each.port in rows:
                rows[each.port][each.column] = value * each.factor
        for port, row in rows.items():
            graph.put_row(self._ports[port], tick, row)
