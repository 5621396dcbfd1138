"""What a protocol handler gets: one endpoint, and as much of the vehicle as it may see and ask for."""

from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

from services.mavlink.clock import Clock
from services.mavlink.command_queue import CommandQueue, OnAcknowledgement
from services.mavlink.component_metadata import files
from services.mavlink.endpoint import Endpoint
from services.mavlink.file_server import FileServer
from services.mavlink.mission_store import MissionStore
from services.mavlink.parameter_store import ParameterStore
from services.mavlink.schedule import Schedule
from services.mavlink.view import VehicleView


class Session:
    """The conversation with one endpoint."""

    def __init__(
        self,
        endpoint: Endpoint,
        vehicle: VehicleView,
        clock: Clock,
        commands: CommandQueue,
        parameters: ParameterStore,
        missions: MissionStore,
        counts: Counter[str],
        trusts: Callable[[Endpoint], bool],
    ):
        """A conversation that begins.

        Args:
            endpoint: with whom.
            vehicle: its newest state.
            clock: of the link.
            commands: to the autopilot.
            parameters: of the autopilot.
            missions: that the vehicle holds.
            counts: what was refused, by reason.
            trusts: whether commands of an endpoint are taken.
        """
        self.endpoint, self.vehicle, self.clock = endpoint, vehicle, clock
        self.parameters, self.missions = parameters, missions
        self.schedule = Schedule(vehicle)
        self.files = FileServer(files(vehicle.description))
        self._commands, self._counts, self._trusts = commands, counts, trusts

    @property
    def address(self) -> tuple[int, int]:
        """System and component id of the endpoint, which messages to it name as their target."""
        return self.endpoint.system, self.endpoint.component

    @property
    def trusted(self) -> bool:
        """Whether the endpoint's commands are taken; counts it where not."""
        return self._trusts(self.endpoint)

    def send(self, message: Any) -> None:
        """Send a message to the endpoint."""
        self.endpoint.send(message)

    def command(
        self, kind: str, values: Sequence[float] = (), on_acknowledgement: OnAcknowledgement | None = None
    ) -> None:
        """Queue a command to the autopilot; it must be trusted. `on_acknowledgement` gets every acknowledgement."""
        self._commands.put(kind, self.endpoint.name, on_acknowledgement, values)

    def count(self, reason: str) -> None:
        """Count a message that was refused."""
        self._counts[reason] += 1
