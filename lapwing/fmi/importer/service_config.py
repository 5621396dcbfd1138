"""Configuration of the FMUs of a run."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from lapwing.cosim.config.run_config import ServiceConfig
from lapwing.cosim.diagram.compiled_block import Block
from lapwing.cosim.diagram.port_rows import RenamedPortRows
from lapwing.cosim.diagram.tick_schedule import InputPort
from lapwing.services.common.ports import EFFECT


class Element(NamedTuple):
    """Scalar variable of an FMU, or element of an array variable."""

    variable: str  # name, with the index of an element: "u[0]"
    reference: int
    type: str  # FMI type: Real, Float64, Int32, ...
    position: int  # index in the array, row-major; 0 for a scalar
    size: int  # number of elements of the variable; 1 for a scalar


class Connection(NamedTuple):
    """Connection of a column of a port and an element of a variable."""

    port: str
    column: int
    element: Element
    factor: float  # conversion from the source's unit to the target's


class StartValue(NamedTuple):
    """Start value of an element."""

    element: Element
    value: float | str  # text for the type String, and for Binary (hexadecimal)


class FmuConfig(NamedTuple):
    """Configuration of one FMU."""

    name: str  # name of the service
    path: str
    sha256: str
    content: str  # the FMU in base64, "" if it stays in its file
    version: int  # version of FMI, 2 or 3
    inputs: tuple[Connection, ...]
    outputs: tuple[Connection, ...]
    start: tuple[StartValue, ...]
    delay: int  # [ticks] delay of the inputs
    timeout: float  # [s] limit of a step, wall time


def fmus_of(services: Mapping[str, ServiceConfig]) -> list[FmuConfig]:
    """Return the FMUs among the services of a vehicle."""
    return [service.parameters for service in services.values() if isinstance(service.parameters, FmuConfig)]


def replaced_ports(fmus: Iterable[FmuConfig]) -> dict[str, str]:
    """Return the port that other services read in place of each port with columns of an FMU."""
    return {
        each.port: replaced_port(fmu.name, each.port) for fmu in fmus for each in fmu.outputs if not is_new(each.port)
    }


def own_port(name: str) -> str:
    """Return the name of the port with the outputs of an FMU that other FMUs read."""
    return f"fmu.{name}"


def is_new(port: str) -> bool:
    """Return True for a port that only exists for an FMU: its own port, or named inputs of an effect."""
    return port.startswith((own_port(""), EFFECT))


def replaced_port(name: str, port: str) -> str:
    """Return the name of a port whose columns an FMU computes in part."""
    return f"{port}.{name}"


def rewire(parts: Sequence[Any], replaced: Mapping[str, str]) -> list[Any]:
    """Return the blocks of a service with other inputs.

    Args:
        parts: compiled and Python blocks.
        replaced: port to read in place of each port of another service.
    """
    return [
        replace(part, inputs=_renamed(part.inputs, replaced))
        if isinstance(part, Block)
        else _PythonBlock(part, replaced)
        for part in parts
    ]


def _renamed(inputs: Sequence[InputPort], replaced: Mapping[str, str]) -> tuple[InputPort, ...]:
    return tuple(i._replace(port=replaced.get(i.port, i.port)) for i in inputs)


class _PythonBlock:
    """Python block with replaced ports; it reads ports by name from the diagram."""

    def __init__(self, block: Any, replaced: Mapping[str, str]):
        self._block, self._replaced = block, replaced
        self.inputs = _renamed(getattr(block, "inputs", ()), replaced)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._block, name)

    def bind(self, diagram: Any) -> None:
        self._block.bind(_Diagram(diagram, self._replaced))


class _Diagram(RenamedPortRows):
    """View of a block diagram, or of a vehicle's part, with ports of FMUs under the names of the replaced ports."""

    def __init__(self, diagram: Any, replaced: Mapping[str, str]):
        super().__init__(diagram, lambda port: replaced.get(port, port))
        self._diagram = diagram

    def __getattr__(self, name: str) -> Any:
        return getattr(self._diagram, name)
