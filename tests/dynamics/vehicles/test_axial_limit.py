"""Rotors that cross the limit of `axial_inflow` within a step, against SciPy's DOP853 split at each crossing."""

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
from tests.combinations import rest_nightly

DRONE = load_airframe(Path(__file__).parents[3] / "lapwing/scenes/vehicles/delivery_drone.toml")
TICK, TOLERANCE = 0.004, 1e-9
BURSTS = ((20, (12.0, 15.0, 10.0, 18.0)), (20, (34.0, 30.0, 36.0, 32.0)))  # ticks, voltages [V]


def plant(wind):
    tables = {"axial_inflow": {}, "gravity": {}, "rotor_thrust": {}, "wind_constant": {"velocity": wind}}
    return multirotor.parameters(DRONE, effects.from_scene(tables, DRONE))._replace(tolerance=TOLERANCE)


def rate(p, volts, side, y):
    """Return Newton, Euler and the rotors' lag, `side` of each rotor: 0 within the limit, 1 or -1 beyond."""
    gravity, inflow, rotor, _ = p.effects
    R, o, speed = y[3:12].reshape(3, 3), y[15:18], y[18:]
    place = np.column_stack([p.layout.x_body, p.layout.y_body, p.layout.z_body])
    w = np.where(side == 0, advance_of(p, y), 0.5 * side * speed)
    thrust = STANDARD_DENSITY * (rotor.thrust_constant * speed**2 - inflow.thrust_constant * speed * w)
    drag = rotor.torque_constant * speed**2 - inflow.induced_torque_constant * w * (2.0 * speed - w)
    torque = np.cross(place, np.outer(thrust, (0.0, 0.0, 1.0))).sum(axis=0)
    torque[2] += STANDARD_DENSITY * np.dot(p.layout.reaction_sign, drag)
    omega_rate = (torque - np.cross(o, np.array(p.body.inertia) * o)) / p.body.inertia
    acceleration = R[:, 2] * thrust.sum() / p.body.mass - [0.0, 0.0, gravity.acceleration]
    lag = p.layout.lag_rate * (np.array(volts) * p.layout.speed_per_volt - speed)
    return np.concatenate([y[12:15], attitude_rate(y[3:12], o), acceleration, omega_rate, lag])


def advance_of(p, y):
    """Return the axial speed of each hub through the air, in turns over the pitch [rad/s]."""
    R, o = y[3:12].reshape(3, 3), y[15:18]
    place = np.column_stack([p.layout.x_body, p.layout.y_body, p.layout.z_body])
    past = R.T @ (y[12:15] - p.effects[3].velocity) + np.cross(o, place)
    return p.effects[1].turn_per_metre * past[:, 2]


def reference(p):
    """Return (coordinates at the end, number of crossings)."""
    y, crossings = of_state(START), 0
    side = np.where(np.abs(advance_of(p, y)) > 0.5 * y[18:], np.sign(advance_of(p, y)), 0)

    def crossing(k):
        def off(t, x):
            return abs(advance_of(p, x)[k]) - 0.5 * x[18 + k]

        off.terminal, off.direction = True, -1.0 if side[k] else 1.0
        return off

    for ticks, volts in BURSTS:
        t, end = 0.0, ticks * TICK
        while t < end:
            events = [crossing(k) for k in range(4)]
            part = solve_ivp(
                lambda _, x, volts=volts: rate(p, volts, side, x), (t, end), y, "DOP853",
                rtol=1e-13, atol=1e-14, events=events, max_step=1e-3,
            )  # fmt: skip
            t, y = part.t[-1], part.y[:, -1]
            for k in (k for k in range(4) if len(part.t_events[k])):
                side[k] = 0 if side[k] else np.sign(advance_of(p, y)[k])
                crossings += 1
    return y, crossings


@pytest.mark.long
@pytest.mark.parametrize("wind", [(0.5, -0.3, -5.5), (0.5, -0.3, 4.0)], ids=["from above", "from below"])
@pytest.mark.parametrize(("integrator", "steps"), rest_nightly(("rk4_renormalised", 4), ("rk8_renormalised", 1)))
def test_crossing_of_limit_is_as_accurate_as_tolerance(integrator, steps, wind):
    p = plant(wind)
    exact, crossings = reference(p)
    assert crossings >= 6
    state, method = multirotor.initial_state(p)._replace(motion=START), get(integrator).Method()
    for tick, volts in enumerate(volts for ticks, volts in BURSTS for _ in range(ticks)):
        state = multirotor.advance(method, p, (0, 0), tick, state, volts, TICK / steps, steps)
    assert error(of_state(state.motion), exact) < 30.0 * TOLERANCE
