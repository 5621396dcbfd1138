"""The complete PX4 cascade, from setpoint to motor voltages, and its parameters by PX4's names."""

from collections.abc import Mapping
from typing import NamedTuple

from lapwing.dynamics.lie.quaternion import to_roll_pitch_yaw
from lapwing.dynamics.vector import ZERO, Vec3, norm, scale, subtract
from lapwing.kernels import always_inline, math, python_function
from lapwing.kernels.codegen import map_tuple
from lapwing.services.autopilot.allocation import tables_for_failures
from lapwing.services.autopilot.control import Command, sign
from lapwing.services.autopilot.controller_parameters import Airframe, hover_thrust, moments, shares
from lapwing.services.autopilot.mixer import (
    Shares,
    VirtualControls,
    active_allocation,
    airmode,
    clamp_to_range,
    mix,
    saturate,
)
from lapwing.services.autopilot.motor import Motor, thrust_at, thrusts_at
from lapwing.services.autopilot.px4 import attitude, position, rates
from lapwing.services.common.ports import Setpoint, StateEstimate

LEAST_HOVER, MOST_HOVER = 0.1, 0.9  # bounds of PX4's hover thrust estimator, fraction
AXES = ("ROLL", "PITCH", "YAW")


class Parameters(NamedTuple):
    """Parameters of the law."""

    position: position.Parameters
    attitude: attitude.Parameters
    rates: rates.Parameters
    acceleration_cutoff: float  # [Hz] of the filter of the measured acceleration
    thrust_model: float  # THR_MDL_FAC: 0: signal proportional to thrust setpoint, 1: to its square root
    scale: Vec3  # virtual controls over normalised torque
    shares: tuple[Shares, ...]  # with all rotors, then with each one failed
    airmode: int  # see `mixer.saturate`
    motor: Motor
    voltage_max: float  # [V] of a full signal


class State(NamedTuple):
    """State of the law."""

    velocity_integral: Vec3  # [m/s^2] world
    acceleration: Vec3  # measured, filtered [m/s^2] world
    rate_integral: Vec3  # normalised torque
    omega: Vec3  # omega_body of the last tick [rad/s]
    angular_acceleration: Vec3  # filtered [rad/s^2] body
    cut: Vec3  # sign of the part of the torque that saturation removed


START = State(ZERO, ZERO, ZERO, ZERO, ZERO, ZERO)


def normalisation(airframe: Airframe) -> Vec3:
    """Return the virtual controls of normalised torques of 1 about body x, y, z.

    As in PX4's control allocation: the rotor thrusts of a unit torque are scaled to a root mean
    square of 1/sqrt(2) for the larger of roll and pitch, which share the scale, and to at most 1 for yaw.
    """
    table, effects = shares(airframe)[0], moments(airframe)

    def size(axis: int) -> float:
        column = [share[axis + 1] / effects[axis] for share in table]
        rotors = sum(abs(e) > 1e-9 for e in column)
        return math.sqrt(math.total(e * e for e in column) / (0.5 * rotors))

    tilting = max(size(0), size(1))
    return 1.0 / (effects[0] * tilting), 1.0 / (effects[1] * tilting), 1.0 / max(share[3] for share in table)


def hover_collective(airframe: Airframe, thrust_model: float) -> float:
    """Return the collective at which the airframe hovers, as a fraction, from its nominal weight and motors."""
    full = python_function(thrust_at)(airframe.motor, airframe.voltage_max)
    signal = math.sqrt(hover_thrust(airframe) / full)
    hover = thrust_model * signal * signal + (1.0 - thrust_model) * signal
    return min(max(hover, LEAST_HOVER), MOST_HOVER)


