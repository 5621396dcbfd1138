"""How a run ends: at its duration, a while after the mission, or because the numbers do."""

from lapwing.cosim.diagram.compiled_block import CONTINUE, FINISHED, NON_FINITE
from lapwing.kernels import always_inline


@always_inline
def signal(tick: int, last: int, sound: bool) -> int:
    """The plant's signal at `tick` of a run whose last tick is `last`."""
    if not sound:
        return NON_FINITE
    return FINISHED if tick >= last else CONTINUE
