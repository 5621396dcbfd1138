"""Configuration of the FMUs of a run."""

from collections.abc import Iterable, Mapping
from typing import NamedTuple

from lapwing.cosim.config.run_config import ServiceConfig
from lapwing.services.common.ports import EFFECT

CO_SIMULATION, MODEL_EXCHANGE, SCHEDULED_EXECUTION = "co_simulation", "model_exchange", "scheduled_execution"
CLOCK = "Clock"  # type of FMI; a number that is not 0 is a tick


class Element(NamedTuple):
    """A scalar variable of an FMU, or an element of an array variable."""

    variable: str  # name, with the index of an element: "u[0]"
    reference: int
    type: str  # as FMI names it: Real, Float64, Int32, ...
    position: int  # in the array, row-major; 0 of a scalar
    size: int  # elements of the variable; 1 of a scalar


class Connection(NamedTuple):
    """A column of a port and an element of a variable."""

    port: str
    column: int
    element: Element
    factor: float  # from the source's unit to the target's


class StartValue(NamedTuple):
    """A start value."""

    element: Element
    value: float | str  # a text for the types String, and Binary in hexadecimal


class FmuConfig(NamedTuple):
    """One FMU."""

    name: str  # of the service
    path: str
    sha256: str
    content: str  # the FMU in base64, "" if it stays in its file
    version: int  # of FMI, 2 or 3
    interface: str  # CO_SIMULATION, MODEL_EXCHANGE or SCHEDULED_EXECUTION
    integrator: str  # method of model exchange
    accuracy: float  # of model exchange, relative to 1 + size of a state
    inputs: tuple[Connection, ...]
    outputs: tuple[Connection, ...]
    start: tuple[StartValue, ...]
    delay: int  # [ticks] of the inputs
    timeout: float  # [s]


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
    """Return True for a port that exists only because an FMU writes it: its own one, or named inputs of an effect."""
    return port.startswith((own_port(""), EFFECT))


def replaced_port(name: str, port: str) -> str:
    """Return the name of a port whose columns an FMU computes in part."""
    return f"{port}.{name}"
