"""Python block that steps one FMU at every tick."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.cosim.diagram.tick_schedule import InputPort, Port
from lapwing.cosim.run_errors import LockStepError
from lapwing.services.fmu.host_process import HostError, HostProcess
from lapwing.services.fmu.service_config import Connection, FmuConfig


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
        self._host: HostProcess | None = None

    def bind(self, graph: BlockDiagram) -> None:
        """Store the diagram; the process of the FMU starts at the first tick."""
        self._graph, fmu = graph, self._fmu
        self._interval = graph.setup.interval
        self._read = [
            (port, max(1, graph.ports[port].period), _places(fmu.inputs, port))
            for port in dict.fromkeys(each.port for each in fmu.inputs)
        ]
        self._write = [
            (port, own, graph.ports[own].period, _places(fmu.outputs, port)) for port, own in self._ports.items()
        ]

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
            self._set_inputs(tick, self._host.inputs)
            self._host.step(begin, step)
        except HostError as error:
            raise LockStepError(f"{self._where}: {error} at t = {time:.3f} s") from None
        self._publish(tick, self._host.outputs.tolist(), time)
        return tick + 1

    def _set_inputs(self, tick: int, inputs: "memoryview[float]") -> None:
        """Write the newest samples of ports in the units of the FMU; the inputs are 0 before the first."""
        stamp = tick - self._fmu.delay
        if stamp < 0:
            return
        for port, period, places in self._read:
            row = self._graph.row(port, stamp - stamp % period).tolist()
            for index, column, factor in places:
                inputs[index] = row[column] * factor

    def _publish(self, tick: int, outputs: Sequence[float], time: float) -> None:
        """Write the ports that are due, with the outputs of the FMU in their columns."""
        if not all(map(math.isfinite, outputs)):
            for each, value in zip(self._fmu.outputs, outputs, strict=True):
                if not math.isfinite(value):
                    name = each.element.variable
                    raise LockStepError(f"{self._where}: output {name} is {value} at t = {time:.3f} s")
        for port, own, period, places in self._write:
            if tick % period == 0:
                row = self._graph.row(own, tick)
                if port != own:
                    row[:] = self._graph.row(port, tick)
                for index, column, factor in places:
                    row[column] = outputs[index] * factor


def _places(connections: tuple[Connection, ...], port: str) -> list[tuple[int, int, float]]:
    """Return (index among the connections, column, factor) of the connections of a port."""
    return [(k, each.column, each.factor) for k, each in enumerate(connections) if each.port == port]
