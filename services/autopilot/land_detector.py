"""Land detector: take-off, contact with the ground, and the ramp that stops the motors (theory, section 4.5)."""

from collections.abc import Mapping
from typing import NamedTuple

from lapwing.kernels import always_inline
from lapwing.services.common.ports import Setpoint, StateEstimate

ON_GROUND, FLYING, LANDED = 0, 1, 2  # motors off before the first take-off, flying, off after a landing
TAKEOFF_HEIGHT = 0.05  # [m] over the ground, above which a rising setpoint starts the motors again after a landing
GROUNDED = 1e-6  # [m] height of a setpoint on the ground
DOWNWARDS = -0.3  # [g] vertical acceleration of a setpoint without velocity that does not hold the vehicle up
SUPPORT_TIME = 0.05  # [s] time constant of the filter of the ground's force: vibration is faster
LIFT_TIME = 1.0  # [s] time constant in which the lift of the commanded thrust is learned
LEAST_LIFT, MOST_LIFT = 0.5, 2.0  # of the commanded thrust
CLEAR = 0.2  # [m] over the ground, from which it is learned
HYSTERESIS = 0.5  # contact lasts down to this fraction of `ground_force`
SETTLING = 0.6  # fraction of the commanded thrust from contact on, which presses the feet down without a fall
FASTEST = 2.0  # [m/s] and up to this speed: the vehicle tilts onto its feet, and impacts disturb the estimate by 1
CUT_REST_TIME = 2.0  # [s] at rest with a setpoint on the ground, after which the motors stop without `cut_height`
CUT_HEIGHT_ERROR = 0.5  # [m] maximum error of the estimated height for that
CUT_REST_SPEED = 0.1  # [m/s] maximum estimated vertical speed at rest


class Thresholds(NamedTuple):
    """The scene's `[autopilot.landing]`; see schema.py."""

    cut_height: float = 0.0  # [m] 0: contact with the ground is detected
    thrust: float = 0.75  # fraction of the hover thrust
    ground_force: float = 0.25  # fraction of the weight
    vertical_speed: float = 0.2  # [m/s]
    hold_time: float = 0.1  # [s]
    ramp_time: float = 0.6  # [s]


class Parameters(NamedTuple):
    """Parameters of the detector and of the final approach."""

    thresholds: Thresholds
    resting_height: float  # [m] world z of the vehicle's origin at rest on the ground at the start
    hover_thrust: float  # [N] sum of the rotors' thrusts in hover; 0 without weight
    gravity: float  # [m/s^2]
    slow_height: float  # [m] below which a trajectory that ends on the ground is slowed to `slow_speed`
    slow_speed: float  # [m/s]


class LandedState(NamedTuple):
    """State of the land detector."""

    name: int  # ON_GROUND, FLYING or LANDED
    contact_time: float  # [s] of contact, or at rest with a setpoint on the ground
    support: float  # filtered vertical force that is not that of the rotors, fraction of the weight
    power: float  # fraction of the commanded thrust that the motors get: falls to 0 after contact
    lift: float  # measured lift over that of the model, learned in flight: mass, motors or air differ


INITIAL_LANDED_STATE = LandedState(ON_GROUND, 0.0, 0.0, 1.0, 1.0)


@always_inline
def _without_contact(name: int, time: float) -> LandedState:
    return LandedState(name, time, 0.0, 1.0, 1.0)


def build(
    thresholds: Thresholds,
    resting_height: float,
    hover_thrust: float,
    gravity: float,
    parameters: Mapping[str, float],
    height_known: bool,
) -> Parameters:
    """Return the parameters.

    Args:
        thresholds: of the scene.
        resting_height: world z of the vehicle's origin at rest on the ground [m].
        hover_thrust: sum of the rotors' thrusts in hover [N].
        gravity: [m/s^2].
        parameters: values of the autopilot's parameters by name.
        height_known: the height above the ground is measured.
    """
    slow = parameters["MPC_LAND_CRWL" if height_known else "MPC_LAND_SPEED"]
    return Parameters(thresholds, resting_height, hover_thrust, gravity, parameters["MPC_LAND_ALT3"], slow)


