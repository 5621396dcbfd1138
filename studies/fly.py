"""Flies a scene in this process, in memory and compiled, as fast as it goes."""

from collections.abc import Collection
from typing import TypeVar

import numpy as np

from cosim.errors import DivergedError, LockStepError
from cosim.graph import Graph
from cosim.scene import Scene
from cosim.setup import Setup
from messages.topics import Topic
from services.common.operator import Operator, nobody
from services.processes import create_all
from services.table import resolve
from studies.flight import Flight

F = TypeVar("F", bound=Flight)

PAGE = 64  # ticks of ports that nobody asks for; the commander looks back less


def fly(
    run: Setup | Scene,
    only: Collection[Topic] | None = None,
    operator: Operator = nobody,
    kind: type[F] = Flight,  # type: ignore[assignment]
    rows: dict[str, np.ndarray] | None = None,
) -> F:
    """Fly to the end, or until a state is not sound: the verdict then says so.

    Args:
        run: what to fly.
        only: the topics wanted, None for all that are recorded; the fewer, the less memory and time.
        operator: gives the commands that have come until a tick.
        kind: the class of the flight, where more is to be had of it.
        rows: memory of the flight, for many that are looked at one after the other: the next one writes over it.
    """
    setup = run if isinstance(run, Setup) else resolve(run)
    services = create_all(setup, operator)
    wires = [wire for service in services for wire in service.wires]
    wanted = {wire.port for wire in wires if (wire.topic.recorded if only is None else wire.topic in only)}
    graph, failure, diverged = Graph(setup, services, PAGE, wanted, rows), "", False
    try:
        graph.advance(setup.last_tick + 1)
    except LockStepError as error:
        failure, diverged = str(error), isinstance(error, DivergedError)
    return kind.of(graph, only, failure, diverged)
