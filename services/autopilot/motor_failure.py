"""Detector of rotors with a loss of thrust, from gyroscope readings (theory, eqs. (4.25)-(4.26b)).

The angular acceleration about body x and y is compared with that of the commands, after the effectiveness of the
commands and constant torques have been learned in flight. A weak rotor misses torque along its own arm; the loss above
a threshold is integrated until it is beyond doubt. ArduPilot's thrust-loss check detects the same failure by
saturation.
"""

from collections.abc import Mapping
from typing import NamedTuple

from lapwing.dynamics.lie.quaternion import Quaternion, rotate_back
from lapwing.dynamics.vector import Vec3
from lapwing.kernels import always_inline, math
from lapwing.kernels.codegen import map_index, map_tuple
from lapwing.services.autopilot.controller_parameters import Airframe, lift, rotor_effectiveness
from lapwing.services.common.ports import PerRotor, StateEstimate

BANDWIDTH = 40.0  # [rad/s] of the filters
LEAST_LOSS = 0.3  # fraction of lost thrust that model errors may feign
ALIGNED = 0.25  # maximum squared fraction of the disturbance that is not along the rotor's arm
ALARM = 0.12  # [s] integral of the loss above LEAST_LOSS
MEAN_TIME = 1.0  # [s] of the means
LEARNING_TIME = 3.0  # [s] of the moments and of the lift
CAUTION = 0.1  # speed of learning while a rotor is suspected
PRIOR = 0.005  # weight of the model, over the mean square of the rotors' angular accelerations in hover
WIDEST = 2.0  # maximum ratio of an effectiveness to that of the model, or its inverse
CLEAR = 0.3  # [m] height below which the feet may push
IMPACT = 1.0  # [g] upward specific force, beyond that of the rotors, that only a contact causes
PUSH = 0.3  # [g] the same of a vehicle that sits on ground higher than at the start; 0.00 in flight
PAUSE = 0.5  # [s] after an impact, during which the feet may push or bounce
NEAR_RANGE = 0.95  # fraction of the gyroscope's range from which a reading may be clipped


class Parameters(NamedTuple):
    """Vehicle parameters of the detector."""

    roll: PerRotor  # [rad/s^2] angular acceleration about body x per 1 N of each rotor's thrust
    pitch: PerRotor  # [rad/s^2] the same about body y
    inertia_body: Vec3  # [kg m^2]
    damping: tuple[float, float]  # [1/s] of the rates about body x and y
    time_constant: float  # [s] first-order lag of the rotor speeds
    hover_thrust: float  # thrust of each rotor [N]
    prior: float  # [rad^2/s^4] weight of the modelled effectiveness
    gravity: float  # [m/s^2]
    gyro_range: float  # [rad/s]
    enabled: bool  # False: no failure is detected
    repaired: int = 0  # number of a rotor whose injected failure has ended, from 1; 0: none


class Axis(NamedTuple):
    """Means and moments of the measured and the commanded angular acceleration about an axis."""

    measured: float  # mean [rad/s^2]
    commanded: float  # mean [rad/s^2]
    variance: float  # of the commanded one [rad^2/s^4]
    covariance: float  # [rad^2/s^4]


class State(NamedTuple):
    """State of the detector."""

    commanded: PerRotor  # commanded thrusts of the last tick [N]
    root: PerRotor  # square root of the expected thrusts [N^(1/2)]
    thrust: PerRotor  # filtered expected thrusts [N]
    rate: tuple[float, float]  # filtered omega x, y [rad/s]
    roll: Axis
    pitch: Axis
    load: float  # mean specific force along body z [g]
    collective: float  # mean of the expected thrusts, over the hover thrust
    loss: PerRotor  # lost fraction of each rotor's thrust
    evidence: PerRotor  # [s] integral of each rotor's loss above LEAST_LOSS
    failed: int  # number of the failed rotor, from 1; 0: none
    pause: float  # [s] remaining time after an impact


def build(airframe: Airframe, gyro_range: float, values: Mapping[str, float]) -> Parameters:
    """Return the detector of an airframe with a gyroscope's range [rad/s] and the autopilot's parameter `values`."""
    a = airframe
    _, roll, pitch, _ = rotor_effectiveness(a)
    roll, pitch = (tuple(row.tolist()) for row in (roll / a.inertia_body[0], pitch / a.inertia_body[1]))
    hover_thrust = a.mass * a.gravity / lift(a)
    square = math.total(x * x + y * y for x, y in zip(roll, pitch, strict=True)) / len(roll)
    prior = PRIOR * square * hover_thrust * hover_thrust
    enabled = values.get("FD_ACT_EN", 1.0) != 0.0  # not in logs of former versions
    damping = a.rotational_drag[0] / a.inertia_body[0], a.rotational_drag[1] / a.inertia_body[1]
    return Parameters(
        roll, pitch, a.inertia_body, damping, a.motor.time_constant, hover_thrust, prior, a.gravity, gyro_range,
        enabled,
    )  # fmt: skip


@always_inline
def _none(_: float, x: float, y: float) -> float:
    return 0.0


@always_inline
def start(p: Parameters) -> State:
    """Return the initial state."""
    none, axis = map_tuple(_none, 0.0, p.roll, p.pitch), Axis(0.0, 0.0, 0.0, 0.0)
    return State(none, none, none, (0.0, 0.0), axis, axis, 1.0, 1.0, none, none, 0, 0.0)


@always_inline
def _follow(share: float, root: float, commanded: float) -> float:
    return root + share * (math.sqrt(commanded) - root)


