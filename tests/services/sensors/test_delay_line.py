"""Sensor faults, one at a time, on an ideal magnetometer in a growing field; invalid schedules."""

import numpy as np
import pytest

from lapwing.dynamics.environment import STANDARD
from lapwing.dynamics.noise import stream_key
from lapwing.services.sensors import imu, magnetometer, schema
from lapwing.services.sensors.fault_schedule import compile_faults
from lapwing.services.sensors.sensor_inputs import Truth

pytestmark = pytest.mark.usefixtures("uncompiled")

TICK = 0.1  # [s]


def fly(fault, sensor="magnetometer", ticks=30):
    """Return the x readings of an ideal magnetometer in a field that grows by 1 T per tick; fault from 1 s to 2 s."""
    module = schema.sensors()[sensor]
    p = schema.parameters(sensor, {"preset": "ideal", "faults": [{"start": 1.0, "stop": 2.0, **fault}]}, TICK)
    key = stream_key(1, "drone1", sensor)

    def truth(tick):
        field = (float(tick), 0.0, 0.0)
        environment = STANDARD._replace(gravity=9.81, magnetic_field_world=field)
        return Truth(omega_body=field, height_above_ground=1.0, environment=environment)

    s = module.initial(p, key, truth(0))
    readings = []
    for tick in range(ticks):
        s, reading = module.sample(p, s, key, tick, truth(tick))
        readings.append(reading)
    return readings


def fields(fault):
    return np.array([r.field_body[0] for r in fly(fault)])


TRUE = np.arange(30.0)
ON = (TRUE >= 10) & (TRUE < 20)


def test_dropout_makes_reading_invalid():
    assert [r.valid for r in fly({"kind": "dropout"})] == [not on for on in ON]


def test_freeze_repeats_last_reading():
    np.testing.assert_array_equal(fields({"kind": "freeze"}), np.where(ON, 9.0, TRUE))


def test_bias_adds_constant():
    np.testing.assert_array_equal(fields({"kind": "bias", "size": [3.0, 0.0, 0.0]}), np.where(ON, TRUE + 3, TRUE))


def test_drift_grows_by_its_size_per_second():
    expected = np.where(ON, TRUE + 5.0 * (TRUE - 10) * TICK, TRUE)
    np.testing.assert_allclose(fields({"kind": "drift", "size": 5.0}), expected, atol=1e-12)


def test_scale_multiplies_reading():
    np.testing.assert_array_equal(fields({"kind": "scale", "size": 2.0}), np.where(ON, 2 * TRUE, TRUE))


def test_delay_returns_earlier_reading():
    np.testing.assert_array_equal(fields({"kind": "delay", "samples": 4}), np.where(ON, TRUE - 4, TRUE))


def test_spikes_have_stated_probability_and_size():
    error = np.array(
        [r.field_body[0] for r in fly({"kind": "spikes", "size": 50.0, "probability": 0.3, "stop": 1e9}, ticks=2000)]
    )
    hit = error[10:] != np.arange(10.0, 2000.0)
    assert hit.mean() == pytest.approx(0.3, abs=0.04)
    assert np.std((error[10:] - np.arange(10.0, 2000.0))[hit]) == pytest.approx(50.0, rel=0.15)


def test_fault_affects_only_its_channel():
    readings = fly({"kind": "bias", "channel": "gyro", "size": 1.0}, sensor="imu")
    assert readings[15].omega_body == (16.0, 1.0, 1.0)
    assert readings[15].specific_force_body == (0.0, 0.0, 9.81)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"kind": "explode"}, ["faults.0.kind", "dropout", "explode"]),
        ({"kind": "bias", "channel": "pressure"}, ["faults.0.channel", "accelerometer, all, gyro"]),
        ({"kind": "bias", "start": 5.0, "stop": 4.0}, ["faults.0.stop", "later than start"]),
        ({"kind": "bias", "start": -1.0}, ["faults.0.start", "at least 0"]),
        ({"kind": "spikes", "probability": 2.0}, ["faults.0.probability", "at most 1"]),
        ({"kind": "delay", "samples": 16}, ["faults.0.samples", "below 16"]),
        ({"kind": "bias", "size": [1.0, 2.0]}, ["faults.0.size"]),
        ({"kind": "bias", "sice": 1.0}, ["faults.0.sice"]),
    ],
)
def test_invalid_schedule_error_is_one_line(table, words):
    with pytest.raises(ValueError, match=words[0]) as error:
        compile_faults([table], imu.CHANNELS, TICK)
    assert all(word in str(error.value) for word in words)
    assert "\n" not in str(error.value)


def test_more_than_four_faults_are_rejected():
    with pytest.raises(ValueError, match="at most 4"):
        compile_faults([{"kind": "freeze"}] * 5, magnetometer.CHANNELS, TICK)


def test_empty_schedule_compiles_to_none():
    assert compile_faults([], imu.CHANNELS, TICK) is None
