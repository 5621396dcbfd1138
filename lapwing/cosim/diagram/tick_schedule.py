"""Lock step: which message is due on which input at which tick. One rule, for every executor.

A tick is one exchange interval. Every port has a period in ticks; at tick k a part gets exactly the messages that are
due on its inputs at k (or at k - delay), steps, and gives those of its outputs that are due at k. There is no central
barrier, and the result does not depend on the order of arrival.
"""

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from lapwing.cosim.run_errors import LockStepError
from lapwing.kernels import always_inline

LATCHED = 0  # period of a port whose value is due at every tick, and stays until another is given


class Port(NamedTuple):
    """A stream of values that one part gives and others take: a tree of numbers every `period` ticks, or KEPT."""

    name: str
    like: Any  # a value of this port: fixes the shape and the types
    period: int = 1  # [ticks]


class InputPort(NamedTuple):
    """A port that a part takes, `delay` ticks after it was stamped (at least 1 where it closes a loop)."""

    port: str
    delay: int = 0


@always_inline
def due(tick: int, period: int, delay: int) -> int:
    """The tick with which the message due at `tick` is stamped; -1 where none is."""
    stamp = tick - delay
    return stamp if stamp >= 0 and (period <= 1 or stamp % period == 0) else -1


def execution_order(needs: Mapping[str, Iterable[InputPort]], gives: Mapping[str, Iterable[str]]) -> list[str]:
    """An order in which, within one tick, everybody comes after those whose undelayed messages it needs.

    Args:
        needs: the inputs of each participant.
        gives: the names of the ports that each participant gives.

    Raises:
        LockStepError: a loop has no delay in it, or an input has no producer.
    """
    producer = {port: name for name, ports in gives.items() for port in ports}
    for name, inputs in needs.items():
        for needed in inputs:
            if needed.port not in producer:
                raise LockStepError(f"{name} needs {needed.port}, which no service of this scene gives")
    waiting = {name: {producer[i.port] for i in inputs if i.delay == 0} - {name} for name, inputs in needs.items()}
    order: list[str] = []
    while waiting:
        ready = sorted(name for name, before in waiting.items() if before <= set(order))
        if not ready:
            raise LockStepError(f"a loop without delay: {', '.join(sorted(waiting))}")
        order += ready
        for name in ready:
            del waiting[name]
    return order
