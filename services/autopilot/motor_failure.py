"""Detector of rotors with a loss of thrust, from gyroscope readings (theory, eqs. (4.25)-(4.26)).

An observer estimates the angular acceleration about body x and y that the commands do not explain. A weak rotor
causes one along its own arm. ArduPilot's thrust-loss check detects the same failure by saturation.
"""

from collections.abc import Mapping
from typing import NamedTuple

from lapwing.dynamics.lie.quaternion import Quaternion, rotate_back
from lapwing.dynamics.vector import Vec3
from lapwing.kernels import always_inline, math
from lapwing.kernels.codegen import map_tuple
from lapwing.services.autopilot.controller_parameters import Airframe, lift, rotor_effectiveness
from lapwing.services.common.ports import PerRotor, StateEstimate

BANDWIDTH = 40.0  # [rad/s] of the observer
LEAST_LOSS = 0.3  # minimum fraction of lost thrust
ALIGNED = 0.25  # maximum squared fraction of the disturbance that is not along the rotor's arm
DETECTION_TIME = 0.1  # [s]
CLEAR = 0.3  # [m] height below which the feet may push
IMPACT = 1.0  # [g] upward specific force, beyond that of the rotors, that only a contact causes
PUSH = 0.3  # [g] the same of a vehicle that sits on ground higher than at the start; 0.00 in flight
PAUSE = 0.5  # [s] after an impact, during which the feet may push or bounce
LEAST = 0.3  # minimum expected thrust, as a fraction of the hover thrust


class Parameters(NamedTuple):
    """Vehicle parameters of the detector."""

    roll_arm: PerRotor  # [m] torque about body x per 1 N of each rotor's thrust
    pitch_arm: PerRotor  # [m] torque about body y per 1 N of each rotor's thrust
    inertia_body: Vec3  # [kg m^2]
    time_constant: float  # [s] first-order lag of the rotor speeds
    hover_thrust: float  # thrust of each rotor [N]
    gravity: float  # [m/s^2]
    enabled: bool  # False: no failure is detected
    repaired: int = 0  # number of a rotor whose injected failure has ended, from 1; 0: none


class State(NamedTuple):
    """State of the detector."""

    commanded: PerRotor  # commanded thrusts of the last tick [N]
    root: PerRotor  # square root of the expected thrusts [N^(1/2)]
    rate: tuple[float, float]  # omega x, y as predicted [rad/s]
    disturbance: tuple[float, float]  # unexplained angular acceleration [rad/s^2]
    suspect: int  # number of the suspected rotor, from 1; 0: none
    duration: float  # [s] since it is suspected
    failed: int  # number of the failed rotor, from 1; 0: none
    pause: float  # [s] remaining time after an impact


def build(airframe: Airframe, values: Mapping[str, float]) -> Parameters:
    """Return the detector of an airframe with the autopilot's parameter `values`."""
    a = airframe
    _, roll, pitch, _ = rotor_effectiveness(a).tolist()
    hover_thrust = a.mass * a.gravity / lift(a)
    enabled = values.get("FD_ACT_EN", 1.0) != 0.0  # not in logs of former versions
    return Parameters(
        tuple(roll), tuple(pitch), a.inertia_body, a.motor.time_constant, hover_thrust, a.gravity, enabled
    )


@always_inline
def _none(_: float, x: float, y: float) -> float:
    return 0.0


@always_inline
def start(p: Parameters) -> State:
    """Return the initial state."""
    none = map_tuple(_none, 0.0, p.roll_arm, p.pitch_arm)
    return State(none, none, (0.0, 0.0), (0.0, 0.0), 0, 0.0, 0, 0.0)


@always_inline
def _follow(share: float, root: float, commanded: float) -> float:
    return root + share * (math.sqrt(commanded) - root)


@always_inline
def _arm(p: Parameters, k: int, root: PerRotor) -> tuple[float, float]:
    """Return the expected angular acceleration [rad/s^2] of rotor k about x and y."""
    thrust = max(root[k] * root[k], LEAST * p.hover_thrust)
    return p.roll_arm[k] * thrust / p.inertia_body[0], p.pitch_arm[k] * thrust / p.inertia_body[1]


@always_inline
def suspect(p: Parameters, root: PerRotor, disturbance: tuple[float, float]) -> int:
    """Return the number, from 1, of the rotor whose loss of thrust explains the disturbance, 0 if none does."""
    x, y = disturbance
    suspected, largest = 0, LEAST_LOSS
    for k in range(len(p.roll_arm)):
        ax, ay = _arm(p, k, root)
        loss = -(x * ax + y * ay) / (ax * ax + ay * ay)
        residual = (x + loss * ax) * (x + loss * ax) + (y + loss * ay) * (y + loss * ay)
        if loss > largest and residual < ALIGNED * (x * x + y * y):
            suspected, largest = k + 1, loss
    return suspected


@always_inline
def excess(p: Parameters, root: PerRotor, attitude: Quaternion, acceleration_world: Vec3) -> float:
    """Return the specific force along body z that the rotors do not explain [g]; positive on ground that pushes."""
    x, y, z = acceleration_world
    load = rotate_back(attitude, (x, y, z + p.gravity))[2]
    thrust = 0.0
    for k in range(len(root)):
        thrust += root[k] * root[k]
    return load / p.gravity - thrust / (len(root) * p.hover_thrust)


@always_inline
def step(p: Parameters, s: State, dt: float, e: StateEstimate, height: float, commanded: PerRotor) -> State:
    """Return the state after a tick.

    Args:
        p: parameters.
        s: state; initially `start`.
        dt: length of the tick [s].
        e: state estimate.
        height: above the resting height [m].
        commanded: commanded thrusts from now on [N].
    """
    share = 1.0 - math.exp(-dt / p.time_constant)
    root = map_tuple(_follow, share, s.root, s.commanded)
    ix, iy, iz = p.inertia_body
    wx, wy, wz = e.omega_body
    ax, ay = (iy - iz) * wy * wz / ix, (iz - ix) * wz * wx / iy
    for k in range(len(p.roll_arm)):
        thrust = root[k] * root[k]
        ax += p.roll_arm[k] * thrust / ix
        ay += p.pitch_arm[k] * thrust / iy
    before = s.failed if p.enabled and s.failed != p.repaired else 0
    # the ground may be higher than at the start
    unexplained = excess(p, root, e.attitude, e.acceleration_world)
    pause = PAUSE if unexplained > IMPACT else max(s.pause - dt, 0.0)
    if height < CLEAR or pause > 0.0 or unexplained > PUSH:
        return State(commanded, root, (wx, wy), (0.0, 0.0), 0, 0.0, before, pause)
    ex, ey = wx - s.rate[0], wy - s.rate[1]
    gain = 2.0 * BANDWIDTH
    rate = (s.rate[0] + dt * (ax + s.disturbance[0] + gain * ex), s.rate[1] + dt * (ay + s.disturbance[1] + gain * ey))
    square = BANDWIDTH * BANDWIDTH * dt
    disturbance = (s.disturbance[0] + square * ex, s.disturbance[1] + square * ey)
    suspected = suspect(p, root, disturbance)
    duration = s.duration + dt if suspected > 0 and suspected == s.suspect else 0.0
    failed = suspected if duration > DETECTION_TIME and before == 0 and p.enabled else before
    return State(commanded, root, rate, disturbance, suspected, duration, failed, pause)