def build(values: Mapping[str, float], airframe: Airframe) -> Parameters:
    """Return the parameters of the law.

    Args:
        values: the autopilot's parameters by name, see `services/common/autopilot_parameters.py`.
        airframe: nominal vehicle parameters.
    """

    def by_axis(pattern: str) -> Vec3:
        x, y, z = (values[pattern.format(axis)] for axis in AXES)
        return x, y, z

    def velocity_gains(term: str) -> Vec3:
        xy = values[f"MPC_XY_VEL_{term}_ACC"]
        return xy, xy, values[f"MPC_Z_VEL_{term}_ACC"]

    def product(a: Vec3, b: Vec3) -> Vec3:
        return a[0] * b[0], a[1] * b[1], a[2] * b[2]

    k, thrust_model = by_axis("MC_{}RATE_K"), values["THR_MDL_FAC"]
    hover = hover_collective(airframe, thrust_model) if values["MPC_USE_HTE"] else values["MPC_THR_HOVER"]
    limits = by_axis("MC_{}RATE_MAX")
    return Parameters(
        position=position.Parameters(
            position_xy=values["MPC_XY_P"],
            position_z=values["MPC_Z_P"],
            velocity_p=velocity_gains("P"),
            velocity_i=velocity_gains("I"),
            velocity_d=velocity_gains("D"),
            speed_xy=values["MPC_XY_VEL_MAX"],
            climb=values["MPC_Z_VEL_MAX_UP"],
            sink=values["MPC_Z_VEL_MAX_DN"],
            tilt=math.radians(values["MPC_TILTMAX_AIR"]),
            hover=hover,
            thrust_min=values["MPC_THR_MIN"],
            thrust_max=values["MPC_THR_MAX"],
            margin_xy=min(values["MPC_THR_XY_MARG"], values["MPC_THR_MAX"]),
            gravity=airframe.gravity,
        ),
        attitude=attitude.Parameters(
            by_axis("MC_{}_P"),
            values["MC_YAW_WEIGHT"],
            (math.radians(limits[0]), math.radians(limits[1]), math.radians(limits[2])),
        ),
        rates=rates.Parameters(
            product(k, by_axis("MC_{}RATE_P")),
            product(k, by_axis("MC_{}RATE_I")),
            product(k, by_axis("MC_{}RATE_D")),
            by_axis("MC_{}RATE_FF"),
            (values["MC_RR_INT_LIM"], values["MC_PR_INT_LIM"], values["MC_YR_INT_LIM"]),
            values["IMU_DGYRO_CUTOFF"],
        ),
        acceleration_cutoff=values["MPC_VELD_LP"],
        thrust_model=thrust_model,
        scale=normalisation(airframe),
        shares=tables_for_failures(shares(airframe), values),
        airmode=airmode(values),
        motor=airframe.motor,
        voltage_max=airframe.voltage_max,
    )


@always_inline
def signal(thrust_model: float, thrust: float) -> float:
    """Return the motor signal u of a thrust setpoint t, 0..1, with f u^2 + (1 - f) u = t."""
    f = thrust_model
    if f <= 0.0:
        return thrust
    linear = (1.0 - f) / (2.0 * f)
    return math.sqrt(linear * linear + thrust / f) - linear


@always_inline
def _volts(p: Parameters, thrust: float, _: float) -> float:
    return p.voltage_max * signal(p.thrust_model, thrust)


@always_inline
def start(estimate: StateEstimate) -> State:
    """Return the state at take-off."""
    return State(ZERO, ZERO, ZERO, estimate.omega_body, ZERO, ZERO)


@always_inline
def step(
    p: Parameters, s: State, dt: float, estimate: StateEstimate, setpoint: Setpoint, failed: int
) -> tuple[State, Command]:
    """Return the state and the command after a tick in flight.

    Args:
        p: parameters.
        s: state; `start` at take-off.
        dt: length of the tick [s].
        estimate: state estimate.
        setpoint: setpoint.
        failed: number of the failed rotor, from 1; 0: none.
    """
    acceleration = rates.low_pass(p.acceleration_cutoff, dt, s.acceleration, estimate.acceleration_world)
    position_error = subtract(setpoint.position_world, estimate.position_world)
    velocity = position.velocity_setpoint(p.position, position_error, setpoint.velocity_world)
    velocity_error = subtract(velocity, estimate.velocity_world)
    desired = position.acceleration_setpoint(
        p.position, velocity_error, s.velocity_integral, acceleration, setpoint.acceleration_world
    )
    thrust = position.thrust_setpoint(p.position, desired)
    velocity_integral = position.velocity_integral(p.position, s.velocity_integral, velocity_error, desired, thrust, dt)

    reference = attitude.attitude_setpoint(thrust, setpoint.yaw)
    omega = attitude.rate_setpoint(p.attitude, estimate.attitude, reference, setpoint.yaw_rate)

    change = scale(1.0 / dt, subtract(estimate.omega_body, s.omega))
    angular_acceleration = rates.low_pass(p.rates.derivative_cutoff, dt, s.angular_acceleration, change)
    torque = rates.torque_setpoint(p.rates, omega, estimate.omega_body, angular_acceleration, s.rate_integral)
    rate_error = subtract(omega, estimate.omega_body)
    rate_integral = rates.rate_integral(p.rates, s.rate_integral, rate_error, s.cut, dt)

    table = active_allocation(p.shares, failed)
    demand = VirtualControls(norm(thrust), p.scale[0] * torque[0], p.scale[1] * torque[1], p.scale[2] * torque[2])
    saturated = saturate(table, demand, 1.0, p.airmode)
    cut = (sign(demand.roll - saturated.roll), sign(demand.pitch - saturated.pitch), sign(demand.yaw - saturated.yaw))
    parts = clamp_to_range(mix(table, saturated), 1.0)
    volts = map_tuple(_volts, p, parts, parts)
    roll, pitch, yaw = to_roll_pitch_yaw(reference)
    state = State(velocity_integral, acceleration, rate_integral, estimate.omega_body, angular_acceleration, cut)
    return state, Command(volts, thrusts_at(p.motor, volts), roll, pitch, yaw, False)
