"""The parts that make failures, and the ports that carry what arrives."""

from collections.abc import Callable, Mapping
from typing import Any

from cosim.part import Part
from cosim.schedule import Input, Port
from dynamics.cell import Cell
from services.autopilot.injection.battery import BatteryInjection
from services.autopilot.injection.imu import ImuInjection
from services.autopilot.injection.memory import Memory
from services.autopilot.injection.motors import MotorInjection
from services.autopilot.injection.sensor import SensorInjection
from services.common import ports

_SENSORS: dict[str, Callable[[Any], Any]] = {
    ports.IMU: ImuInjection,
    ports.MAGNETOMETER: SensorInjection,
    ports.BAROMETER: SensorInjection,
    ports.GPS: SensorInjection,
    ports.SONAR: SensorInjection,
}
_UNITS = {
    ports.IMU: ("gyro", "accelerometer"),
    ports.MAGNETOMETER: ("magnetometer",),
    ports.BAROMETER: ("barometer",),
    ports.GPS: ("gps",),
    ports.SONAR: ("sonar",),
}


class Injection:
    """Where failures are injected in a run; without a cell of `Faults`, nowhere."""

    def __init__(self, faults: Cell | None, known: Mapping[str, Port], fuses: bool):
        """`known`: the ports of the run by name; `fuses`: the autopilot's estimator reads the sensors."""
        self.faults = faults
        self._known = known
        self._sensors = [name for name in _SENSORS if name in known] if fuses and faults is not None else []

    @property
    def units(self) -> tuple[str, ...]:
        """What can fail."""
        if self.faults is None:
            return ()
        return (*[unit for name in self._sensors for unit in _UNITS[name]], "battery", "motor")

    def received(self, port: str) -> str:
        """Name of the port on which the autopilot gets what is sent on another."""
        through = self.faults is not None and (port in self._sensors or port == ports.BATTERY)
        return f"{port}.received" if through else port

    def commanded(self, actuators: Port) -> Port:
        """The port that the controller writes, in place of that of the motors."""
        return actuators if self.faults is None else actuators._replace(name=f"{actuators.name}.commanded")

    def before(self, name: str) -> list[Part]:
        """The parts between sensors and estimator, and behind the battery."""
        found = []
        for port in self._sensors:
            known = self._known[port]
            memory = Cell(Memory(known.like, 0))
            given = known._replace(name=self.received(port))
            parameters = _SENSORS[port](self.faults)
            found.append(Part(f"{name}.inject.{port}", parameters, memory, (Input(port),), (given,), known.period))
        if self.faults is not None:
            known = self._known[ports.BATTERY]
            given = known._replace(name=self.received(ports.BATTERY))
            inputs = (Input(ports.BATTERY),)
            parameters = BatteryInjection(self.faults)
            found.append(Part(f"{name}.inject.battery", parameters, Cell(0.0), inputs, (given,), known.period))
        return found

    def after(self, name: str, actuators: Port) -> list[Part]:
        """The part between the controller and the motors."""
        if self.faults is None:
            return []
        inputs = (Input(self.commanded(actuators).name),)
        return [Part(f"{name}.inject.motors", MotorInjection(self.faults), Cell(0.0), inputs, (actuators,))]
