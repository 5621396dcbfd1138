"""Cascaded PID controller with saturation, from setpoint to motor voltages (theory, section 4.2).

The attitude error about the body axes is that of Euler angles or of SO(3).
"""

from collections.abc import Sequence
from typing import NamedTuple

from lapwing.dynamics.lie.quaternion import (
    Quaternion,
    conjugate,
    from_roll_pitch_yaw,
    log,
    multiply,
    rotate,
    to_roll_pitch_yaw,
)
from lapwing.dynamics.vector import ZERO, Vec3, subtract
from lapwing.kernels import always_inline, kernel, math
from lapwing.services.autopilot.angle_reference import AT_REST, Angle, Smoothing, advance
from lapwing.services.autopilot.mixer import (
    Shares,
    VirtualControls,
    active_allocation,
    clamp,
    clamp_to_range,
    mix,
    saturate,
)
from lapwing.services.autopilot.motor import Motor, voltages
from lapwing.services.autopilot.pid import Pid, integrate, output
from lapwing.services.common.ports import PerRotor, Setpoint, StateEstimate


@always_inline
def wrap(angle: float) -> float:
    """Return the equivalent angle in [-pi, pi] [rad]."""
    return angle - 2.0 * math.pi * round(angle / (2.0 * math.pi))


@always_inline
def angle_rates(roll: float, pitch: float, omega_body: Vec3) -> Vec3:
    """Return the rates of roll, pitch and yaw [rad/s] from body rates (theory, eq. (4.17)); singular at +-pi/2."""
    s, c = math.sincos(roll)
    turn = (s * omega_body[1] + c * omega_body[2]) / math.cos(pitch)
    return (omega_body[0] + math.sin(pitch) * turn, c * omega_body[1] - s * omega_body[2], turn)


@always_inline
def body_rates(roll: float, pitch: float, rates: Vec3) -> Vec3:
    """Return omega_body of the rates of roll, pitch and yaw, the inverse of `angle_rates`."""
    s, c = math.sincos(roll)
    turn = math.cos(pitch) * rates[2]
    return (rates[0] - math.sin(pitch) * rates[2], c * rates[1] + s * turn, c * turn - s * rates[1])


@always_inline
def error_by_angle(angles: Vec3, angles_reference: Vec3, rates_reference: Vec3, omega_body: Vec3) -> tuple[Vec3, Vec3]:
    """Return reference minus measured (roll, pitch, yaw) [rad] and its derivative [rad/s], as in the paper."""
    rates = angle_rates(angles[0], angles[1], omega_body)
    roll, pitch, yaw = subtract(angles_reference, angles)
    return (roll, pitch, wrap(yaw)), subtract(rates_reference, rates)


@always_inline
def error_on_so3(
    attitude: Quaternion, angles_reference: Vec3, rates_reference: Vec3, omega_body: Vec3
) -> tuple[Vec3, Vec3]:
    """Return the rotation vector [rad] in body axes from the attitude to the reference and its rate [rad/s].

    Free of singularities (theory, eq. (4.18)).
    """
    reference = from_roll_pitch_yaw(angles_reference[0], angles_reference[1], angles_reference[2])
    between = multiply(conjugate(attitude), reference)
    omega_reference = rotate(between, body_rates(angles_reference[0], angles_reference[1], rates_reference))
    return log(between), subtract(omega_reference, omega_body)


class Command(NamedTuple):
    """Output of the control law."""

    motor_voltage: PerRotor  # [V]
    thrust: PerRotor  # [N]
    roll_reference: float  # [rad] reference of the inner loop
    pitch_reference: float  # [rad]
    yaw_reference: float  # [rad]


class Parameters(NamedTuple):
    """Controller parameters; see `controller_parameters.build`."""

    altitude: Pid  # [N] of every rotor over [m]
    yaw: Pid  # [N] over [rad]
    roll_inner: Pid  # [N] over [rad] of tilt to the left: negative gains
    pitch_inner: Pid  # [N] over [rad]
    roll_outer: Pid  # [rad] of tilt over [m]
    pitch_outer: Pid  # [rad] over [m]
    smoothing: Smoothing  # filter of the tilt references
    tilt_limit: float  # [rad] about either axis
    hover_collective: float  # [N] feed-forward of every rotor; 0 without feed-forward
    gravity: float  # [m/s^2]
    controls_per_acceleration: Vec3  # [N/(rad/s^2)] roll, pitch, yaw; 0 without feed-forward
    geometric: bool  # attitude error on SO(3) instead of Euler angles
    shares: tuple[Shares, ...]  # with all rotors, then with each one failed
    airmode: int  # see `mixer.saturate`
    thrust_max: float  # [N] of a rotor
    motor: Motor
    resting_height: float  # [m] world z of the vehicle's origin at rest on the ground


class State(NamedTuple):
    """State of the controller."""

    integral_world: Vec3  # [m s] integral of the position error
    integral_angles: Vec3  # [rad s] integral of the errors of roll, pitch and yaw
    tilt_x: Angle  # reference of the pitch
    tilt_y: Angle  # reference of the tilt to the left, -roll
    cut: VirtualControls  # sign of the part of each control that saturation removed at the last tick
    tilt_cut: tuple[float, float]  # sign of the part of the tilts that the limit removed, world axes


START = State(ZERO, ZERO, AT_REST, AT_REST, VirtualControls(0.0, 0.0, 0.0, 0.0), (0.0, 0.0))


@always_inline
def sign(x: float) -> float:
    """Return -1.0, 0.0 or 1.0."""
    return 1.0 if x > 0.0 else (-1.0 if x < 0.0 else 0.0)


