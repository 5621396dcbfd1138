"""Limits of `dc_motor` and `dynamic_inflow` crossed within a step, against SciPy's DOP853 split at each crossing."""

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from lapwing.dynamics import effects
from lapwing.dynamics.integrators import get
from lapwing.dynamics.vehicles import multirotor
from lapwing.dynamics.vehicles.airframe import load_airframe
from lapwing.dynamics.vehicles.multirotor_equations import STANDARD_DENSITY
from lapwing.studies.accuracy.coordinates import error, of_state
from lapwing.studies.accuracy.reference import attitude_rate
from lapwing.studies.accuracy.systems.multirotor import START

DRONE = load_airframe(Path(__file__).parents[3] / "lapwing/scenes/vehicles/delivery_drone.toml")
WEAK = DRONE.model_copy(update={"motor": DRONE.motor.model_copy(update={"peak_power": 1000.0})})
TICK, STEPS, TOLERANCE = 0.004, 4, 1e-9


def plant(frame, **tables):
    active = {"gravity": {}, "rotor_thrust": {}, **tables}
    return multirotor.parameters(frame, effects.from_scene(active, frame))._replace(tolerance=TOLERANCE)


def fly(p, start, commands):
    """Return (coordinates at the end, discrete state of the effect in each communication step)."""
    state, method, memories = multirotor.initial_state(p)._replace(motion=start), get("rk4_renormalised").Method(), []
    for tick, volts in enumerate(commands):
        state = multirotor.advance(method, p, (0, 0), tick, state, tuple(volts), TICK / STEPS, STEPS)
        memories.append(np.array(state.memory[1]))
    return of_state(state.motion), memories


def motion_rate(p, y, thrust, drag, acceleration):
    """Return Newton and Euler for loads at standard density, shape (4,) each, and the rotors' acceleration."""
    R, o = y[3:12].reshape(3, 3), y[15:18]
    place = np.column_stack([p.layout.x_body, p.layout.y_body, p.layout.z_body])
    torque = np.cross(place, np.outer(thrust, (0.0, 0.0, 1.0))).sum(axis=0)
    torque[2] += np.dot(p.layout.reaction_sign, drag)
    omega_rate = (torque - np.cross(o, np.array(p.body.inertia) * o)) / p.body.inertia
    linear = R[:, 2] * thrust.sum() / p.body.mass - [0.0, 0.0, p.effects[0].acceleration]
    return np.concatenate([y[12:15], attitude_rate(y[3:12], o), linear, omega_rate, acceleration])


class Motors:
    """Direct-current motors: three gaps of each rotor, to coasting, to a limit, and between its two limits."""

    def gaps(self, p, volts, memory, y, limited):
        e, speed = p.effects[1], y[18:]
        free = (np.array(volts) - e.motor_constant * speed) * e.inverse_resistance
        back = e.motor_constant * speed
        by_power = 2.0 * e.power_limit / (back + np.sqrt(back**2 + 4.0 * e.power_limit / e.inverse_resistance))
        limit = np.where(limited > 0.0, e.current_limit, by_power)
        return free - e.least_current, free - limit, by_power - e.current_limit

    def rate(self, p, volts, memory, side, y):
        e, rotor, speed = p.effects[1], p.effects[2], y[18:]
        above, over, limited = side
        free, excess, _ = self.gaps(p, volts, memory, y, limited)
        current = np.where(above < 0.0, e.least_current, free + e.least_current - np.where(over > 0.0, excess, 0.0))
        thrust, drag = (STANDARD_DENSITY * c * speed**2 for c in (rotor.thrust_constant, rotor.torque_constant))
        push = e.efficiency * e.motor_constant * (current - e.no_load_current)
        return motion_rate(p, y, thrust, drag, (push - drag) * e.inverse_inertia)


class Flow:
    """Flow through the rotors: two gaps of each rotor, to its lower and its upper limit."""

    def gaps(self, p, volts, memory, y, _):
        R, o, blades = y[3:12].reshape(3, 3), y[15:18], p.effects[1].pitch * y[18:]
        place = np.column_stack([p.layout.x_body, p.layout.y_body, p.layout.z_body])
        flow = (R.T @ (y[12:15] - p.effects[3].velocity) + np.cross(o, place))[:, 2] + memory
        return flow + 0.5 * blades, flow - 1.5 * blades

    def rate(self, p, volts, memory, side, y):
        e, rotor, speed = p.effects[1], p.effects[2], y[18:]
        high = self.gaps(p, volts, memory, y, None)[1]
        blades = e.pitch * speed
        flow = np.where(side[0] < 0.0, -0.5 * blades, np.where(side[1] > 0.0, 1.5 * blades, high + 1.5 * blades))
        lift = e.slope * (blades - flow)
        thrust = rotor.thrust_constant * speed**2 + e.slope * speed * (e.hover * speed - flow)
        drag = rotor.torque_constant * speed**2 + lift * flow - e.static * e.hover * speed**2
        lag = p.layout.lag_rate * (np.array(volts) * p.layout.speed_per_volt - speed)
        return motion_rate(p, y, STANDARD_DENSITY * thrust, STANDARD_DENSITY * drag, lag)


def reference(model, p, start, commands, memories):
    """Return (coordinates at the end, number of crossings)."""
    y, crossings = of_state(start), 0
    for volts, memory in zip(commands, memories, strict=True):
        limited = np.sign(model.gaps(p, volts, memory, y, np.zeros(4))[-1])
        side = np.sign(model.gaps(p, volts, memory, y, limited))
        t = 0.0
        while t < TICK:

            def crossing(i, k, side=side, volts=volts, memory=memory):
                def gap(_, x):
                    return model.gaps(p, volts, memory, x, side[-1])[i][k]

                gap.terminal, gap.direction = True, -side[i, k]
                return gap

            places = [(i, k) for i in range(len(side)) for k in range(4)]
            part = solve_ivp(
                lambda _, x, volts=volts, memory=memory, side=side: model.rate(p, volts, memory, side, x),
                (t, TICK), y, "DOP853", rtol=1e-12, atol=1e-13, events=[crossing(*place) for place in places],
            )  # fmt: skip
            t, y, side = part.t[-1], part.y[:, -1], side.copy()
            for place in (place for place, times in zip(places, part.t_events, strict=True) if len(times)):
                side[place] *= -1.0
                crossings += 1
    return y, crossings


@pytest.mark.parametrize("frame", [DRONE, WEAK], ids=["current", "power"])
def test_crossing_of_current_limit_is_as_accurate_as_tolerance(frame):
    p = plant(frame, dc_motor={})
    commands = np.repeat(np.random.default_rng(4).uniform(30.0, 42.0, (5, 4)), 8, axis=0)
    end, memories = fly(p, START, commands)
    exact, crossings = reference(Motors(), p, START, commands, memories)
    assert crossings >= 10
    assert error(end, exact) < 30.0 * TOLERANCE


@pytest.mark.parametrize("wind", [(0.5, -0.3, -12.0), (0.5, -0.3, 9.0)], ids=["from above", "from below"])
def test_crossing_of_flow_limit_is_as_accurate_as_tolerance(wind):
    p = plant(DRONE, dynamic_inflow={}, wind_constant={"velocity": wind})
    commands = np.repeat([(8.0, 11.0, 6.0, 14.0), (34.0, 30.0, 36.0, 32.0)], 20, axis=0)
    end, memories = fly(p, START, commands)
    exact, crossings = reference(Flow(), p, START, commands, memories)
    assert crossings >= 2
    assert error(end, exact) < 30.0 * TOLERANCE
