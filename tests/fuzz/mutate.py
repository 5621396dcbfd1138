"""Random and malicious damage to bytes."""

import random

TOKENS = (
    *(b"", b"\0", b"\xff" * 4, b"\xff" * 8, b"\0\0\0\x80", b"\xff\xff\xff\x7f", b"inf", b"nan", b"-1", b"1e999"),
    *(b"9" * 400, b"[" * 2000, b"{" * 50, b'"', b"\n", b"null", b"[]", b"{}", b"=", b"'''", b"\xc3\x28", b"true"),
)
MOST = 1 << 16  # [bytes]
PLACES = (1, 1, 2, 3, 8)
CUTS = (1, 2, 4, 8, 64, MOST)  # [bytes]


def mutated(chance: random.Random, seeds: tuple[bytes, ...]) -> bytes:
    """Return a seed with damage in a few places; occasionally only noise."""
    draw = chance.random  # an index of n is int(n * draw()): five times as fast as `choice` and `randrange`
    if draw() < 0.02:
        return chance.randbytes(int(600 * draw()))
    data = bytearray(seeds[int(len(seeds) * draw())])
    for _ in range(PLACES[int(len(PLACES) * draw())]):
        place = int((len(data) + 1) * draw())
        match int(5 * draw()):
            case 0 if data:
                data[place % len(data)] ^= 1 << int(8 * draw())
            case 1 if data:
                data[place % len(data)] = int(256 * draw())
            case 2:
                data[place:place] = TOKENS[int(len(TOKENS) * draw())]
            case 3:
                del data[place : place + CUTS[int(len(CUTS) * draw())]]
            case _:
                other = seeds[int(len(seeds) * draw())]
                start = int((len(other) + 1) * draw())
                data[place : place + int(16 * draw())] = other[start : start + int(64 * draw())]
    return bytes(data[:MOST])
