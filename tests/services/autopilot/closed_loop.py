"""Minimal plant for closed-loop tests: rigid body, four rotors with a lag, wind at the centre of mass, ground stand."""

import math
from typing import NamedTuple

import numpy as np

from lapwing.dynamics.lie.quaternion import NO_ROTATION, Quaternion, normalise, retract, rotate, to_roll_pitch_yaw
from lapwing.dynamics.vector import ZERO, Vec3, add, cross, divide, multiply, norm, scale, subtract
from lapwing.kernels import kernel
from lapwing.services.autopilot.control import START, step, wrap
from lapwing.services.autopilot.controller_parameters import Airframe
from lapwing.services.autopilot.land_detector import (
    FLYING,
    INITIAL_LANDED_STATE,
    LANDED,
    Parameters,
    Thresholds,
    update_landed_state,
)
from lapwing.services.autopilot.motor import RPM, Motor
from lapwing.services.common.ports import PerRotor, StateEstimate
from lapwing.services.trajectory.phases import Phases
from lapwing.services.trajectory.polynomial_piece import evaluate
from lapwing.services.trajectory.trajectory_compiler import compile

ARM = 0.4974 / math.sqrt(2.0)
MOTOR = Motor(thrust_coefficient=2.234e-4, gear_ratio=2.0 / 3.0, speed_constant=150.0, time_constant=0.02)
AIRFRAME = Airframe(
    mass=10.0224,
    inertia_body=(0.27, 0.26, 0.42),
    rotor_x=(ARM, -ARM, -ARM, ARM),
    rotor_y=(ARM, ARM, -ARM, -ARM),
    reaction_sign=(1.0, -1.0, 1.0, -1.0),
    torque_per_thrust=0.0381,
    motor=MOTOR,
    voltage_max=44.4,
    resting_height=0.35,
)
DETECTOR = Parameters(
    Thresholds(cut_height=0.05), AIRFRAME.resting_height, AIRFRAME.mass * AIRFRAME.gravity, AIRFRAME.gravity, 0.0, 0.0
)
TICK, SUBSTEPS = 0.004, 4
WIND_MEAN, WIND_SIGMA, WIND_TIME = (3.0, 1.0, 0.0), 1.0, 0.5  # [m/s], [m/s], [s]
OFF = (0.0, 0.0, 0.0, 0.0)  # [V]
WIND_AREA = 0.5 * 0.06 * 1.22  # half C_s S rho [kg/m]


def _phase(name, **channels):
    return {"name": name, **channels}


def _ramp(to, rate=1.0):
    return {"kind": "ramp", "to": to, "rate": rate}


MISSION = {
    "phase": [
        _phase("climb", z=_ramp(10.0)),
        _phase("hover", duration=5.0),
        _phase("forward", x=_ramp(10.0)),
        _phase("stay", duration=5.0),
        _phase("left", y=_ramp(10.0)),
        _phase("stop", duration=5.0),
        _phase("turn", yaw=_ramp(math.pi / 2, 0.3)),
        _phase("wait", duration=5.0),
        _phase("descend", z=_ramp(0.0)),
        _phase("down", duration=1.0),
    ]
}


class Plant(NamedTuple):
    """True vehicle, which may differ from the nominal airframe of the controller."""

    mass: float
    inertia: Vec3
    torque_per_thrust: float
    thrust_coefficient: float
    delay: int  # [ticks] between command and effect: 0 or 1


class Body(NamedTuple):
    position_world: Vec3
    attitude: Quaternion
    velocity_world: Vec3
    omega_body: Vec3
    speed: PerRotor  # of the propellers [rad/s]


@kernel
def move(plant, b, speed_command, wind_world, h):
    """Return the state after a half-explicit Euler step of h [s]."""
    k = 1.0 - math.exp(-h / MOTOR.time_constant)
    s0, s1, s2, s3 = b.speed
    u0, u1, u2, u3 = speed_command
    s0, s1, s2, s3 = s0 + k * (u0 - s0), s1 + k * (u1 - s1), s2 + k * (u2 - s2), s3 + k * (u3 - s3)
    c = plant.thrust_coefficient
    f0, f1, f2, f3 = c * s0 * s0, c * s1 * s1, c * s2 * s2, c * s3 * s3
    torque = (ARM * (f0 + f1 - f2 - f3), ARM * (-f0 + f1 + f2 - f3), plant.torque_per_thrust * (f0 - f1 + f2 - f3))
    turn = divide(subtract(torque, cross(b.omega_body, multiply(plant.inertia, b.omega_body))), plant.inertia)
    air = subtract(wind_world, b.velocity_world)
    force = add(rotate(b.attitude, (0.0, 0.0, f0 + f1 + f2 + f3)), scale(WIND_AREA * norm(air), air))
    v = add(b.velocity_world, scale(h, add(scale(1.0 / plant.mass, force), (0.0, 0.0, -AIRFRAME.gravity))))
    w = add(b.omega_body, scale(h, turn))
    x = add(b.position_world, scale(h, v))
    q = normalise(retract(b.attitude, scale(h, w)))
    if x[2] <= AIRFRAME.resting_height:  # on the stand the vehicle does not sink, slide or tip
        x, v, w = (
            (b.position_world[0], b.position_world[1], AIRFRAME.resting_height),
            (0.0, 0.0, max(v[2], 0.0)),
            (0.0,) * 3,
        )
        q = b.attitude
    return Body(x, q, v, w, (s0, s1, s2, s3))


