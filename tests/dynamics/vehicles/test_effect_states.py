"""States of effects against their continuous equations: SciPy's DOP853 for a climb with steps of the voltage.

The equations are written here for a vertical climb with four equal rotors. Commands change every 8 ms at any
communication rate, so all rates have the same solution.
"""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from lapwing.dynamics import effects
from lapwing.dynamics.atmosphere import Atmosphere
from lapwing.dynamics.atmosphere import temperature as air_temperature
from lapwing.dynamics.geodesy import Home
from lapwing.dynamics.integrators import get
from lapwing.dynamics.vehicles import multirotor
from lapwing.dynamics.vehicles.airframe import load_airframe
from lapwing.dynamics.vehicles.propeller import thrust_constant, torque_coefficient

pytestmark = [pytest.mark.usefixtures("uncompiled"), pytest.mark.long]

DRONE = load_airframe(Path(__file__).parents[3] / "lapwing/scenes/vehicles/delivery_drone.toml")
DENSITY, GRAVITY = 1.225, 9.80665
RATES = (250, 500, 1000)  # [Hz] of communication
HELD, DURATION = 0.008, 0.048  # [s] of a command, of the climb
STEP = 0.001  # [s]
BAR = 1e-5  # of held quantities, with 1e-6 asked of the solver
CLIMB, SPIN = 2.0, 330.0  # [m/s], [rad/s] at the start


def volts(t):
    """Return the command [V] from t [s] on."""
    return (34.0, 41.0, 31.0, 38.0, 42.0, 35.0)[int(t / HELD + 1e-6)]


def fly(rate, step, **tables):
    """Return (climb [m/s], rotor speed [rad/s], discrete state of the first of `tables`) at the end of the climb."""
    named = {"gravity": {}, "rotor_thrust": {}, **tables}
    p = multirotor.parameters(DRONE, effects.from_scene(named, DRONE))
    state = multirotor.initial_state(p, rotor_speed=SPIN, velocity_world=(0.0, 0.0, CLIMB))
    steps = round(1.0 / (rate * step))
    for tick in range(round(DURATION * rate)):
        command = (volts(tick / rate),) * 4
        state = multirotor.advance(get("rk4").Method(), p, (0, 0), tick, state, command, 1.0 / rate / steps, steps)
    first = next(i for i, e in enumerate(p.effects) if type(e).__module__.endswith(f".{next(iter(tables))}"))
    return np.array([state.motion.velocity_world[2], state.motion.rotor_speed[0]]), state.memory[first]


def solve(rate_of, start):
    """Return the solution of y' = rate_of(y, command) at the end of the climb."""
    y = np.array(start)
    for k in range(round(DURATION / HELD)):
        command = volts(k * HELD)
        part = solve_ivp(
            lambda t, y, command=command: rate_of(y, command), (0.0, HELD), y, "DOP853", rtol=1e-12, atol=1e-13
        )
        y = part.y[:, -1]
    return y


def lag(speed, voltage):
    return (voltage / DRONE.motor.rotor_constant - speed) / DRONE.motor.time_constant


def relative(value, exact):
    return abs(np.array(value) - exact).max() / abs(np.array(exact)).max()


def climb_with_inflow(y, voltage):
    """Return the rate of (climb, rotor speed, induced velocity): blades, momentum theory and the mass of the air."""
    climb, speed, induced = y
    propeller = DRONE.propeller
    radius, pitch = 0.5 * propeller.diameter, propeller.pitch / (2.0 * math.pi)
    area, kappa = math.pi * radius**2, propeller.induced_power_factor
    static = thrust_constant(propeller)
    slope = static / (pitch - kappa * math.sqrt(0.5 * static / area))
    thrust = DENSITY * slope * speed * (pitch * speed - climb - induced)
    hover = math.sqrt(thrust / (2.0 * DENSITY * area))
    steady = kappa * (math.sqrt(0.25 * climb**2 + hover**2) - 0.5 * climb)
    air = 0.637 * 4.0 / 3.0 * math.pi * DENSITY * radius**3
    return (
        4.0 * thrust / DRONE.mass.total - GRAVITY,
        lag(speed, voltage),
        4.0 * DENSITY * area * hover / (air * kappa) * (steady - induced),
    )


@pytest.mark.parametrize("rate", RATES)
def test_inflow_of_climb_solves_its_equation_at_any_rate(rate):
    exact = solve(climb_with_inflow, (CLIMB, SPIN, 0.0))
    motion, induced = fly(rate, STEP, dynamic_inflow={})
    assert relative(motion[0], exact[0]) < 0.1 * BAR
    assert relative(induced[0], exact[2]) < 0.1 * BAR


