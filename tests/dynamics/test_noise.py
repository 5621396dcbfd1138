"""Noise against published vectors, an independent normal quantile, and moments."""

import numpy as np
import pytest
from scipy import special, stats

from lapwing.dynamics import noise
from lapwing.kernels import kernel

# Known-answer vectors of Random123 (tests/kat_vectors, "philox4x32 10"): counter, key, result.
KNOWN = [
    ("00000000 00000000 00000000 00000000", "00000000 00000000", "6627e8d5 e169c58d bc57ac4c 9b00dbd8"),
    ("ffffffff ffffffff ffffffff ffffffff", "ffffffff ffffffff", "408f276d 41c83b0e a20bc7c6 6d5451fd"),
    ("243f6a88 85a308d3 13198a2e 03707344", "a4093822 299f31d0", "d16cfe09 94fdcceb 5001e420 24126ea1"),
]


def hexadecimal(text):
    return [np.uint64(int(word, 16)) for word in text.split()]


@pytest.mark.parametrize(("counter", "key", "expected"), KNOWN)
def test_philox_known_answers(counter, key, expected):
    result = noise.philox(*hexadecimal(counter), *hexadecimal(key))
    assert [int(word) for word in result] == [int(word) for word in hexadecimal(expected)]


def test_tick_fills_64_bits_and_lane_third_word():
    key = (0xA4093822, 0x299F31D0)
    tick = 0x85A308D3_243F6A88 - 2**64  # as a signed integer
    expected = noise.philox(*hexadecimal("243f6a88 85a308d3 00000007 00000000"), *hexadecimal("a4093822 299f31d0"))
    assert noise.words(key, tick, 7) == expected


def test_normal_quantile_against_scipy():
    p = np.concatenate([np.linspace(1e-6, 1 - 1e-6, 2001), 2.0 ** -np.arange(2.0, 60.0)])
    ours = np.array([noise.normal_quantile(x) for x in p])
    np.testing.assert_allclose(ours, special.ndtri(p), rtol=4e-15, atol=1e-16)


@kernel
def many(key, n, out):
    for tick in range(n):
        out[tick] = noise.normal3(key, tick, 0)


def draws(key, n=200_000):
    out = np.empty((n, 3))
    many(key, n, out)
    return out


@pytest.mark.long
def test_normal_draws_are_normal_and_white():
    x = draws(noise.stream_key(1, "drone1", "imu"))
    n = x.size
    assert abs(x.mean()) < 4 / np.sqrt(n)
    assert abs(x.var() - 1) < 4 * np.sqrt(2 / n)
    assert stats.kstest(x.ravel(), "norm").pvalue > 1e-3
    # Cross-correlation of the three draws of a tick, and with the next ticks: zero within 4.5 standard errors.
    z = x[:-5]
    for lag in range(6):
        correlation = z.T @ x[lag : len(z) + lag] / len(z)
        if lag == 0:
            correlation -= np.eye(3)
        assert np.abs(correlation).max() < 4.5 * np.sqrt(2 / len(z))


def test_streams_are_independent_across_seeds_vehicles_and_names():
    names = [(1, "a", "imu"), (2, "a", "imu"), (1, "b", "imu"), (1, "a", "gps"), (12, "a", "imu"), (-1, "a", "imu")]
    n = 100_000
    streams = np.array([draws(noise.stream_key(*name), n)[:, 0] for name in names])
    correlation = streams @ streams.T / n - np.diag((streams**2).mean(axis=1))
    assert np.abs(correlation).max() < 4.5 / np.sqrt(n)


def test_keys_are_stable_and_do_not_collide_at_seams():
    assert noise.stream_key(1, "drone1", "imu") == noise.stream_key(1, "drone1", "imu")
    assert noise.stream_key(1, "a", "bc") != noise.stream_key(1, "ab", "c")
    assert noise.stream_key(1, "1", "") != noise.stream_key(11, "", "")
    keys = {noise.stream_key(seed, v, s) for seed in range(100) for v in ("a", "b") for s in ("imu", "gps")}
    assert len(keys) == 400


def test_golden_values_pin_bits():
    """Golden values detect any change of a scene's noise."""
    key = noise.stream_key(42, "drone1", "imu")
    uniform = (0.11378459015395492, 0.6023793310159817, 0.15549789380747825, 0.7433139720233157)
    normal = (-1.206644243225024, 0.2595105565941289, -1.0131347799287371)
    assert key == (4068878825, 4095216003)
    assert noise.uniform4(key, 5, 2) == uniform
    assert noise.uniform(key, 5, 2) == uniform[0]
    assert noise.normal3(key, 5, 2) == normal
    assert noise.normal(key, 5, 2) == normal[0]
    assert noise.uniform(key, noise.TURN_ON, 0) != noise.uniform(key, 0, 0)
