"""Presets of sensors, and their messages."""

import math

import numpy as np
import pytest
from record import REST, record
from scipy.signal import welch

from lapwing.cosim.diagram.topic_encoder import encode
from lapwing.kernels.row_packing import pack_row
from lapwing.messages import stamp_ns
from lapwing.messages import topics as topic
from lapwing.services.process_table import create_all
from lapwing.services.scene_resolver import load, resolve
from lapwing.services.sensors import schema
from lapwing.services.sensors.airspeed import PRESETS as AIRSPEEDS
from lapwing.services.sensors.barometer import PRESETS as BAROMETERS
from lapwing.services.sensors.imu import PRESETS as IMUS
from lapwing.services.sensors.magnetometer import PRESETS as MAGNETOMETERS
from lapwing.services.sensors.optical_flow import PRESETS as FLOWS
from lapwing.services.sensors.rangefinder import PRESETS as RANGEFINDERS
from lapwing.services.sensors.sonar import PRESETS as SONARS
from tests.commands import run_command

DPS, MG, PSI = math.radians(1.0), 1e-3 * 9.80665, 6894.757
UP = REST._replace(position_world=(0.0, 0.0, 2.0))
DENSITIES = {  # one-sided densities of the channels, and replacements for readings without rounding
    "barometer": lambda p: ([p.noise_pa_per_sqrt_hz], {"resolution_pa": 0.0}),
    "sonar": lambda p: ([p.noise_m_per_sqrt_hz], {"resolution": 0.0}),
    "rangefinder": lambda p: ([p.noise_m_per_sqrt_hz], {"resolution": 0.0}),
    "airspeed": lambda p: ([p.noise_pa_per_sqrt_hz], {"resolution_pa": 0.0}),
    "magnetometer": lambda p: ([1e-9 * p.noise_nt_per_sqrt_hz] * 3, {"resolution_nt": 0.0}),
    "optical_flow": lambda p: (
        [p.noise_rad_per_s_per_sqrt_hz] * 2 + [DPS * p.gyro_noise_dps_per_sqrt_hz] * 2, {}
    ),
    "gps": lambda p: (
        [p.noise_horizontal_m_per_sqrt_hz] * 2
        + [p.noise_vertical_m_per_sqrt_hz]
        + [p.noise_velocity_m_per_s_per_sqrt_hz] * 3,
        {},
    ),
    "imu": lambda p: (
        [DPS * p.gyro.noise_dps_per_sqrt_hz] * 3 + [MG * p.accelerometer.noise_mg_per_sqrt_hz] * 3,
        {"warm_up_rise": 0.0},
    ),
}  # fmt: skip
PARTS = [(name, part) for name in DENSITIES for part in schema.sensors()[name].PRESETS if part != "ideal"]


def test_each_sensor_has_presets_of_two_parts():
    for name in DENSITIES:
        assert len([part for sensor, part in PARTS if sensor == name]) >= 2, name


@pytest.mark.parametrize(("name", "part"), PARTS)
def test_spectrum_above_wander_is_stated_density(name, part):
    """One-sided power spectral density above a quarter of the Nyquist frequency, within 4 %."""
    p = schema.sensors()[name].PRESETS[part]
    densities, fine = DENSITIES[name](p)
    f, power = welch(record(name, p._replace(**fine), 60_000, truth=UP), p.rate, nperseg=512, axis=0)
    assert np.sqrt(power[f > p.rate / 8].mean(axis=0)) == pytest.approx(np.array(densities), rel=0.04)


def deviation(density, p):
    return density * math.sqrt(0.5 * p.rate)


def test_barometer_preset_matches_data_sheet():
    p = BAROMETERS["dps422"]
    assert deviation(p.noise_pa_per_sqrt_hz, p._replace(rate=10.0)) == pytest.approx(0.5, rel=0.05)
    assert 2.0 * p.turn_on_bias_pa == 100.0
    assert 2.0 * p.temperature_pa_per_k <= 0.5


def test_second_barometer_preset_matches_data_sheet():
    p = BAROMETERS["ms5611"]
    assert deviation(p.noise_pa_per_sqrt_hz, p) == pytest.approx(1.5, rel=0.05)  # 1.2 Pa at the maximum oversampling
    assert (2.0 * p.turn_on_bias_pa, p.resolution_pa, p.range_pa) == (150.0, 1.0, 1.2e5)


