"""Limits of `dc_motor` and `dynamic_inflow` crossed within a step, against SciPy's DOP853 split at each crossing."""

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from lapwing.dynamics import effects
from lapwing.dynamics.integrators import get
from lapwing.dynamics.vehicles import multirotor
from lapwing.dynamics.vehicles.airframe import load_airframe
from lapwing.dynamics.vehicles.inflow import induced_velocity
from lapwing.dynamics.vehicles.multirotor_equations import STANDARD_DENSITY
from lapwing.studies.accuracy.coordinates import error, of_state
from lapwing.studies.accuracy.reference import attitude_rate
from lapwing.studies.accuracy.systems.multirotor import START
from tests.combinations import rest_nightly

DRONE = load_airframe(Path(__file__).parents[3] / "lapwing/scenes/vehicles/delivery_drone.toml")
WEAK = DRONE.model_copy(update={"motor": DRONE.motor.model_copy(update={"peak_power": 1000.0})})
pytestmark = pytest.mark.long  # compilation of four plants

TICK, STEPS, TOLERANCE = 0.004, 4, 1e-9
SOON, LONGEST = 1e-9, 1e-4  # [s] a current may cross a limit twice within 0.5 ms


def plant(frame, **tables):
    active = {"gravity": {}, "rotor_thrust": {}, **tables}
    return multirotor.parameters(frame, effects.from_scene(active, frame))._replace(tolerance=TOLERANCE)


def effect(p, name):
    """Return the effect of a class, or None."""
    return next((e for e in p.effects if type(e).__name__ == name), None)


def fly(p, start, commands):
    """Return the coordinates at the end."""
    state, method = multirotor.initial_state(p)._replace(motion=start), get("rk4_renormalised").Method()
    for tick, volts in enumerate(commands):
        state = multirotor.advance(method, p, (0, 0), tick, state, tuple(volts), TICK / STEPS, STEPS)
    return of_state(state.motion)


def rotor_places(p):
    return np.column_stack([p.layout.x_body, p.layout.y_body, p.layout.z_body])


class Flow:
    """Flow through the rotors: two gaps of each rotor, to its lower and its upper limit; y[22:] is induced."""

    def __init__(self, p):
        self.p, self.e, self.rotor = p, effect(p, "DynamicInflow"), effect(p, "RotorThrust")

    def hub_air(self, y):
        R, o = y[3:12].reshape(3, 3), y[15:18]
        return R.T @ (y[12:15] - effect(self.p, "WindConstant").velocity) + np.cross(o, rotor_places(self.p))

    def gaps(self, y):
        if self.e is None:
            return np.empty((0, 4))
        blades, through = self.e.pitch * y[18:22], self.hub_air(y)[:, 2] + y[22:]
        return np.array([through + 0.5 * blades, through - 1.5 * blades])

    def rate(self, side, y):
        """Return the rate of the induced velocities [m/s^2]."""
        if self.e is None:
            return np.empty(0)
        e, speed, air = self.e, y[18:22], self.hub_air(y)
        hover = np.sqrt(np.maximum(0.5 * e.slope / e.area * speed * (e.pitch * speed - self.through(side, y)), 1e-6))
        climb, across = air[:, 2] / hover, np.hypot(air[:, 0], air[:, 1]) / hover
        steady = hover * [induced_velocity.py_func(*both, e.kappa) for both in zip(climb, across, strict=True)]
        return 4.0 * e.area * hover / (e.mass * e.kappa) * (steady - y[22:])

    def through(self, side, y):
        """Return the flow through the discs [m/s] within its limits."""
        blades = self.e.pitch * y[18:22]
        flow = self.gaps(y)[1] + 1.5 * blades
        return np.where(side[0] < 0.0, -0.5 * blades, np.where(side[1] > 0.0, 1.5 * blades, flow))

    def loads(self, side, y):
        """Return (thrust [N], torque [N m]) of the rotors, shape (4,) each."""
        e, speed = self.e, y[18:22]
        thrust, drag = self.rotor.thrust_constant * speed**2, self.rotor.torque_constant * speed**2
        if e is not None:
            blades = e.pitch * speed
            flow = self.through(side, y)
            thrust = thrust + e.slope * speed * (e.hover * speed - flow)
            drag = drag + e.slope * (blades - flow) * flow - e.static * e.hover * speed**2
        return STANDARD_DENSITY * thrust, STANDARD_DENSITY * drag


