"""Run configuration: a scene and every file that it names, resolved to numbers in SI units.

The process that starts a run resolves it once, sends it to every other process, and records it in the log.
"""

from typing import Any, NamedTuple

from lapwing.cosim.diagram.tick_schedule import InputPort, Port, execution_order
from lapwing.cosim.run_errors import LockStepError


class ServiceConfig(NamedTuple):
    """Parameters, inputs and ports of a lock-step service."""

    parameters: Any  # NamedTuples of numbers; their classes are the service's own
    inputs: tuple[InputPort, ...]  # ports of other services
    ports: tuple[Port, ...]  # output ports


class PerVehicle(NamedTuple):
    """Values of the vehicles of a fleet: their parameters of a service or of an auxiliary process."""

    vehicles: tuple[str, ...]  # names of the vehicles that have the service or process
    given: tuple[Any, ...]  # value of each vehicle


class RunConfig(NamedTuple):
    """Resolved run.

    In a fleet (`lapwing.cosim.diagram.multi_vehicle.merge_configs`) the parameters of a service are each
    vehicle's `ServiceConfig`, and the names of ports begin with the vehicle's: "left/truth".
    """

    scene: str  # name of the scene
    title: str
    seed: int
    last_tick: int  # latest end of the run
    rate: int  # [Hz] tick rate
    interval_ns: int  # [ns] length of a tick
    coupling: str  # "gauss_seidel" or "jacobi"
    vehicle: str  # name, the first part of its topics; "" for a fleet, whose topic names contain the vehicle
    services: dict[str, ServiceConfig]  # services of the lock step, by name
    auxiliary: dict[str, Any]  # configurations of the processes outside the lock step, by name
    resolved: dict[str, Any]  # tables of the scene, including the content of its files

    @property
    def interval(self) -> float:
        """Length of a tick [s]."""
        return 1.0 / self.rate

    @property
    def duration(self) -> float:
        """Latest end of the run [s]."""
        return self.last_tick / self.rate

    @property
    def vehicles(self) -> tuple[str, ...]:
        """Names of all vehicles."""
        if self.vehicle:
            return (self.vehicle,)
        return tuple(entry["vehicle"]["name"] for entry in self.resolved["vehicle"])

    @property
    def modules(self) -> dict[str, str]:
        """Texts of the user's modules, by name."""
        return self.resolved.get("modules", {})

    @property
    def ports(self) -> dict[str, Port]:
        """All ports of the run by name."""
        return {port.name: port for service in self.services.values() for port in service.ports}

    @property
    def producers(self) -> dict[str, str]:
        """Name of the service that publishes each port."""
        return {port.name: name for name, service in self.services.items() for port in service.ports}

    @property
    def order(self) -> list[str]:
        """The services in the order in which they step within a tick."""
        return execution_order(
            {name: service.inputs for name, service in self.services.items()},
            {name: [port.name for port in service.ports] for name, service in self.services.items()},
        )

    def port(self, name: str) -> Port:
        """Return the port of this name.

        Raises:
            LockStepError: no service has it.
        """
        try:
            return self.ports[name]
        except KeyError:
            raise LockStepError(f"no service of this scene publishes {name}") from None