def test_inflow_has_order_of_integrator():
    exact = solve(climb_with_inflow, (CLIMB, SPIN, 0.0))
    coarse, fine = (relative(fly(250, step, dynamic_inflow={})[0][0], exact[0]) for step in (0.002, 0.001))
    assert coarse / fine > 10.0  # 16 of order 4


def under_load(y, voltage, cell, resistance, lost=0.0):
    """Return (supply [V], power [W]) of rotors at y = (climb, speed, charge, ...) whose voltage the battery limits."""
    speed, charge = y[1:3]
    torque = DENSITY * torque_constant() * speed**2
    draw = 4.0 * (torque / DRONE.motor.rotor_constant + DRONE.motor.no_load_current)  # [A] of motors at full duty
    open_circuit = DRONE.battery.cells * cell(charge) - lost
    saturated = open_circuit - resistance * draw
    if voltage > saturated:
        return saturated, saturated * draw
    return 0.5 * (open_circuit + math.sqrt(open_circuit**2 - 4.0 * resistance * voltage * draw)), voltage * draw


def torque_constant():
    return torque_coefficient(DRONE.propeller) * DRONE.propeller.diameter**5 / (2.0 * math.pi) ** 2


def open_circuit(charge):
    """Return the voltage of a cell: Chen and Rincon-Mora (2006), eq. (2)."""
    return -1.031 * math.exp(-35.0 * charge) + 3.685 + 0.2156 * charge - 0.1178 * charge**2 + 0.3201 * charge**3


def climb_rates(y, voltage, supply):
    thrust = DENSITY * thrust_constant(DRONE.propeller) * y[1] ** 2
    return 4.0 * thrust / DRONE.mass.total - GRAVITY, lag(y[1], min(voltage, supply))


def climb_with_battery(y, voltage):
    """Return the rate of (climb, rotor speed, charge)."""
    pack = DRONE.battery
    supply, power = under_load(y, voltage, open_circuit, pack.cells * pack.cell_resistance)
    return *climb_rates(y, voltage, supply), -power / supply / pack.capacity


def climb_with_thevenin(y, voltage):
    """Return the rate of (climb, rotor speed, charge, temperature, two transients), with the constants given below."""
    pack, (temperature, fast, slow) = DRONE.battery, y[3:]
    ohmic = pack.cells * pack.cell_resistance * math.exp(2400.0 * (1.0 / temperature - 1.0 / 298.15))
    supply, power = under_load(y, voltage, open_circuit, ohmic, fast + slow)
    current = power / supply
    return (
        *climb_rates(y, voltage, supply),
        -current / pack.capacity,
        (ohmic * current + fast + slow) * current / 500.0 - (temperature - AIR) / 1800.0,
        (2.0 * ohmic * current - fast) / 0.1,
        (ohmic * current - slow) / 1.0,
    )


AIR, COLD = air_temperature(Atmosphere(), Home().height), 278.0  # [K] of the air at home, of the pack at the start
LOW = 0.15  # charge at which the battery limits the higher voltages
THEVENIN = {"transient_resistance": (0.004, 0.002), "transient_time": (0.1, 1.0), "heat_capacity": 500.0,
            "temperature": COLD, "initial_charge": LOW}  # fmt: skip


@pytest.mark.parametrize("rate", RATES)
def test_charge_and_sag_of_battery_solve_their_equation_at_any_rate(rate):
    exact = solve(climb_with_battery, (CLIMB, SPIN, LOW))
    motion, (charge, _) = fly(rate, STEP, battery={"initial_charge": LOW})
    assert relative(motion[0], exact[0]) < BAR
    assert relative(motion[1], exact[1]) < BAR
    assert relative(LOW - charge, LOW - exact[2]) < BAR


@pytest.mark.parametrize("rate", RATES)
def test_states_of_thevenin_battery_solve_their_equation_at_any_rate(rate):
    exact = solve(climb_with_thevenin, (CLIMB, SPIN, LOW, COLD, 0.0, 0.0))
    motion, (charge, temperature, fast, slow, _) = fly(rate, STEP, battery_thevenin=THEVENIN)
    assert relative(motion[0], exact[0]) < BAR
    assert relative(motion[1], exact[1]) < BAR
    assert relative(LOW - charge, LOW - exact[2]) < BAR
    assert relative(temperature - COLD, exact[3] - COLD) < BAR
    assert relative([fast, slow], exact[4:]) < BAR
