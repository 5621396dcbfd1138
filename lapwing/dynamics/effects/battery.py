"""Battery with state of charge and voltage sag."""

from typing import Annotated, NamedTuple

from annotated_types import Ge, Gt, Le

from lapwing.dynamics.effects._external_inputs import external, initial_state, input_or
from lapwing.dynamics.effects._from_scene import Airframe, reject, validate_table
from lapwing.dynamics.effects._hooks import battery, discrete_update, memory_rate
from lapwing.dynamics.effects._rotor_sums import total
from lapwing.kernels import always_inline, math

KIND = "battery model"


class Settings(NamedTuple):
    """Scene table."""

    initial_charge: Annotated[float, Gt(0), Le(1)] = 1.0  # fraction of the capacity at the start
    cutoff_voltage: Annotated[float, Ge(2.5), Le(3.7)] = 3.0  # [V] per cell, below which the motors stay off


class Battery(NamedTuple):
    """Lithium-polymer cells in series: open-circuit voltage of the charge minus an ohmic drop (theory, eq. (2.10)).

    The battery voltage limits the motor voltages. The charge is integrated with the motion, and the voltage solved
    with the motors' power at every evaluation; the cut-off is decided once per communication step. Source: Chen and
    Rincon-Mora, IEEE Trans. Energy Conversion 21 (2006) 504, open-circuit curve; one ohmic resistance, without
    transient ones. Valid at room temperature, charge above a few per cent.
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

    def initial_discrete_state(self) -> tuple[float, float]:
        """Return (charge, 1: on, 0: cut off)."""
        return (self.initial_charge, 1.0)

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
def under_load(open_circuit, resistance, power):
    """Return the voltage [V] under a power [W]: the greater root of V = E - R P / V; E / 2 beyond the largest power."""
    return 0.5 * (open_circuit + math.sqrt(max(open_circuit * open_circuit - 4.0 * resistance * power, 0.0)))


@always_inline
def current_of(voltage, power):
    """Return the current [A] at a power [W]; zero with the battery off."""
    return power / voltage if voltage > 0.0 else 0.0


@always_inline
def _voltage(e, memory, power):
    """Return the voltage [V] under a power [W]; zero after the cut-off."""
    charge, on = memory
    return under_load(e.cells * open_circuit_voltage(charge), e.resistance, power) if on > 0.0 else 0.0


@memory_rate(Battery)
def discharge(e, memory, s, rotors):
    """Return the rates of charge [1/s] and switch."""
    power = total(rotors.power)
    return _discharge(e, memory[0], current_of(_voltage(e, memory, power), power))


@always_inline
def _discharge(e, charge, current):
    return (-current / e.capacity if charge > 0.0 else 0.0, 0.0)


@discrete_update(Battery)
def cut_off(e, memory, s, rotors, key, tick, interval):
    """Return the discrete state with the battery off for good if its voltage is too low."""
    charge, _ = memory
    return (charge, 1.0 if _voltage(e, memory, total(rotors.power)) > e.cutoff_voltage else 0.0)


@battery(Battery)
def read(e, memory, power):
    """Return the voltage [V] under a power [W], and (charge, voltage, current [A], no temperature)."""
    voltage = _voltage(e, memory, power)
    return voltage, (max(memory[0], 0.0), voltage, current_of(voltage, power), math.nan)


@always_inline
def _with_charge(memory):
    """Return the battery's own discrete state with the charge of the inputs."""
    (charge, on), inputs = memory
    return input_or(charge, inputs.charge), on


@always_inline
def _external_voltage(e, memory, power):
    """Return the voltage [V] under a power [W], or that of the inputs; zero after the cut-off."""
    own, inputs = _with_charge(memory), memory[1]
    return input_or(_voltage(e.own, own, power), inputs.voltage) if own[1] > 0.0 else 0.0


@memory_rate(ExternalBattery)
def discharge_external(e, memory, s, rotors):
    """Return the rates of the battery's own charge [1/s] and switch."""
    power = total(rotors.power)
    return _discharge(e.own, memory[0][0], current_of(_external_voltage(e, memory, power), power))


@discrete_update(ExternalBattery)
def cut_off_external(e, memory, s, rotors, key, tick, interval):
    """Return the discrete state with the inputs' charge, and off for good if the voltage is too low."""
    is_on = _external_voltage(e, memory, total(rotors.power)) > e.own.cutoff_voltage
    return (_with_charge(memory)[0], 1.0 if is_on else 0.0), memory[1]


@battery(ExternalBattery)
def read_external(e, memory, power):
    """Return the voltage [V] under a power [W], and (charge, voltage, current [A], no temperature)."""
    voltage = _external_voltage(e, memory, power)
    return voltage, (max(_with_charge(memory)[0], 0.0), voltage, current_of(voltage, power), math.nan)
