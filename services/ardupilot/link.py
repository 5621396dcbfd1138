"""Link to ArduPilot SITL: lock step over UDP, and MAVLink over TCP for the mission.

ArduPilot sends a servo packet and waits for the state after that step, so each exchange answers the last packet and
waits for the next one. Compiled code does this (`exchange`) as long as the packets arrive in order and within 0.2 s.
"""

import socket
import time
from collections.abc import Callable

from lapwing.cosim.diagram.compiled_block import InputRing
from lapwing.kernels import math
from lapwing.services.ardupilot.exchange import OUTPUTS, PWM_MAX, PWM_MIN, ArduPilotExchange
from lapwing.services.ardupilot.frame_sequence import Frame, FrameSequence
from lapwing.services.ardupilot.modes import CONVENTIONS
from lapwing.services.ardupilot.resolve import LOOP_RATE, NAME, ArduPilotSetup
from lapwing.services.ardupilot.sample import Samples
from lapwing.services.ardupilot.servo_packet import ServoPacket, decode, throttle
from lapwing.services.common import ports
from lapwing.services.common.firmware.datagrams import DatagramSocket, bound_socket
from lapwing.services.common.firmware.exchange import INVALID, LAST_START, POLL, SEND, Shared, empty_ring
from lapwing.services.common.firmware.link import FirmwareOutput, LinkReport, Read, Waits
from lapwing.services.common.firmware.mavlink_transport import TcpTransport
from lapwing.services.common.firmware.mission_client import MissionClient, poll_flight
from lapwing.services.common.firmware.mission_messages import mission_items, mission_messages
from lapwing.services.common.firmware.program import Program, ProgramLink
from lapwing.services.common.firmware.setup import FirmwareSetup, first_free
from lapwing.services.common.ports import AirspeedReading, DistanceReading, ImuReading

PORT, MAVLINK_PORT, STRIDE = 9002, 5760, 10
INSTANCES = 100
PEER_TIMEOUT = 2.0  # [s] without an answer; after it, another sender is a restarted firmware
PARAMETERS_FILE = "lapwing.parm"
PARAMETERS = {"AUTO_OPTIONS": 3.0, "SIM_SPEEDUP": 1000.0}  # arm and take off in AUTO; no time control
EVERY = 0.2  # [s] between two updates of the simulated sensors
SAG = 0.7  # [V] that ArduPilot subtracts at full throttle


class SimulatedSensors:
    """Sender of GPS outages and battery voltage to ArduPilot's own sensor models, as parameters of its simulation.

    The JSON interface does not reach them. Sources: ArduPilot, SITL.cpp and SITL_State_common.cpp.
    """

    def __init__(self, own: ArduPilotSetup, client: MissionClient):
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
        if math.isfinite((battery := read(ports.BATTERY)).charge):
            throttle = math.total(motors) / len(motors)
            self._client.send_parameter("SIM_BATT_VOLTAGE", battery.voltage + SAG * throttle)


