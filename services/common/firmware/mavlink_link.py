"""Link in lock step with a firmware that flies missions: compiled exchange, and MAVLink beside it."""

from collections.abc import Callable

from lapwing.services.common.firmware.channel import SharedSocket
from lapwing.services.common.firmware.exchange import POLL, Shared
from lapwing.services.common.firmware.firmware_config import FirmwareConfig
from lapwing.services.common.firmware.link import FirmwareOutput, ProgramLink, Read
from lapwing.services.common.firmware.mavlink_transport import Transport
from lapwing.services.common.firmware.mission_client import Conventions, MissionClient, poll_flight
from lapwing.services.common.firmware.schema import parameters_in
from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.common.mavlink.mission_export import to_mavlink


class MavlinkLink(ProgramLink):
    """Connection of compiled code (`_socket`) and of the mission's client to one firmware.

    The adapter's own values have the `datum` of the mission, and `parameters`, which describe the scene's sensors and
    battery to the firmware.
    """

    CONVENTIONS: Conventions

    _run: Callable[[dict[str, float]], None]  # start the program with parameters
    _connect: Callable[[], None]  # wait for the firmware
    _handle: Callable[[int, int, int, Read], None]  # handle a call for a reason other than POLL; see `handle_call`
    _update: Callable[[Read], None]  # send what the exchange does not, such as the state of the battery
    _client: MissionClient
    _shared: Shared
    _transport: Transport | None = None

    def __init__(self, config: FirmwareConfig, client: type[MissionClient] = MissionClient) -> None:
        """Store the configuration, and the class of the client of the MAVLink link."""
        super().__init__(config)
        self._own, self._socket, self._client_of = config.own, SharedSocket(), client

    @property
    def client(self) -> MissionClient:
        """Client of the firmware's MAVLink link."""
        return self._client

    @property
    def clock_at_start(self) -> float:
        """Return the firmware's clock [s] at tick 0."""
        return self._config.interval

    def handle_call(self, tick: int, reason: int, number: int, read: Read) -> FirmwareOutput | None:
        """Handle a call from compiled code at `tick`: wait for outputs, send again, or poll the MAVLink link.

        Args:
            tick: tick of the exchange.
            reason: WAIT, SEND, POLL or INVALID of `exchange`, or an adapter's own.
            number: for WAIT, size [bytes] of the message that compiled code received.
            read: returns the newest sample of a port.

        Returns:
            The state of the vehicle without outputs after a poll, otherwise None.
        """
        self._time = tick * self._config.interval
        if reason != POLL:
            self._handle(tick, reason, number, read)
            return None
        result = poll_flight(self.report, self._client, self._time)
        self._update(read)
        self._shared.next_poll[0] = max(tick + 1, self._client.next_poll_tick(self._config.interval))
        return result

    def close(self) -> None:
        """End the program and close the connections."""
        super().close()
        if self._transport:
            self._transport.close()
        self._socket.close()

    def _begin(self) -> None:
        config = self._config
        chosen = parameters_in(config.parameter_text) | config.parameters
        described, conventions = self._own.parameters, self.CONVENTIONS
        items = next((command.items for command in config.plan if command.kind == "mission_upload"), ())
        messages = to_mavlink(items, mavlink.MAV_MISSION_TYPE_MISSION, self._own.datum)
        assert self._transport is not None
        if config.command:
            self._run({**conventions.parameters, **described, **chosen})
            self._client = self._client_of(self._transport, conventions, messages, chosen, sets=False)
        else:
            required = {**(conventions.parameters if items else {}), **chosen}
            self._client = self._client_of(self._transport, conventions, messages, required, optional=described)
        self._connect()
