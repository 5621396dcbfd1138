"""What an inertial measurement unit is exposed to: rates and specific force where it is mounted, means, vibration."""

from typing import Annotated, Any, NamedTuple

from annotated_types import Ge, Gt, Le

from lapwing.dynamics.lie.quaternion import conjugate, log, multiply, rotate, rotate_back
from lapwing.dynamics.vector import ZERO, Vec3, add, cross, scale, subtract
from lapwing.kernels import always_inline, kernel, math
from lapwing.services.sensors.sensor_inputs import Truth
from lapwing.services.sensors.triad import MG

Amplitude = Annotated[float, Ge(0), Le(1e5)]


class Vibration(NamedTuple):
    """What rotors that are out of balance shake the accelerometers by, at the mean of the rotors' speeds."""

    amplitude_mg: tuple[Amplitude, Amplitude, Amplitude]  # [mg] body, goes with the square of the rotor speed
    rotor_speed: Annotated[float, Gt(0), Le(1e5)]  # [rad/s] of that amplitude
    harmonic: Annotated[float, Gt(0), Le(16)] = 1.0  # of the rotor speed; blades pass at their number


@kernel
def _swung(position: Vec3 | None, truth: Truth, force: Vec3) -> Vec3:
    """The specific force [m/s^2] at a place of the body that turns (theory.md, eq. (3.37))."""
    if position is None:
        return force
    omega = truth.omega_body
    turning = add(cross(truth.angular_acceleration_body, position), cross(omega, cross(omega, position)))
    return add(force, turning)


@always_inline
def true_values(p: Any, truth: Truth) -> tuple[Vec3, Vec3]:
    """(rate [rad/s], specific force [m/s^2]) of the body where the accelerometers are."""
    a = truth.acceleration_world
    force = rotate_back(truth.attitude, (a[0], a[1], a[2] + truth.gravity))
    return truth.omega_body, _swung(p.position, truth, force)


@kernel
def velocity_world(position: Vec3 | None, truth: Truth) -> Vec3:
    """Velocity [m/s] of a place of the body, in the world."""
    if position is None:
        return truth.velocity_world
    return add(truth.velocity_world, rotate(truth.attitude, cross(truth.omega_body, position)))


@always_inline
def means(p: Any, s: Any, truth: Truth, velocity_world: Vec3) -> tuple[Vec3, Vec3]:
    """(rate [rad/s], specific force [m/s^2]) whose effect over the interval is what happened (theory.md, eq. (3.43)).

    The turning is the rotation vector from the attitude before, the force is in that attitude: coning and sculling
    are in both.
    """
    turned = log(multiply(conjugate(s.attitude), truth.attitude))
    a = scale(p.rate, subtract(velocity_world, s.velocity_world))
    return scale(p.rate, turned), rotate_back(s.attitude, (a[0], a[1], a[2] + truth.gravity))


@kernel
def shaken(
    vibration: Vibration | None, integrates: bool, rate: float, phase: float, truth: Truth
) -> tuple[float, Vec3]:
    """Phase [rad] of the vibration now, and what it adds to the specific force [m/s^2] (theory.md, eq. (3.44))."""
    if vibration is None:
        return phase, ZERO
    turn = vibration.harmonic * truth.rotor_speed / rate
    ratio, middle = truth.rotor_speed / vibration.rotor_speed, phase + turn
    size = ratio * ratio * MG
    if integrates:
        middle = phase + 0.5 * turn
        size *= math.sin(0.5 * turn) / (0.5 * turn) if turn > 0.0 else 1.0
    x, y, z = scale(size, vibration.amplitude_mg)
    shake = (x * math.cos(middle), y * math.sin(middle), z * math.cos(middle))
    return (phase + turn) % (2.0 * math.pi), shake
