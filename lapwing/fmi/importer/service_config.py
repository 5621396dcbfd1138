"""Configuration of the FMUs of a run."""

from collections.abc import Iterable, Mapping
from typing import NamedTuple

from lapwing.cosim.config.run_config import ServiceConfig
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
