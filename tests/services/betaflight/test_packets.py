"""Packets of Betaflight: sizes, frames, malformed bytes."""

import math

import numpy as np
import pytest
from betaflight_peer import status_reply
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from lapwing.services.betaflight import msp
from lapwing.services.betaflight.packets import MOTORS, RC, STATE, State, parse_motors, rc_packet, state_packet

HALF_TURN = np.diag([1.0, -1.0, -1.0])  # FLU to FRD


def test_packet_sizes_match_interface():
    assert (STATE.size, RC.size, MOTORS.size) == (144, 40, 16)


@pytest.mark.parametrize("seed", range(3))
def test_state_packet_has_frd_rates_and_turned_attitude(seed):
    random = np.random.default_rng(seed)
    rotation = Rotation.random(random_state=seed)
    x, y, z, w = rotation.as_quat()
    omega, force, velocity = random.normal(size=(3, 3))
    state = State(tuple(omega), tuple(force), (w, x, y, z), tuple(velocity), 40.5, 14.5, 300.0, 99000.0)
    result = STATE.unpack(state_packet(2.0, state))
    assert result[0] == 2.0
    assert result[1:4] == pytest.approx(HALF_TURN @ omega)
    assert result[4:7] == pytest.approx(HALF_TURN @ force)
    w, x, y, z = result[7:11]
    turned = HALF_TURN @ rotation.as_matrix() @ HALF_TURN
    assert Rotation.from_quat([x, y, z, w]).as_matrix() == pytest.approx(turned)
    assert result[11:] == pytest.approx((*velocity, 14.5, 40.5, 300.0, 99000.0))


def test_specific_force_at_rest_points_up():
    state = State((0, 0, 0), (0, 0, 9.81), (1, 0, 0, 0), (0, 0, 0), 0.0, 0.0, 0.0, 101325.0)
    assert STATE.unpack(state_packet(0.0, state))[4:7] == (0.0, 0.0, -9.81)


def test_rc_packet_pads_channels():
    assert RC.unpack(rc_packet(1.5, (1500, 1600)))[1:] == (1500, 1600, *(1000,) * 14)


@given(st.binary(max_size=40))
def test_random_motor_packets_are_parsed_or_rejected(data):
    try:
        result = parse_motors(data)
    except ValueError:
        return
    assert len(result) == 4
    assert all(map(math.isfinite, result))


class Stream:
    """Socket with bytes to read."""

    def __init__(self, data):
        self._data = data

    def recv(self, size):
        part, self._data = self._data[:size], self._data[size:]
        if not part:
            raise BlockingIOError
        return part


def connection(data):
    result = msp.Msp.__new__(msp.Msp)
    result._socket, result._data = Stream(data), b""
    return result


def test_status_names_reasons():
    ((command, payload),) = connection(status_reply(True, 1 << 7 | 1 << 12)).poll()
    assert command == msp.STATUS
    assert msp.parse_status(payload) == msp.FirmwareStatus(True, ("throttle not low", "calibrating"), 0.05)


def test_reply_follows_noise_and_wrong_check_sums():
    good = status_reply()
    bad = good[:-1] + bytes((good[-1] ^ 1,))
    assert len(connection(b"noise$M" + bad + good).poll()) == 1


@given(st.binary(max_size=200))
def test_random_bytes_are_replies_or_ignored(data):
    for command, payload in connection(b"$M>" + data).poll():
        if command == msp.STATUS:
            try:
                msp.parse_status(payload)
            except ValueError:
                continue


def test_short_status_is_rejected():
    with pytest.raises(ValueError, match="MSP status of 5 bytes is too short"):
        msp.parse_status(b"12345")
