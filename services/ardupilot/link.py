"""Link to ArduPilot SITL: lock step over UDP, and MAVLink over TCP for the mission.

ArduPilot sends a servo packet and waits for the state after that step, so each exchange answers the last packet and
waits for the next one. Compiled code does this (`exchange`) as long as the packets arrive in order and within 0.2 s.
"""

import time
from collections.abc import Callable
from functools import partial

import numpy as np

from lapwing.cosim.diagram.compiled_block import InputRing
from lapwing.kernels import math
from lapwing.services.ardupilot.exchange import ArduPilotExchange, Samples
from lapwing.services.ardupilot.modes import CONVENTIONS
from lapwing.services.ardupilot.resolve import LOOP_RATE, NAME, ArduPilotConfig
from lapwing.services.ardupilot.servo_packet import (
    ANY,
    RESENT,
    RESTARTED,
    ServoPacket,
    decode,
    frames_ahead,
    pulse_range,
    throttle,
)
from lapwing.services.common import ports
from lapwing.services.common.firmware.exchange import INVALID, LAST_START, SEND, Shared, empty_ring
from lapwing.services.common.firmware.firmware_config import FirmwareConfig
from lapwing.services.common.firmware.link import Read
from lapwing.services.common.firmware.mavlink_link import MavlinkLink
from lapwing.services.common.firmware.mavlink_transport import TcpTransport
from lapwing.services.common.firmware.mission_client import MissionClient
from lapwing.services.common.firmware.program import TCP, UDP, OwnPort
from lapwing.services.common.firmware.repeatable import Turns
from lapwing.services.common.firmware.schema import parameters_in
from lapwing.services.common.firmware.service import firmware_service
from lapwing.services.common.ports import AirspeedReading, DistanceReading, ImuReading

PORT, MAVLINK_PORT, RC_PORT, STRIDE = 9002, 5760, 5501, 10
PEER_TIMEOUT = 2.0  # [s] without an answer; after it, another sender is a restarted firmware
PARAMETERS_FILE = "lapwing.parm"
EVERY = 0.2  # [s] between two updates of the simulated sensors
SAG = 0.7  # [V] that ArduPilot subtracts at full throttle


class SimulatedSensors:
    """Sender of GPS outages and battery voltage to ArduPilot's own sensor models, as parameters of its simulation.

    The JSON interface does not reach them. Sources: ArduPilot, SITL.cpp and SITL_State_common.cpp.
    """

    def __init__(self, own: ArduPilotConfig, client: MissionClient):
        """Store the adapter's values and the client."""
        self._own, self._client = own, client
        self._fix = True  # as ArduPilot starts
        self._next = 0.0  # [s] of the next update

    def update(self, time: float, read: Read, motors: tuple[float, ...]) -> None:
        """Set the parameters at simulation `time` [s]; `motors`: outputs, 0 to 1."""
        if time < self._next or not self._client.connected:
            return
        self._next = time + EVERY
        if self._own.gps and (fix := read(ports.GPS).valid) != self._fix:
            self._fix = fix
            self._client.send_parameter("SIM_GPS_DISABLE", float(not fix))  # name up to version 4.5
            self._client.send_parameter("SIM_GPS1_ENABLE", float(fix))
        sag = SAG * math.total(motors) / len(motors)
        self._client.send_parameter("SIM_BATT_VOLTAGE", read(ports.BATTERY).voltage + sag)


