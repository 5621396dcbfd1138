"""True inputs of an inertial measurement unit: rates and specific force at its position, means, vibration."""

from typing import Annotated, Any, NamedTuple

from annotated_types import Ge, Gt, Le

from lapwing.dynamics.lie.quaternion import conjugate, log, multiply, rotate, rotate_back
from lapwing.dynamics.vector import ZERO, Vec3, add, cross, scale, subtract
from lapwing.kernels import always_inline, kernel, math
from lapwing.services.sensors.sensor_inputs import Truth
from lapwing.services.sensors.triad import MG

Amplitude = Annotated[float, Ge(0), Le(1e5)]


class Vibration(NamedTuple):
    """Vibration of the accelerometers by unbalanced rotors, at their mean speed."""

    amplitude_mg: tuple[Amplitude, Amplitude, Amplitude]  # [mg] body, proportional to the square of the rotor speed
    rotor_speed: Annotated[float, Gt(0), Le(1e5)]  # [rad/s] of that amplitude
    harmonic: Annotated[float, Gt(0), Le(16)] = 1.0  # of the rotor speed; the number of blades for blade passage


@kernel
def _force_at(position: Vec3 | None, truth: Truth, force: Vec3) -> Vec3:
    """Return the specific force [m/s^2] at a position on the rotating body (theory, eq. (3.37))."""
    if position is None:
        return force
    omega = truth.omega_body
    turning = add(cross(truth.angular_acceleration_body, position), cross(omega, cross(omega, position)))
    return add(force, turning)


@always_inline
def true_values(p: Any, truth: Truth) -> tuple[Vec3, Vec3]:
    """Return rate [rad/s] and specific force [m/s^2], body, at the accelerometers."""
    a = truth.acceleration_world
    force = rotate_back(truth.attitude, (a[0], a[1], a[2] + truth.gravity))
    return truth.omega_body, _force_at(p.position, truth, force)


@kernel
def velocity_world(position: Vec3 | None, truth: Truth) -> Vec3:
    """Return the world velocity [m/s] of a position on the body."""
    if position is None:
        return truth.velocity_world
    return add(truth.velocity_world, rotate(truth.attitude, cross(truth.omega_body, position)))


@always_inline
def means(p: Any, s: Any, truth: Truth, velocity_world: Vec3) -> tuple[Vec3, Vec3]:
    """Return the mean rate [rad/s] and specific force [m/s^2] over the interval (theory, eq. (3.43)).

    The rate is the rotation vector from the previous attitude; the force is in that attitude. Both include coning and
    sculling.
    """
    rotation = log(multiply(conjugate(s.attitude), truth.attitude))
    a = scale(p.rate, subtract(velocity_world, s.velocity_world))
    return scale(p.rate, rotation), rotate_back(s.attitude, (a[0], a[1], a[2] + truth.gravity))


@kernel
def vibration_at(
    vibration: Vibration | None, delta_output: bool, rate: float, phase: float, truth: Truth
) -> tuple[float, Vec3]:
    """Return the phase [rad] of the vibration and its specific force [m/s^2] (theory, eq. (3.44))."""
    if vibration is None:
        return phase, ZERO
    turn = vibration.harmonic * truth.rotor_speed / rate
    ratio, middle = truth.rotor_speed / vibration.rotor_speed, phase + turn
    size = ratio * ratio * MG
    if delta_output:
        middle = phase + 0.5 * turn
        size *= math.sin(0.5 * turn) / (0.5 * turn) if turn > 0.0 else 1.0
    x, y, z = scale(size, vibration.amplitude_mg)
    shake = (x * math.cos(middle), y * math.sin(middle), z * math.cos(middle))
    return (phase + turn) % (2.0 * math.pi), shake
