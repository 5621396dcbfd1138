"""Conversation with one endpoint, the argument of every protocol handler."""

from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.mavlink.clock import Clock, Instant
from lapwing.services.mavlink.command_queue import CommandQueue, OnAcknowledgement
from lapwing.services.mavlink.component_metadata import files
from lapwing.services.mavlink.endpoint import Endpoint
from lapwing.services.mavlink.file_server import FileServer
from lapwing.services.mavlink.log_server import LogServer
from lapwing.services.mavlink.mission_store import MissionStore
from lapwing.services.mavlink.parameter_store import ParameterStore
from lapwing.services.mavlink.setpoint_keeper import SetpointKeeper
from lapwing.services.mavlink.statustext import statustext
from lapwing.services.mavlink.stream_rates import Schedule
from lapwing.services.mavlink.vehicle_cache import VehicleCache

TEXT_PERIOD, MAX_TEXTS = 5.0, 64  # [s] between two equal texts; number of texts that are stored


class LinkState(NamedTuple):
    """State that the conversations with all endpoints share."""

    vehicle: VehicleCache
    clock: Clock
    commands: CommandQueue
    parameters: ParameterStore
    missions: MissionStore
    setpoints: SetpointKeeper
    sticks: SetpointKeeper
    counts: Counter[str]  # rejected messages by reason
    log: Path | None  # log of the run
    trusts: Callable[[Endpoint], bool]  # returns True if commands of an endpoint are accepted
    restart: Callable[[], None]  # restarts the link after the present message


class Session:
    """Conversation with one endpoint."""

    def __init__(self, endpoint: Endpoint, link: LinkState):
        """Start a conversation."""
        self.endpoint, self._link = endpoint, link
        self.vehicle, self.clock, self.restart = link.vehicle, link.clock, link.restart
        self.parameters, self.missions = link.parameters, link.missions
        self.schedule = Schedule(link.vehicle)
        self.log = LogServer(link.log)
        self.files = FileServer(files(link.vehicle.description))
        self._sent_texts: dict[str, Instant] = {}

    @property
    def address(self) -> tuple[int, int]:
        """System and component id of the endpoint, the target of messages to it."""
        return self.endpoint.system, self.endpoint.component

    @property
    def trusted(self) -> bool:
        """True if the endpoint's commands are accepted; counts a rejection."""
        return self._link.trusts(self.endpoint)

    def send(self, message: Any) -> None:
        """Send a message to the endpoint."""
        self.endpoint.send(message)

    def command(
        self, kind: str, values: Sequence[float] = (), on_acknowledgement: OnAcknowledgement | None = None
    ) -> None:
        """Queue a command to the autopilot; it must be trusted. `on_acknowledgement` receives every acknowledgement."""
        self._link.commands.put(kind, self.endpoint.name, on_acknowledgement, values)

    def offboard(self, kind: str, values: Sequence[float]) -> None:
        """Queue an offboard setpoint; it must be trusted."""
        self.command(kind, values)
        self._link.setpoints.hold(kind, self.endpoint.name, values)

    def sticks(self, values: Sequence[float]) -> None:
        """Queue stick positions; they must be trusted."""
        self.command("manual", values)
        self._link.sticks.hold("manual", self.endpoint.name, values)

    def send_text(self, text: str) -> None:
        """Send the reason of a rejection to this endpoint only, the same text at most every `TEXT_PERIOD` seconds."""
        last_sent = self._sent_texts.get(text)
        if last_sent is None or self.clock.since(last_sent) > TEXT_PERIOD:
            if len(self._sent_texts) >= MAX_TEXTS:
                self._sent_texts.clear()
            self._sent_texts[text] = self.clock.now
            for message in statustext(mavlink.MAV_SEVERITY_WARNING, text):
                self.endpoint.send(message)

    def count(self, reason: str) -> None:
        """Count a rejected message."""
        self._link.counts[reason] += 1
