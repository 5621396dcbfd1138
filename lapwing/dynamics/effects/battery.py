"""Battery with state of charge and voltage sag."""

from typing import Annotated, NamedTuple

from annotated_types import Ge, Gt, Le

from lapwing.dynamics.effects._external_inputs import external, initial_state, input_or
from lapwing.dynamics.effects._from_scene import Airframe, reject, validate_table
from lapwing.dynamics.effects._hooks import battery_state, discrete_update, supply_voltage
from lapwing.dynamics.effects._rotor_sums import total
from lapwing.kernels import always_inline, math, python_function
from lapwing.kernels.codegen import map_tuple

KIND = "battery model"


class Settings(NamedTuple):
    """Scene table."""

    initial_charge: Annotated[float, Gt(0), Le(1)] = 1.0  # fraction of the capacity at the start
    cutoff_voltage: Annotated[float, Ge(2.5), Le(3.7)] = 3.0  # [V] per cell, below which the motors stay off


class Battery(NamedTuple):
    """Lithium-polymer cells in series: open-circuit voltage of the charge minus an ohmic drop (theory, eq. (2.10)).

    The battery voltage limits the motor voltages. Charge and voltage are updated once per
    communication step. Source: Chen and Rincon-Mora, IEEE Trans. Energy Conversion 21 (2006) 504, open-circuit
    curve; one ohmic resistance, without transient ones. Valid at room temperature, charge above a few per cent.
    """

    cells: float
    capacity: float  # [A s]
    resistance: float  # [ohm] of all cells
    initial_charge: float  # fraction
    cutoff_voltage: float  # [V] of all cells

    @classmethod
    def from_scene(cls, table: dict, airframe: Airframe) -> "Battery":
        """Return the parameters of the airframe's battery."""
        settings = validate_table(Settings, table)
        pack = airframe.battery or reject("the vehicle has no [battery]")
        resistance = pack.cells * pack.cell_resistance
        return cls(
            float(pack.cells), pack.capacity, resistance, settings.initial_charge, pack.cells * settings.cutoff_voltage
        )

    def initial_discrete_state(self) -> tuple[float, float, float]:
        """Return (charge, voltage [V] under load, current [A])."""
        return (self.initial_charge, self.cells * python_function(open_circuit_voltage)(self.initial_charge), 0.0)

    def with_inputs(self) -> "ExternalBattery":
        """Return the battery with named inputs."""
        return ExternalBattery(self)


class BatteryInputs(NamedTuple):
    """Named inputs of a battery; NaN: the battery computes it."""

    voltage: float = math.nan  # [V] of all cells under load
    charge: float = math.nan  # fraction of the capacity


@external
class ExternalBattery(NamedTuple):
    """Battery whose voltage or charge comes from an external model; the cut-off acts on that voltage."""

    own: Battery
    inputs: BatteryInputs = BatteryInputs()

    def initial_discrete_state(self) -> tuple:
        """Return the battery's own discrete state, and its inputs."""
        return initial_state(self)


@always_inline
def open_circuit_voltage(charge):
    """Return the voltage [V] of one cell at a charge between 0 and 1."""
    return -1.031 * math.exp(-35.0 * charge) + 3.685 + charge * (0.2156 + charge * (-0.1178 + charge * 0.3201))


@always_inline
def at_most(limit, voltage, _):
    """Return the lower of voltage and limit."""
    return min(voltage, limit)


@discrete_update(Battery)
def discharge(e, memory, s, rotors, key, tick, interval):
    """Return the discrete state after an interval at the motors' power."""
    charge, voltage, _ = memory
    if voltage == 0.0:
        return (charge, 0.0, 0.0)
    current = total(rotors.power) / voltage
    charge = max(charge - current * interval / e.capacity, 0.0)
    voltage = e.cells * open_circuit_voltage(charge) - e.resistance * current
    return (charge, voltage if voltage > e.cutoff_voltage else 0.0, current)


@supply_voltage(Battery)
def battery(e, memory, voltage):
    """Return the voltage [V] of each motor."""
    return map_tuple(at_most, memory[1], voltage, voltage)


@battery_state(Battery)
def read(e, memory):
    """Return charge, voltage [V] under load, current [A]; no temperature."""
    return memory[0], memory[1], memory[2], math.nan


@discrete_update(ExternalBattery)
def discharge_external(e, memory, s, rotors, key, tick, interval):
    """Return the discrete state after an interval, with the inputs in place of the battery's own numbers."""
    before, inputs = memory
    charge, own_voltage, current = discharge(e.own, before, s, rotors, key, tick, interval)
    voltage = input_or(own_voltage, inputs.voltage)
    is_on = before[1] != 0.0 and voltage > e.own.cutoff_voltage
    return (input_or(charge, inputs.charge), voltage if is_on else 0.0, current), inputs


@supply_voltage(ExternalBattery)
def external_battery(e, memory, voltage):
    """Return the voltage [V] of each motor."""
    return battery(e.own, memory[0], voltage)


@battery_state(ExternalBattery)
def read_external(e, memory):
    """Return charge, voltage [V] under load, current [A]; no temperature."""
    return read(e.own, memory[0])
