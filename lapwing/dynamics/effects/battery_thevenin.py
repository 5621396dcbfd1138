"""Battery with transient voltages and temperature; the motors restart when its voltage recovers."""

from typing import Annotated, NamedTuple

from annotated_types import Ge, Gt, Le

from lapwing.dynamics.atmosphere import temperature as air_temperature
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.effects._external_inputs import external, initial_state, input_or
from lapwing.dynamics.effects._from_scene import Airframe, reject, validate_table
from lapwing.dynamics.effects._hooks import battery, discrete_update, memory_rate
from lapwing.dynamics.effects._rotor_sums import total
from lapwing.dynamics.effects.battery import KIND, BatteryInputs, current_of, open_circuit_voltage, under_load
from lapwing.dynamics.environment import Environment
from lapwing.kernels import always_inline, math

__all__ = ["KIND", "OPTIONS", "BatteryThevenin", "Settings"]

REFERENCE = 298.15  # [K] at which resistances are stated
NOMINAL_VOLTAGE = 3.7  # [V] of a cell
OPTIONS = {"peukert_exponent": 1.05}  # value of a lithium-polymer pack, for `lapwing effects`
HEAT_PER_ENERGY = 1000.0 / (150.0 * 3600.0)  # [1/K] 1000 J/(kg K) over 150 W h/kg

Resistance = Annotated[float, Ge(0), Le(1)]
Time = Annotated[float, Ge(0.1), Le(1e4)]


class Settings(NamedTuple):
    """Scene table."""

    initial_charge: Annotated[float, Gt(0), Le(1)] = 1.0  # fraction of the capacity at the start
    cutoff_voltage: Annotated[float, Ge(2.5), Le(3.7)] = 3.0  # [V] of one cell, below which the controllers stop
    restart: Annotated[float, Ge(2.5), Le(4.2)] | None = None  # [V] above which they start again; never if left out
    transient_resistance: tuple[Resistance, Resistance] | None = None  # [ohm] of a cell; by its ohmic one if left out
    transient_time: tuple[Time, Time] = (32.9, 223.0)  # [s] of the two
    temperature: Annotated[float, Ge(233.15), Le(333.15)] | None = None  # [K] at the start; the air's if left out
    activation: Annotated[float, Ge(0), Le(1e4)] = 2400.0  # [K] resistances go with exp(activation / temperature)
    heat_capacity: Annotated[float, Gt(0), Le(1e6)] | None = None  # [J/K] of the pack; by its energy if left out
    cooling_time: Annotated[float, Ge(1), Le(1e6)] = 1800.0  # [s] in which it comes near the air's temperature
    peukert_exponent: Annotated[float, Ge(1), Le(2)] = 1.0  # n: I above 1 C drains as I (I / 1 C)^(n - 1)


class BatteryThevenin(NamedTuple):
    """Thevenin model: open-circuit voltage, an ohmic resistance and two RC elements in series (theory, eq. (2.34)).

    Resistances decrease as losses warm the pack. Source: Chen and Rincon-Mora, IEEE Trans. Energy Conversion 21
    (2006) 504: curve, ratios of the resistances and both time constants, above 20 % of charge; one thermal mass.
    Currents above 1 C use more charge by Peukert's law, if its exponent is given. The activation temperature, 20
    kJ/mol over the gas constant, and the cooling time are chosen. Valid from -20 to 60 degC. Charge, transients and
    temperature are integrated with the motion; cut-off and restart are decided once per communication step.
    """

    cells: float
    capacity: float  # [A s]
    resistance: float  # [ohm] ohmic, of all cells, at REFERENCE
    fast: float  # [ohm] of the first transient, of all cells
    slow: float  # [ohm] of the second
    fast_time: float  # [s]
    slow_time: float  # [s]
    initial_charge: float  # fraction
    cutoff_voltage: float  # [V] of all cells
    restart: float  # [V] of all cells, inf: never
    activation: float  # [K]
    heat_capacity: float  # [J/K]
    cooling_time: float  # [s]
    temperature: float = REFERENCE  # [K] at the start
    peukert_exponent: float = 1.0
    air_temperature: float = REFERENCE  # [K]
    given_temperature: bool = False  # True if the scene defines the initial temperature

    @classmethod
    def from_scene(cls, table: dict, airframe: Airframe) -> "BatteryThevenin":
        """Return the parameters of the airframe's battery."""
        settings = validate_table(Settings, table)
        pack = airframe.battery or reject("the vehicle has no [battery]")
        if settings.restart is not None and settings.restart <= settings.cutoff_voltage:
            raise ConfigError(
                "restart", f"got {settings.restart:g} V", f"more than cutoff_voltage = {settings.cutoff_voltage:g} V"
            )
        n, ohmic = pack.cells, pack.cell_resistance
        fast, slow = settings.transient_resistance or (0.627 * ohmic, 0.669 * ohmic)
        heat = settings.heat_capacity or n * NOMINAL_VOLTAGE * pack.capacity * HEAT_PER_ENERGY
        restart = math.inf if settings.restart is None else n * settings.restart
        return cls(
            float(n), pack.capacity, n * ohmic, n * fast, n * slow, *settings.transient_time, settings.initial_charge,
            n * settings.cutoff_voltage, restart, settings.activation, heat, settings.cooling_time,
            settings.temperature or REFERENCE, settings.peukert_exponent,
            given_temperature=settings.temperature is not None,
        )  # fmt: skip

    def in_environment(self, environment: Environment) -> "BatteryThevenin":
        """Return the battery at the air temperature at home."""
        air = float(air_temperature(environment.atmosphere, environment.home.height))
        return self._replace(air_temperature=air, temperature=self.temperature if self.given_temperature else air)

    def initial_discrete_state(self) -> tuple[float, float, float, float, float]:
        """Return (charge, temperature [K], voltage of each transient [V], 1: on, 0: cut off)."""
        return (self.initial_charge, self.temperature, 0.0, 0.0, 1.0)

    def with_inputs(self) -> "ExternalBatteryThevenin":
        """Return the battery with named inputs."""
        return ExternalBatteryThevenin(self)


