"""Inertial measurement unit: three gyroscopes and three accelerometers (theory, section 3.2)."""

from typing import Annotated, Any, NamedTuple

from annotated_types import Ge, Gt, Le, Lt

from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.lie.quaternion import NO_ROTATION, Quaternion, conjugate, log, multiply, rotate, rotate_back
from lapwing.dynamics.noise import Key, normal
from lapwing.dynamics.vector import ZERO, Vec3, add, cross, scale, subtract
from lapwing.kernels import always_inline, kernel
from lapwing.services.common.ports import ImuReading
from lapwing.services.sensors import error_models
from lapwing.services.sensors.delay_line import DEPTH, Fault
from lapwing.services.sensors.low_pass import LowPass, check_low_pass
from lapwing.services.sensors.rotor_vibration import (
    AT_REST,
    Phases,
    RotorVibration,
    Vibration,
    initial_phases,
    vibration,
    vibration_at,
)
from lapwing.services.sensors.sensor_inputs import Place, Truth
from lapwing.services.sensors.triad import (
    BLANK_TRIAD,
    Accelerometer,
    CrossCoupling,
    Gyro,
    Triad,
    accelerometer_units,
    gyro_coupling_bias,
    gyro_units,
    measure,
    new_triad,
    rectification_bias,
)

CHANNELS = ("gyro", "accelerometer")
_JITTER = 4  # lane of the draws of the sampling instants


class Imu(NamedTuple):
    """Parameters of an inertial measurement unit."""

    gyro: Gyro = Gyro()  # errors of the gyroscopes
    accelerometer: Accelerometer = Accelerometer()  # errors of the accelerometers
    rate: Annotated[float, Gt(0)] = 250.0  # [Hz] readings a second
    instances: Annotated[int, Ge(1), Le(3)] = 1  # redundant units, with a vote in the autopilot; `faults` of the first
    latency_samples: Annotated[int, Ge(0), Lt(DEPTH)] = 0  # [samples] delay of a reading
    warm_up_rise: float = 0.0  # [K] temperature rise from the start to the calibrated temperature
    warm_up_time: Annotated[float, Gt(0)] = 100.0  # [s] time constant of the warming
    delta_output: bool = False  # readings are means over the sampling interval (delta angle and velocity)
    vibration: Vibration | None = None  # of the rotors, at their mean speed; default: none
    gyro_filter: LowPass | None = None  # between the gyroscopes and the output
    accelerometer_filter: LowPass | None = None  # between the accelerometers and the output
    cross_coupling: CrossCoupling | None = None  # non-orthogonality, g-sensitivity, vibration rectification
    rotor_vibration: RotorVibration | None = None  # of each rotor, at its speed; default: none
    sampling_jitter: Annotated[float, Ge(0), Le(1e-2)] = 0.0  # [s] standard deviation of the sampling instant
    saturation_recovery: Annotated[float, Ge(0), Le(1)] = 0.0  # [s] that an axis stays at its limit after saturation
    position: Place | None = None  # [m] body, of the accelerometers; default: centre of mass
    faults: tuple[Fault, ...] | None = None  # compiled from the scene's schedule


class ImuState(NamedTuple):
    """State of an IMU."""

    gyro: Triad
    accelerometer: Triad
    warm_up: float  # [K] remaining warm-up
    phase: float  # [rad] of the vibration
    attitude: Quaternion  # at the previous sample
    velocity_world: Vec3  # [m/s] of the accelerometers at the previous sample
    phases: Phases  # [rad] of the rotors
    force: Vec3  # [m/s^2] true specific force at the previous sample


def check(p: Imu) -> None:
    """Raise ConfigError if a filter's delay does not fit its bandwidth."""
    for name in ("gyro_filter", "accelerometer_filter"):
        try:
            check_low_pass(getattr(p, name), p.rate)
        except ConfigError as error:
            raise error.with_prefix(name) from None


READING = ImuReading()


def blank() -> ImuState:
    """Return a placeholder state, replaced at the first tick."""
    return ImuState(BLANK_TRIAD, BLANK_TRIAD, 0.0, 0.0, NO_ROTATION, ZERO, AT_REST, ZERO)


@kernel
def _force_at(position: Vec3 | None, truth: Truth, force: Vec3) -> Vec3:
    """Return the specific force [m/s^2] at a position on the rotating body (theory, eq. (3.37))."""
    if position is None:
        return force
    omega = truth.omega_body
    turning = add(cross(truth.angular_acceleration_body, position), cross(omega, cross(omega, position)))
    return add(force, turning)


@always_inline
def _true_values(p: Any, truth: Truth) -> tuple[Vec3, Vec3]:
    """Return rate [rad/s] and specific force [m/s^2], body, at the accelerometers."""
    a = truth.acceleration_world
    force = rotate_back(truth.attitude, (a[0], a[1], a[2] + truth.environment.gravity))
    return truth.omega_body, _force_at(p.position, truth, force)


@kernel
def _velocity_world(position: Vec3 | None, truth: Truth) -> Vec3:
    """Return the world velocity [m/s] of a position on the body."""
    if position is None:
        return truth.velocity_world
    return add(truth.velocity_world, rotate(truth.attitude, cross(truth.omega_body, position)))


@always_inline
def _means(p: Any, s: Any, truth: Truth, velocity_world: Vec3) -> tuple[Vec3, Vec3]:
    """Return the mean rate [rad/s] and specific force [m/s^2] over the interval (theory, eq. (3.43)).

    The rate is the rotation vector from the previous attitude; the force is in that attitude. Both include coning and
    sculling.
    """
    rotation = log(multiply(conjugate(s.attitude), truth.attitude))
    a = scale(p.rate, subtract(velocity_world, s.velocity_world))
    return scale(p.rate, rotation), rotate_back(s.attitude, (a[0], a[1], a[2] + truth.environment.gravity))


