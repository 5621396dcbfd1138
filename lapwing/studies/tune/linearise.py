"""Linearisation of the plant about hover by central differences of the compiled model."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import fsolve

from lapwing.cosim.scene import Scene
from lapwing.dynamics import effects
from lapwing.dynamics.lie.quaternion import NO_ROTATION, Quaternion, from_roll_pitch_yaw
from lapwing.dynamics.vehicles.multirotor import initial_state, observe, parameters
from lapwing.services.autopilot.controller_parameters import shares
from lapwing.services.autopilot.nominal_airframe import known_airframe
from lapwing.services.common.schemas.environment_schema import environment
from lapwing.services.common.schemas.vehicle_schema import Effects, airframe

HEIGHT = 50.0  # [m] above the ground effect
INTERVAL = 0.004  # [s] without influence, since the tick is 0
STEP = 1e-3  # relative to the rotor speed and to a radian; the model is smooth and nearly quadratic


class Hover(NamedTuple):
    """Linear model about hover in still air."""

    rotor_speed: float  # [rad/s] at hover
    voltage: float  # [V] at hover
    lag: float  # [s] of the rotors' speed behind the voltage
    thrust_slope: float  # [N s/rad] of one rotor without interference, over its speed
    altitude: float  # [m/s^2 / N] acceleration upwards over the force demand of every rotor
    roll: float  # [rad/s^2 / N]
    pitch: float  # [rad/s^2 / N]
    yaw: float  # [rad/s^2 / N] of steady rotor speeds
    spin_up_zero: float  # [s] that of changing speeds over it: (1 + spin_up_zero s) is the rotors' spin-up reaction
    tilt: float  # [m/s^2 / rad] forward acceleration over the pitch


def hover(scene: Scene) -> Hover:
    """Return the scene's plant, without winds, linearised about hover.

    Raises:
        ValueError: the vehicle cannot hover.
    """
    frame = airframe(scene)
    still = {name: table for name, table in scene[Effects].tables.items() if not name.startswith("wind")}
    p = parameters(frame, effects.from_scene(still, frame, environment(scene)))
    known = known_airframe(scene)
    lift, *turns = np.array(shares(known)[0]).T  # shares of the rotors
    free = next((k for k, row in enumerate(known.wakes.thrust) if row[k] == 1.0), 0)  # a rotor outside all wakes
    count, evenly = len(lift), np.sqrt(lift)  # speeds in hover, over the speed of a rotor that carries the mean

    def at_hover(speeds: np.ndarray, voltage: np.ndarray, attitude: Quaternion = NO_ROTATION) -> Any:
        state = initial_state(p, (0.0, 0.0, HEIGHT), attitude)
        motion = state.motion._replace(rotor_speed=tuple(float(v) for v in speeds))
        volts = tuple(float(v) for v in voltage)
        return observe(p, 0, INTERVAL, state._replace(motion=motion), volts)

    def unbalance(x: np.ndarray) -> tuple[float, float]:
        o = at_hover(x[0] * evenly, x[1] * evenly)
        return o.acceleration_world[2], o.rotor_acceleration[0]

    top = frame.motor.max_voltage
    guess = 0.7 * top / frame.motor.rotor_constant, 0.7 * top
    (speed, voltage), _, solved, _ = fsolve(unbalance, guess, full_output=True)
    if solved != 1 or not 0.0 < voltage < top:
        raise ValueError(f"{scene.path}: no hover found within {top:g} V; expected a vehicle that can hover")

    rotors, volts = speed * evenly, voltage * evenly
    d = STEP * speed

    def slope(direction: np.ndarray, value: Callable[[Any], float]) -> float:
        after, before = (at_hover(rotors + sign * direction, volts) for sign in (d, -d))
        return (value(after) - value(before)) / (2.0 * d)

    one = np.ones(count)
    thrust = slope(one, lambda o: o.thrust[free])
    tilted = [at_hover(rotors, volts, from_roll_pitch_yaw(0.0, pitch, 0.0)) for pitch in (-STEP, STEP)]
    ahead = [o.acceleration_world[0] for o in tilted]

    def angular_acceleration_per_thrust(k: int) -> float:
        return slope(turns[k], lambda o: o.angular_acceleration_body[k]) / thrust

    roll, pitch, turn = map(angular_acceleration_per_thrust, range(3))
    lag = -1.0 / slope(one, lambda o: o.rotor_acceleration[0])
    # With different voltages at equal speeds only the spin-up reaction of the rotors acts on the body.
    yawing, most = turns[2], int(np.argmax(np.abs(turns[2])))
    more, less = (at_hover(rotors, volts + sign * STEP * voltage * yawing) for sign in (1.0, -1.0))
    per_acceleration = (more.angular_acceleration_body[2] - less.angular_acceleration_body[2]) / float(
        (more.rotor_acceleration[most] - less.rotor_acceleration[most]) / yawing[most]
    )
    yaw = turn + per_acceleration / (lag * thrust)  # at constant voltage a speed perturbation decays with 1 / lag
    altitude, tilt = slope(one, lambda o: o.acceleration_world[2]) / thrust, (ahead[1] - ahead[0]) / (2.0 * STEP)
    spin_up_zero = per_acceleration / (thrust * yaw)
    return Hover(*map(float, (speed, voltage, lag, thrust, altitude, roll, pitch, yaw, spin_up_zero, tilt)))
