"""Adaptive run of the Munthe-Kaas 5(4) pair: PI step controller, and output at given times without shortening steps."""

from lapwing.dynamics.integrators._fixed_step import rate
from lapwing.dynamics.integrators.rkmk54 import between, stages
from lapwing.kernels import kernel, math
from lapwing.kernels.state_tree import error_ratio, finite, flatten, largest, scale

DONE, STEP_TOO_SMALL, NOT_FINITE = 0, 1, 2
SAFETY, SHRINK, GROW = 0.9, 0.2, 10.0
BETA = 0.04  # integral gain of the controller (Hairer, Wanner: Solving ODEs II, section IV.2)


@kernel
def integrate_adaptive(p, x, times, tolerance, out):
    """Write the state's numbers at each of `times` (increasing, the first that of x) into the rows of `out`.

    Return (status, t, x, steps, rejected) at the end (theory, eq. (6.17)).
    """
    t, end = times[0], times[-1]
    f = rate(p, t, x)
    steps = rejected = row = 0
    previous = 1e-4
    h = min(end - t, 0.01 * (1.0 + largest(x)) / (largest(f) + 1e-300))
    while row < len(times):
        if not finite(f):
            return NOT_FINITE, t, x, steps, rejected
        last_step = t + h >= end
        h = min(h, end - t)
        if h < 1e-14 * max(abs(t), end - times[0]) and not last_step:
            return STEP_TOO_SMALL, t, x, steps, rejected
        after, u, e, k, last = stages(rate, p, t, x, h, scale(h, f))
        # a maximum ignores NaN, which therefore needs a separate check
        ratio = error_ratio(x, e) / tolerance if finite(e) else math.inf
        if ratio > 1.0:
            rejected += 1
            h *= max(SHRINK, SAFETY / math.pow(ratio, 0.2)) if ratio < 1e300 else SHRINK
            continue
        arrival = end if last_step else t + h
        while row < len(times) and times[row] <= arrival:
            numbers = flatten(between(x, u, k, (times[row] - t) / h) if times[row] < arrival else after)
            for i in range(len(numbers)):
                out[row, i] = numbers[i]
            row += 1
        factor = SAFETY * math.pow(previous, BETA) / math.pow(max(ratio, 1e-10), 0.2 - 0.75 * BETA)
        previous = max(ratio, 1e-4)
        x, f = after, scale(1.0 / h, last)
        t = arrival
        steps += 1
        h *= min(GROW, max(SHRINK, factor))
    return DONE, t, x, steps, rejected
