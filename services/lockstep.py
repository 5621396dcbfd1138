"""Lock step: who waits for which message at which tick. Pure bookkeeping, shared by all three speeds.

A tick is one exchange interval. Every topic has a period in ticks; at tick k a service gets exactly the messages that
are due at k (or at k - delay) on its inputs, steps, and gives those of its outputs that are due at k. There is no
central barrier: a service that has its inputs goes on, and the result does not depend on the order of arrival.
"""

from collections.abc import Iterable
from typing import Any, NamedTuple, Protocol

from messages.topics import Topic


class Input(NamedTuple):
    """A topic that a service needs, `delay` ticks after it was stamped (at least 1 where it closes a loop).

    One that is `external` comes from outside the lock step: nobody waits for it. When it is due, the service's shell
    joins what has arrived into one message of that tick, records it, and hands it over.
    """

    topic: Topic
    delay: int = 0
    external: bool = False


class Service(Protocol):
    """A participant of the lock step: what it needs, what it gives, and its pure step."""

    inputs: tuple[Input, ...]
    outputs: tuple[Topic, ...]

    def prepare(self) -> None:
        """Compile or load the kernels, so that no step has to wait for that."""
        ...

    def step(self, tick: int, *messages: Any) -> Iterable[tuple[Topic, Any]]:
        """The messages of this tick; `messages` follow `inputs`, None where none is due."""
        ...


class LockStepError(RuntimeError):
    """The lock step cannot go on; the text says who waits for what."""


def due(tick: int, period: int, delay: int = 0) -> bool:
    """Whether an input of this period and delay has a message to be taken at `tick`."""
    stamped = tick - delay
    return stamped >= 0 and stamped % period == 0


def published(services: Iterable[Service]) -> set[Topic]:
    """The topics of a run: what its services give, and what comes from outside."""
    found = {topic for service in services for topic in service.outputs}
    return found | {i.topic for service in services for i in service.inputs if i.external}


def execution_order(services: dict[str, Service]) -> list[str]:
    """An order in which, within one tick, everybody comes after those whose undelayed messages it needs.

    Raises:
        LockStepError: a loop has no delay in it, or an input has no producer.
    """
    producer = {topic: name for name, service in services.items() for topic in service.outputs}
    for name, service in services.items():
        for needed in service.inputs:
            if needed.topic not in producer and not needed.external:
                raise LockStepError(f"{name} needs {needed.topic.name}, which no service of this scene gives")
    waiting = {
        name: {producer[i.topic] for i in service.inputs if i.delay == 0 and not i.external} - {name}
        for name, service in services.items()
    }
    order: list[str] = []
    while waiting:
        ready = sorted(name for name, needs in waiting.items() if needs <= set(order))
        if not ready:
            raise LockStepError(f"a loop without delay: {', '.join(sorted(waiting))}")
        order += ready
        for name in ready:
            del waiting[name]
    return order