@always_inline
def takes_off(name: int, height: float, speed: float) -> bool:
    """Return True if a setpoint's height over the ground [m] and climb rate [m/s] start the motors."""
    if name == ON_GROUND:
        return height > GROUNDED or speed > 0.0
    return height >= TAKEOFF_HEIGHT and speed > 0.0


@always_inline
def descends(p: Parameters, setpoint: Setpoint) -> bool:
    """Return True if the setpoint leads down to the ground, or lies on or below it."""
    height, speed = setpoint.position_world[2] - p.resting_height, setpoint.velocity_world[2]
    if setpoint.acceleration_world[2] < DOWNWARDS * p.gravity:  # attitude control: the velocity is the estimate
        return True
    return speed < 0.0 or (height <= GROUNDED and speed <= 0.0)


@always_inline
def update_landed_state(
    p: Parameters, s: LandedState, estimate: StateEstimate, setpoint: Setpoint, thrust: float, dt: float
) -> LandedState:
    """Return the state after a tick of dt [s]; `thrust` is the sum of the rotors' last commands [N]."""
    if s.name != FLYING:
        height, speed = setpoint.position_world[2] - p.resting_height, setpoint.velocity_world[2]
        return _without_contact(FLYING if takes_off(s.name, height, speed) else s.name, 0.0)
    if p.thresholds.cut_height > 0.0:
        return _cut_at_height(p, s, estimate, setpoint, dt)
    return _detect_contact(p, s, estimate, setpoint, thrust, dt)


@always_inline
def _detect_contact(
    p: Parameters, s: LandedState, estimate: StateEstimate, setpoint: Setpoint, thrust: float, dt: float
) -> LandedState:
    """Wait for contact (theory, eq. (4.29)), and let the motors' power fall while it lasts."""
    t, fall = p.thresholds, estimate.velocity_world[2]
    expected = thrust / p.hover_thrust if p.hover_thrust > 0.0 else 1.0  # tilt only lowers it
    force = 1.0 + estimate.acceleration_world[2] / p.gravity if p.gravity > 0.0 else 0.0
    lift = s.lift * expected
    support = s.support + dt / (SUPPORT_TIME + dt) * (force - lift - s.support)
    recent = s.contact_time > 0.0  # impacts also interrupt the measured force for moments
    share, fastest = (HYSTERESIS, FASTEST) if recent else (1.0, t.vertical_speed)
    contact = support > share * t.ground_force and abs(fall) < fastest and descends(p, setpoint)
    contact = contact and (recent or lift < t.thrust)
    time = s.contact_time + dt if contact else max(0.0, s.contact_time - dt)
    power = SETTLING * min(1.0, 1.0 - (time - t.hold_time) / t.ramp_time) if time > 0.0 else 1.0
    if power <= 0.0:
        return _without_contact(LANDED, 0.0)
    learns = time <= 0.0 and estimate.position_world[2] - p.resting_height > CLEAR
    learns = learns and (setpoint.velocity_world[2] >= 0.0 or support < HYSTERESIS * t.ground_force)
    ratio = s.lift + dt / LIFT_TIME * (force - lift) if learns else s.lift
    return LandedState(FLYING, time, support, power, min(max(ratio, LEAST_LIFT), MOST_LIFT))


@always_inline
def _cut_at_height(
    p: Parameters, s: LandedState, estimate: StateEstimate, setpoint: Setpoint, dt: float
) -> LandedState:
    """Stop the motors below a height over the ground, on the way to it, or at rest if the estimated height is wrong."""
    height, cut_height = estimate.position_world[2] - p.resting_height, p.thresholds.cut_height
    if setpoint.position_world[2] - p.resting_height >= cut_height or setpoint.velocity_world[2] > 0.0:
        return _without_contact(FLYING, 0.0)
    at_rest = abs(estimate.velocity_world[2]) < CUT_REST_SPEED and height < CUT_HEIGHT_ERROR
    time = s.contact_time + dt if at_rest else 0.0
    return _without_contact(LANDED if height < cut_height or time > CUT_REST_TIME else FLYING, time)