@always_inline
def _filter(share: float, thrust: float, root: float) -> float:
    return thrust + share * (root * root - thrust)


@always_inline
def effectiveness(p: Parameters, axis: Axis) -> float:
    """Return the learned ratio of measured to modelled angular acceleration of the commands (theory, eq. (4.25b))."""
    return min(max((axis.covariance + p.prior) / (axis.variance + p.prior), 1.0 / WIDEST), WIDEST)


@always_inline
def _disturbance(p: Parameters, axis: Axis, measured: float, commanded: float) -> float:
    """Return the angular acceleration [rad/s^2] that neither the commands nor constant torques explain."""
    return measured - axis.measured - effectiveness(p, axis) * (commanded - axis.commanded)


@always_inline
def _learn(axis: Axis, share: float, measured: float, commanded: float) -> Axis:
    faster = share * (LEARNING_TIME / MEAN_TIME)
    mean_m = axis.measured + faster * (measured - axis.measured)
    mean_c = axis.commanded + faster * (commanded - axis.commanded)
    m, c = measured - mean_m, commanded - mean_c
    return Axis(
        mean_m,
        mean_c,
        axis.variance + share * (c * c - axis.variance),
        axis.covariance + share * (m * c - axis.covariance),
    )


@always_inline
def _loss(p: Parameters, s: State, thrust: PerRotor, x: float, y: float, k: int) -> float:
    """Return the lost fraction of rotor k's thrust that causes a disturbance along its arm; 0 if it is not along it.

    It is a fraction of at least the hover thrust: a small disturbance is no large loss of an idling rotor.
    """
    expected = max(thrust[k], p.hover_thrust)
    ax, ay = effectiveness(p, s.roll) * p.roll[k] * expected, effectiveness(p, s.pitch) * p.pitch[k] * expected
    loss = -(x * ax + y * ay) / (ax * ax + ay * ay)
    residual = (x + loss * ax) * (x + loss * ax) + (y + loss * ay) * (y + loss * ay)
    return loss if residual < ALIGNED * (x * x + y * y) else 0.0


@always_inline
def _accumulate(dt: float, evidence: float, loss: float) -> float:
    return max(0.0, evidence + dt * (min(loss, 1.0) - LEAST_LOSS))


@always_inline
def load(p: Parameters, attitude: Quaternion, acceleration_world: Vec3) -> float:
    """Return the specific force along body z [g]."""
    x, y, z = acceleration_world
    return rotate_back(attitude, (x, y, z + p.gravity))[2] / p.gravity


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
    root = map_tuple(_follow, 1.0 - math.exp(-dt / p.time_constant), s.root, s.commanded)
    share, learned = 1.0 - math.exp(-dt * BANDWIDTH), dt / LEARNING_TIME
    thrust = map_tuple(_filter, share, s.thrust, root)
    ax, ay, total = 0.0, 0.0, 0.0
    for k in range(len(p.roll)):
        ax += p.roll[k] * thrust[k]
        ay += p.pitch[k] * thrust[k]
        total += root[k] * root[k]
    lifted, collective = load(p, e.attitude, e.acceleration_world), total / (len(p.roll) * p.hover_thrust)
    ratio = min(max(s.load / max(s.collective, 0.1), 1.0 / WIDEST), WIDEST)
    excess = lifted - ratio * collective  # [g] that the rotors do not explain; the ground may be higher than at start
    pause = PAUSE if excess > IMPACT else max(s.pause - dt, 0.0)
    wx, wy, wz = e.omega_body
    before = s.failed if p.enabled and s.failed != p.repaired else 0
    mean_load, mean_collective = s.load, s.collective
    if height >= CLEAR:
        mean_load += learned * (lifted - mean_load)
        mean_collective += learned * (collective - mean_collective)
    if height < CLEAR or pause > 0.0 or excess > PUSH or before > 0:
        none = map_tuple(_none, 0.0, p.roll, p.pitch)
        return State(
            commanded, root, thrust, (wx, wy), s.roll, s.pitch, mean_load, mean_collective, none, none, before, pause
        )
    ix, iy, iz = p.inertia_body
    ex, ey = share * (wx - s.rate[0]), share * (wy - s.rate[1])
    rate = (s.rate[0] + ex, s.rate[1] + ey)
    mx = ex / dt - (iy - iz) * wy * wz / ix + p.damping[0] * rate[0]  # the filtered difference quotient, exactly
    my = ey / dt - (iz - ix) * wz * wx / iy + p.damping[1] * rate[1]
    x, y = _disturbance(p, s.roll, mx, ax), _disturbance(p, s.pitch, my, ay)
    clipped = max(abs(wx), abs(wy)) > NEAR_RANGE * p.gyro_range  # the reading hides the acceleration
    losses = s.loss if clipped else map_index(_loss, p.roll, p, s, thrust, x, y)
    evidence = map_tuple(_accumulate, dt, s.evidence, losses)
    largest, failed = ALARM, 0
    for k in range(len(losses)):
        if losses[k] > LEAST_LOSS:
            learned = CAUTION * dt / LEARNING_TIME
        if evidence[k] > largest and p.enabled:
            largest, failed = evidence[k], k + 1
    learned = 0.0 if clipped else learned
    roll, pitch = _learn(s.roll, learned, mx, ax), _learn(s.pitch, learned, my, ay)
    return State(
        commanded, root, thrust, rate, roll, pitch, mean_load, mean_collective, losses, evidence, failed, pause
    )
