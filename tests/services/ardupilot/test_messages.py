"""Packets of ArduPilot's JSON interface: bytes, frames and signs."""

import json
import math
import struct

import numpy as np
import pytest

from lapwing.kernels import kernel
from lapwing.services.ardupilot.servo_packet import ANY, RESENT, RESTARTED, decode, frames_ahead, pulse_range, throttle
from lapwing.services.ardupilot.state_message import INVALID, Extras, VehicleState, write_state

pytestmark = pytest.mark.usefixtures("uncompiled")


def packet(count=1, pwm=(1000,) * 16, magic=18458, rate=1200):
    return struct.pack(f"<HHI{len(pwm)}H", magic, rate, count, *pwm)


def yawed(yaw):
    """Return the attitude with a yaw of `yaw` [rad], counter-clockwise from east."""
    return math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw)


@kernel
def write(out, time, state, extras):
    return write_state(out, time, state, extras)


NO_EXTRAS = Extras()


def encode(time, state, extras=NO_EXTRAS):
    """Return the message."""
    out = np.zeros(2048, np.uint8)
    size = write(out, time, state, extras)
    return out[:size].tobytes() if size != INVALID else None


def sent(time=1.0, **state):
    return json.loads(encode(time, VehicleState(**state)))


def rotation(q):
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def test_servo_packet_of_16_and_32_channels():
    result = decode(packet(7, tuple(range(1000, 1016))))
    assert (result.frame_rate, result.frame_count, result.pwm[0], result.pwm[15]) == (1200, 7, 1000, 1015)
    assert len(decode(packet(7, (1500,) * 32, 29569)).pwm) == 32


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "0 bytes"),
        (packet()[:-2], "38 bytes with magic number 18458, expected 40"),
        (packet() + b"\0", "41 bytes"),
        (packet(magic=1), "magic number 1, expected 18458 or 29569"),
        (packet(magic=29569), "expected 72"),
        (packet(rate=0), "frame rate 0"),
        (packet(pwm=(65535,) * 16), "pulse width of 65535 us"),
    ],
)
def test_malformed_servo_packet_is_rejected(data, message):
    with pytest.raises(ValueError, match=message):
        decode(data)


def test_throttle_is_limited():
    assert [throttle(pwm, *pulse_range({})) for pwm in (0, 1000, 1250, 2000, 2100)] == [0.0, 0.0, 0.25, 1.0, 1.0]
    narrow = pulse_range({"MOT_PWM_MIN": 1100.0, "MOT_PWM_MAX": 1900.0})
    assert [throttle(pwm, *narrow) for pwm in (0, 1000, 1100, 1300, 1900)] == [0.0, 0.0, 0.0, 0.25, 1.0]


@pytest.mark.parametrize(
    ("count", "expected", "ahead"),
    [(5, ANY, 0), (6, 6, 0), (6, 7, RESENT), (9, 7, 2), (0, 10, RESTARTED), (0xFFFFFFFF, ANY, 0), (0, 0x100000000, 0)],
)
def test_frames_ahead(count, expected, ahead):
    assert frames_ahead(count, expected) == ahead


def test_level_at_rest_has_negative_acceleration_in_frd():
    result = sent(specific_force_body=(0.0, 0.0, 9.81))
    assert result["imu"]["accel_body"] == [0, 0, -9.81]


def test_body_vectors_are_frd_and_world_vectors_ned():
    result = sent(omega_body=(0.1, 0.2, 0.3), position_world=(1.0, 2.0, 3.0), velocity_world=(4.0, 5.0, 6.0))
    assert result["imu"]["gyro"] == [0.1, -0.2, -0.3]
    assert result["position"] == [2, 1, -3]
    assert result["velocity"] == [5, 4, -6]


@pytest.mark.parametrize(("yaw", "heading"), [(0.0, 90.0), (90.0, 0.0), (180.0, -90.0), (30.0, 60.0)])
def test_nose_east_is_heading_90(yaw, heading):
    nose = rotation(sent(attitude=yawed(math.radians(yaw)))["quaternion"])[:, 0]  # in NED
    assert math.degrees(math.atan2(nose[1], nose[0])) == pytest.approx(heading, abs=1e-6)


def test_attitude_maps_specific_force_to_gravity():
    """At rest the specific force is -g in NED's down direction at any attitude."""
    rng = np.random.default_rng(3)
    for _ in range(10):
        q = rng.normal(size=4)
        q /= np.linalg.norm(q)
        force = rotation(q).T @ (0.0, 0.0, 9.81)
        result = sent(attitude=tuple(q), specific_force_body=tuple(force))
        world = rotation(result["quaternion"]) @ result["imu"]["accel_body"]
        np.testing.assert_allclose(world, (0.0, 0.0, -9.81), atol=1e-6)


def test_message_has_no_spaces_and_ends_with_newline():
    data = encode(12.345678901, VehicleState(), Extras((1.0, math.inf, 2.5), 3.0, 11.1, 4.0))
    assert data.startswith(b"\n{")
    assert data.endswith(b"}\n")
    assert b" " not in data
    result = json.loads(data)
    assert result["timestamp"] == pytest.approx(12.345678901, abs=1e-9)
    assert (result["rng_1"], result["rng_3"], result["airspeed"]) == (1, 2.5, 3)
    assert "rng_2" not in result
    assert result["battery"] == {"voltage": 11.1, "current": 4}


def test_keys_are_not_prefixes_of_later_sections():
    """Check the keys in the text, where ArduPilot searches their first occurrence."""
    text = encode(1.0, VehicleState(), Extras((1.0,) * 6, 3.0, 11.1, 4.0)).decode()
    for key in ("timestamp", "imu", "gyro", "accel_body", "position", "quaternion", "velocity", "airspeed", "battery"):
        assert text.count(key) == 1


def test_non_finite_state_is_rejected():
    for value in (math.nan, math.inf, -1e9):
        assert encode(1.0, VehicleState(omega_body=(value, 0.0, 0.0))) is None
