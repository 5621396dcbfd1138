"""How a run ends: at its duration, a while after the mission, or because the numbers do."""

from lapwing.cosim.diagram.compiled_block import END, FAILED, GO_ON
from lapwing.kernels import leaf


@leaf
def signal(tick: int, last: int, sound: bool) -> int:
    """The plant's signal at `tick` of a run whose last tick is `last`."""
    if not sound:
        return FAILED
    return END if tick >= last else GO_ON
