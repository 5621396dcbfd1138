"""Output of the full covariance and of the normalised innovations."""

from typing import NamedTuple

from lapwing.cosim.diagram.compiled_block import CONTINUE, InputSample
from lapwing.kernels import always_inline, kernel
from lapwing.kernels.row_packing import load
from lapwing.services.autopilot.estimator.blocks.navigation_state import NavigationState
from lapwing.services.autopilot.estimator.filter_state import SIZE, WATCHED, Memory
from lapwing.services.common.ports import EstimateCovariance


class CovarianceOutput(NamedTuple):
    """Parameters of the block."""

    example: EstimateCovariance  # prototype of the sample


@kernel
def pack(m: Memory) -> None:
    """Write the upper triangle of the covariance and the normalised innovations to `m.packed`."""
    k = 0
    for i in range(SIZE):
        for j in range(i, SIZE):
            m.packed[0, k] = m.covariance[i, j]
            k += 1
    for i in range(WATCHED):
        m.packed[0, k + i] = m.nis[i]


@always_inline
def step(
    p: CovarianceOutput, s: NavigationState, tick: int, inputs: tuple[InputSample, ...]
) -> tuple[NavigationState, tuple[EstimateCovariance], int]:
    """Output the covariance at this tick."""
    pack(s.filter.memory)
    return s, (load(p.example, s.filter.memory.packed, 0),), CONTINUE
