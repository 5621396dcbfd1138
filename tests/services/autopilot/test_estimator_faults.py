"""Each fault of each sensor in flight: the source is rejected, the flight continues, and the source is used again."""

import estimator_flight as ef
import numpy as np
import pytest

from lapwing.services.autopilot import estimator
from lapwing.services.sensors import schema

START, STOP = 16.0, 22.0  # [s]

# sensor, fault, sources of which one must be rejected (none: no effect), largest position error meanwhile [m]
CASES = [
    ("gps", {"kind": "dropout"}, {"gps"}, 0.5),
    ("gps", {"kind": "freeze"}, {"gps"}, 0.5),
    ("gps", {"kind": "bias", "channel": "position", "size": [5.0, 0.0, 0.0]}, {"gps"}, 0.1),
    ("gps", {"kind": "bias", "channel": "velocity", "size": [1.0, 0.0, 0.0]}, {"gps_velocity"}, 0.1),
    ("gps", {"kind": "spikes", "channel": "position", "size": 3.0, "probability": 0.3}, {"gps"}, 0.1),
    ("gps", {"kind": "drift", "channel": "position", "size": 0.3}, {"gps"}, 0.1),
    ("gps", {"kind": "scale", "channel": "position", "size": 1.5}, {"gps"}, 0.1),
    ("gps", {"kind": "delay", "samples": 5}, {"gps", "gps_velocity"}, 5.0),
    ("barometer", {"kind": "dropout"}, {"barometer"}, 0.05),
    ("barometer", {"kind": "freeze"}, {"barometer"}, 0.05),
    ("barometer", {"kind": "bias", "size": 100.0}, {"barometer"}, 0.05),
    ("barometer", {"kind": "spikes", "size": 200.0}, {"barometer"}, 0.05),
    ("barometer", {"kind": "drift", "size": 20.0}, {"barometer"}, 0.05),
    ("barometer", {"kind": "scale", "size": 1.01}, {"barometer"}, 0.05),
    ("barometer", {"kind": "delay", "samples": 15}, set(), 0.05),
    ("sonar", {"kind": "dropout"}, {"sonar"}, 0.1),
    ("sonar", {"kind": "freeze"}, {"sonar"}, 0.1),
    ("sonar", {"kind": "bias", "size": 0.5}, {"sonar"}, 0.1),
    ("sonar", {"kind": "spikes", "size": 1.0, "probability": 0.3}, {"sonar"}, 0.1),
    ("sonar", {"kind": "drift", "size": 0.1}, {"sonar"}, 0.1),
    ("sonar", {"kind": "scale", "size": 1.2}, {"sonar"}, 0.1),
    ("sonar", {"kind": "delay", "samples": 5}, {"sonar"}, 0.1),
    ("magnetometer", {"kind": "dropout"}, {"magnetometer"}, 0.1),
    ("magnetometer", {"kind": "freeze"}, {"magnetometer"}, 0.1),
    ("magnetometer", {"kind": "bias", "size": [2e-5, 0.0, 0.0]}, {"magnetometer"}, 0.1),
    ("magnetometer", {"kind": "spikes", "size": 2e-5}, {"magnetometer"}, 0.1),
    ("magnetometer", {"kind": "drift", "size": 2e-6}, {"magnetometer"}, 0.1),
    ("magnetometer", {"kind": "scale", "size": [1.5, 1.0, 1.0]}, {"magnetometer"}, 0.1),
    ("magnetometer", {"kind": "delay", "samples": 15}, {"magnetometer"}, 0.1),
    ("imu", {"kind": "dropout", "stop": START + 0.3}, {"imu"}, 0.2),
    ("imu", {"kind": "freeze", "stop": START + 0.3}, {"imu"}, 0.2),
    ("imu", {"kind": "bias", "channel": "gyro", "size": [0.02, 0.0, 0.0]}, {"gps"}, 1.0),
    ("imu", {"kind": "bias", "channel": "accelerometer", "size": [0.5, 0.0, 0.0]}, {"gps"}, 1.0),
    ("imu", {"kind": "spikes", "channel": "gyro", "size": 5.0, "probability": 0.02}, set(), 0.2),
    ("imu", {"kind": "spikes", "channel": "accelerometer", "size": 50.0, "probability": 0.02}, {"imu"}, 0.2),
    ("imu", {"kind": "drift", "channel": "gyro", "size": 0.01}, {"gps_velocity"}, 1.0),
    ("imu", {"kind": "scale", "channel": "gyro", "size": 1.1}, {"gps"}, 1.0),
    ("imu", {"kind": "scale", "channel": "accelerometer", "size": 1.05}, {"gps_velocity"}, 1.0),
    ("imu", {"kind": "delay", "samples": 5}, set(), 0.2),
]


@pytest.mark.long
@pytest.mark.parametrize(("sensor", "fault", "rejected", "largest"), CASES)
def test_sensor_fault_is_rejected_and_recovers(sensor, fault, rejected, largest):
    p = schema.parameters(sensor, {"faults": [{"start": START, "stop": STOP, **fault}]}, ef.INTERVAL)
    flight = ef.flight(seed=3, instruments=ef.sensor_parameters(**{sensor: p}))
    bits = np.bitwise_or.reduce(flight.rejected[round(START * 10) : round(STOP * 10) + 5])
    named = {name for i, name in enumerate(estimator.SOURCES) if bits >> i & 1}
    assert named >= rejected
    if sensor not in ("imu", "gps"):
        assert named <= {sensor}
    distance = np.linalg.norm(flight.error[:, ef.P], axis=1)
    assert distance[100:].max() < largest
    assert distance[-70:].max() < 0.05
    assert np.linalg.norm(flight.error[-70:, ef.THETA], axis=1).max() < 0.03
    assert flight.health[-1] == 0


@pytest.mark.long
def test_health_reports_loss_and_recovery():
    p = schema.parameters("gps", {"faults": [{"kind": "dropout", "start": START, "stop": STOP}]}, ef.INTERVAL)
    health = ef.flight(seed=3, instruments=ef.sensor_parameters(gps=p)).health
    lost = 1 << estimator.SOURCES.index("gps") | 1 << estimator.SOURCES.index("gps_velocity")
    assert np.all(health[165:215] == lost)
    assert not health[100:158].any()
    assert not health[240:].any()
