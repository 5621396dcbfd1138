"""Simulation of a scene in this process, in memory and compiled, at full speed."""

from collections.abc import Callable, Collection, Mapping
from types import MappingProxyType
from typing import Any, TypeVar

import numpy as np

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.cosim.run_errors import DivergedError, LockStepError
from lapwing.cosim.scene import Scene
from lapwing.flights.flight_data import FlightData
from lapwing.messages.topics import Topic, template_topic
from lapwing.services.common.operator_inbox import Operator, no_operator
from lapwing.services.process_table import create_all
from lapwing.services.scene_resolver import resolve

F = TypeVar("F", bound=FlightData)

LOOK = 250  # [ticks] between two calls of an observer
KEPT_TICKS = 64  # [ticks] history of ports whose full history is not requested; more than the commander needs


def fly(
    run: RunConfig | Scene,
    only: Collection[Topic] | None = None,
    operator: Operator = no_operator,
    kind: type[F] = FlightData,  # type: ignore[assignment]
    rows: dict[str, np.ndarray] | None = None,
    observe: Callable[[int], None] | None = None,
) -> F:
    """Simulate a run to its end, or until it fails; a non-finite state gives the outcome "diverged".

    Args:
        run: run configuration or scene.
        only: topics to keep; None: all recorded ones. Fewer topics take less memory and time.
        operator: returns the commands received until a tick.
        kind: class of the result, a subclass of `FlightData`.
        rows: buffers of the topics, reused and overwritten by the next flight of a series.
        observe: called with the current tick after the compilation, and then every LOOK ticks.

    Raises:
        LockStepError: the run failed before its first tick, for example because a firmware did not start.
    """
    return kind.of(*_fly(run, only, operator, rows, observe))


def fly_each(
    run: RunConfig | Scene, only: Collection[Topic], rows: dict[str, np.ndarray] | None = None
) -> list[FlightData]:
    """Return the flights of all vehicles of a run. See `fly` for arguments."""
    return FlightData.of_each(*_fly(run, only, no_operator, rows))


def fly_with_ports(
    config: RunConfig,
    only: Collection[Topic] | None = None,
    observe: Callable[[int], None] | None = None,
    operator: Operator | Mapping[str, Operator] = no_operator,
    recorded: Mapping[str, Any] = MappingProxyType({}),
) -> tuple[list[FlightData], BlockDiagram]:
    """Return the flights of all vehicles, and the block diagram at the end with the full history of all ports.

    See `fly` and `process_table.create_all` for arguments.
    """
    diagram, _, failure, diverged = _fly(config, only, operator, None, observe, True, recorded)
    return FlightData.of_each(diagram, only, failure, diverged), diagram


def _fly(
    run: RunConfig | Scene,
    only: Collection[Topic] | None,
    operator: Operator | Mapping[str, Operator],
    rows: dict[str, np.ndarray] | None,
    observe: Callable[[int], None] | None = None,
    every_port: bool = False,
    recorded: Mapping[str, Any] = MappingProxyType({}),
) -> tuple[BlockDiagram, Collection[Topic] | None, str, bool]:
    """Return (block diagram at the end, `only`, reason of an early end, True for a non-finite state)."""
    config = run if isinstance(run, RunConfig) else resolve(run)
    services = create_all(config, operator, recorded)
    encoders = [encoder for service in services for encoder in service.encoders]
    selected = {
        encoder.port
        for encoder in encoders
        if (encoder.topic.recorded if only is None else template_topic(encoder.topic) in only)
    }
    if every_port:
        selected = {port.name for service in services for block in service.blocks for port in block.outputs}
    diagram, failure, diverged = BlockDiagram(config, services, KEPT_TICKS, selected, rows), "", False
    try:
        look = config.last_tick + 1 if observe is None else LOOK
        while diagram.tick <= config.last_tick and not diagram.ended:
            if observe is not None:
                observe(diagram.tick)
            diagram.advance(min(diagram.tick + look, config.last_tick + 1))
    except LockStepError as error:
        if diagram.tick == 0 and not isinstance(error, DivergedError):  # a firmware did not start: there is no flight
            raise
        failure, diverged = str(error), isinstance(error, DivergedError)
    finally:
        diagram.close()
    return diagram, only, failure, diverged
