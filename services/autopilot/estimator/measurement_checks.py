"""Detection of stuck readings and bookkeeping of gate results."""

from lapwing.dynamics.vector import Vec3
from lapwing.kernels import kernel
from lapwing.services.autopilot.estimator.filter_state import Memory


@kernel
def is_stuck(m: Memory, source: int, first: Vec3, second: Vec3, noisy: bool, limit: int) -> bool:
    """Return True if a noisy instrument is stuck: it has repeated the same numbers `limit` times.

    Args:
        m: `Memory`, changed in place.
        source: index into SOURCES.
        first: three numbers of the reading.
        second: three more.
        noisy: the reading has a positive variance; ideal instruments may repeat at rest.
        limit: number of repetitions that noise excludes; larger for coarse rounding.
    """
    same = noisy
    for i in range(3):
        same = same and m.last[source, i] == first[i] and m.last[source, 3 + i] == second[i]
        m.last[source, i] = first[i]
        m.last[source, 3 + i] = second[i]
    m.repeats[source] = m.repeats[source] + 1 if same else 0
    return m.repeats[source] >= limit


@kernel
def record_gate_result(m: Memory, source: int, accepted: bool, nis: float) -> None:
    """Record the gate result of a reading."""
    m.rejected[source] = 0 if accepted else 1
    m.nis[source] = nis
    if accepted:
        m.since[source] = 0
