"""Numbers as decimal text with a fixed precision, written by compiled code."""

from typing import Any

from lapwing.kernels import always_inline, math, noinline

LIMIT = 9e8  # numbers below it have up to 10 decimals in an integer of 64 bits
_ZERO, _MINUS, _POINT = b"0-."


@always_inline
def write_text(out: Any, at: int, text: Any) -> int:
    """Write bytes into `out` at index `at`. Return the index after them."""
    for k in range(len(text)):
        out[at + k] = text[k]
    return at + len(text)


@noinline
def write_number(out: Any, at: int, value: float, decimals: int, scale: int) -> int:
    """Write a number, rounded to `decimals` decimals, without zeros at its end; its absolute value is below LIMIT.

    Args:
        out: buffer of bytes.
        at: index of the first byte.
        value: number to write.
        decimals: at most 10.
        scale: 10^decimals.

    Returns:
        The index after the number.
    """
    n = int(math.fabs(value) * scale + 0.5)
    if value < 0.0 and n > 0:
        out[at] = _MINUS
        at += 1
    whole, rest = n // scale, n % scale
    digits, power = 1, 10
    while whole >= power:
        digits, power = digits + 1, power * 10
    for k in range(digits):
        out[at + digits - 1 - k] = _ZERO + whole % 10
        whole //= 10
    at += digits
    if rest == 0:
        return at
    out[at] = _POINT
    at += 1 + decimals
    for k in range(decimals):
        out[at - 1 - k] = _ZERO + rest % 10
        rest //= 10
    while out[at - 1] == _ZERO:
        at -= 1
    return at
