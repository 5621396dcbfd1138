"""Link to PX4 SITL: lock step over TCP, and MAVLink over UDP for the mission.

PX4's clock is the time of the last HIL_SENSOR. Every HIL_SENSOR is answered by HIL_ACTUATOR_CONTROLS with its time. A
PX4 that runs in turns (`repeatable.c`) answers from the first message on, before it has outputs by IDLE; any other gets
the messages of a vehicle at rest without waiting ("free-wheel") until its first outputs.
Compiled code makes this exchange (`exchange`) as long as only expected answers arrive.
"""

import math
import socket
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from lapwing.cosim.diagram.compiled_block import InputRing
from lapwing.kernels import python_function
from lapwing.services.common import ports
from lapwing.services.common.firmware.channel import CLOSED, DO_NOT_WAIT, WAIT
from lapwing.services.common.firmware.exchange import SEND, Shared, empty_ring
from lapwing.services.common.firmware.firmware_config import FirmwareConfig
from lapwing.services.common.firmware.link import Read
from lapwing.services.common.firmware.mavlink_link import MavlinkLink
from lapwing.services.common.firmware.mavlink_transport import UdpTransport
from lapwing.services.common.firmware.mission_client import MissionClient
from lapwing.services.common.firmware.program import TCP, UDP, OwnPort
from lapwing.services.common.firmware.repeatable import Turns
from lapwing.services.common.firmware.service import firmware_service
from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.common.ports import AirspeedReading
from lapwing.services.px4.exchange import MESSAGES, Px4Exchange, Readings, is_new
from lapwing.services.px4.messages import ARMED, LOCK_STEP, RC, rare_messages
from lapwing.services.px4.modes import CONVENTIONS
from lapwing.services.px4.resolve import NAME, Px4Config
from lapwing.services.px4.sensor_frame import COMPONENT, NONE, SYSTEM, Sensors, frame, sensor_frame

PORT, MAVLINK_PORT = 4560, 14540
SECOND = 1_000_000  # [us]
DITHER = 0.02  # [m/s^2], and 2e-3 rad/s: variation of the readings at rest, since PX4 rejects constant ones
ANSWER_TIMEOUT = 1.0  # [s] after which a step continues without the answer of PX4
BATTERY_EVERY = 0.2  # [s] between two states of the battery
OTHERS_EVERY = 1.0  # [s] between two checks for a second firmware
OUTPUT = "HIL_ACTUATOR_CONTROLS"
# answer at time 0: no outputs
IDLE = mavlink.MAVLink_hil_actuator_controls_message(0, [0.0] * 16, 0, LOCK_STEP).pack(mavlink.MAVLink(None, 1, 1))