@always_inline
def to_heading(yaw: float, v_world: Sequence[float]) -> tuple[float, float]:
    """Return the components of a world vector along the heading and to its left (theory, eq. (4.11))."""
    s, c = math.sincos(yaw)
    return (c * v_world[0] + s * v_world[1], c * v_world[1] - s * v_world[0])


@always_inline
def tilt_targets(
    p: Parameters, yaw: float, integral: Vec3, error: Vec3, error_rate: Vec3, acceleration_world: Vec3
) -> tuple[float, float]:
    """Return the outer loops' tilts [rad] towards the heading and to its left (theory, eq. (4.12)).

    `error` is that of the position [m], `integral` [m s] and `error_rate` [m/s] belong to it; all in world axes.
    """
    x, y = to_heading(yaw, error)
    vx, vy = to_heading(yaw, error_rate)
    ix, iy = to_heading(yaw, integral)
    tilt_x, tilt_y = output(p.pitch_outer, ix, x, vx), output(p.roll_outer, iy, y, vy)
    if p.hover_collective > 0.0:
        ax, ay = to_heading(yaw, acceleration_world)
        tilt_x, tilt_y = tilt_x + ax / p.gravity, tilt_y + ay / p.gravity
    return tilt_x, tilt_y


@always_inline
def collective_control(
    p: Parameters, integral: float, error: float, error_rate: float, acceleration: float, roll: float, pitch: float
) -> float:
    """Return the lift [N] of every rotor, with feed-forward of weight and tilt (theory, eq. (4.13)).

    `error` is that of the height [m]; `roll` and `pitch` are those of the estimate [rad].
    """
    collective = output(p.altitude, integral, error, error_rate)
    if p.hover_collective > 0.0:
        upright = max(math.cos(roll) * math.cos(pitch), 0.5)
        collective = (collective + p.hover_collective * (1.0 + acceleration / p.gravity)) / upright
    return collective


@kernel
def step(
    p: Parameters, s: State, dt: float, estimate: StateEstimate, setpoint: Setpoint, failed: int
) -> tuple[State, Command]:
    """Return the state and the command after a tick in flight.

    Args:
        p: parameters.
        s: state; initially `START`.
        dt: length of the tick [s].
        estimate: state estimate.
        setpoint: setpoint.
        failed: number of the failed rotor, from 1; 0: none.
    """
    roll, pitch, yaw = to_roll_pitch_yaw(estimate.attitude)
    angles = (roll, pitch, yaw)
    error = subtract(setpoint.position_world, estimate.position_world)
    error_rate = subtract(setpoint.velocity_world, estimate.velocity_world)
    # The horizontal integral is in world axes: a steady wind does not turn with the heading.
    saturated_tilt = error[0] * s.tilt_cut[0] + error[1] * s.tilt_cut[1] > 0.0
    integral = (
        s.integral_world[0] if saturated_tilt else s.integral_world[0] + dt * error[0],
        s.integral_world[1] if saturated_tilt else s.integral_world[1] + dt * error[1],
        integrate(p.altitude, s.integral_world[2], error[2], s.cut.collective, dt),
    )
    desired_x, desired_y = tilt_targets(p, yaw, integral, error, error_rate, setpoint.acceleration_world)
    limited_x, limited_y = clamp(desired_x, -p.tilt_limit, p.tilt_limit), clamp(desired_y, -p.tilt_limit, p.tilt_limit)
    cut_x, cut_y = sign(desired_x - limited_x), sign(desired_y - limited_y)
    tilt_x = advance(p.smoothing, s.tilt_x, limited_x, dt)
    tilt_y = advance(p.smoothing, s.tilt_y, limited_y, dt)

    # With a modelled motor lag the references of this tick are those of the old state: see eq. (4.16).
    now_x, now_y = (s.tilt_x, s.tilt_y) if p.smoothing.lag > 0.0 else (tilt_x, tilt_y)
    angles_reference = (-now_y.angle, now_x.angle, setpoint.yaw)
    rates_reference = (-now_y.rate, now_x.rate, setpoint.yaw_rate)
    if p.geometric:
        turn, turn_rate = error_on_so3(estimate.attitude, angles_reference, rates_reference, estimate.omega_body)
    else:
        turn, turn_rate = error_by_angle(angles, angles_reference, rates_reference, estimate.omega_body)
    integral_angles = (
        integrate(p.roll_inner, s.integral_angles[0], -turn[0], s.cut.roll, dt),
        integrate(p.pitch_inner, s.integral_angles[1], turn[1], s.cut.pitch, dt),
        integrate(p.yaw, s.integral_angles[2], turn[2], s.cut.yaw, dt),
    )
    desired = VirtualControls(
        collective_control(p, integral[2], error[2], error_rate[2], setpoint.acceleration_world[2], roll, pitch),
        output(p.roll_inner, integral_angles[0], -turn[0], -turn_rate[0])
        - p.controls_per_acceleration[0] * tilt_y.command_acceleration,
        output(p.pitch_inner, integral_angles[1], turn[1], turn_rate[1])
        + p.controls_per_acceleration[1] * tilt_x.command_acceleration,
        output(p.yaw, integral_angles[2], turn[2], turn_rate[2]),
    )
    shares = active_allocation(p.shares, failed)
    saturated = saturate(shares, desired, p.thrust_max, p.airmode)
    cut = VirtualControls(
        sign(desired.collective - saturated.collective),
        sign(desired.roll - saturated.roll),
        sign(desired.pitch - saturated.pitch),
        sign(desired.yaw - saturated.yaw),
    )
    thrust = clamp_to_range(mix(shares, saturated), p.thrust_max)
    volts = voltages(p.motor, thrust)
    state = State(integral, integral_angles, tilt_x, tilt_y, cut, to_heading(-yaw, (cut_x, cut_y)))
    return state, Command(volts, thrust, angles_reference[0], angles_reference[1], setpoint.yaw)
