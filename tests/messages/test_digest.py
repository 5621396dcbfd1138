import hashlib
import struct

import pytest

from messages.digest import Digest

A = [("/a", t, bytes([t % 256])) for t in range(5000)]
B = [("/b", t, b"x" * (t % 7)) for t in range(300)]


def digest(entries):
    result = Digest()
    for entry in entries:
        result.update(*entry)
    return result.hexdigest()


def test_definition():
    parts = hashlib.blake2b(b"".join(struct.pack("<qQ", t, len(p)) + p for _, t, p in A), digest_size=32)
    assert digest(A) == hashlib.blake2b(b"\2\0\0\0/a" + parts.digest(), digest_size=16).hexdigest()


def test_interleaving_of_topics_does_not_count():
    mixed = [entry for pair in zip(A, B, strict=False) for entry in pair] + A[len(B) :]
    assert digest(A + B) == digest(B + A) == digest(mixed)


@pytest.mark.parametrize(
    "other",
    [
        [A[1], A[0], *A[2:]],
        A[:-1],
        [("/c", t, p) for _, t, p in A],
        [("/a", 1, A[0][2]), *A[1:]],
        [("/a", 0, b"\1"), *A[1:]],
    ],
)
def test_order_times_names_and_contents_count(other):
    assert digest(other) != digest(A)


def test_reading_it_changes_nothing():
    one, other = Digest(), Digest()
    for entry in A[:10]:
        one.update(*entry)
        one.hexdigest()
        other.update(*entry)
    assert one.hexdigest() == other.hexdigest()