class ArduPilotLink(ProgramLink):
    """Connection to one ArduPilot SITL."""

    outputs = OUTPUTS

    def __init__(self, setup: FirmwareSetup) -> None:
        """Store the configuration."""
        self._setup = setup
        self._own: ArduPilotSetup = setup.own
        self.report = LinkReport("ardupilot")
        self._sequence, self._socket = FrameSequence(), DatagramSocket()
        self._client: MissionClient | None = None
        self._simulated: SimulatedSensors | None = None
        self._packet: ServoPacket | None = None
        self._was_resent = False  # a frame was resent since the last answer

    @property
    def address(self) -> tuple[str, int]:
        """Host and port of this link's lock-step socket."""
        return self._setup.host, self._setup.port_at(PORT, STRIDE)

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
        return ArduPilotExchange(shared, samples, self._socket.memory, self._sequence.next)

    def open(self, waits: Waits) -> None:
        """Start ArduPilot or wait for it, and receive its first servo packet."""
        self._setup, bound = first_free(self._setup, INSTANCES, _claim)
        self._socket.attach(bound)
        setup = self._setup
        items = mission_items(setup.plan)
        parameters = {**PARAMETERS, **setup.parameters} if items else dict(setup.parameters)
        if setup.command:
            text = "".join(f"{name} {value:.9g}\n" for name, value in {**PARAMETERS, **parameters}.items())
            files = {PARAMETERS_FILE: setup.parameter_text + "\n" + text}
            self._program = Program(setup, self._arguments(), files)
            parameters = {}
        port = MAVLINK_PORT + STRIDE * setup.instance
        self._client = MissionClient(
            TcpTransport(setup.host, port), CONVENTIONS, mission_messages(items, self._own.datum), parameters
        )
        self._simulated = SimulatedSensors(self._own, self._client)
        patience = self._patience(setup.start_timeout)
        while self._packet is None:
            waits(f"ardupilot on udp {self.address[0]}:{self.address[1]}")
            self._client.read()  # ArduPilot waits for a connection before it starts
            self._process(self._socket.receive())
            self._check(patience, "no servo packet", "start arducopter with --model JSON:127.0.0.1")

    def _arguments(self) -> list[str]:
        """Return the arguments of the program that the scene does not set."""
        home, instance = self._own.datum.home, self._setup.instance
        position = f"{home.latitude_deg:.9f},{home.longitude_deg:.9f},{home.height:.3f},0"
        defaults = {
            "--model": f"JSON:{self._setup.host}",
            "--home": position,
            "--instance": str(instance),
            "--sim-port-out": str(self.address[1]) if self._setup.port else "",
            "--defaults": PARAMETERS_FILE,
        }
        arguments = set(self._setup.command)
        return [text for name, value in defaults.items() if value and name not in arguments for text in (name, value)]

    def handle_call(self, tick: int, reason: int, number: int, read: Read, waits: Waits) -> FirmwareOutput | None:
        """Handle a call from the compiled exchange; see `ExchangeLink`."""
        self._time = tick * self._setup.interval
        if reason == INVALID:
            raise ValueError("the state of the vehicle is not finite")
        if reason == SEND:
            self._send()
        elif reason == POLL:
            return self._poll(tick, read)
        else:
            self._await(number, waits)
        return None

    def _poll(self, tick: int, read: Read) -> FirmwareOutput:
        """Poll the MAVLink link. Return the state of the flight."""
        assert self._client is not None
        assert self._simulated is not None
        result = poll_flight(NAME, self._client, self._time)
        self.report.version = self._client.version
        self._simulated.update(self._time, read, tuple(self._shared.outputs))
        self._shared.next_poll[0] = max(tick + 1, self._client.next_poll_tick(self._setup.interval))
        return result

    def _await(self, size: int, waits: Waits) -> None:
        """Wait for the next servo packet, after compiled code received `size` bytes that were not this packet.

        A resent frame is answered again only if no other packet follows it: ArduPilot may have sent it before the
        answer arrived, and would use a second answer for its next frame. All later outputs would then be a step late.
        """
        self._packet, self._was_resent = None, False
        self._process(size)
        patience = self._patience(self._setup.step_timeout)
        while self._packet is None:
            waits("ardupilot")
            self._check(patience, "no servo packet", "check that it runs and that its steps are not blocked")
            size = self._socket.receive()
            self._process(size)
            if size < 0 and self._was_resent:
                self._was_resent = False
                self._send()
            elif size < 0 and self._client:
                self._client.read()  # ArduPilot waits for a connection before it starts again
        self._shared.outputs[:] = [throttle(pwm, PWM_MIN, PWM_MAX) for pwm in self._packet.pwm[:OUTPUTS]]

    def close(self) -> None:
        """Close the connections and end the program."""
        if self._client:
            self._client.close()
        self._socket.close()
        if self._program:
            self._program.close()
        self._program = self._client = None

    def _send(self) -> None:
        """Send the last answer."""
        if reason := self._socket.send():
            self.report.note(f"cannot send to ArduPilot ({reason})")

    def _process(self, size: int) -> None:
        """Process a datagram of `size` bytes; negative if none has arrived."""
        link = self._socket
        if size < 0:  # none, or the firmware's port is closed
            return
        try:
            packet = decode(link.datagram(size))
        except ValueError as error:
            self._reject(f"packet from {link.sender} is not a servo packet: {error}")
            return
        if link.has_peer and not link.knows_sender:
            if time.monotonic() < self._shared.seconds[LAST_START] + PEER_TIMEOUT:
                self._reject(f"another ArduPilot sends from {link.sender}")
                return
            self._sequence.restart()
        link.answer_sender()
        meaning = self._sequence.receive(packet.frame_count)
        self.report.resent, self.report.missed = self._sequence.resent, self._sequence.skipped
        if self._sequence.restarts > self.report.reconnected and self._client:
            self._client.restart()
            self._simulated = SimulatedSensors(self._own, self._client)
        self.report.reconnected = self._sequence.restarts
        if meaning is Frame.RESENT:
            self._was_resent = True
            return
        if packet.frame_rate <= LOOP_RATE:  # a rate that ArduPilot cannot keep
            self.report.note(f"SIM_RATE_HZ is {packet.frame_rate}; set it above the loop rate of {LOOP_RATE} Hz")
        self._packet = packet

    def _reject(self, text: str) -> None:
        self.report.rejected += 1
        self.report.note(text)


def _claim(setup: FirmwareSetup) -> socket.socket:
    """Open the port of an instance. Raise FirmwareError if it is in use."""
    advice = "stop the other simulator, or set autopilot.instance"
    return bound_socket(NAME, setup.host, setup.port_at(PORT, STRIDE), advice)