class Px4Link(MavlinkLink):
    """Connection to one PX4 SITL."""

    CONVENTIONS = CONVENTIONS
    INSTANCES, OWN_LOGS = 10, "log/**/*.ulg"  # instances with separate MAVLink ports
    OWN_PORTS = tuple(  # its ends of the links to onboard computer, ground station, payload and gimbal
        OwnPort(UDP, port) for port in (14580, 18570, 14280, 13030)
    )
    _server: socket.socket | None = None

    def __init__(self, config: FirmwareConfig, client: type[MissionClient] = MissionClient) -> None:
        """Store the configuration; see `MavlinkLink`."""
        super().__init__(config, client)
        flow = config.own.periods.get(ports.OPTICAL_FLOW, 0) * config.interval
        self._rare = rare_messages(config.own.datum.home, flow, config.own.rc)
        self._sequence, self._rest, self._epoch, self._armed, self._silent, self._answers = np.zeros((6, 1), np.int64)
        self._port = 0  # of the firmware's end, 0 without a connection
        self._last_us = 0  # [us] of the last message
        self._step_us = config.period * config.interval_ns // 1000
        self._battery_at = self._others_at = 0.0  # [s] of the next state of the battery, check for a second firmware

    def exchange(self, shared: Shared, ring: Callable[[str], InputRing]) -> Px4Exchange:
        """Return the parameters of the compiled exchange."""
        self._shared, periods, channel = shared, self._own.periods, self._socket.memory
        port_names = (ports.IMU, ports.MAGNETOMETER, ports.BAROMETER, ports.AIRSPEED, *self._rare)
        airspeed = ring(ports.AIRSPEED) if ports.AIRSPEED in periods else empty_ring(AirspeedReading())
        readings = Readings(
            ring(ports.IMU),
            ring(ports.MAGNETOMETER),
            ring(ports.BAROMETER),
            airspeed,
            np.array([periods.get(port, 0) for port in port_names]),
            self._config.period,
        )
        return Px4Exchange(
            shared, readings, channel, frame(channel.sent), frame(), self._sequence, self._rest, self._epoch,
            self._config.interval_ns, self._armed, self._silent, self._answers,
        )  # fmt: skip

    @property
    def clock_at_start(self) -> float:
        """Return the firmware's clock [s] at tick 0."""
        return 1e-6 * float(self._epoch[0])

    def close(self) -> None:
        """End the program and close the connections."""
        super().close()
        if self._server:
            self._server.close()

    def _claim(self) -> None:
        self._server = self._bound(TCP, self._config.port_at(PORT))
        self._server.listen(1)
        self._transport = UdpTransport(self._bound(UDP, MAVLINK_PORT + (self._config.instance or 0)))

    def _peer(self) -> tuple[int, int] | None:
        return (TCP, self._port) if self._port else None

    def _run(self, parameters: dict[str, float]) -> None:
        config = self._config
        arguments = () if "-i" in config.command else ("-i", str(config.instance))
        variables = {f"PX4_PARAM_{name}": f"{value:.9g}" for name, value in parameters.items()}
        peers = (MAVLINK_PORT + (config.instance or 0),)
        turns = Turns("c", config.port_at(PORT), 1000 * self._step_us, peers, IDLE)
        self._start(arguments, variables=variables, turns=turns)

    def _connect(self) -> None:
        """Connect to PX4, and run it up to a full second of its clock."""
        self._last_us = 0
        self._free_wheel()
        self._epoch[0] = -(-self._last_us // SECOND) * SECOND
        while self._last_us + self._step_us < self._epoch[0]:
            self._send_rest(self._last_us // self._step_us)
            self._await(self._receive(), self._last_us)
        self.report.late = 0  # answers to messages that were sent without waiting

    def _free_wheel(self) -> None:
        """Wait for a connection, and send the readings at rest until the first answer."""
        assert self._server is not None
        timeout, where = self._config.start_timeout, "tcp {}:{}".format(*self._server.getsockname())
        if not any(self._accept() for _ in self._attempts(f"px4 on {where}", timeout)):
            advice = "check its model" if self.program else "start px4 with PX4_SIM_MODEL=none_iris"
            self._time_out(f"no connection for {timeout:g} s", advice)
        self._take_turns("linked")
        self._answers[0] = self.in_turns
        count, newest = 0, None
        for _ in self._attempts("px4 to send its first outputs", timeout):
            if newest is not None or not self.in_turns or count == 0:
                self._send_rest(count)
                count += 1
            if not self.in_turns:
                time.sleep(1e-6 * self._step_us)
            newest = self._store_outputs(self._receive(0 if self.in_turns else DO_NOT_WAIT))
            if newest:
                return
            if not self._socket.is_open:
                self._fail("it closed its connection", "check its model and parameters")
        self._time_out(f"no {OUTPUT} for {timeout:g} s", "check that pwm_out_sim runs")

    def _accept(self) -> bool:
        """Wait for a firmware at most 0.2 s. Return True once one is connected."""
        assert self._server is not None
        self._server.settimeout(WAIT)
        try:
            peer, (_, self._port) = self._server.accept()  # the system forgets the address of a lost peer
        except OSError:
            return False
        peer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket.attach(peer)
        self._codec, self._rest[0] = mavlink.MAVLink(None, srcSystem=SYSTEM, srcComponent=COMPONENT), 0
        self._codec.robust_parsing = True
        return True

    def _lose(self) -> None:
        """Close the connection."""
        self._socket.close()
        self._port = 0

    def _reject_others(self) -> None:
        """Close a connection of a second firmware while the first is connected."""
        assert self._server is not None
        if not self._socket.is_open or self._socket.receive(socket.MSG_PEEK | DO_NOT_WAIT) == CLOSED:
            return
        self._server.settimeout(0.0)
        try:
            self._server.accept()[0].close()
        except OSError:
            return
        self.report.reject(f"a second PX4 tried to connect at t = {self._time:.3f} s")

    def _send_rest(self, count: int) -> None:
        """Send the next readings of a vehicle that rests at its start, the `count`-th ones."""
        self._last_us += self._step_us
        if self._socket.send(sensor_frame(self._next_sequence(), self._last_us, at_rest(self._own, count))):
            self._lose()  # also if the buffer is full, since the firmware does not read

    def _next_sequence(self) -> int:
        sequence = int(self._sequence[0])
        self._sequence[0] = (sequence + 1) & 0xFF
        return sequence

    def _handle(self, tick: int, reason: int, number: int, read: Read) -> None:
        self._last_us = int(self._epoch[0]) + tick * self._config.interval_ns // 1000
        if reason == MESSAGES:
            for port, message_of in self._rare.items():
                if python_function(is_new)(self._own.periods.get(port, 0), self._config.period, tick) and (
                    message := message_of(self._last_us, tick * self._config.interval if port == RC else read(port))
                ):
                    self._codec.seq = self._next_sequence()
                    self._socket.append(message.pack(self._codec))
        elif reason == SEND:  # also if the buffer is full, since the firmware does not read
            self._lose()
            self._check_program()
        else:
            self._await(self._parse(number), self._last_us)

    def _update(self, read: Read) -> None:
        """Send the battery, and reject other firmwares."""
        if self._time >= self._others_at:
            self._others_at = self._time + OTHERS_EVERY
            self._reject_others()
        if self._time >= self._battery_at:
            self._battery_at = self._time + BATTERY_EVERY
            battery = read(ports.BATTERY)  # without an effect that models it, it is full
            charge = battery.charge if math.isfinite(battery.charge) else 1.0
            self._client.send_battery(battery.voltage, battery.current, charge)

    def _receive(self, flags: int = 0) -> list[Any]:
        """Return the outputs that have arrived; wait for them at most 0.2 s."""
        return self._parse(self._socket.receive(flags))

    def _parse(self, size: int) -> list[Any]:
        """Return the outputs that the last `size` bytes complete."""
        if size == CLOSED:
            self._lose()
        if size <= CLOSED or not self._socket.is_open:
            return []
        messages = self._codec.parse_buffer(self._socket.data(size)) or []
        self._rest[0] = self._codec.buf_len()
        self.report.rejected += sum(m.get_type() == "BAD_DATA" for m in messages)
        return [m for m in messages if m.get_type() == OUTPUT]

    def _await(self, messages: Sequence[Any], time_us: int) -> None:
        """Wait for the outputs of a time, which may be among `messages`; continue without them after a second."""
        report = self.report
        limit = self._config.step_timeout if self.in_turns else ANSWER_TIMEOUT
        for _ in self._attempts("px4", limit):
            newest = self._store_outputs(messages)
            if newest == 0 and self.in_turns:
                report.missed += 1
                self._silent[0] += 1
                if 1e-6 * self._silent[0] * self._step_us >= limit:
                    self._time_out(f"no {OUTPUT} for {limit:g} s", "check that it runs")
                return
            if newest is not None and newest >= time_us:
                report.skew_max = max(report.skew_max, 1e-6 * (newest - time_us))
                self._silent[0] = 0
                return
            report.late += newest is not None
            if not self._socket.is_open:
                self._reconnect()
                return
            messages = self._receive()
        report.missed += 1
        self._silent[0] += 1
        if self._silent[0] * limit >= self._config.step_timeout:
            self._time_out(f"no {OUTPUT} for {self._config.step_timeout:g} s", "check that it runs")

    def _reconnect(self) -> None:
        """Wait for the restarted firmware; the vehicle keeps its state, with its motors off."""
        if self.program:
            self._fail("it closed its connection", "check why in its output")
        self.report.note(f"PX4 closed its connection at t = {self._time:.3f} s")
        self._shared.outputs[:], self._armed[0] = 0.0, False
        self._client.restart()
        self._free_wheel()
        self.report.reconnected += 1
        self._epoch[0] = self._last_us - round(self._time * 1e6)

    def _store_outputs(self, messages: Sequence[Any]) -> int | None:
        """Store the outputs of messages. Return the time [us] of the newest, None if there are none."""
        result = None
        for message in messages:
            if not message.flags & LOCK_STEP:
                self._fail("it runs without lock step", "build px4_sitl_default")
            result, motors = message.time_usec, message.controls[: len(self._shared.outputs)]
            if self.in_turns and result == 0:
                continue
            if all(map(math.isfinite, motors)):
                self._shared.outputs[:], self._armed[0] = motors, message.mode & ARMED != 0
            else:
                self.report.missed += 1
                self.report.note(f"non-finite outputs at t = {self._time:.3f} s; the last ones are kept")
        return result


def at_rest(own: Px4Config, count: int) -> Sensors:
    """Return the `count`-th readings of a vehicle that rests at its start, before the run begins."""
    dither = DITHER * (count * 7 % 5 - 2)
    x, y, z = own.force_body
    rates = (0.1 * dither, -0.1 * dither, 0.05 * dither)
    field = own.field_body if count % 5 == 0 else NONE
    pressure = own.pressure + 50.0 * dither if count % 5 == 0 else math.nan
    return Sensors(rates, (x + dither, y - dither, z + dither), field, pressure)


create = partial(firmware_service, name=NAME, link=Px4Link)
