"""Frames against those of pymavlink, byte by byte."""

import random
import struct
from collections import Counter

import pytest
from adapter_harness import Bench

from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.mavlink.channel import Channel, frame
from lapwing.services.mavlink.endpoint import MAX_DATAGRAM
from lapwing.services.mavlink.signing import Signature

SYSTEM = 7
SIZES = {"b": 8, "B": 8, "h": 16, "H": 16, "i": 32, "I": 32, "q": 64, "Q": 64}


def value(rng, code, length, empty):
    """Return a value of a field with this `struct` format character."""
    if code in "cs":
        size = rng.randrange(length + 1) if length else 1
        return bytes(1) * (not length) if empty else bytes(rng.randrange(1, 128) for _ in range(size))
    if length:
        return [value(rng, code, 0, empty) for _ in range(length)]
    if empty:
        return 0
    if code in "fd":
        return rng.choice([rng.gauss(0.0, 1e3), float("nan"), float("inf"), -0.0])
    bits = SIZES[code]
    return rng.randrange(1 << bits) - (1 << bits - 1 if code.islower() else 0)


def arguments(kind, seed, empty=False):
    """Return random arguments of a message class."""
    rng, codes = random.Random(seed), kind.native_format.decode()[1:]
    by_wire = [value(rng, code, kind.array_lengths[i], empty) for i, code in enumerate(codes)]
    return tuple(by_wire[i] for i in kind.orders)


def example(kind, seed, empty=False):
    """Return a message of a class with random fields."""
    return kind(*arguments(kind, seed, empty))


def test_every_message_of_dialect_has_bytes_of_pymavlink():
    fast = 0
    for kind in mavlink.mavlink_map.values():
        for seed in range(4):
            codec = mavlink.MAVLink(None, SYSTEM, 1)
            codec.seq = 60 * seed
            message = example(kind, seed, empty=seed == 0)
            result = frame(message, codec.seq, SYSTEM, 1)
            fast += result is not None
            expected = example(kind, seed, empty=seed == 0).pack(codec)
            assert result in (None, expected), kind.msgname
            if result is not None:
                assert frame((kind, arguments(kind, seed, empty=seed == 0)), codec.seq, SYSTEM, 1) == expected, (
                    kind.msgname
                )
    assert fast > 4 * 100


@pytest.mark.parametrize("signature", [None, Signature(bytes(32))], ids=["unsigned", "signed"])
def test_channel_numbers_its_frames_and_codec_reads_them(signature):
    channel, reader = Channel((SYSTEM, 1), signature, True, Counter()), mavlink.MAVLink(None, 255, 190)
    if signature:
        reader.signing.secret_key = bytes(32)
    for k in range(300):
        message = mavlink.MAVLink_attitude_message(k, 0.1, -0.2, 3.0, 0.0, 0.0, 0.0)
        numbers = type(message), (k, 0.1, -0.2, 3.0, 0.0, 0.0, 0.0)
        (actual,) = reader.parse_buffer(channel.encode(numbers if k % 2 else message))
        assert (actual.get_seq(), actual.time_boot_ms, actual.get_signed()) == (k % 256, k, signature is not None)


@pytest.mark.parametrize("signature", [None, Signature(bytes(32))], ids=["unsigned", "signed"])
def test_number_beyond_float_of_32_bits_is_not_sent_and_counted(signature):
    counts = Counter()
    channel = Channel((SYSTEM, 1), signature, True, counts)
    assert channel.encode(mavlink.MAVLink_attitude_message(0, 1e39, 0.0, 0.0, 0.0, 0.0, 0.0)) == b""
    assert counts.total() == 1
    (actual,) = mavlink.MAVLink(None, 255, 190).parse_buffer(
        channel.encode(mavlink.MAVLink_attitude_message(0, 3e38, 0.0, 0.0, 0.0, 0.0, 0.0))
    )
    assert actual.get_seq() == 0


def test_simultaneous_messages_share_datagrams():
    bench, pieces = Bench(), []
    bench.adapter.connect(True, True, pieces.append)
    bench.step(100)
    codec = mavlink.MAVLink(None, 255, 190)
    counts = [len(codec.parse_buffer(piece)) for piece in pieces]
    assert sum(counts) > 2.0 * len(counts)
    assert 200 < max(map(len, pieces)) <= MAX_DATAGRAM


def test_frame_bytes_match_mavlink_guide():
    """MAVLink guide, "Packet Serialization": marker, length, flags, number, sender, message id, payload, checksum."""
    result = frame(mavlink.MAVLink_heartbeat_message(2, 12, 81, 65536, 4, 3), 5, 1, 1)
    assert result[:10] == bytes([0xFD, 9, 0, 0, 5, 1, 1, 0, 0, 0])
    assert result[10:19] == struct.pack("<IBBBBB", 65536, 2, 12, 81, 4, 3)
    assert mavlink.x25crc(result[1:19] + bytes([50])).crc == struct.unpack("<H", result[19:])[0]  # 50: CRC_EXTRA
