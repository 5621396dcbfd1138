"""Registry of sensors: discovery, valid presets, and one-line errors for invalid tables."""

import pytest

from lapwing.dynamics.config_error import ConfigError
from lapwing.services.sensors import schema


def test_sensors_of_folder_are_discovered():
    assert set(schema.sensors()) == {
        "airspeed",
        "barometer",
        "depth_camera",
        "external_vision",
        "gps",
        "imu",
        "lidar",
        "magnetometer",
        "optical_flow",
        "rangefinder",
        "sonar",
    }


@pytest.mark.parametrize("sensor", schema.sensors())
def test_every_preset_passes_its_own_validation(sensor):
    for name, preset in schema.sensors()[sensor].PRESETS.items():
        assert schema.parameters(sensor, {"preset": name}, 0.004) == preset


def test_first_preset_is_default():
    assert schema.parameters("gps", {}, 0.004) == schema.sensors()["gps"].PRESETS["rtk"]


def test_table_changes_single_values():
    p = schema.parameters("imu", {"preset": "bmi088", "rate": 500, "gyro": {"turn_on_bias_dps": 1}}, 0.002)
    assert (p.rate, p.gyro.turn_on_bias_dps, p.gyro.noise_dps_per_sqrt_hz) == (500.0, 1.0, 0.016)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"preset": "mpu9999"}, ["preset", "bmi088, ideal, mpu6000"]),
        ({"rate": -1}, ["imu.rate", "above 0", "-1"]),
        ({"gyro": {"noise_dps_per_sqrt_hz": -0.1}}, ["gyro.noise_dps_per_sqrt_hz", "at least 0"]),
        ({"gyro": {"noise": 1.0}}, ["gyro.noise", "unknown key", "noise_dps_per_sqrt_hz"]),
        ({"ratio": 1.0}, ["ratio", "unknown key", "rate"]),
        ({"rate": "fast"}, ["rate", "number", "'fast'"]),
        ({"faults": 3}, ["faults", "list"]),
    ],
)
def test_invalid_table_error_is_one_line(table, words):
    with pytest.raises(ValueError, match=words[0]) as error:
        schema.parameters("imu", table, 0.004)
    assert all(word in str(error.value) for word in words)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("sensor", "table", "message"),
    [
        ("imu", {"gyro": {"noise_dps_per_sqrt_hz": float("inf")}}, "imu.gyro.noise_dps_per_sqrt_hz: expected a finite"),
        ("airspeed", {"scale_error": float("nan")}, "airspeed.scale_error: expected a number at least 0 and below 1"),
        ("sonar", {"range_min": 8.0}, "sonar.range_min: expected less than range_max = 7.65 m, got 8"),
        ("rangefinder", {"range_max": 0.05}, "rangefinder.range_min: expected less than range_max = 0.05 m, got 0.05"),
        ("optical_flow", {"range_min": 31.0}, "optical_flow.range_min: expected less than range_max = 30 m, got 31"),
    ],
)
def test_invalid_limit_is_rejected(sensor, table, message):
    with pytest.raises(ConfigError, match=message):
        schema.parameters(sensor, table, 0.004)


def test_limit_may_be_infinite():
    assert schema.parameters("rangefinder", {"range_max": float("inf")}, 0.004).range_max == float("inf")


def test_unknown_sensor_lists_choices():
    with pytest.raises(ValueError, match="airspeed, barometer, depth_camera, external_vision, gps, imu"):
        schema.parameters("radar", {}, 0.004)


def test_satellites_without_position_are_rejected():
    few = [{"azimuth_deg": a, "elevation_deg": 45.0} for a in (0.0, 120.0, 240.0)]
    with pytest.raises(ValueError, match=r"gps.sky: expected 4 or more, .* got 3 satellites"):
        schema.parameters("gps", {"sky": few}, 0.004)
    cone = [*few, {"azimuth_deg": 60.0, "elevation_deg": 45.0}]
    with pytest.raises(ValueError, match=r"got 4 satellites with a dilution of precision \(PDOP\) of nan"):
        schema.parameters("gps", {"sky": cone}, 0.004)
    spread = [*few, {"azimuth_deg": 60.0, "elevation_deg": 90.0}]
    assert len(schema.parameters("gps", {"sky": spread}, 0.004).sky) == 4
