"""Service of the lock step that steps an FMU in a process of its own at every tick.

The block runs in compiled code (`exchange`) if the FMU answers immediately.
"""

import ctypes
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.block_diagram import NEVER, BlockDiagram, Service
from lapwing.cosim.diagram.compiled_block import Block
from lapwing.cosim.diagram.tick_schedule import InputPort, Port
from lapwing.cosim.run_errors import LockStepError
from lapwing.fmi.importer.exchange import FmuExchange
from lapwing.fmi.importer.host_process import HostError, HostProcess
from lapwing.fmi.importer.pipe_polling import LOOKS
from lapwing.fmi.importer.service_config import Connection, FmuConfig, replaced_port
from lapwing.kernels import math
from lapwing.kernels.cell import Cell
from lapwing.kernels.native_calls import address_of, poll_entry
from lapwing.kernels.row_packing import pack_row
from lapwing.services.common import foreign_code
from lapwing.services.common.encoders import reading_encoder

_WAIT = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64, ctypes.c_int64)


class FmuBlock:
    """Passes inputs to an FMU, steps it to the tick, and overwrites columns of ports with its outputs."""

    def __init__(self, fmu: FmuConfig, outputs: Mapping[str, Port]):
        """Create the block.

        Args:
            fmu: configuration of the FMU.
            outputs: published port by the name of the port that it replaces; an own port by its own name.
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
        self._request, self._reply = np.zeros(2 + len(fmu.inputs)), np.zeros(1 + len(fmu.outputs))
        self._channels, self._poll_entry = np.full(2, -1), poll_entry(-1)
        self._host: HostProcess | None = None
        self._error: BaseException | None = None
        self._wait = _WAIT(self._finish)
        self._report_wait: Callable[[str], None] = lambda text: None

    def bind(self, diagram: BlockDiagram) -> None:
        """Let the diagram run compiled code for this block; the process of the FMU starts at the first tick."""
        self._interval = diagram.config.interval
        for port in self.outputs:  # columns that the FMU does not compute
            diagram.ring(port.name)[:] = pack_row(port.example)
        code = diagram.prepare(Block(self.name, self._exchange(diagram), Cell(0)))
        diagram.replace(diagram.block(self.name), code)

    def open(self, report_wait: Callable[[str], None], log: Path | None = None) -> None:
        """Store the function that reports waits for the FMU, which may exceed the permitted silence of a service."""
        self._report_wait = report_wait

    def close(self) -> None:
        """End the process of the FMU."""
        self._host = None

    @property
    def reports(self) -> dict[str, str]:
        """Return no entries of the log's metadata."""
        return {}

    def on_tick(self, tick: int) -> int:
        """Return NEVER: the compiled code has replaced this function."""
        return NEVER

    def failure(self, tick: int) -> Exception:
        """Return the error of `tick`. Raise an exception that interrupted the wait for the FMU."""
        where = f"t = {tick * self._interval:.3f} s"
        if isinstance(self._error, HostError):
            return LockStepError(f"{self._where}: {self._error} at {where}")
        if self._error is not None:
            raise self._error
        name, value = next(
            (each.element.variable, value)
            for each, value in zip(self._fmu.outputs, self._reply[1:], strict=True)
            if not math.isfinite(value)
        )
        return LockStepError(f"{self._where}: output {name} is {value} at {where}")

    def _finish(self, sent: int, received: int) -> int:
        """Finish an exchange that compiled code has started. Return 0 on success."""
        try:
            if self._host is None:
                self._host = HostProcess(self._fmu, self._request, self._reply, self._report_wait)
                self._channels[:] = self._host.requests, self._host.replies
                self._poll_entry[:] = poll_entry(self._host.replies)
            self._host.finish(sent, received)
        except BaseException as error:  # exceptions do not pass through compiled code; `failure` raises it
            self._error = error
            return 1
        return 0

    def _exchange(self, diagram: BlockDiagram) -> FmuExchange:
        fmu, libc = self._fmu, ctypes.CDLL(None)
        sources = {each.port: () for each in fmu.inputs}
        targets = {
            port: (0, 0) if own == port else (diagram.ring(port).ctypes.data, len(diagram.ring(port)) - 1)
            for port, own in self._ports.items()
        }
        write, poll, read, wait = map(address_of, (libc.write, libc.poll, libc.read, self._wait))
        source_tables = _tables(diagram, fmu.inputs, sources, {})
        target_tables = _tables(diagram, fmu.outputs, targets, self._ports)
        return FmuExchange(
            diagram.config.interval, fmu.delay, self._request, self._reply, self._request.ctypes.data,
            self._reply.ctypes.data, self._channels, self._poll_entry.ctypes.data, LOOKS, write, poll,
            read, wait, *source_tables, *target_tables,
        )  # fmt: skip


def _tables(
    diagram: BlockDiagram,
    connections: Sequence[Connection],
    more: Mapping[str, tuple[int, ...]],
    own: Mapping[str, str],
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the tables of ports, places and factors of an exchange.

    Args:
        diagram: the diagram.
        connections: inputs or outputs.
        more: further columns of each port.
        own: port of the FMU by the port that it replaces.
    """
    ports: list[tuple[int, ...]] = []
    places: list[tuple[int, int]] = []
    factors: list[float] = []
    for port, columns in more.items():
        first = len(places)
        for index, each in enumerate(connections):
            if each.port == port:
                places.append((index, 8 * each.column))
                factors.append(each.factor)
        name = own.get(port, port)
        ring = diagram.ring(name)
        place = ring.ctypes.data, ring.strides[0], len(ring) - 1, diagram.ports[name].period
        ports.append((*place, first, len(places), *columns))
    width = 6 + len(next(iter(more.values()), ()))
    return (
        np.array(ports, np.int64).reshape(-1, width),
        np.array(places, np.int64).reshape(-1, 2),
        np.array(factors, np.float64),
    )


def create(config: RunConfig, name: str) -> Service:
    """Return the service of an FMU.

    Args:
        config: run configuration.
        name: name of the service, such as "motor_fmu" for `[services.motor]`.

    Raises:
        ValueError: foreign code is not allowed (`--allow-code`).
    """
    foreign_code.check(config)
    fmu: FmuConfig = config.services[name].parameters
    own = {port.name: port for port in config.services[name].ports}
    ports = dict.fromkeys(each.port for each in fmu.outputs)
    block = FmuBlock(fmu, {port: own.get(port) or own[replaced_port(fmu.name, port)] for port in ports})
    return Service(name, [block], [reading_encoder(config.vehicle, port) for port in own.values()])
