"""Damage to bytes, as chance or somebody with bad intentions does it."""

import random

TOKENS = (
    *(b"", b"\0", b"\xff" * 4, b"\xff" * 8, b"\0\0\0\x80", b"\xff\xff\xff\x7f", b"inf", b"nan", b"-1", b"1e999"),
    *(b"9" * 400, b"[" * 2000, b"{" * 50, b'"', b"\n", b"null", b"[]", b"{}", b"=", b"'''", b"\xc3\x28", b"true"),
)
MOST = 1 << 16  # [bytes]


def mutated(chance: random.Random, seeds: tuple[bytes, ...]) -> bytes:
    """A seed with a few places damaged; now and then nothing but noise."""
    if chance.random() < 0.02:
        return chance.randbytes(chance.randrange(600))
    data = bytearray(chance.choice(seeds))
    for _ in range(chance.choice((1, 1, 2, 3, 8))):
        place = chance.randrange(len(data) + 1)
        match chance.randrange(5):
            case 0 if data:
                data[place % len(data)] ^= 1 << chance.randrange(8)
            case 1 if data:
                data[place % len(data)] = chance.randrange(256)
            case 2:
                data[place:place] = chance.choice(TOKENS)
            case 3:
                del data[place : place + chance.choice((1, 2, 4, 8, 64, len(data)))]
            case _:
                other = chance.choice(seeds)
                start = chance.randrange(len(other) + 1)
                data[place : place + chance.randrange(16)] = other[start : start + chance.randrange(64)]
    return bytes(data[:MOST])
