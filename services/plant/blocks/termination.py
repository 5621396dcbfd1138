"""End of a run: duration, mission end plus stop delay, or a non-finite state."""

from lapwing.cosim.diagram.compiled_block import CONTINUE, FINISHED, NON_FINITE
from lapwing.kernels import always_inline


@always_inline
def termination_status(tick: int, last: int, is_finite: bool) -> int:
    """Return the plant's step status at `tick` of a run with last tick `last`."""
    if not is_finite:
        return NON_FINITE
    return FINISHED if tick >= last else CONTINUE
