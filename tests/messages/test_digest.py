import hashlib
import struct

import numpy as np
import pytest

from lapwing.messages.digest import Digest

A = [("/a", t, bytes([t % 256])) for t in range(5000)]
B = [("/b", t, b"x" * (t % 7)) for t in range(300)]


def digest(entries):
    result = Digest()
    for entry in entries:
        result.update(*entry)
    return result.hexdigest()


def test_digest_equals_definition():
    parts = hashlib.blake2b(b"".join(struct.pack("<qQ", t, len(p)) + p for _, t, p in A), digest_size=32)
    assert digest(A) == hashlib.blake2b(b"\2\0\0\0/a" + parts.digest(), digest_size=16).hexdigest()


def test_digest_is_independent_of_topic_interleaving():
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
def test_digest_depends_on_order_times_names_and_contents(other):
    assert digest(other) != digest(A)


def test_hexdigest_leaves_digest_unchanged():
    one, other = Digest(), Digest()
    for entry in A[:10]:
        one.update(*entry)
        one.hexdigest()
        other.update(*entry)
    assert one.hexdigest() == other.hexdigest()


@pytest.mark.parametrize("n", [0, 1, 300])
def test_batch_digest_equals_message_digests(n):
    rng = np.random.default_rng(n)
    times = rng.integers(-5, 1 << 60, n)
    payloads = rng.integers(0, 256, (n, 37), dtype=np.uint8)
    one, page = Digest(), Digest()
    for digest_ in (one, page):
        digest_.update("/b", 1, b"before")
    for time_ns, payload in zip(times.tolist(), payloads, strict=True):
        one.update("/a", time_ns, payload.tobytes())
        one.update("/b", time_ns, payload.tobytes())
    page.update_page("/a", times, payloads)
    page.update_page("/b", times, payloads)
    for digest_ in (one, page):
        digest_.update("/b", 2, b"behind")
    assert one.hexdigest() == page.hexdigest()


def test_page_needs_time_for_each_payload():
    with pytest.raises(ValueError, match="/a: 2 times for 3 payloads"):
        Digest().update_page("/a", np.zeros(2, np.int64), np.zeros((3, 8), np.uint8))
