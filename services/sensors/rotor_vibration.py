"""Vibration of an inertial measurement unit by the rotors (theory, eqs. (3.44) and (3.49))."""

from typing import Annotated, Any, NamedTuple

from annotated_types import Ge, Gt, Le

from lapwing.dynamics.noise import TURN_ON, Key, normal3
from lapwing.dynamics.vector import ZERO, Vec3, scale
from lapwing.kernels import kernel, math
from lapwing.services.sensors.low_pass import LowPass, response
from lapwing.services.sensors.sensor_inputs import ROTORS, Truth
from lapwing.services.sensors.triad import MG

Phases = tuple[float, ...]  # [rad] of ROTORS rotors
AT_REST: Phases = (0.0,) * ROTORS
Amplitude = Annotated[float, Ge(0), Le(1e5)]
_LANE = 40  # lanes of the random imbalances and phases, above those of the triads


class Vibration(NamedTuple):
    """Vibration of the accelerometers by unbalanced rotors, at their mean speed."""

    amplitude_mg: tuple[Amplitude, Amplitude, Amplitude]  # [mg] body, proportional to the square of the rotor speed
    rotor_speed: Annotated[float, Gt(0), Le(1e5)]  # [rad/s] of that amplitude
    harmonic: Annotated[float, Gt(0), Le(16)] = 1.0  # of the rotor speed; the number of blades for blade passage


class Damage(NamedTuple):
    """Lost part of a blade, from the scene's `effects.rotor_damage`."""

    rotor: int  # from 0
    start: int  # [tick] of the damage
    lost: float  # fraction of the thrust


class RotorVibration(NamedTuple):
    """Vibration of the accelerometers by each rotor; amplitudes are proportional to the square of its speed."""

    rotor_speed: Annotated[float, Gt(0), Le(1e5)]  # [rad/s] of these amplitudes
    imbalance_mg: Amplitude = 0.0  # [mg] body x and y, one standard deviation over rotors
    blade_pass_mg: Amplitude = 0.0  # [mg] body z, at `blades` times the rotor speed
    blades: Annotated[int, Gt(0), Le(16)] = 2  # of a rotor
    damage_mg: Annotated[float, Ge(0), Le(1e6)] = 0.0  # [mg] imbalance of a rotor that has lost all its thrust
    damage: Damage | None = None  # compiled from the scene's `effects.rotor_damage`


@kernel
def vibration_at(
    vibration: Vibration | None, delta_output: bool, rate: float, phase: float, truth: Truth
) -> tuple[float, Vec3]:
    """Return the phase [rad] of the vibration and its specific force [m/s^2] (theory, eq. (3.44))."""
    if vibration is None:
        return phase, ZERO
    turn = vibration.harmonic * truth.rotors.speed / rate
    ratio, middle = truth.rotors.speed / vibration.rotor_speed, phase + turn
    size = ratio * ratio * MG
    if delta_output:
        middle = phase + 0.5 * turn
        size *= math.sin(0.5 * turn) / (0.5 * turn) if turn > 0.0 else 1.0
    x, y, z = scale(size, vibration.amplitude_mg)
    shake = (x * math.cos(middle), y * math.sin(middle), z * math.cos(middle))
    return (phase + turn) % (2.0 * math.pi), shake


@kernel
def _lost_thrust(damage: Damage | None, tick: int, i: int) -> float:
    """Return the fraction of the thrust that a rotor has lost."""
    if damage is None:
        return 0.0
    return damage.lost if damage.rotor == i and tick >= damage.start else 0.0


@kernel
def _imbalance(v: RotorVibration, key: Key, tick: int, i: int) -> float:
    """Return the amplitude [mg] of a rotor at the reference speed."""
    amplitude = v.imbalance_mg * abs(normal3(key, TURN_ON, _LANE + i)[0])
    return amplitude + v.damage_mg * _lost_thrust(v.damage, tick, i)


@kernel
def _wave(low_pass: LowPass | None, averaged: bool, rate: float, omega: float, phase: float) -> tuple[float, float]:
    """Return gain and phase [rad] of a harmonic in the reading: filtered, and averaged between readings."""
    gain = 1.0
    if averaged and omega > 0.0:
        half = 0.5 * omega / rate
        gain, phase = math.sin(half) / half, phase - half
    if low_pass is not None:
        attenuation, shift = response(low_pass, omega)
        gain, phase = gain * attenuation, phase + shift
    return gain, phase


@kernel
def _next_phase(phases: Phases, truth: Truth, rate: float, i: int) -> float:
    return (phases[i] + truth.rotors.speeds[i] / rate) % (2.0 * math.pi)


@kernel
def initial_phases(v: RotorVibration | None, key: Key) -> Phases:
    """Return the phases at the start."""
    if v is None:
        return AT_REST
    a, b = normal3(key, TURN_ON, _LANE + ROTORS), normal3(key, TURN_ON, _LANE + ROTORS + 1)
    c = normal3(key, TURN_ON, _LANE + ROTORS + 2)
    k = math.pi
    return (k * a[0], k * a[1], k * a[2], k * b[0], k * b[1], k * b[2], k * c[0], k * c[1])


@kernel
def vibration(
    v: RotorVibration | None, low_pass: LowPass | None, p: Any, phases: Phases, key: Key, tick: int, truth: Truth,
    jitter: float,
) -> tuple[Phases, Vec3, Vec3]:  # fmt: skip
    """Return the next phases, the specific force [m/s^2] in the reading, and its mean square at the element [g^2].

    Args:
        v: parameters; None: no vibration.
        low_pass: filter of the accelerometers.
        p: `Imu`, for `rate` and `delta_output`.
        phases: [rad] at the last sample.
        key: key of the instrument.
        tick: present tick.
        truth: rotor speeds.
        jitter: [s] delay after the nominal instant.
    """
    if v is None:
        return phases, ZERO, ZERO
    phases = (
        _next_phase(phases, truth, p.rate, 0), _next_phase(phases, truth, p.rate, 1),
        _next_phase(phases, truth, p.rate, 2), _next_phase(phases, truth, p.rate, 3),
        _next_phase(phases, truth, p.rate, 4), _next_phase(phases, truth, p.rate, 5),
        _next_phase(phases, truth, p.rate, 6), _next_phase(phases, truth, p.rate, 7),
    )  # fmt: skip
    x = y = z = across = along = 0.0
    for i in range(ROTORS):
        speed = truth.rotors.speeds[i]
        ratio = speed * speed / (v.rotor_speed * v.rotor_speed)
        size, push = _imbalance(v, key, tick, i) * ratio, v.blade_pass_mg * ratio
        gain, phase = _wave(low_pass, p.delta_output, p.rate, speed, phases[i] + speed * jitter)
        sine, cosine = math.sincos(phase)
        x, y = x + gain * size * cosine, y + gain * size * sine
        passing = v.blades * speed
        gain, phase = _wave(low_pass, p.delta_output, p.rate, passing, v.blades * (phases[i] + speed * jitter))
        z += gain * push * math.sin(phase)
        across, along = across + 0.5 * size * size, along + 0.5 * push * push
    return phases, (x * MG, y * MG, z * MG), (across * 1e-6, across * 1e-6, along * 1e-6)