@external
class ExternalBatteryThevenin(NamedTuple):
    """Battery whose voltage or charge comes from an external model; cut-off and restart act on that voltage."""

    own: BatteryThevenin
    inputs: BatteryInputs = BatteryInputs()

    def initial_discrete_state(self) -> tuple:
        """Return the battery's own discrete state, and its inputs."""
        return initial_state(self)


@always_inline
def _warmth(e, temperature):
    """Return the resistances over those at REFERENCE."""
    return math.exp(e.activation * (1.0 / temperature - 1.0 / REFERENCE))


@always_inline
def _voltage(e, memory, power):
    """Return the voltage [V] under a power [W], also while the controllers are off."""
    charge, temperature, fast, slow, _ = memory
    open_circuit = max(e.cells * open_circuit_voltage(charge) - fast - slow, 0.0)
    return under_load(open_circuit, _warmth(e, temperature) * e.resistance, power)


@always_inline
def _power(memory, rotors):
    """Return the power [W] of the motors; zero while the controllers are off."""
    return total(rotors.power) if memory[4] > 0.0 else 0.0


@always_inline
def _rates(e, memory, current):
    charge, temperature, fast, slow, _ = memory
    warmth = _warmth(e, temperature)
    drain = current
    rated = e.capacity / 3600.0  # [A] 1 C
    if e.peukert_exponent > 1.0 and current > rated:
        drain = current * math.pow(current / rated, e.peukert_exponent - 1.0)
    # the heat of the transients is that of the current through them, which is exact in the mean of a load
    heat = (warmth * e.resistance * current + fast + slow) * current
    return (
        -drain / e.capacity if charge > 0.0 else 0.0,
        heat / e.heat_capacity - (temperature - e.air_temperature) / e.cooling_time,
        (warmth * e.fast * current - fast) / e.fast_time,
        (warmth * e.slow * current - slow) / e.slow_time,
        0.0,
    )


@always_inline
def _switched(e, memory, voltage):
    """Return the discrete state with the controllers on or off by the battery's voltage [V]."""
    charge, temperature, fast, slow, on = memory
    return charge, temperature, fast, slow, 1.0 if voltage > (e.cutoff_voltage if on > 0.0 else e.restart) else 0.0


@memory_rate(BatteryThevenin)
def discharge(e, memory, s, rotors):
    """Return the rates of the discrete state."""
    power = _power(memory, rotors)
    return _rates(e, memory, current_of(_voltage(e, memory, power), power))


@discrete_update(BatteryThevenin)
def switch(e, memory, s, rotors, key, tick, interval):
    """Return the discrete state after cut-off or restart."""
    return _switched(e, memory, _voltage(e, memory, _power(memory, rotors)))


@battery(BatteryThevenin)
def battery_thevenin(e, memory, power):
    """Return the voltage [V] for the motors, zero while the controllers are off, and the battery's state."""
    is_on = memory[4] > 0.0
    power = power if is_on else 0.0
    voltage = _voltage(e, memory, power)
    state = max(memory[0], 0.0), voltage, current_of(voltage, power), memory[1]
    return voltage if is_on else 0.0, state


@always_inline
def _with_charge(memory):
    """Return the battery's own discrete state with the charge of the inputs."""
    (charge, temperature, fast, slow, on), inputs = memory
    return input_or(charge, inputs.charge), temperature, fast, slow, on


@always_inline
def _external_voltage(e, memory, power):
    """Return the voltage [V] under a power [W], or that of the inputs."""
    return max(input_or(_voltage(e.own, _with_charge(memory), power), memory[1].voltage), 0.0)


@memory_rate(ExternalBatteryThevenin)
def discharge_external(e, memory, s, rotors):
    """Return the rates of the battery's own discrete state."""
    power = _power(memory[0], rotors)
    return _rates(e.own, memory[0], current_of(_external_voltage(e, memory, power), power))


@discrete_update(ExternalBatteryThevenin)
def switch_external(e, memory, s, rotors, key, tick, interval):
    """Return the discrete state with the inputs' charge, after cut-off or restart."""
    voltage = _external_voltage(e, memory, _power(memory[0], rotors))
    return _switched(e.own, _with_charge(memory), voltage), memory[1]


@battery(ExternalBatteryThevenin)
def external_battery(e, memory, power):
    """Return the voltage [V] for the motors, zero while the controllers are off, and the battery's state."""
    is_on = memory[0][4] > 0.0
    power = power if is_on else 0.0
    voltage = _external_voltage(e, memory, power)
    state = max(_with_charge(memory)[0], 0.0), voltage, current_of(voltage, power), memory[0][1]
    return voltage if is_on else 0.0, state
