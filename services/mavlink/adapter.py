"""The adapter without its sockets: bytes of clients and messages of the vehicle in, bytes and commands out."""

from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

from messages import OperatorInput, header
from messages.topics import ANSWERS, ESTIMATE, OPERATOR, STATUS, Topic
from services.mavlink.channel import Channel, Signature
from services.mavlink.client import Client
from services.mavlink.clock import Clock, Instant
from services.mavlink.dialect import id_of, mavlink
from services.mavlink.missions import Missions
from services.mavlink.parameters import Parameters
from services.mavlink.protocols import HANDLERS
from services.mavlink.requests import Requests
from services.mavlink.telemetry import STREAMS
from services.mavlink.vehicle import COMPONENT, Vehicle
from services.parameters import Parameter

SECOND = 1_000_000_000
FRESH = 3.5  # [s] after its last heartbeat a ground station counts as gone
ALL = 0  # target system or component of a message for everybody
TEXT = 50  # bytes of a STATUSTEXT
NONE = 0xFFFF
_NOTHING = len(OperatorInput(header(0, "world")).encode())  # bytes of an input without a command


class Adapter:
    """One vehicle and its partners."""

    def __init__(
        self,
        vehicle: Vehicle,
        parameters: Sequence[Parameter],
        operate: Callable[[Any], None] | None,
        key: bytes | None = None,
        insecure: bool = False,
    ):
        """An adapter that nobody has connected to.

        Args:
            vehicle: what it speaks for.
            parameters: what can be tuned, with the scene's values.
            operate: hands an OperatorCommand to the autopilot; None for a recorded flight.
            key: signs what is sent, and refuses what is not signed with it.
            insecure: commands are taken from other machines without a key.
        """
        self.vehicle = vehicle
        self.clock = Clock()
        self.counts: Counter[str] = Counter()
        self.requests = Requests(self.clock, operate)
        self.missions = Missions(self.clock, self.requests, vehicle.flavour.HOME_FIRST, self.counts)
        self.parameters = Parameters(parameters, vehicle.flavour, self.requests, self.counts)
        self.clients: list[Client] = []
        self._signature = Signature(key) if key else None
        self._insecure = insecure
        self._shown: tuple = ()
        self._home = vehicle.status.home
        self._reached, self._item = NONE, (0, 0)
        self._texts = 0
        self._next_link = 0

    def connect(self, local: bool, datagrams: bool, put: Callable[[bytes], None]) -> Client:
        """A new partner; `local`: on this machine, `datagrams`: no frame spans two pieces of its bytes."""
        channel = Channel(self.vehicle.system, self._signature, datagrams, self.counts)
        client = Client(channel, local, put)
        client.plan(self.vehicle)
        self.clients.append(client)
        return client

    def disconnect(self, client: Client) -> None:
        """A partner is gone."""
        self.clients.remove(client)
        self.parameters.forget(client)

    def trusts(self, client: Client) -> bool:
        """Whether its commands are taken: signed ones always, unsigned ones from this machine."""
        if self._signature or client.local or self._insecure:
            return True
        self.counts["command from another machine"] += 1
        return False

    def receive(self, client: Client, data: bytes) -> int:
        """Bytes have come from a partner; how many sound messages they held."""
        sound = 0
        for m in client.receive(data):
            sound += 1
            self.counts["received"] += 1
            source = m.get_srcSystem(), m.get_srcComponent()
            target = getattr(m, "target_system", getattr(m, "target", ALL))
            component = getattr(m, "target_component", ALL)
            if source == (self.vehicle.system, COMPONENT):
                self.counts["in our own name"] += 1
            elif target not in (ALL, self.vehicle.system) or component not in (ALL, COMPONENT):
                self.counts["for another vehicle"] += 1
            elif (handler := HANDLERS.get(m.get_msgId())) is None:
                self.counts["message that we have no use for"] += 1
            else:
                client.system, client.component = source
                handler(self, client, m)
        return sound

    def take(self, topic: Topic, time_ns: int, payload: bytes, wall: float) -> None:
        """The vehicle has published a message; an estimate moves time on, and sends what is due.

        Args:
            topic: what it is about.
            time_ns: simulation time.
            payload: the message, encoded.
            wall: monotonic wall time [s].
        """
        if topic is OPERATOR:
            if len(payload) > _NOTHING:
                ours = {client.name for client in self.clients} if self.requests.taken else ()
                given = topic.message.decode(payload).commands
                self.missions.overhear([command for command in given if command.source not in ours], ())
            return
        self.vehicle.view.put(topic, payload)
        if topic is ESTIMATE:
            self.vehicle.time_ns = time_ns
            self.clock.now = Instant(time_ns, wall)
            self._step()
        elif topic is ANSWERS:
            said = self.vehicle.view.get(ANSWERS)
            self.requests.take(said.answers)
            self.missions.overhear((), said.answers)
            for text in said.text:
                self.say(text)
        elif topic is STATUS:
            self._announce()

    def tick(self, wall: float) -> None:
        """Wall time goes on, also while the vehicle is silent."""
        self.clock.now = Instant(self.clock.now.time_ns, wall)

    def knows(self, number: int) -> bool:
        """Whether a message is one that the vehicle sends."""
        return number in STREAMS

    def build(self, number: int) -> Any:
        """A message of the telemetry as it would be now, None while there is nothing to say."""
        return STREAMS[number].build(self.vehicle)

    def send_all(self, name: str) -> None:
        """Send a message of the telemetry to everybody now."""
        number = id_of(name)
        if number is not None and (message := self.build(number)) is not None:
            for client in self.clients:
                client.send(message)

    def say(self, text: str) -> None:
        """Tell the pilots, in pieces where it is long."""
        grave = self.vehicle.status.failsafe
        severity = mavlink.MAV_SEVERITY_CRITICAL if grave else mavlink.MAV_SEVERITY_WARNING
        data = text.encode()
        number = 0
        if len(data) > TEXT:
            self._texts = number = self._texts % NONE + 1
        for piece, start in enumerate(range(0, len(data), TEXT)):
            message = mavlink.MAVLink_statustext_message(severity, data[start : start + TEXT], number, piece)
            for client in self.clients:
                client.send(message)

    def _step(self) -> None:
        built: dict[int, Any] = {}
        for client in self.clients:
            client.step(self.vehicle, built)
        self.requests.step()
        self.missions.step()
        self.parameters.step()
        if self.vehicle.time_ns >= self._next_link:
            self._next_link = self.vehicle.time_ns + SECOND
            self._keep_link()

    def _keep_link(self) -> None:
        """Tell the autopilot once a simulated second that a ground station is there."""
        for client in self.clients:
            if client.heartbeat and self.clock.since(client.heartbeat) < FRESH and self.trusts(client):
                self.requests.ask("link", client.name)
                return

    def _announce(self) -> None:
        """Say at once what clients wait for: another mode, the next item."""
        s = self.vehicle.status
        shown = s.mode, s.armed, s.failsafe
        if shown != self._shown:
            self._shown = shown
            self.send_all("HEARTBEAT")
            self.send_all("EXTENDED_SYS_STATE")
        if s.home != self._home:
            self._home = s.home
            self.send_all("HOME_POSITION")
        if (s.mission_current, s.mission_state) != self._item:
            self._item = s.mission_current, s.mission_state
            self.send_all("MISSION_CURRENT")
        if s.mission_reached != self._reached:
            self._reached = s.mission_reached
            if s.mission_count and s.mission_reached != NONE:
                for client in self.clients:
                    client.send(mavlink.MAVLink_mission_item_reached_message(s.mission_reached))