@kernel
def initial(p: Imu, key: Key, truth: Truth) -> ImuState:
    """Return the state before the first sample; draw the errors of this unit and of this start."""
    omega, force = _true_values(p, truth)
    return ImuState(
        new_triad(gyro_units(p.gyro), p.cross_coupling, key, 0, p.warm_up_rise, omega),
        new_triad(accelerometer_units(p.accelerometer), p.cross_coupling, key, 8, p.warm_up_rise, force),
        p.warm_up_rise,
        0.0,
        truth.attitude,
        _velocity_world(p.position, truth),
        initial_phases(p.rotor_vibration, key),
        force,
    )


@kernel
def sample(p: Imu, s: ImuState, key: Key, tick: int, truth: Truth) -> tuple[ImuState, ImuReading]:
    """Return the next state and the reading.

    Args:
        p: parameters.
        s: state.
        key: key of the instrument's random stream (`lapwing.dynamics.noise.stream_key`).
        tick: integer, different for every sample.
        truth: `Truth` at this tick.
    """
    omega, force = _true_values(p, truth)
    velocity_world = s.velocity_world
    if p.delta_output:
        velocity_world = _velocity_world(p.position, truth)
        if tick > 0:
            omega, force = _means(p, s, truth, velocity_world)
    true_force, jitter = force, 0.0
    if p.sampling_jitter > 0.0:
        jitter = p.sampling_jitter * normal(key, tick, _JITTER)
        omega = add(omega, scale(jitter, truth.angular_acceleration_body))
        force = add(force, scale(jitter * p.rate, subtract(force, s.force)))
    phase, shake = vibration_at(p.vibration, p.delta_output, p.rate, s.phase, truth)
    force = add(force, shake)
    warm_up = s.warm_up * (1.0 - 1.0 / (p.rate * p.warm_up_time))
    g, a = gyro_units(p.gyro), accelerometer_units(p.accelerometer)
    phases, shake, square = vibration(p.rotor_vibration, p.accelerometer_filter, p, s.phases, key, tick, truth, jitter)
    gyro_bias = gyro_coupling_bias(p.cross_coupling, key, force, square)
    gyro, omega, gyro_valid = measure(g, s.gyro, p, p.gyro_filter, warm_up, 0, key, tick, omega, gyro_bias, ZERO)
    accelerometer, force, force_valid = measure(
        a, s.accelerometer, p, p.accelerometer_filter, warm_up, 1, key, tick, force,
        rectification_bias(p.cross_coupling, square), shake,
    )  # fmt: skip
    omega_variance = error_models.sample_variance(g.noise, g.resolution, p.rate)
    force_variance = error_models.sample_variance(a.noise, a.resolution, p.rate)
    reading = ImuReading(omega, force, omega_variance, force_variance, gyro_valid and force_valid)
    return ImuState(gyro, accelerometer, warm_up, phase, truth.attitude, velocity_world, phases, true_force), reading


# InvenSense PS-MPU-6000A: ranges and resolutions (500 deg/s and 8 g settings), at most 10 % of the raw temperature
# drift remains after calibration. Noise 0.30 deg/sqrt(h), 4.6 deg/h, 0.24 mg/sqrt(Hz), 36 ug: measured Allan curves.
# Residual bias, scale and alignment after calibration: chosen.
MPU6000 = Imu(
    Gyro(
        noise_dps_per_sqrt_hz=error_models.density_of_random_walk(0.30),
        bias_instability_deg_per_h=4.6,
        turn_on_bias_dps=0.1,
        temperature_dps_per_k=0.008,
        scale_error=1e-3,
        misalignment_deg=0.05,
        range_dps=500.0,
        resolution_dps=500.0 / 2**15,
    ),
    Accelerometer(
        noise_mg_per_sqrt_hz=0.24,
        bias_instability_ug=36.0,
        turn_on_bias_mg=3.0,
        temperature_mg_per_k=0.05,
        scale_error=1e-3,
        misalignment_deg=0.05,
        range_g=8.0,
        resolution_mg=8000.0 / 2**15,
    ),
    warm_up_rise=5.0,
)

# Bosch BST-BMI088-DS001: accelerometer 0.175 mg/sqrt(Hz) (160 in x and y, 190 in z), 0.2 mg/K and 0.015 deg/s/K before
# calibration, of which a tenth is left. Gyroscope 0.016 deg/s/sqrt(Hz), 6.5 deg/h: measured Allan curves. Accelerometer
# instability and residuals after calibration: chosen.
BMI088 = Imu(
    Gyro(
        noise_dps_per_sqrt_hz=0.016,
        bias_instability_deg_per_h=6.5,
        turn_on_bias_dps=0.05,
        temperature_dps_per_k=0.0015,
        scale_error=1e-3,
        misalignment_deg=0.05,
        range_dps=500.0,
        resolution_dps=500.0 / 2**15,
    ),
    Accelerometer(
        noise_mg_per_sqrt_hz=0.175,
        bias_instability_ug=30.0,
        turn_on_bias_mg=2.0,
        temperature_mg_per_k=0.02,
        scale_error=1e-3,
        misalignment_deg=0.05,
        range_g=12.0,
        resolution_mg=12000.0 / 2**15,
    ),
    warm_up_rise=5.0,
)

PRESETS = {"mpu6000": MPU6000, "bmi088": BMI088, "ideal": Imu()}
