"""MAVLink adapter without sockets: converts between bytes of endpoints and messages and commands of the vehicle."""

import math
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

from lapwing.messages import CommandAcks, OperatorInput, header
from lapwing.messages.topics import COMMAND_ACKS, ESTIMATE, OPERATOR, STATUS, Topic
from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.mavlink.announcements import Announcements
from lapwing.services.mavlink.channel import Channel
from lapwing.services.mavlink.clock import Clock, Instant
from lapwing.services.mavlink.command_queue import CommandQueue
from lapwing.services.mavlink.endpoint import Endpoint
from lapwing.services.mavlink.mission_store import MissionStore
from lapwing.services.mavlink.parameter_store import ParameterStore
from lapwing.services.mavlink.protocols import handlers
from lapwing.services.mavlink.px4_facts import COMPONENT_ID, SYSTEM_ID
from lapwing.services.mavlink.session import LinkState, Session
from lapwing.services.mavlink.setpoint_keeper import SetpointKeeper
from lapwing.services.mavlink.signing import Signature, TimeStampStore
from lapwing.services.mavlink.telemetry.system_status import heartbeat
from lapwing.services.mavlink.vehicle_cache import VehicleCache
from lapwing.services.mavlink.vehicle_description import VehicleDescription

SECOND = 1_000_000_000
LINK_TIMEOUT = 3.5  # [s] after its last heartbeat, a ground station counts as lost
HEARTBEAT_INTERVAL = 1.0  # [s]
ALL = 0  # target system or component of a message for all receivers
EMPTY_SIZES = {  # [bytes] of messages without content
    COMMAND_ACKS: len(CommandAcks(header(0, "world")).encode()),
    OPERATOR: len(OperatorInput(header(0, "world")).encode()),
}


