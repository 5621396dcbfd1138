"""Failure injection blocks, direct motor control, and their ports."""

from collections.abc import Collection
from typing import Any

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.compiled_block import Block
from lapwing.cosim.diagram.tick_schedule import InputPort, Port
from lapwing.dynamics.noise import stream_key
from lapwing.kernels.cell import Cell
from lapwing.services.autopilot.failure_injection.battery_failures import BatteryInjection
from lapwing.services.autopilot.failure_injection.failure_state import DELAY, Memory
from lapwing.services.autopilot.failure_injection.imu_failures import ImuInjection
from lapwing.services.autopilot.failure_injection.motor_failures import DirectMotorControl, MotorInjection
from lapwing.services.autopilot.failure_injection.sensor_failures import SensorInjection
from lapwing.services.autopilot.motor import Motor
from lapwing.services.common import ports

_UNITS: dict[str, tuple[str, ...]] = {  # units of each sensor port; redundant IMUs have those of the first
    **dict.fromkeys(ports.IMUS, ()),
    ports.IMU: ("gyro", "accelerometer"),
    ports.MAGNETOMETER: ("magnetometer",),
    ports.BAROMETER: ("barometer",),
    ports.GPS: ("gps",),
    ports.SONAR: ("distance_sensor",),
    ports.RANGEFINDER: ("distance_sensor",),
    ports.OPTICAL_FLOW: ("optical_flow",),
    ports.AIRSPEED: ("airspeed",),
}


class Injection:
    """Failure injection of a run; inactive without a cell of `Faults`."""

    def __init__(self, faults: Cell | None, config: RunConfig, read: Collection[str], motor: Motor):
        """Create the injection; `read` has the names of the sensor ports that the autopilot reads."""
        self.faults, self._motor = faults, motor
        rotors = len(config.port(ports.ACTUATORS).example.motor_voltage)
        self.released = DirectMotorControl(False, (0.0,) * rotors)  # the controller's command reaches the motors
        self.direct = None if faults is None else Cell(self.released)
        self._config, self._ports = config, config.ports
        self._sensors = [name for name in _UNITS if name in read] if faults is not None else []

    @property
    def units(self) -> tuple[str, ...]:
        """Units that can fail."""
        if self.faults is None:
            return ()
        return (*[unit for name in self._sensors for unit in _UNITS[name]], "battery", "motor")

    def received(self, port: str) -> str:
        """Return the port on which the autopilot receives samples of `port`."""
        through = self.faults is not None and (port in self._sensors or port == ports.BATTERY)
        return f"{port}.received" if through else port

    def commanded(self, actuators: Port) -> Port:
        """Return the port that the controller writes."""
        return actuators if self.faults is None else actuators._replace(name=f"{actuators.name}.commanded")

    def before(self, name: str) -> list[Block]:
        """Return the blocks between sensors and estimator and after the battery."""
        blocks = []
        for port in self._sensors:
            sensor_port = self._ports[port]
            memory = Cell(Memory(sensor_port.example, 0))
            received_port = sensor_port._replace(name=self.received(port))
            key = stream_key(self._config.seed, self._config.vehicle, f"failure.{port}")
            late = sensor_port.period * max(1, round(DELAY / self._config.interval / sensor_port.period))
            inputs = InputPort(port), InputPort(port, late)
            parameters: Any = SensorInjection(self.faults, key)
            if port in ports.IMUS:
                parameters = ImuInjection(self.faults, key, ports.IMUS.index(port))
            blocks.append(
                Block(f"{name}.inject.{port}", parameters, memory, inputs, (received_port,), sensor_port.period)
            )
        if self.faults is not None:
            sensor_port = self._ports[ports.BATTERY]
            received_port = sensor_port._replace(name=self.received(ports.BATTERY))
            battery, memory = BatteryInjection(self.faults), Cell(sensor_port.example)
            reads = (InputPort(ports.BATTERY),)
            blocks.append(Block(f"{name}.inject.battery", battery, memory, reads, (received_port,), sensor_port.period))
        return blocks

    def after(self, name: str, actuators: Port) -> list[Block]:
        """Return the block between the controller and the motors."""
        if self.faults is None:
            return []
        inputs = (InputPort(self.commanded(actuators).name),)
        memory = Cell(Memory(actuators.example.motor_voltage, 0))
        parameters = MotorInjection(self.faults, self.direct, self._motor)
        return [Block(f"{name}.inject.motors", parameters, memory, inputs, (actuators,))]
