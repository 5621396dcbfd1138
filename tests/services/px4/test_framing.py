"""Frames of the simulator link, against pymavlink as an independent implementation."""

import random

import pytest
from pymavlink.dialects.v20 import all as mavlink

from lapwing.services.px4.framing import FrameParser, checksum, frame
from lapwing.services.px4.messages import (
    COMMAND_LONG,
    DISTANCE_SENSOR,
    HEARTBEAT,
    HIL_ACTUATOR_CONTROLS,
    HIL_GPS,
    HIL_SENSOR,
)

LAYOUTS = (HIL_SENSOR, HIL_GPS, DISTANCE_SENSOR, HIL_ACTUATOR_CONTROLS, HEARTBEAT, COMMAND_LONG)


def codec(system=1):
    return mavlink.MAVLink(None, srcSystem=system, srcComponent=1)


def controls(time_us, values=(0.5, 0.25, 0.125, 0.0625), mode=129, flags=1):
    return mavlink.MAVLink_hil_actuator_controls_message(time_us, [*values, *(0.0,) * 12], mode, flags)


def read(data):
    return mavlink.MAVLink(None).parse_buffer(data)[0]


@pytest.mark.parametrize("layout", LAYOUTS, ids=lambda layout: str(layout.number))
def test_layouts_equal_dialect(layout):
    known = mavlink.mavlink_map[layout.number]
    assert layout.extra == known.crc_extra
    assert layout.fields.size == known.unpacker.size


def test_checksum_equals_x25():
    random.seed(1)
    for length in (1, 2, 7, 30, 81, 82, 270):
        data = random.randbytes(length)
        assert checksum(data) == mavlink.x25crc(data).crc


def test_frame_equals_pymavlink():
    message = mavlink.MAVLink_hil_sensor_message(123456789, *(0.1 * k for k in range(13)), 0x1FFF, 0)
    sender = codec()
    sender.seq = 77
    values = tuple(getattr(message, name) for name in message.ordered_fieldnames)
    assert frame(HIL_SENSOR, 77, values, 1, 1) == message.pack(sender)


@pytest.mark.parametrize("old", [False, True])
def test_parser_reads_both_versions(old):
    data = controls(1000).pack(codec(), force_mavlink1=old)
    ((number, values),) = FrameParser((HIL_ACTUATOR_CONTROLS,)).parse(data)
    assert number == 93
    assert values[:2] == (1000, 1)
    assert values[2:6] == (0.5, 0.25, 0.125, 0.0625)
    assert values[18] == 129


def test_parser_joins_pieces():
    data = b"".join(controls(k).pack(codec()) for k in range(5))
    parser, times = FrameParser((HIL_ACTUATOR_CONTROLS,)), []
    for k in range(0, len(data), 7):
        times += [values[0] for _, values in parser.parse(data[k : k + 7])]
    assert times == [0, 1, 2, 3, 4]
    assert parser.rejected == 0


def test_parser_skips_other_messages():
    data = mavlink.MAVLink_attitude_message(1, *(0.1,) * 6).pack(codec()) + controls(9).pack(codec())
    parser = FrameParser((HIL_ACTUATOR_CONTROLS,))
    assert [values[0] for _, values in parser.parse(data)] == [9]
    assert parser.rejected == 0


def test_parser_counts_garbage_and_recovers():
    damaged = bytearray(controls(1).pack(codec()))
    damaged[20] ^= 0xFF
    parser = FrameParser((HIL_ACTUATOR_CONTROLS,))
    data = b"GET / HTTP/1.1\r\n\r\n" + controls(2).pack(codec()) + bytes(damaged) + controls(3).pack(codec()) * 3
    assert [values[0] for _, values in parser.parse(data)][-2:] == [3, 3]
    assert parser.rejected >= 2
