"""Link to PX4 SITL: lock step over TCP, and MAVLink over UDP for the mission.

PX4's clock is the time of the last HIL_SENSOR. While PX4 starts, messages of a vehicle at rest are sent without waiting
("free-wheel"), until its first HIL_ACTUATOR_CONTROLS; from then on every HIL_SENSOR is answered by one with its time.
Compiled code makes this exchange (`exchange`) as long as only expected answers arrive.
"""

import math
import time
from collections.abc import Callable

import numpy as np

from lapwing.cosim.diagram.compiled_block import InputRing
from lapwing.cosim.processes.patience import Patience
from lapwing.services.common import ports
from lapwing.services.common.firmware.exchange import POLL, SEND, Shared, empty_ring
from lapwing.services.common.firmware.link import FirmwareError, FirmwareOutput, LinkReport, Read, Waits
from lapwing.services.common.firmware.mission_client import MissionClient, poll_flight
from lapwing.services.common.firmware.mission_messages import mission_items, mission_messages
from lapwing.services.common.firmware.program import Program, ProgramLink
from lapwing.services.common.firmware.setup import FirmwareSetup, first_free
from lapwing.services.common.ports import AirspeedReading
from lapwing.services.px4.connection import Connection, claim
from lapwing.services.px4.exchange import MESSAGES, OUTPUTS, Px4Exchange
from lapwing.services.px4.messages import HIL_ACTUATOR_CONTROLS, ActuatorControls, actuator_controls
from lapwing.services.px4.modes import CONVENTIONS
from lapwing.services.px4.resolve import NAME, Px4Setup
from lapwing.services.px4.sample import RARE, Readings, at_rest, rare_messages
from lapwing.services.px4.sensor_frame import payload
from lapwing.services.px4.stream import stream

INSTANCES = 10  # number of instances with separate MAVLink ports
SECOND = 1_000_000  # [us]
ANSWER_TIMEOUT = 1.0  # [s] after which a step continues without the answer of PX4
BATTERY_EVERY = 0.5  # [s] between two states of the battery
OTHERS_EVERY = 1.0  # [s] between two checks for a second firmware


