"""Link to PX4 SITL: lock step over TCP, and MAVLink over UDP for the mission.

PX4's clock is the time of the last HIL_SENSOR. While PX4 starts, messages of a vehicle at rest are sent without waiting
("free-wheel"), until its first HIL_ACTUATOR_CONTROLS; from then on every HIL_SENSOR is answered by one with its time.
"""

import math
import time

from lapwing.services.common import ports
from lapwing.services.common.firmware.flight_status import FlightStatus
from lapwing.services.common.firmware.link import FirmwareError, FirmwareOutput, LinkReport, Read, Waits
from lapwing.services.common.firmware.mavlink_transport import UdpTransport
from lapwing.services.common.firmware.mission import mission_messages, uploaded
from lapwing.services.common.firmware.mission_client import MissionClient
from lapwing.services.common.firmware.patience import Patience
from lapwing.services.common.firmware.program import Program
from lapwing.services.common.firmware.setup import FirmwareSetup, first_free
from lapwing.services.common.ports import BatteryReading
from lapwing.services.px4.connection import Connection
from lapwing.services.px4.messages import HIL_ACTUATOR_CONTROLS, ActuatorControls, actuator_controls
from lapwing.services.px4.modes import CONVENTIONS
from lapwing.services.px4.resolve import Px4Setup
from lapwing.services.px4.sample import Sampler, at_rest

PORT, MAVLINK_PORT = 4560, 14540
INSTANCES = 10  # with a MAVLink port of their own
SECOND = 1_000_000  # [us]
MISSED = 1.0  # [s] after which a step goes on without the answer of PX4
OUTPUTS = 4
BATTERY_EVERY = 0.5  # [s]
OTHERS_EVERY = 250  # steps between two looks for a second firmware


