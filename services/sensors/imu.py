"""Inertial measurement unit: three gyroscopes and three accelerometers (theory.md, section 3.2)."""

from typing import Annotated, NamedTuple

from annotated_types import Ge, Gt, Lt

from lapwing.dynamics.lie.quaternion import NO_ROTATION, Quaternion
from lapwing.dynamics.noise import Key
from lapwing.dynamics.vector import ZERO, Vec3, add
from lapwing.kernels import kernel
from lapwing.services.common.ports import ImuReading
from lapwing.services.sensors import error_models, imu_motion
from lapwing.services.sensors.delay_line import DEPTH, Fault
from lapwing.services.sensors.imu_motion import Vibration
from lapwing.services.sensors.sensor_inputs import Place, Truth
from lapwing.services.sensors.triad import (
    BLANK_TRIAD,
    Accelerometer,
    Gyro,
    Triad,
    accelerometer_units,
    gyro_units,
    measure,
    new_triad,
)

CHANNELS = ("gyro", "accelerometer")


class Imu(NamedTuple):
    """Parameters of an inertial measurement unit."""

    gyro: Gyro = Gyro()  # its gyroscopes
    accelerometer: Accelerometer = Accelerometer()  # its accelerometers
    rate: Annotated[float, Gt(0)] = 250.0  # [Hz]
    latency_samples: Annotated[int, Ge(0), Lt(DEPTH)] = 0  # samples that a reading is late
    warm_up: float = 0.0  # [K] still to come at the start, over the calibrated temperature
    warm_up_time: Annotated[float, Gt(0)] = 100.0  # [s]
    integrates: bool = False  # readings are means since the one before: what it turned and sped up by, over the time
    vibration: Vibration | None = None  # of the rotors; none if left out
    position: Place | None = None  # [m] body, of the accelerometers; the centre of mass if left out
    faults: tuple[Fault, ...] | None = None  # compiled from the scene's schedule


class ImuState(NamedTuple):
    """State of an IMU."""

    gyro: Triad
    accelerometer: Triad
    cold: float  # [K] of the warm-up still to come
    phase: float  # [rad] of the vibration
    attitude: Quaternion  # at the sample before
    velocity_world: Vec3  # [m/s] of the accelerometers at the sample before


def blank() -> ImuState:
    """A state without meaning, to be overwritten at the first tick."""
    return ImuState(BLANK_TRIAD, BLANK_TRIAD, 0.0, 0.0, NO_ROTATION, ZERO)


@kernel
def initial(p: Imu, key: Key, truth: Truth) -> ImuState:
    """State before the first sample: what differs from unit to unit and from start to start is drawn here."""
    omega, force = imu_motion.true_values(p, truth)
    return ImuState(
        new_triad(gyro_units(p.gyro), key, 0, p.warm_up, omega),
        new_triad(accelerometer_units(p.accelerometer), key, 8, p.warm_up, force),
        p.warm_up,
        0.0,
        truth.attitude,
        imu_motion.velocity_world(p.position, truth),
    )


@kernel
def sample(p: Imu, s: ImuState, key: Key, tick: int, truth: Truth) -> tuple[ImuState, ImuReading]:
    """Next state and reading.

    Args:
        p: `Imu`.
        s: `ImuState`.
        key: of this instrument's random stream (`lapwing.dynamics.noise.stream_key`).
        tick: integer, different for every sample.
        truth: `Truth` at this tick.
    """
    omega, force = imu_motion.true_values(p, truth)
    velocity_world = s.velocity_world
    if p.integrates:
        velocity_world = imu_motion.velocity_world(p.position, truth)
        if tick > 0:
            omega, force = imu_motion.means(p, s, truth, velocity_world)
    phase, shake = imu_motion.shaken(p.vibration, p.integrates, p.rate, s.phase, truth)
    force = add(force, shake)
    cold = s.cold * (1.0 - 1.0 / (p.rate * p.warm_up_time))
    g, a = gyro_units(p.gyro), accelerometer_units(p.accelerometer)
    gyro, omega, gyro_valid = measure(g, s.gyro, p, cold, 0, key, tick, omega)
    accelerometer, force, force_valid = measure(a, s.accelerometer, p, cold, 1, key, tick, force)
    omega_variance = error_models.sample_variance(g.noise, g.resolution, p.rate)
    force_variance = error_models.sample_variance(a.noise, a.resolution, p.rate)
    reading = ImuReading(omega, force, omega_variance, force_variance, gyro_valid and force_valid)
    return ImuState(gyro, accelerometer, cold, phase, truth.attitude, velocity_world), reading


# InvenSense PS-MPU-6000A: ranges and resolutions (500 deg/s and 8 g settings), temperature within 10 % of the raw drift
# that calibration leaves. Noise 0.30 deg/sqrt(h), 4.6 deg/h, 0.24 mg/sqrt(Hz), 36 ug: measured Allan curves. What
# calibration leaves of bias, scale and alignment: chosen.
MPU6000 = Imu(
    Gyro(
        noise_dps_per_sqrt_hz=error_models.density_of_random_walk(0.30),
        bias_instability_deg_per_h=4.6,
        turn_on_dps=0.1,
        temperature_dps_per_k=0.008,
        scale_error=1e-3,
        misalignment_deg=0.05,
        range_dps=500.0,
        resolution_dps=500.0 / 2**15,
    ),
    Accelerometer(
        noise_mg_per_sqrt_hz=0.24,
        bias_instability_ug=36.0,
        turn_on_mg=3.0,
        temperature_mg_per_k=0.05,
        scale_error=1e-3,
        misalignment_deg=0.05,
        range_g=8.0,
        resolution_mg=8000.0 / 2**15,
    ),
    warm_up=5.0,
)

# Bosch BST-BMI088-DS001: accelerometer 0.175 mg/sqrt(Hz) (160 in x and y, 190 in z), 0.2 mg/K and 0.015 deg/s/K before
# calibration, of which a tenth is left. Gyroscope 0.016 deg/s/sqrt(Hz), 6.5 deg/h: measured Allan curves. Accelerometer
# instability and what calibration leaves: chosen.
BMI088 = Imu(
    Gyro(
        noise_dps_per_sqrt_hz=0.016,
        bias_instability_deg_per_h=6.5,
        turn_on_dps=0.05,
        temperature_dps_per_k=0.0015,
        scale_error=1e-3,
        misalignment_deg=0.05,
        range_dps=500.0,
        resolution_dps=500.0 / 2**15,
    ),
    Accelerometer(
        noise_mg_per_sqrt_hz=0.175,
        bias_instability_ug=30.0,
        turn_on_mg=2.0,
        temperature_mg_per_k=0.02,
        scale_error=1e-3,
        misalignment_deg=0.05,
        range_g=12.0,
        resolution_mg=12000.0 / 2**15,
    ),
    warm_up=5.0,
)

PRESETS = {"mpu6000": MPU6000, "bmi088": BMI088, "ideal": Imu()}
