"""Tick schedule: the rule for when a sample is due at an input, for all executors.

A tick is one communication interval. A port has a period in ticks; at tick k a block gets exactly the samples that are
due at its inputs at k (or at k - delay), steps, and writes those of its outputs that are due at k. There is no central
barrier, and the result does not depend on the order of arrival.
"""

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from lapwing.cosim.run_errors import LockStepError
from lapwing.kernels import always_inline

LATCHED = 0  # period of a port whose value is due at every tick and held until the next one


class Port(NamedTuple):
    """Stream of values from one block to others: a tree of numbers every `period` ticks, or LATCHED."""

    name: str
    example: Any  # example value: fixes the shape and the types
    period: int = 1  # [ticks]


class InputPort(NamedTuple):
    """Input of a block: a port, read `delay` ticks after its stamp (at least 1 in a loop)."""

    port: str
    delay: int = 0


@always_inline
def due(tick: int, period: int, delay: int) -> int:
    """Return the stamp of the sample that is due at `tick`; -1 if none is."""
    stamp = tick - delay
    return stamp if stamp >= 0 and (period <= 1 or stamp % period == 0) else -1


def execution_order(inputs: Mapping[str, Iterable[InputPort]], outputs: Mapping[str, Iterable[str]]) -> list[str]:
    """Return an order in which each participant steps after the producers of its undelayed inputs.

    Args:
        inputs: input ports of each participant.
        outputs: names of the output ports of each participant.

    Raises:
        LockStepError: there is an algebraic loop, or an input has no producer.
    """
    producer = {port: name for name, ports in outputs.items() for port in ports}
    for name, own in inputs.items():
        for needed in own:
            if needed.port not in producer:
                raise LockStepError(f"{name} needs {needed.port}, which no service of this scene publishes")
    waiting = {name: {producer[i.port] for i in own if i.delay == 0} - {name} for name, own in inputs.items()}
    order: list[str] = []
    while waiting:
        ready = sorted(name for name, before in waiting.items() if before <= set(order))
        if not ready:
            loop = ", ".join(sorted(waiting))
            raise LockStepError(f"algebraic loop: {loop}; give one input a delay of at least 1 tick")
        order += ready
        for name in ready:
            del waiting[name]
    return order