class Px4Link:
    """Connection to one PX4 SITL."""

    def __init__(self, setup: FirmwareSetup) -> None:
        """Store the configuration."""
        self._setup = setup
        self._own: Px4Setup = setup.own
        self.report = LinkReport("px4")
        self._sampler = Sampler(setup.own)
        self._program: Program | None = None
        self._connection: Connection | None = None
        self._status: FlightStatus | None = None
        self._client: MissionClient | None = None
        self._epoch = 0  # [us] of PX4's clock at tick 0
        self._last_us = 0  # [us] of the last message
        self._time = 0.0  # [s] of the simulation
        self._battery_at = 0.0  # [s] of the next message about the battery
        self._silent = 0  # consecutive steps without an answer
        self._motors: tuple[float, ...] = (0.0,) * OUTPUTS
        self._armed = False

    def open(self, waits: Waits) -> None:
        """Start or await PX4, and run it up to a full second of its clock."""
        self._setup, (self._connection, transport) = first_free(self._setup, INSTANCES, _claim)
        setup = self._setup
        items, parameters = uploaded(setup.plan), dict(setup.parameters)
        if setup.command:
            self._program = self._start(setup.instance)
            parameters = {}
        self._client = MissionClient(transport, CONVENTIONS, mission_messages(items, self._own.datum), parameters)
        self._status = FlightStatus("px4", self._client)
        self._connect(waits, self._patience(setup.start_timeout))
        self._epoch = -(-self._last_us // SECOND) * SECOND
        while self._last_us + self._step_us < self._epoch:
            self._rest(self._last_us // self._step_us)
            self._await(self._last_us, waits)
        self.report.late = 0  # answers to messages that were sent without waiting

    @property
    def _step_us(self) -> int:
        return self._setup.period * self._setup.interval_ns // 1000

    def _start(self, instance: int) -> Program:
        """Start the program, with parameters in its environment."""
        setup = self._setup
        arguments = () if "-i" in setup.command else ("-i", str(instance))
        own = {"SIM_BAT_ENABLE": 0.0} if self._own.battery else {}
        named = {f"PX4_PARAM_{name}": f"{value:.9g}" for name, value in {**own, **setup.parameters}.items()}
        return Program(setup._replace(environment={**named, **setup.environment}), arguments)

    def _connect(self, waits: Waits, patience: Patience) -> None:
        """Await a connection, and send messages of rest until the first answer."""
        link = self._connection
        assert link is not None
        while not link.accept():
            waits(f"px4 on {link.where}")
            self._check(patience, "no connection", "start px4 with PX4_SIM_MODEL=none_iris")
        count = 0
        while not self._answers(link.receive(wait=False)):
            if not link.connected:
                raise FirmwareError("px4: closed its connection while it started; see its output")
            self._rest(count)
            count += 1
            if count % 50 == 0:
                waits("px4 to send its first outputs")
                self._check(patience, "no HIL_ACTUATOR_CONTROLS", "check that pwm_out_sim runs")
            time.sleep(1e-6 * self._step_us)

    def _rest(self, count: int) -> None:
        """Send the next message of a vehicle at rest."""
        assert self._connection is not None
        self._last_us += self._step_us
        self._connection.send(at_rest(self._own, count, self._last_us))

    def step(self, tick: int, read: Read, waits: Waits) -> FirmwareOutput:
        """Send the readings at the tick, and wait for the outputs of the same time."""
        link, setup = self._connection, self._setup
        assert link is not None
        assert self._status is not None
        self._time = tick * setup.interval
        time_us = self._epoch + tick * setup.interval_ns // 1000
        messages, answered = self._sampler.messages(tick, time_us, read)
        self._last_us = time_us
        link.send(messages)
        if answered:
            self._await(time_us, waits)
        if tick // setup.period % OTHERS_EVERY == 0:
            self._look_for_others()
        self.report.rejected = link.rejected + link.refused
        self._status.poll(self._time)
        self.report.version = self._status.version
        if self._own.battery and self._time >= self._battery_at:
            self._battery_at = self._time + BATTERY_EVERY
            self._tell_battery(read(ports.BATTERY))
        return self._status.output(self._motors, running=self._armed)

    def _tell_battery(self, battery: BatteryReading) -> None:
        if self._client and math.isfinite(battery.charge):
            self._client.send_battery(battery.voltage, battery.current, battery.charge)

    def cpu(self) -> float:
        """Return the CPU time [s] of the program, 0 if somebody else has started it."""
        return self._program.cpu() if self._program else 0.0

    def close(self) -> None:
        """End the connections, and the program."""
        if self._client:
            self._client.close()
        if self._connection:
            self._connection.close()
        if self._program:
            self._program.close()
        self._program = self._connection = self._client = None

    def _await(self, time_us: int, waits: Waits) -> None:
        """Wait for the outputs of a time; go on without them if they do not come within a second."""
        link, report, begun = self._connection, self.report, time.perf_counter()
        assert link is not None
        patience: Patience | None = None
        while True:
            result = self._answers(link.receive())
            if result and result.time_us >= time_us:
                report.skew_max = max(report.skew_max, 1e-6 * (result.time_us - time_us))
                self._silent = 0
                break
            if result:
                report.late += 1
                continue
            waits("px4")
            patience = patience or self._patience(MISSED)
            if not link.connected:
                self._reconnect(waits)
                break
            self._check_program()
            if patience.over:
                report.missed += 1
                self._silent += 1
                if self._silent * MISSED >= self._setup.step_timeout:
                    self._fail(f"no HIL_ACTUATOR_CONTROLS for {self._setup.step_timeout:g} s", "check that it runs")
                break
        report.waiting += time.perf_counter() - begun

    def _reconnect(self, waits: Waits) -> None:
        """Await a firmware that is started again; the vehicle keeps its state, with its motors off."""
        if self._program:
            self._check_program()
            self._fail("it closed its connection", "see its output")
        self.report.note(f"PX4 closed its connection at t = {self._time:.3f} s")
        self._motors, self._armed = (0.0,) * OUTPUTS, False
        self._connect(waits, self._patience(self._setup.start_timeout))
        self.report.reconnected += 1
        self._epoch = self._last_us - round(self._time * 1e6)

    def _answers(self, messages: list[tuple[int, tuple]]) -> ActuatorControls | None:
        """Take in the outputs among messages. Return the newest."""
        result = None
        for number, values in messages:
            if number != HIL_ACTUATOR_CONTROLS.number:
                continue
            result = actuator_controls(values)
            if not result.lock_step:
                self._fail("it runs without lock step", "build px4_sitl_default")
            motors = result.controls[:OUTPUTS]
            if all(map(math.isfinite, motors)):
                self._motors, self._armed = motors, result.armed
            else:
                self.report.missed += 1
                self.report.note(f"non-finite outputs at t = {self._time:.3f} s; the last ones are held")
        return result

    def _look_for_others(self) -> None:
        link = self._connection
        assert link is not None
        before = link.refused
        link.refuse_others()
        if link.refused > before:
            self.report.note(f"a second PX4 tried to connect at t = {self._time:.3f} s")

    def _patience(self, timeout: float) -> Patience:
        return Patience(timeout, self._program.pid if self._program else None)

    def _check_program(self) -> None:
        if self._program:
            self._program.check(f" at t = {self._time:.3f} s")

    def _check(self, patience: Patience, what: str, advice: str) -> None:
        """Raise FirmwareError if the program has ended or the patience is over."""
        self._check_program()
        if patience.over:
            self._fail(f"{what} for {self._setup.start_timeout:g} s", advice)

    def _fail(self, what: str, advice: str) -> None:
        raise FirmwareError(f"px4: {what} at t = {self._time:.3f} s; {advice}")


def _claim(setup: FirmwareSetup) -> tuple[Connection, UdpTransport]:
    """Open the ports of an instance.

    Raises:
        FirmwareError: one is in use.
    """
    connection, port = Connection(setup.host, setup.port_at(PORT)), MAVLINK_PORT + setup.instance
    try:
        return connection, UdpTransport(setup.host, port)
    except OSError as error:
        connection.close()
        message = f"px4: cannot listen on udp {setup.host}:{port} ({error.strerror})"
        raise FirmwareError(f"{message}; end the other program, or set autopilot.instance") from None