@kernel
def fly(p, trajectory, plant, white, noise):
    """Fly len(white) ticks and return the log.

    `white` is unit noise (ticks, 3 wind + 12 estimate), `noise` the deviations of position, velocity, angle and rate of
    the estimate. Columns: time, position, roll, pitch, yaw, references of these six, largest thrust, landed state.
    """
    b = Body((0.0, 0.0, AIRFRAME.resting_height), NO_ROTATION, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0))
    s, landed = START, INITIAL_LANDED_STATE
    log = np.zeros((len(white), 15))
    gust = (0.0, 0.0, 0.0)
    a = math.exp(-TICK / WIND_TIME)
    n_gust = WIND_SIGMA * math.sqrt(1.0 - a * a)
    old = (0.0, 0.0, 0.0, 0.0)
    for i in range(len(white)):
        e = white[i]
        gust = (a * gust[0] + n_gust * e[0], a * gust[1] + n_gust * e[1], a * gust[2] + n_gust * e[2])
        setpoint = evaluate(trajectory, i * TICK, 0)
        estimate = StateEstimate(
            add(b.position_world, (noise[0] * e[3], noise[0] * e[4], noise[0] * e[5])),
            retract(b.attitude, (noise[2] * e[9], noise[2] * e[10], noise[2] * e[11])),
            add(b.velocity_world, (noise[1] * e[6], noise[1] * e[7], noise[1] * e[8])),
            add(b.omega_body, (noise[3] * e[12], noise[3] * e[13], noise[3] * e[14])),
            ZERO, ZERO, ZERO, ZERO, ZERO, ZERO, 0, 0,
        )  # fmt: skip
        landed = update_landed_state(DETECTOR, landed, estimate, setpoint, 0.0, TICK)
        s, u = step(p, s if landed.name == FLYING else START, TICK, estimate, setpoint, 0)
        angles = to_roll_pitch_yaw(b.attitude)
        for k in range(3):
            log[i, 1 + k] = b.position_world[k]
            log[i, 4 + k] = angles[k]
            log[i, 7 + k] = setpoint.position_world[k]
        log[i, 0], log[i, 10], log[i, 11], log[i, 12] = i * TICK, u.roll_reference, u.pitch_reference, u.yaw_reference
        log[i, 13], log[i, 14] = max(max(u.thrust[0], u.thrust[1]), max(u.thrust[2], u.thrust[3])), landed.name
        volts = u.motor_voltage if landed.name == FLYING else OFF
        k = MOTOR.speed_constant * MOTOR.gear_ratio / RPM
        new = (k * volts[0], k * volts[1], k * volts[2], k * volts[3])
        applied = old if plant.delay == 1 else new
        old = new
        for _ in range(SUBSTEPS):
            b = move(plant, b, applied, add(WIND_MEAN, gust), TICK / SUBSTEPS)
    return log


NOMINAL = Plant(AIRFRAME.mass, AIRFRAME.inertia_body, AIRFRAME.torque_per_thrust, MOTOR.thrust_coefficient, 0)
TRUTH = OFF


def mission(parameters, plant=NOMINAL, seed=1, noise=TRUTH, spec=MISSION):
    """Return the log of a flight of the delivery mission. See `fly`."""
    trajectory = compile(Phases.model_validate(spec), (0.0, 0.0, AIRFRAME.resting_height))
    ticks = round(trajectory.duration / TICK)
    white = np.random.default_rng(seed).standard_normal((ticks, 15))
    return fly(parameters, trajectory.parameters, plant, white, noise)


def rmse(log):
    """Return the RMSE of x, y, z [m], roll, pitch, yaw [rad] while the motors ran."""
    flight = log[log[:, 14] != LANDED]
    difference = flight[:, 7:13] - flight[:, 1:7]
    difference[:, 5] = [wrap(d) for d in difference[:, 5]]
    return np.sqrt(np.mean(difference**2, axis=0))
