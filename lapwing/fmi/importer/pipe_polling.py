"""Polling of a pipe in compiled code, because a sleeping process takes 10 to 30 us to wake up."""

import os

from lapwing.kernels import always_inline
from lapwing.kernels.native_calls import call_int

LOOKS = 200 if len(os.sched_getaffinity(0)) > 1 else 0
"""Number of polls (0.2 us each) before a process sleeps; on one processor, the other end cannot write meanwhile."""


@always_inline
def soon_readable(poll: int, entry: int, looks: int) -> bool:
    """Poll a pipe until it has data or its other end is closed, at most `looks` times.

    Args:
        poll: address of the C function.
        entry: address of a `struct pollfd`.
        looks: see `LOOKS`.
    """
    readable = False
    while looks > 0 and not readable:
        readable = call_int(poll, (entry, 1, 0)) != 0
        looks -= 1
    return readable
