"""IMU errors due to cross-coupling, internal filter, sampling and rotors, against closed forms."""

import math

import numpy as np
import pytest
from scipy import signal

from lapwing.dynamics.environment import STANDARD
from lapwing.dynamics.noise import stream_key
from lapwing.dynamics.vector import ZERO
from lapwing.kernels import kernel
from lapwing.services.sensors import imu, low_pass
from lapwing.services.sensors.low_pass import LowPass
from lapwing.services.sensors.rotor_vibration import Damage, RotorVibration
from lapwing.services.sensors.sensor_inputs import Rotors, Truth
from lapwing.services.sensors.triad import CrossCoupling
from tests.commands import assert_rejected, run_command

pytestmark = pytest.mark.usefixtures("uncompiled")

KEY = stream_key(3, "drone1", "imu")
G0 = 9.80665
REST = Truth(height_above_ground=2.0, environment=STANDARD._replace(gravity=G0))
TURNING = REST._replace(rotors=Rotors(500.0, (500.0, *(0.0,) * 7)))


@kernel
def record(p, key, truth, push, spin, out):
    """Return the readings for histories of acceleration along x and rotation about z."""
    s = imu.initial(p, key, truth)
    for k in range(len(out)):
        push_world, spin_body = (push[k], 0.0, 0.0), (0.0, 0.0, spin[k])
        now = Truth(
            truth.position_world, truth.attitude, truth.velocity_world, spin_body, push_world,
            truth.angular_acceleration_body, truth.height_above_ground, truth.air_velocity_world, truth.air_density,
            truth.rotors, truth.environment,
        )  # fmt: skip
        s, r = imu.sample(p, s, key, k, now)
        out[k, 0], out[k, 1], out[k, 2] = r.omega_body
        out[k, 3], out[k, 4], out[k, 5] = r.specific_force_body


def readings(p, truth=REST, push=None, spin=None, samples=400, key=KEY):
    out = np.empty((samples, 6))
    still = np.zeros(samples)
    record(p, key, truth, still if push is None else push, still if spin is None else spin, out)
    return out


def spectrum(x, rate, frequency):
    """Return the amplitude of a spectral line in a record of whole periods."""
    t = np.arange(len(x)) / rate
    return 2.0 * abs(np.mean((x - x.mean()) * np.exp(-2j * math.pi * frequency * t)))


def test_filter_equals_exact_simulation_of_linear_input():
    rate, f = 250.0, LowPass(42.0)
    t = np.arange(200) / rate
    u = np.interp(t, [0.0, 0.1, 0.3, 0.8], [0.0, 2.0, -1.0, 4.0])
    w = 2.0 * math.pi * f.bandwidth_hz
    _, expected, _ = signal.lsim(([w * w], [1.0, math.sqrt(2.0) * w, w * w]), u, t)
    s, result = low_pass.state_at_rest(ZERO), []
    for value in u:
        s = low_pass.update(f, s, rate, (value, 0.0, 0.0))
        result.append(s.output[0])
    np.testing.assert_allclose(result, expected, atol=1e-9)


def test_filter_response_equals_transfer_function():
    f = LowPass(98.0, 2.8e-3)
    for omega in (10.0, 600.0, 2000.0):
        gain, phase = low_pass.response(f, omega)
        _, h = signal.freqs(*signal.butter(2, 2.0 * math.pi * 98.0, analog=True), [omega])
        expected = h[0] * np.exp(-1j * omega * (2.8e-3 - math.sqrt(2.0) / (2.0 * math.pi * 98.0)))
        assert gain * np.exp(1j * phase) == pytest.approx(expected, abs=1e-12)


def test_filter_delays_slow_motion_by_its_group_delay():
    p = imu.Imu(rate=250.0, gyro_filter=LowPass(98.0, 2.8e-3))
    ramp = 3.0 * np.arange(400) / p.rate
    np.testing.assert_allclose(readings(p, spin=ramp)[200:, 2], ramp[200:] - 3.0 * 2.8e-3, atol=1e-12)


def test_cross_coupling_matrix_and_g_sensitivity_of_gyro():
    rows = (1.01, 0.002, 0.0, -0.003, 1.0, 0.0, 0.0, 0.004, 0.99)
    p = imu.Imu(cross_coupling=CrossCoupling(gyro_matrix=rows))
    result = readings(p, spin=np.full(4, 2.0), samples=4)[3, :3]
    np.testing.assert_allclose(result, 2.0 * np.array([0.0, 0.0, 0.99]), atol=1e-15)
    matrices = [
        readings(
            imu.Imu(cross_coupling=CrossCoupling(g_sensitivity_dps_per_g=0.1)), samples=1, key=stream_key(k, "", "imu")
        )
        for k in range(300)
    ]
    spread = np.degrees(np.std(np.array(matrices)[:, 0, :3], axis=0))
    np.testing.assert_allclose(spread, 0.1, rtol=4.0 / math.sqrt(600))