class ArduPilotLink(MavlinkLink):
    """Connection to one ArduPilot SITL."""

    CONVENTIONS = CONVENTIONS
    INSTANCES, OWN_LOGS = 100, "logs/*.BIN"
    OWN_PORTS = (*(OwnPort(TCP, MAVLINK_PORT + k, STRIDE) for k in (0, 2, 3)), OwnPort(UDP, RC_PORT, STRIDE))

    _was_resent = False  # a frame was resent since the last answer

    def __init__(self, config: FirmwareConfig, client: type[MissionClient] = MissionClient) -> None:
        """Store the configuration; see `MavlinkLink`."""
        super().__init__(config, client)
        self._pulses = pulse_range(parameters_in(config.parameter_text) | config.parameters)
        self._next = np.full(1, ANY)  # count of the next frame; compiled code increments it for each frame in order

    @property
    def address(self) -> tuple[str, int]:
        """Host and port of this link's lock-step socket."""
        return self._config.host, self._config.port_at(PORT, STRIDE)

    def exchange(self, shared: Shared, ring: Callable[[str], InputRing]) -> ArduPilotExchange:
        """Return the parameters of the compiled exchange."""
        own, self._shared = self._own, shared
        samples = Samples(
            own.gravity_world,
            ring(ports.TRUTH),
            ring(ports.IMU) if own.imu else empty_ring(ImuReading()),
            ring(own.range_port) if own.range_port else empty_ring(DistanceReading()),
            ring(ports.AIRSPEED) if own.airspeed else empty_ring(AirspeedReading()),
            ring(ports.BATTERY),
            own.imu,
            bool(own.range_port),
            own.airspeed,
        )
        return ArduPilotExchange(shared, samples, self._socket.memory, self._next, self._pulses)

    def close(self) -> None:
        """End the program and close the connections."""
        if self._transport:
            self._transport.close()  # first: the port of the end that closes first stays in use for a while
        super().close()

    def _claim(self) -> None:
        self._socket.attach(self._bound(UDP, self.address[1]))
        self._transport = TcpTransport(self._config.host, MAVLINK_PORT + STRIDE * (self._config.instance or 0))

    def _peer(self) -> tuple[int, int] | None:
        port = self._socket.peer_port
        return (UDP, port) if port else None

    def _run(self, parameters: dict[str, float]) -> None:
        """Start the program, with those arguments that the scene does not set."""
        home, config = self._own.datum.home, self._config
        defaults = {
            "--model": f"JSON:{config.host}",
            "--home": f"{home.latitude_deg:.9f},{home.longitude_deg:.9f},{home.height:.3f},0",
            "--instance": str(config.instance),
            "--sim-port-out": str(self.address[1]) if config.port else "",
            "--defaults": PARAMETERS_FILE,
        }
        own = [
            text for name, value in defaults.items() if value and name not in config.command for text in (name, value)
        ]
        text = "".join(f"{name} {value:.9g}\n" for name, value in parameters.items())
        peers = (MAVLINK_PORT + STRIDE * (config.instance or 0),)
        turns = Turns("s", self.address[1], config.period * config.interval_ns, peers)
        self._start(own, {PARAMETERS_FILE: text}, turns=turns)

    def _connect(self) -> None:
        """Receive the first servo packet."""
        self._simulated = SimulatedSensors(self._own, self._client)
        timeout = self._config.start_timeout
        for _ in self._attempts("ardupilot on udp {}:{}".format(*self.address), timeout):
            self._client.read()  # ArduPilot waits for a connection before it starts
            if self._process(self._socket.receive()):
                self._take_turns("linked")
                return
        advice = "check that it runs" if self.program else "start arducopter with --model JSON:127.0.0.1"
        self._time_out(f"no servo packet for {timeout:g} s", advice)

    def _handle(self, tick: int, reason: int, number: int, read: Read) -> None:
        if reason == INVALID:
            raise ValueError("the state of the vehicle is not finite")
        if reason == SEND:
            self._send()
        else:
            self._await(number)

    def _update(self, read: Read) -> None:
        self._simulated.update(self._time, read, tuple(self._shared.outputs))

    def _await(self, size: int) -> None:
        """Wait for the next servo packet, after compiled code received `size` bytes that were not this packet.

        A resent frame is answered again only if no other packet follows it: ArduPilot may have sent it before the
        answer arrived, and would use a second answer for its next frame. All later outputs would then be a step late.
        """
        self._was_resent, timeout = False, self._config.step_timeout
        for _ in self._attempts("ardupilot", timeout):
            if packet := self._process(size):
                pulses = packet.pwm[: len(self._shared.outputs)]
                self._shared.outputs[:] = [throttle(pwm, *self._pulses) for pwm in pulses]
                return
            if size < 0 and self._was_resent:
                self._was_resent = False
                self._send()
            elif size < 0 and not self.in_turns:
                self._client.read()  # ArduPilot waits for a connection before it starts again
            size = self._socket.receive()
        self._time_out(f"no servo packet for {timeout:g} s", "check that it runs and that its steps are not blocked")

    def _send(self) -> None:
        """Send the last answer."""
        if reason := self._socket.send():
            self.report.note(f"cannot send to ArduPilot ({reason})")

    def _process(self, size: int) -> ServoPacket | None:
        """Process a datagram of `size` bytes; negative if none has arrived. Return a servo packet that is new."""
        link, report = self._socket, self.report
        if size < 0:  # none, or the firmware's port is closed
            return None
        try:
            packet = decode(link.data(size))
        except ValueError as error:
            report.reject(f"packet from {link.sender} is not a servo packet: {error}")
            return None
        restarted = bool(link.peer_port) and not link.knows_sender
        if restarted:
            if time.monotonic() < self._shared.seconds[LAST_START] + PEER_TIMEOUT:
                report.reject(f"another ArduPilot sends from {link.sender}")
                return None
            self._next[0] = ANY
        link.answer_sender()
        ahead = frames_ahead(packet.frame_count, int(self._next[0]))
        self._next[0] = packet.frame_count + 1
        if ahead == RESENT:
            report.resent += 1
            self._was_resent = True
            return None
        report.missed += max(ahead, 0)
        if restarted or ahead == RESTARTED:
            report.reconnected += 1
            self._client.restart()
            self._simulated = SimulatedSensors(self._own, self._client)
        if packet.frame_rate <= LOOP_RATE:  # a rate that ArduPilot cannot keep
            report.note(f"SIM_RATE_HZ is {packet.frame_rate}; set it above the loop rate of {LOOP_RATE} Hz")
        return packet


create = partial(firmware_service, name=NAME, link=ArduPilotLink)
