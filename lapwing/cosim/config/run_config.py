"""A scene and every file that it names, resolved once: numbers in SI, nothing left to open or to parse.

The set-up is made by whoever starts a run, handed to every process as it is, recorded whole in the log, and hashed.
"""

from typing import Any, NamedTuple

from lapwing.cosim.diagram.tick_schedule import InputPort, Port, execution_order
from lapwing.cosim.run_errors import LockStepError


class ServiceConfig(NamedTuple):
    """What a service of the lock step is given, takes and gives."""

    parameters: Any  # NamedTuples of numbers; their classes are the service's own
    inputs: tuple[InputPort, ...]  # ports of other services
    ports: tuple[Port, ...]  # that it gives


class PerVehicle(NamedTuple):
    """What the vehicles of a fleet are each given: their parameters of a service, or of a process beside."""

    vehicles: tuple[str, ...]  # names; those that have it
    given: tuple[Any, ...]


class RunConfig(NamedTuple):
    """One run, resolved.

    In that of a fleet (`lapwing.cosim.diagram.multi_vehicle.joined`) the parameters of a service are `PerVehicle`
    vehicle's `ServiceConfig`, and a
    port has the vehicle's name in front: "left/truth".
    """

    scene: str  # name
    title: str
    seed: int
    last_tick: int  # the run ends here at the latest
    rate: int  # [Hz] ticks
    interval_ns: int  # length of a tick
    coupling: str  # "gauss_seidel" or "jacobi"
    vehicle: str  # name, first part of its topics' names; "" of a fleet, whose topics have it already
    services: dict[str, ServiceConfig]  # those of the lock step, by name
    beside: dict[str, Any]  # what processes outside of the lock step are given, by name
    resolved: dict[str, Any]  # the scene's tables with all that its files say

    @property
    def interval(self) -> float:
        """Length of a tick [s]."""
        return 1.0 / self.rate

    @property
    def duration(self) -> float:
        """Where the run ends at the latest [s]."""
        return self.last_tick / self.rate

    @property
    def vehicles(self) -> tuple[str, ...]:
        """The names of all vehicles."""
        if self.vehicle:
            return (self.vehicle,)
        return tuple(entry["vehicle"]["name"] for entry in self.resolved["vehicle"])

    @property
    def modules(self) -> dict[str, str]:
        """Texts of the user's own modules, by name."""
        return self.resolved.get("modules", {})

    @property
    def ports(self) -> dict[str, Port]:
        """Every port of the run by name."""
        return {port.name: port for service in self.services.values() for port in service.ports}

    @property
    def producers(self) -> dict[str, str]:
        """The service that gives each port."""
        return {port.name: name for name, service in self.services.items() for port in service.ports}

    @property
    def order(self) -> list[str]:
        """The services in the order in which they step within a tick."""
        return execution_order(
            {name: service.inputs for name, service in self.services.items()},
            {name: [port.name for port in service.ports] for name, service in self.services.items()},
        )

    def port(self, name: str) -> Port:
        """The port of this name.

        Raises:
            LockStepError: nobody gives it.
        """
        try:
            return self.ports[name]
        except KeyError:
            raise LockStepError(f"no service of this scene gives {name}") from None