def test_inertial_presets_match_data_sheets():
    mpu6000, bmi088 = IMUS["mpu6000"], IMUS["bmi088"]
    assert (mpu6000.gyro.range_dps, 1.0 / mpu6000.gyro.resolution_dps) == (500.0, pytest.approx(65.5, rel=1e-3))
    assert (mpu6000.accelerometer.range_g, 1e3 / mpu6000.accelerometer.resolution_mg) == (8.0, 4096.0)
    assert (bmi088.gyro.range_dps, 1.0 / bmi088.gyro.resolution_dps) == (500.0, pytest.approx(65.536))
    assert bmi088.gyro.noise_dps_per_sqrt_hz == pytest.approx(0.014, rel=0.2)  # typical; measured: 0.016
    assert bmi088.accelerometer.noise_mg_per_sqrt_hz == pytest.approx(0.175)
    assert (bmi088.accelerometer.range_g, 1e3 / bmi088.accelerometer.resolution_mg) == (
        12.0,
        pytest.approx(2730.67, rel=1e-4),
    )
    assert 10.0 * bmi088.gyro.temperature_dps_per_k == pytest.approx(0.015)
    assert 10.0 * bmi088.accelerometer.temperature_mg_per_k == pytest.approx(0.2)


def test_magnetometer_presets_match_data_sheets():
    rm3100, hmc5883l = MAGNETOMETERS["rm3100"], MAGNETOMETERS["hmc5883l"]
    assert deviation(rm3100.noise_nt_per_sqrt_hz, rm3100) == pytest.approx(15.0)
    assert (rm3100.range_ut, rm3100.resolution_nt) == (800.0, 13.0)
    assert deviation(hmc5883l.noise_nt_per_sqrt_hz, hmc5883l) == pytest.approx(200.0)
    assert (hmc5883l.range_ut, hmc5883l.resolution_nt) == (88.0, 73.0)


def test_second_sonar_preset_matches_data_sheet():
    p = SONARS["mb1202"]
    assert (p.range_min, p.range_max, p.resolution, p.rate) == (0.2, 7.65, 0.01, 10.0)


def test_sonar_preset_matches_data_sheet():
    p = SONARS["hc_sr04"]
    assert 2.0 * deviation(p.noise_m_per_sqrt_hz, p) == pytest.approx(3e-3, rel=0.05)
    assert (p.range_min, p.range_max, 2.0 * p.half_beam_deg) == (0.02, 4.0, 15.0)


@pytest.mark.parametrize(("distance", "accuracy"), [(6.0, 0.04), (12.0, 0.06)])
def test_rangefinder_preset_matches_data_sheet(distance, accuracy):
    p = RANGEFINDERS["tfmini"]
    noise = deviation(p.noise_m_per_sqrt_hz, p)
    assert 2.0 * math.hypot(noise, p.scale_error * distance) == pytest.approx(accuracy, rel=0.1)
    assert (p.range_min, p.range_max, p.resolution, p.beam_deg) == (0.3, 12.0, 0.005, 2.3)


def test_second_rangefinder_preset_matches_data_sheet():
    p = RANGEFINDERS["lidar_lite_v3"]
    assert 2.0 * deviation(p.noise_m_per_sqrt_hz, p) == pytest.approx(0.025)
    assert 2.0 * p.scale_error == pytest.approx(0.01)
    assert (p.range_max, p.resolution, p.rate, p.beam_deg) == (
        40.0,
        0.01,
        50.0,
        pytest.approx(math.degrees(8e-3), rel=1e-3),
    )


def test_airspeed_preset_matches_data_sheet():
    p = AIRSPEEDS["ms4525do"]
    assert p.range_pa == pytest.approx(PSI)
    assert p.resolution_pa == pytest.approx(2.0 * PSI / (0.8 * 16384), rel=1e-3)
    assert 2.0 * p.turn_on_bias_pa == pytest.approx(0.01 * 2.0 * PSI, rel=0.01)


def test_flow_camera_preset_matches_data_sheet():
    p = FLOWS["paw3902"]
    assert (p.flow_max, p.range_min, p.range_max) == (7.4, 0.08, 30.0)


@pytest.mark.long
def test_run_command_flies_with_second_presets(tmp_path):
    parts = {
        "barometer": "dps422", "sonar": "hc_sr04", "rangefinder": "tfmini", "airspeed": "ms4525do",
        "optical_flow": "paw3902", "gps": "standard", "magnetometer": "hmc5883l", "imu": "bmi088",
    }  # fmt: skip
    values = [f"sensors.{name}.preset={part}" for name, part in parts.items()]
    sets = [part for text in (*values, "run.duration=1.0", "success.require=[]") for part in ("--set", text)]
    run_command("run", "quad_x", *sets, "--mode", "single-process", "--log", tmp_path / "a.mcap", code=0)


@pytest.mark.parametrize("which", [topic.GPS, topic.GPS_VELOCITY], ids=["fix", "velocity"])
def test_fix_is_stamped_with_its_moment_and_never_before_start(which):
    config = resolve(load("delivery_mission"))
    encoder = next(w for service in create_all(config) for w in service.encoders if w.topic is which)
    port = config.port(encoder.port)
    ticks = encoder.period * np.arange(4)
    rows = np.array([pack_row(port.example._replace(age=0.2))] * len(ticks))
    payloads = [payload.tobytes() for page in encode(encoder, port, config, ticks, rows) for payload in page.payloads]
    stamps = [stamp_ns(which.message.decode(payload).header) for payload in payloads]
    assert stamps == [0, 0, 0, 100_000_000]