class Px4Link(ProgramLink):
    """Connection to one PX4 SITL."""

    outputs = OUTPUTS

    def __init__(self, setup: FirmwareSetup) -> None:
        """Store the configuration."""
        self._setup = setup
        self._own: Px4Setup = setup.own
        self.report = LinkReport("px4")
        self._stream = stream()
        self._connection: Connection | None = None
        self._client: MissionClient | None = None
        self._battery_at = 0.0  # [s] of the next state of the battery
        self._epoch = np.zeros(1, np.int64)  # [us] of PX4's clock at tick 0
        self._last_us = 0  # [us] of the last message
        self._step_us = setup.period * setup.interval_ns // 1000
        self._others_at = 0.0  # [s] of the next check for a second firmware
        self._silent = np.zeros(1, np.int64)  # consecutive steps without an answer
        self._armed = np.zeros(1, np.int64)

    def exchange(self, shared: Shared, ring: Callable[[str], InputRing]) -> Px4Exchange:
        """Return the parameters of the compiled exchange."""
        self._shared, periods = shared, self._own.periods
        port_names = (ports.IMU, ports.MAGNETOMETER, ports.BAROMETER, ports.AIRSPEED, *RARE)
        airspeed = ring(ports.AIRSPEED) if ports.AIRSPEED in periods else empty_ring(AirspeedReading())
        readings = Readings(
            ring(ports.IMU),
            ring(ports.MAGNETOMETER),
            ring(ports.BAROMETER),
            airspeed,
            np.array([periods.get(port, 0) for port in port_names]),
            self._setup.period,
        )
        return Px4Exchange(
            shared, readings, self._stream, payload(), payload(), self._epoch, self._setup.interval_ns, self._armed,
            self._silent,
        )  # fmt: skip

    def open(self, waits: Waits) -> None:
        """Start PX4 or wait for it, and run it up to a full second of its clock."""
        self._setup, (self._connection, transport) = first_free(
            self._setup, INSTANCES, lambda candidate: claim(candidate, self._stream)
        )
        setup = self._setup
        if setup.command:
            self._program = self._start(setup.instance)
        items, parameters = mission_items(setup.plan), {} if setup.command else dict(setup.parameters)
        messages = mission_messages(items, self._own.datum)
        self._client = MissionClient(transport, CONVENTIONS, messages, parameters)
        self._connect(waits, self._patience(setup.start_timeout))
        self._epoch[0] = -(-self._last_us // SECOND) * SECOND
        while self._last_us + self._step_us < self._epoch[0]:
            self._send_rest(self._last_us // self._step_us)
            self._await(self._connection.receive(), self._last_us, waits)
        self.report.late = 0  # answers to messages that were sent without waiting

    def _start(self, instance: int) -> Program:
        """Start the program, with parameters in its environment."""
        setup = self._setup
        arguments = () if "-i" in setup.command else ("-i", str(instance))
        own = {"SIM_BAT_ENABLE": 0.0} if self._own.battery else {}
        variables = {f"PX4_PARAM_{name}": f"{value:.9g}" for name, value in {**own, **setup.parameters}.items()}
        return Program(setup._replace(environment={**variables, **setup.environment}), arguments)

    def _connect(self, waits: Waits, patience: Patience) -> None:
        """Wait for a connection, and send the readings at rest until the first answer."""
        link = self._connection
        assert link is not None
        while not link.accept():
            waits(f"px4 on {link.where}")
            self._check(patience, "no connection", "start px4 with PX4_SIM_MODEL=none_iris")
        count = 0
        while not self._store_outputs(link.receive(wait=False)):
            if not link.connected:
                raise FirmwareError("px4: closed its connection while it started; see its output")
            self._send_rest(count)
            count += 1
            if count % 50 == 0:
                waits("px4 to send its first outputs")
                self._check(patience, "no HIL_ACTUATOR_CONTROLS", "check that pwm_out_sim runs")
            time.sleep(1e-6 * self._step_us)

    def _send_rest(self, count: int) -> None:
        """Send the next readings of a vehicle at rest."""
        assert self._connection is not None
        self._last_us += self._step_us
        self._connection.send_sensors(self._last_us, at_rest(self._own, count))

    def handle_call(self, tick: int, reason: int, number: int, read: Read, waits: Waits) -> FirmwareOutput | None:
        """Handle a call from the compiled exchange; see `ExchangeLink`."""
        link, setup = self._connection, self._setup
        assert link is not None
        self._time = tick * setup.interval
        self._last_us = int(self._epoch[0]) + tick * setup.interval_ns // 1000
        if reason == MESSAGES:
            link.append(rare_messages(self._own, setup.period, tick, self._last_us, read))
        elif reason == SEND:  # also if the buffer is full, since the firmware does not read
            link.lose()
            self._check_program()
        elif reason == POLL:
            return self._poll(tick, read)
        else:
            self._await(link.parse_received(number), self._last_us, waits)
            self.report.rejected = link.rejected + link.extra_connections
        return None

    def _poll(self, tick: int, read: Read) -> FirmwareOutput:
        """Poll the MAVLink link, send the battery, and reject other firmwares. Return the state of the flight."""
        link = self._connection
        assert link is not None
        assert self._client is not None
        if self._time >= self._others_at:
            self._others_at = self._time + OTHERS_EVERY
            if link.reject_others():
                self.report.note(f"a second PX4 tried to connect at t = {self._time:.3f} s")
        self.report.rejected = link.rejected + link.extra_connections
        result = poll_flight(NAME, self._client, self._time)
        if self._own.battery and self._time >= self._battery_at:
            self._battery_at = self._time + BATTERY_EVERY
            if math.isfinite((battery := read(ports.BATTERY)).charge):
                self._client.send_battery(battery.voltage, battery.current, battery.charge)
        self.report.version = self._client.version
        self._shared.next_poll[0] = max(tick + 1, self._client.next_poll_tick(self._setup.interval))
        return result

    def close(self) -> None:
        """Close the connections and end the program."""
        if self._client:
            self._client.close()
        if self._connection:
            self._connection.close()
        if self._program:
            self._program.close()
        self._program = self._connection = self._client = None

    def _await(self, messages: list[tuple[int, tuple]], time_us: int, waits: Waits) -> None:
        """Wait for the outputs of a time, which may be among `messages`; continue without them after a second."""
        link, report = self._connection, self.report
        assert link is not None
        patience: Patience | None = None
        while True:
            result = self._store_outputs(messages)
            if result and result.time_us >= time_us:
                report.skew_max = max(report.skew_max, 1e-6 * (result.time_us - time_us))
                self._silent[0] = 0
                break
            if result:
                report.late += 1
                messages = link.receive()
                continue
            waits("px4")
            patience = patience or self._patience(ANSWER_TIMEOUT)
            if not link.connected:
                self._reconnect(waits)
                break
            self._check_program()
            if patience.over:
                report.missed += 1
                self._silent[0] += 1
                if self._silent[0] * ANSWER_TIMEOUT >= self._setup.step_timeout:
                    self._fail(f"no HIL_ACTUATOR_CONTROLS for {self._setup.step_timeout:g} s", "check that it runs")
                break
            messages = link.receive()

    def _reconnect(self, waits: Waits) -> None:
        """Wait for the restarted firmware; the vehicle keeps its state, with its motors off."""
        if self._program:
            self._check_program()
            self._fail("it closed its connection", "see its output")
        self.report.note(f"PX4 closed its connection at t = {self._time:.3f} s")
        self._shared.outputs[:], self._armed[0] = 0.0, False
        if self._client:
            self._client.restart()
        self._connect(waits, self._patience(self._setup.start_timeout))
        self.report.reconnected += 1
        self._epoch[0] = self._last_us - round(self._time * 1e6)

    def _store_outputs(self, messages: list[tuple[int, tuple]]) -> ActuatorControls | None:
        """Store the outputs among messages. Return the newest, None if there are none."""
        result = None
        for number, values in messages:
            if number != HIL_ACTUATOR_CONTROLS.number:
                continue
            result = actuator_controls(values)
            if not result.lock_step:
                self._fail("it runs without lock step", "build px4_sitl_default")
            motors = result.controls[:OUTPUTS]
            if all(map(math.isfinite, motors)):
                self._shared.outputs[:], self._armed[0] = motors, result.armed
            else:
                self.report.missed += 1
                self.report.note(f"non-finite outputs at t = {self._time:.3f} s; the last ones are kept")
        return result