class Adapter:
    """One vehicle and the endpoints that are connected to it."""

    def __init__(
        self,
        description: VehicleDescription,
        operate: Callable[[Any], None] | None,
        key: bytes | None = None,
        insecure: bool = False,
        log: Path | None = None,
        time_stamps: Path | None = None,
    ):
        """Create an adapter without endpoints.

        Args:
            description: vehicle that the adapter represents.
            operate: passes an OperatorCommand to the autopilot; None for a recorded flight.
            key: signing key; unsigned frames are then rejected. None: no signing.
            insecure: accept commands from other machines without a key.
            log: log of the run, which endpoints may download.
            time_stamps: file of the time stamps of signed frames; None keeps them in memory.

        Raises:
            ValueError: the file of time stamps cannot be written.
        """
        self.vehicle = VehicleCache(description)
        self.clock = Clock()
        self.counts: Counter[str] = Counter()
        self.commands = CommandQueue(self.clock, operate)
        firmware = self.vehicle.firmware
        self.missions = MissionStore(
            self.clock, self.commands, lambda: self.vehicle.datum, firmware.HOME_FIRST, self.counts
        )
        self.vehicle.mission = lambda: self.missions.items[mavlink.MAV_MISSION_TYPE_MISSION]
        self.parameters = ParameterStore(description, firmware, self.commands, self.broadcast, self.counts)
        self.vehicle.parameter = self.parameters.value
        self.setpoints = SetpointKeeper(self.clock, self.commands, lambda: self.parameters.value("COM_OF_LOSS_T"))
        self.sticks = SetpointKeeper(self.clock, self.commands, lambda: self.parameters.value("COM_RC_LOSS_T"))
        self.sessions: dict[Endpoint, Session] = {}
        store = TimeStampStore(time_stamps, key, description.system_id) if key and time_stamps else None
        self.signature = Signature(key, store) if key else None
        self._insecure = insecure
        self._link = LinkState(
            self.vehicle,
            self.clock,
            self.commands,
            self.parameters,
            self.missions,
            self.setpoints,
            self.sticks,
            self.counts,
            log,
            self.trusts,
            self._request_restart,
        )
        self._announcements = Announcements(self.vehicle, self.broadcast)
        self._restart_requested = False
        self._next_link = 0
        self._next_heartbeat = 0.0  # [s] wall time, before the first message of the vehicle

    def connect(self, local: bool, datagrams: bool, put: Callable[[bytes], None], strict: bool = False) -> Endpoint:
        """Return a new endpoint.

        Args:
            local: True if it is on this machine.
            datagrams: True if no frame continues in the next piece of its bytes.
            put: sends bytes to it.
            strict: True to ignore it if its first bytes are not MAVLink.
        """
        channel = Channel(self.vehicle.address, self.signature, datagrams, self.counts, strict)
        endpoint = Endpoint(channel, local, put)
        self.sessions[endpoint] = Session(endpoint, self._link)
        return endpoint

    def disconnect(self, endpoint: Endpoint) -> None:
        """Remove an endpoint."""
        del self.sessions[endpoint]
        self.parameters.forget(endpoint)
        self.missions.forget(endpoint)

    def trusts(self, endpoint: Endpoint) -> bool:
        """Return True if commands of an endpoint are accepted; count the command otherwise.

        An endpoint is accepted after its first heartbeat, if its frames are signed or it is on this machine.
        """
        if not (self.signature or endpoint.local or self._insecure):
            self.counts["command from another machine"] += 1
        elif endpoint.last_heartbeat is None:
            self.counts["command before a heartbeat"] += 1
        else:
            return True
        return False

    def receive(self, endpoint: Endpoint, data: bytes) -> int:
        """Handle bytes from an endpoint. Return the number of valid messages."""
        valid = 0
        for m in endpoint.decode(data):
            valid += 1
            self.counts["received"] += 1
            self._dispatch(endpoint, m)
        return valid

    def _dispatch(self, endpoint: Endpoint, m: Any) -> None:
        address = self.vehicle.address
        source = m.get_srcSystem(), m.get_srcComponent()
        target = getattr(m, "target_system", getattr(m, "target", ALL))
        component = getattr(m, "target_component", ALL)
        if source == address:
            self.counts["with the address of the vehicle"] += 1
        elif target not in (ALL, address[0]) or component not in (ALL, address[1]):
            self.counts["for another vehicle"] += 1
        elif (handler := handlers().get(m.get_msgId())) is None:
            self.counts["unhandled message"] += 1
        else:
            endpoint.system, endpoint.component = source
            handler(self.sessions[endpoint], m)

    def handle(self, topic: Topic, time_ns: int, payload: bytes, wall: float) -> None:
        """Handle a message of the vehicle. An estimate advances the time and sends the due messages.

        Args:
            topic: topic of the message.
            time_ns: simulation time [ns].
            payload: encoded message.
            wall: monotonic wall time [s].
        """
        if len(payload) <= EMPTY_SIZES.get(topic, 0):
            return
        if topic is OPERATOR:
            own_endpoints = {endpoint.name for endpoint in self.sessions} if self.commands.connected else ()
            accepted = topic.message.decode(payload).commands
            self.missions.observe([command for command in accepted if command.source not in own_endpoints], ())
            return
        self.vehicle.put(topic, payload)
        if topic is ESTIMATE:
            self.commands.start()
            self.vehicle.time_ns = time_ns
            self.clock.now = Instant(time_ns, wall)
            self._step()
        elif topic is COMMAND_ACKS:
            acknowledgements = self.vehicle.get(COMMAND_ACKS)
            self.commands.acknowledge(acknowledgements.acks)
            self.missions.observe((), acknowledgements.acks)
            for text in acknowledgements.text:
                self._announcements.send_text(text)
        elif topic is STATUS:
            self._announcements.step()

    def tick(self, wall: float) -> None:
        """Advance the wall time [s]. Send heartbeats until the vehicle publishes its first message."""
        self.clock.now = Instant(self.clock.now.time_ns, wall)
        if not self.commands.started:
            self._restart_if_requested()
            self.parameters.step()
            if wall >= self._next_heartbeat:
                self._next_heartbeat = wall + HEARTBEAT_INTERVAL
                self.broadcast(heartbeat(self.vehicle))

    def close(self) -> None:
        """Close the file of time stamps."""
        if self.signature:
            self.signature.close()

    def broadcast(self, message: Any) -> None:
        """Send a message to every endpoint."""
        for endpoint in self.sessions:
            endpoint.send(message)

    def _request_restart(self) -> None:
        self._restart_requested = True

    def _restart_if_requested(self) -> None:
        """Take the address of the parameters, and start new conversations."""
        if not self._restart_requested:
            return
        self._restart_requested = False
        system, component = (self.parameters.value(name) for name in (SYSTEM_ID, COMPONENT_ID))
        if not math.isnan(system):  # ArduPilot's are named differently
            self.vehicle.address = int(system), int(component)
            if self.signature:
                self.signature.set_system(int(system))
        for endpoint in self.sessions:
            endpoint.set_source(self.vehicle.address)
            self.parameters.forget(endpoint)
            self.missions.forget(endpoint)
            self.sessions[endpoint] = Session(endpoint, self._link)

    def _step(self) -> None:
        self._restart_if_requested()
        built: dict[int, list[Any]] = {}
        for endpoint, session in self.sessions.items():
            endpoint.send(*session.schedule.due(built), *session.log.step())
        self.commands.step()
        self.setpoints.step()
        self.sticks.step()
        self.missions.step()
        self.parameters.step()
        if self.vehicle.time_ns >= self._next_link:
            self._next_link = self.vehicle.time_ns + SECOND
            self._report_link()

    def _report_link(self) -> None:
        """Report a connected ground station to the autopilot; called once per simulated second."""
        for endpoint in self.sessions:
            heartbeat = endpoint.last_heartbeat
            if heartbeat and self.clock.since(heartbeat) < LINK_TIMEOUT and self.trusts(endpoint):
                self.commands.put("link", endpoint.name)
                return