class Lag:
    """Rotors that follow the voltage with a lag."""

    def __init__(self, p):
        self.layout = p.layout

    def set_voltage(self, volts, y, drag):
        self.volts = np.array(volts)

    def gaps(self, t, y, drag, side):
        return np.empty((0, 4))

    def rate(self, t, y, drag, side):
        return self.layout.lag_rate * (self.volts * self.layout.speed_per_volt - y[18:22])


class Motors:
    """Direct-current motors: three gaps of each rotor, to the lowest current, to a limit, and between its two limits.

    A winding with inductance has the current of theory, eq. (2.76).
    """

    def __init__(self, p):
        self.e, self.volts, self.transient = effect(p, "DcMotor"), np.zeros(4), np.zeros(4)
        self.lag, self.inverse_inertia, self.decay = self.e.winding or (0.0, 0.0, 0.0)

    def set_voltage(self, volts, y, drag):
        """Continue the current, TICK after the last change of the voltage."""
        current = self.before_limits(TICK, y, drag)
        current = np.minimum(np.maximum(current, self.e.least_current), np.minimum(self.e.current_limit, self.power(y)))
        self.volts, self.transient = np.array(volts), np.zeros(4)
        self.transient = (current - self.before_limits(0.0, y, drag)) * bool(self.e.winding)

    def before_limits(self, t, y, drag):
        free = (self.volts - self.e.motor_constant * y[18:22]) * self.e.inverse_resistance
        push = self.e.efficiency * self.e.motor_constant * (free - self.e.no_load_current)
        return free + self.lag * self.inverse_inertia * (push - drag) + np.exp(-self.decay * t) * self.transient

    def power(self, y):
        """Return the current at the limit of the power [A]."""
        back = self.e.motor_constant * y[18:22]
        return (
            2.0 * self.e.power_limit / (back + np.sqrt(back**2 + 4.0 * self.e.power_limit / self.e.inverse_resistance))
        )

    def gaps(self, t, y, drag, side):
        current, by_power = self.before_limits(t, y, drag), self.power(y)
        limit = np.where(side[2] > 0.0, self.e.current_limit, by_power)
        return np.array([current - self.e.least_current, current - limit, by_power - self.e.current_limit])

    def rate(self, t, y, drag, side):
        e = self.e
        above, over, _ = self.gaps(t, y, drag, side)
        current = np.where(side[0] < 0.0, e.least_current, above + e.least_current - np.where(side[1] > 0.0, over, 0.0))
        return (e.efficiency * e.motor_constant * (current - e.no_load_current) - drag) * e.inverse_inertia


def motion_rate(p, y, thrust, drag, acceleration):
    """Return Newton and Euler for loads of the rotors, shape (4,) each, and the rotors' acceleration."""
    R, o = y[3:12].reshape(3, 3), y[15:18]
    torque = np.cross(rotor_places(p), np.outer(thrust, (0.0, 0.0, 1.0))).sum(axis=0)
    torque[2] += np.dot(p.layout.reaction_sign, drag)
    omega_rate = (torque - np.cross(o, np.array(p.body.inertia) * o)) / p.body.inertia
    linear = R[:, 2] * thrust.sum() / p.body.mass - [0.0, 0.0, effect(p, "Gravity").acceleration]
    return np.concatenate([y[12:15], attitude_rate(y[3:12], o), linear, omega_rate, acceleration])


