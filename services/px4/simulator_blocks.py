"""Blocks that replace plant and sensors by an external simulator: readings before the autopilot, controls after it."""

import time
from typing import Any, NamedTuple

from lapwing.cosim.diagram.block_diagram import NEVER, BlockDiagram
from lapwing.cosim.diagram.tick_schedule import InputPort, Port
from lapwing.dynamics.geodesy import Home, geodetic_to_enu
from lapwing.kernels import python_function
from lapwing.services.common import ports
from lapwing.services.common.firmware.link import FirmwareError, Waits
from lapwing.services.px4.messages import HIL_SENSOR
from lapwing.services.px4.simulator_client import SimulatorClient
from lapwing.services.px4.simulator_readings import readings

NAME = "simulator"
TOLERANCE = 0.01  # relative difference between the simulator's step and that of the scene's IMU
MAX_DISTANCE = 1000.0  # [m] from the scene's home to a fix, north or east
_to_enu = python_function(geodetic_to_enu)


class SimulatorSetup(NamedTuple):
    """Configuration of the simulator's link."""

    host: str
    port: int
    nominal: dict[str, Any]  # reading by port, with the variances of the scene's sensors
    order: tuple[int, ...]  # for each rotor of the airframe the number of PX4's output
    voltage_max: float  # [V] of the battery, the full output
    home: Home
    interval_ns: int
    imu_every: int  # [ticks] between two HIL_SENSOR
    start_timeout: float  # [s] until the simulator listens
    step_timeout: float  # [s] of silence after which it has stalled


class Receiver:
    """Block that waits for the readings of a tick and writes them to the ports."""

    def __init__(self, setup: SimulatorSetup, client: SimulatorClient, outputs: tuple[Port, ...]):
        """Create the block; `outputs` are the ports of the readings and of the battery."""
        self.name, self.outputs = f"{NAME}.receive", outputs
        self.time_us = 0  # [us] time of the last HIL_SENSOR
        self._setup, self._client = setup, client
        self._waits: Waits = lambda text: None
        self._epoch = self._last = -1  # [us]
        self._pending: dict[str, Any] = {}  # readings that are not yet due
        self._start = 0.0

    def bind(self, graph: BlockDiagram) -> None:
        """Store the diagram."""
        self._graph = graph

    def open(self, waits: Waits) -> None:
        """Connect, before the first tick."""
        self._waits = waits
        self._client.open(waits, self._setup.start_timeout)

    def close(self) -> None:
        """Close the connection."""
        self._client.close()

    @property
    def reports(self) -> dict[str, str]:
        """Entries of the log's metadata."""
        report = self._client.report
        notes = {"firmware_notes": "; ".join(report.notes)} if report.notes else {}
        return {"firmware": str(report), "external": NAME, **notes}

    def on_tick(self, tick: int) -> int:
        """Write the readings of `tick`, or end the run if the simulator has disconnected."""
        setup, report = self._setup, self._client.report
        self._start = self._start or time.perf_counter()
        if tick % setup.imu_every == 0 and not self._step(tick):
            report.note(f"the simulator closed its connection at t = {1e-9 * tick * setup.interval_ns:.3f} s")
            self._graph.finish()
        for port in self.outputs:
            if port.name in setup.nominal and tick % port.period == 0:
                reading = self._pending.pop(port.name, None)
                self._graph.put(port.name, tick, reading or setup.nominal[port.name])
            elif port.name == ports.BATTERY:
                self._graph.put(port.name, tick, ports.BatteryReading(float("nan"), setup.voltage_max))
        report.wall = time.perf_counter() - self._start
        return tick + 1

    def _step(self, tick: int) -> bool:
        """Process the messages up to the HIL_SENSOR of a new time. Return False if the simulator has disconnected."""
        setup, report = self._setup, self._client.report
        at = f"at t = {1e-9 * tick * setup.interval_ns:.3f} s"
        while True:
            messages = self._client.receive(self._waits, setup.step_timeout, at)
            if messages is None:
                return False
            for number, values in messages:
                self._pending |= readings(number, values, setup.nominal)
            self.time_us = next(values[0] for number, values in reversed(messages) if number == HIL_SENSOR.number)
            if tick == 0 or self.time_us != self._last:
                break
            report.resent += 1
            self._client.repeat()
        self._check_time(tick, at)
        if fix := self._pending.get(ports.GPS):
            self._check_position(fix)
        report.steps += 1
        return True

    def _check_time(self, tick: int, at: str) -> None:
        """Compare the simulator's time with that of the tick."""
        setup, report = self._setup, self._client.report
        before, self._last = self._last, self.time_us
        step = setup.imu_every * setup.interval_ns // 1000
        if tick == setup.imu_every and abs(self.time_us - before - step) > TOLERANCE * step:
            text = 1e-3 * (self.time_us - before)
            message = f"simulator: it steps by {text:g} ms, the scene's IMU by {1e-3 * step:g} ms"
            raise FirmwareError(f"{message}; set communication.rate and sensors.imu.rate to the simulator's rate")
        expected = self._epoch + tick * setup.interval_ns // 1000
        if tick == 0 or self.time_us < before:
            if tick > 0:
                report.note(f"the simulator's time decreased {at}: it has restarted")
                report.reconnected += 1
            self._epoch = self.time_us - tick * setup.interval_ns // 1000
            return
        lost = round((self.time_us - expected) / step)
        if lost > 0:
            report.missed += lost
            self._epoch += lost * step
            expected += lost * step
        report.skew_max = max(report.skew_max, 1e-6 * abs(self.time_us - expected))

    def _check_position(self, fix: Any) -> None:
        """Raise FirmwareError if a fix is far from the scene's home."""
        home = self._setup.home
        east, north, _ = _to_enu(home, fix.latitude_deg, fix.longitude_deg, fix.height)
        if max(abs(east), abs(north)) > MAX_DISTANCE:
            text = f"{fix.latitude_deg:.6f}, {fix.longitude_deg:.6f}, {fix.height:.1f}"
            message = f"simulator: it is at {text} (degrees, metres), over {MAX_DISTANCE:g} m from the scene's home"
            raise FirmwareError(f"{message}; set environment.home to the simulator's")


class Sender:
    """Block that sends the motor commands of a tick to the simulator."""

    outputs = ()

    def __init__(self, setup: SimulatorSetup, client: SimulatorClient, receiver: Receiver):
        """Create the block; `receiver` has the time of the answer."""
        self.name, self.inputs = f"{NAME}.send", (InputPort(ports.ACTUATORS),)
        self._setup, self._client, self._receiver = setup, client, receiver

    def bind(self, graph: BlockDiagram) -> None:
        """Store the diagram."""
        self._graph = graph

    def on_tick(self, tick: int) -> int:
        """Send the controls at `tick`. Return the tick of the next answer."""
        if self._graph.ended:
            return NEVER
        command = self._graph.latest(ports.ACTUATORS, tick)
        controls = [0.0] * len(command.motor_voltage)
        for rotor, output in enumerate(self._setup.order):
            share = command.motor_voltage[rotor] / self._setup.voltage_max
            controls[output] = min(max(share, 0.0), 1.0) if command.armed else 0.0
        self._client.answer(self._receiver.time_us, tuple(controls), bool(command.armed))
        return tick + self._setup.imu_every