def test_skewed_axes_are_symmetric():
    """Non-orthogonality is symmetric: the sensitivity of x to y equals that of y to x."""
    p = imu.Imu(cross_coupling=CrossCoupling(non_orthogonality_deg=1.0))
    m = np.array(imu.initial(p, KEY, REST).accelerometer.matrix).reshape(3, 3)
    np.testing.assert_array_equal(m, m.T)
    assert np.abs(m - np.eye(3)).max() > 1e-3


def test_saturated_axis_stays_at_limit_for_recovery_time():
    p = imu.Imu(accelerometer=imu.Accelerometer(range_g=2.0), rate=100.0, saturation_recovery=0.05)
    push = np.zeros(30)
    push[10:12] = -50.0
    x = readings(p, push=push, samples=30)[:, 3]
    np.testing.assert_allclose(x[10:17], -2.0 * G0)
    np.testing.assert_array_equal(x[17:], 0.0)


def test_jitter_is_noise_in_proportion_to_slope():
    p = imu.Imu(rate=250.0, sampling_jitter=1e-4)
    push = 40.0 * np.arange(4000) / p.rate
    error = (readings(p, push=push, samples=4000)[:, 3] - push)[1:]
    assert error.std() == pytest.approx(40.0 * 1e-4, rel=0.05)


@pytest.mark.long
def test_rotor_imbalance_aliases_and_filter_attenuates():
    """500 rad/s is 79.6 Hz; blade passage at 159.2 Hz appears at 250 - 159.2 Hz."""
    v = RotorVibration(rotor_speed=500.0, damage_mg=100.0, blade_pass_mg=50.0, damage=Damage(0, 0, 1.0))
    p, n = imu.Imu(rate=250.0, rotor_vibration=v), 8000
    frequency = 500.0 / (2.0 * math.pi)
    plain = readings(p, TURNING, samples=n)
    assert spectrum(plain[:, 3], 250.0, frequency) == pytest.approx(0.1 * G0, rel=2e-3)
    assert spectrum(plain[:, 5], 250.0, 250.0 - 2.0 * frequency) == pytest.approx(0.05 * G0, rel=2e-3)
    soft = readings(p._replace(accelerometer_filter=LowPass(40.0)), TURNING, samples=n)
    expected = 0.1 * G0 / math.sqrt(1.0 + (frequency / 40.0) ** 4)
    assert spectrum(soft[:, 3], 250.0, frequency) == pytest.approx(expected, rel=2e-3)


@pytest.mark.long
def test_vibration_causes_rectification_bias():
    v = RotorVibration(rotor_speed=250.0, damage_mg=100.0, damage=Damage(0, 0, 1.0))
    c = CrossCoupling(rectification_mg_per_g2=20.0, gyro_rectification_dps_per_g2=0.5)
    result = readings(imu.Imu(rotor_vibration=v, cross_coupling=c), TURNING, samples=8000).mean(axis=0)
    square = 0.5 * (0.1 * 4.0) ** 2  # [g^2] at twice the speed
    assert result[3] == pytest.approx(20e-3 * G0 * square, rel=0.05)
    assert np.degrees(result[0]) == pytest.approx(0.5 * square, rel=1e-9)


def test_damage_begins_with_rotor_damage_effect():
    v = RotorVibration(rotor_speed=500.0, damage_mg=100.0, damage=Damage(0, 200, 0.5))
    x = readings(imu.Imu(rotor_vibration=v), TURNING)[:, 3]
    assert np.abs(x[:200]).max() == 0.0
    assert np.abs(x[200:]).max() == pytest.approx(0.05 * G0, rel=0.01)


@pytest.mark.long
def test_command_flies_scene_with_sensor_errors(tmp_path):
    tables = (
        'sensors.imu.gyro_filter={bandwidth_hz=98.0,group_delay=2.8e-3}',
        'sensors.imu.accelerometer_filter={bandwidth_hz=94.0,group_delay=3e-3}',
        'sensors.imu.cross_coupling={non_orthogonality_deg=0.1,g_sensitivity_dps_per_g=0.1,rectification_mg_per_g2=1.0}',
        'sensors.imu.rotor_vibration={rotor_speed=400.0,imbalance_mg=20.0,damage_mg=300.0}',
        "sensors.imu.sampling_jitter=1e-5", "sensors.imu.saturation_recovery=0.02", "run.duration=1.0",
        "sensors.magnetometer.soft_iron=0.01", "sensors.barometer.temperature_pa_per_k=0.5", "success.require=[]",
        "sensors.sonar.echo={ground_loss_db=10.0,propeller_noise_db=12.0,fading_db=3.0}",
    )  # fmt: skip
    values = [part for text in tables for part in ("--set", text)]
    command = ["run", "quad_x", "--mode", "single-process", *values]
    run_command(*command, "--log", tmp_path / "a.mcap", code=0)
    bad = run_command(*command[:-2], "--set", "sensors.imu.gyro_filter={bandwidth_hz=98.0,group_delay=1e-3}")
    assert_rejected(bad, "sensors.imu.gyro_filter.group_delay")
