"""What a protocol handler gets: one endpoint, and as much of the vehicle as it may see and ask for."""

from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from lapwing.services.mavlink.clock import Clock, Instant
from lapwing.services.mavlink.command_queue import CommandQueue, OnAcknowledgement
from lapwing.services.mavlink.component_metadata import files
from lapwing.services.mavlink.dialect import mavlink
from lapwing.services.mavlink.endpoint import Endpoint
from lapwing.services.mavlink.file_server import FileServer
from lapwing.services.mavlink.log_server import LogServer
from lapwing.services.mavlink.mission_store import MissionStore
from lapwing.services.mavlink.parameter_store import ParameterStore
from lapwing.services.mavlink.statustext import statustext
from lapwing.services.mavlink.stream_rates import Schedule
from lapwing.services.mavlink.vehicle_cache import VehicleCache

SAY_EVERY, MAX_SAID = 5.0, 64  # [s] between two times of the same text; texts that are remembered


class Session:
    """The conversation with one endpoint."""

    def __init__(
        self,
        endpoint: Endpoint,
        vehicle: VehicleCache,
        clock: Clock,
        commands: CommandQueue,
        parameters: ParameterStore,
        missions: MissionStore,
        counts: Counter[str],
        log: Path | None,
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
            log: of the run, None where there is none.
            trusts: whether commands of an endpoint are taken.
        """
        self.endpoint, self.vehicle, self.clock = endpoint, vehicle, clock
        self.parameters, self.missions = parameters, missions
        self.schedule = Schedule(vehicle)
        self.log = LogServer(log)
        self.files = FileServer(files(vehicle.description))
        self._commands, self._counts, self._trusts = commands, counts, trusts
        self._said: dict[str, Instant] = {}

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

    def say(self, text: str) -> None:
        """Tell the endpoint alone why something is refused; the same text at most every few seconds."""
        before = self._said.get(text)
        if before is None or self.clock.since(before) > SAY_EVERY:
            if len(self._said) >= MAX_SAID:
                self._said.clear()
            self._said[text] = self.clock.now
            for message in statustext(mavlink.MAV_SEVERITY_WARNING, text):
                self.endpoint.send(message)

    def count(self, reason: str) -> None:
        """Count a message that was refused."""
        self._counts[reason] += 1