def reference(p, start, commands):
    """Return (coordinates at the end, number of crossings of a limit by the motors, and by the flow)."""
    flow, motor = Flow(p), (Motors if effect(p, "DcMotor") else Lag)(p)
    y, crossings = np.append(of_state(start), np.zeros(4 if flow.e else 0)), [0, 0]
    motor_rows = len(motor.gaps(0.0, y, np.zeros(4), np.zeros((3, 4))))

    def gaps(t, x, side):
        of_motor, of_flow = side[:motor_rows], side[motor_rows:]
        drag = flow.loads(of_flow, x)[1]
        return np.vstack([motor.gaps(t, x, drag, of_motor), flow.gaps(x)])

    def rate(t, x, side):
        of_motor, of_flow = side[:motor_rows], side[motor_rows:]
        thrust, drag = flow.loads(of_flow, x)
        motion = motion_rate(p, x, thrust, drag, motor.rate(t, x, drag, of_motor))
        return np.append(motion, flow.rate(of_flow, x))

    for volts in commands:
        through = np.sign(flow.gaps(y))
        motor.set_voltage(volts, y, flow.loads(through, y)[1])
        side = np.vstack([np.zeros((motor_rows, 4)), through])
        for _ in range(2):  # the limit of a current depends on which limit is lower
            later = y + SOON * rate(0.0, y, side)  # at the start a current may be at its limit
            side = np.sign(gaps(SOON, later, side))
        t, y = SOON, later
        while t < TICK:

            def crossing(i, k, side=side):
                def gap(time, x):
                    return gaps(time, x, side)[i, k]

                gap.terminal, gap.direction = True, -side[i, k]
                return gap

            places = [(i, k) for i in range(len(side)) for k in range(4)]
            part = solve_ivp(
                lambda time, x, side=side: rate(time, x, side),
                (t, TICK), y, "DOP853", rtol=1e-12, atol=1e-13, max_step=LONGEST,
                events=[crossing(*place) for place in places],
            )  # fmt: skip
            t, y, side = part.t[-1], part.y[:, -1], side.copy()
            for place in (place for place, times in zip(places, part.t_events, strict=True) if len(times)):
                side[place] *= -1.0
                crossings[place[0] >= motor_rows] += 1
    return y[:22], crossings


@pytest.mark.parametrize(
    ("frame", "inductance"),
    rest_nightly((DRONE, 0.0), (WEAK, 1.4e-4), (DRONE, 1.4e-4), (WEAK, 0.0), keep=2),
    ids=["current", "power, winding", "current, winding", "power"],
)
def test_crossing_of_current_limit_is_as_accurate_as_tolerance(frame, inductance):
    p = plant(frame, dc_motor={"inductance": inductance})
    commands = np.repeat(np.random.default_rng(4).uniform(30.0, 42.0, (5, 4)), 8, axis=0)
    end = fly(p, START, commands)
    exact, (crossings, _) = reference(p, START, commands)
    assert crossings >= 10
    assert error(end, exact) < 30.0 * TOLERANCE


@pytest.mark.parametrize("inductance", rest_nightly(5e-5, 5e-6))
def test_transient_of_winding_is_as_accurate_as_tolerance(inductance):
    """The current decays within 0.05 or 0.6 ms after each change of the voltage, far from its limits."""
    p = plant(DRONE, dc_motor={"inductance": inductance})
    commands = np.random.default_rng(5).uniform(32.8, 33.2, (10, 4))
    start = START._replace(rotor_speed=(332.0,) * 4)
    end = fly(p, start, commands)
    exact, (crossings, _) = reference(p, start, commands)
    assert crossings == 0
    assert error(end, exact) < 30.0 * TOLERANCE


@pytest.mark.parametrize("vertical", rest_nightly(-12.0, 9.0), ids=["from above", "from below"])
def test_crossing_of_flow_limit_is_as_accurate_as_tolerance(vertical):
    p = plant(DRONE, dynamic_inflow={}, wind_constant={"velocity": (0.5, -0.3, vertical)})
    commands = np.repeat([(8.0, 11.0, 6.0, 14.0), (34.0, 30.0, 36.0, 32.0)], 20, axis=0)
    end = fly(p, START, commands)
    exact, (_, crossings) = reference(p, START, commands)
    assert crossings >= 2
    assert error(end, exact) < 30.0 * TOLERANCE


@pytest.mark.parametrize(("braking", "inductance"), rest_nightly((20.0, 5e-5), (0.0, 5e-5), (0.0, 0.0), (20.0, 0.0)))
def test_windmilling_motor_is_as_accurate_as_tolerance(braking, inductance):
    """Wind from below drives rotors beyond the speed of their voltage: their current is at its lower limit."""
    motor = {"braking_current": braking, "inductance": inductance}
    p = plant(DRONE, dc_motor=motor, dynamic_inflow={}, wind_constant={"velocity": (0.5, -0.3, 60.0)})
    commands = np.repeat([(8.0, 11.0, 6.0, 14.0), (30.0, 34.0, 28.0, 32.0)], 20, axis=0)
    end = fly(p, START, commands)
    exact, (crossings, _) = reference(p, START, commands)
    assert (end[18:] * effect(p, "DcMotor").motor_constant > commands[-1]).all()
    assert crossings >= 4
    assert error(end, exact) < 30.0 * TOLERANCE
