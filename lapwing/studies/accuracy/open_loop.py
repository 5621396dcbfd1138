"""Error of the solver alone: a flight is repeated in parts with finer steps, under its recorded commands.

A multirotor is unstable without an autopilot, so the error of an entire flight under recorded commands grows with a
high power of time, while a closed loop damps it within seconds. Therefore a part lasts `PART_LENGTH` seconds, begins at
a recorded state, and overlaps half of the next one. Errors are measured in the second half of each part. The commands
are data, so neither decisions of an autopilot nor the resolution of sensors have an influence.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.block_diagram import BlockDiagram, Service
from lapwing.cosim.diagram.compiled_block import Block
from lapwing.cosim.diagram.tick_schedule import LATCHED
from lapwing.kernels.cell import read, write
from lapwing.messages.topics import Topic
from lapwing.services.process_table import CLOCK_OWNER, create
from lapwing.studies.flight_data import FlightData

PART_LENGTH = 2.0  # [s] as in the selection of a solver (`solver_selection`)


class Parts(NamedTuple):
    """Flights of all vehicles in every second part of a run, with finer steps."""

    flights: list[FlightData]
    spans: list[tuple[float, float]]  # [s] intervals to measure: second halves of the parts, end exclusive


class _Plant(NamedTuple):
    """Plant of a run, with recorded inputs."""

    graph: BlockDiagram
    service: Service


def inputs_of_plant(flight: BlockDiagram) -> list[str]:
    """Return the ports that the plant reads from other services."""
    plant = next(service for service in flight.services if service.name == CLOCK_OWNER)
    own = {port.name for part in plant.parts for port in part.outputs}
    names = dict.fromkeys(i.port for part in plant.parts for i in getattr(part, "inputs", ()))
    return [name for name in names if name not in own and flight.ports[name].period != LATCHED]


def fly_parts(
    flight: BlockDiagram, finer: RunConfig, topics: tuple[Topic, ...], observe: Callable[[int], None]
) -> tuple[Parts, Parts]:
    """Repeat a run in parts, from its recorded states and under its recorded commands.

    Args:
        flight: block diagram at the end of the run, with the full history of all ports.
        finer: its configuration with another solver.
        topics: topics of the plant to return for each vehicle.
        observe: called with each tick at which a part begins.

    Returns:
        Two series of parts, whose spans together cover the run.
    """
    recorded, *replicas = (_plant(flight, setup) for setup in (flight.setup, finer, finer))
    interval = flight.setup.interval
    half = max(1, round(0.5 * PART_LENGTH / interval))
    spans: tuple[list[tuple[float, float]], ...] = ([], [])
    for number, start in enumerate(range(0, flight.tick, half)):
        stop = min(start + half, flight.tick)
        observe(start)
        _restart(replicas[number % 2], recorded, start)
        for plant in (recorded, *replicas):
            plant.graph.advance(stop)
        spans[1 - number % 2].append(((start - 0.5) * interval, (stop - 0.5) * interval))
    one, other = (
        Parts(FlightData.of_each(plant.graph, topics), list(span)) for plant, span in zip(replicas, spans, strict=True)
    )
    return one, other


def _plant(flight: BlockDiagram, setup: RunConfig) -> _Plant:
    """Return the plant of `setup` at tick 0, with its inputs of a finished run."""
    service = create(setup, CLOCK_OWNER)
    inputs = inputs_of_plant(flight)
    recorded_ports = {port.name for part in service.parts for port in part.outputs} | set(inputs)
    graph = BlockDiagram(setup, [service], 1, recorded_ports)
    for name in inputs:
        history = flight.history(name, flight.ports[name].period)
        graph.put_rows(name, np.arange(len(history)) * flight.ports[name].period, history)
    return _Plant(graph, service)


def _restart(plant: _Plant, recorded: _Plant, tick: int) -> None:
    """Set the state of a plant before `tick` to that of another one with the same blocks.

    It includes outputs of previous ticks, through which vehicles of a fleet act on each other.
    """
    for own, other in zip(plant.service.parts, recorded.service.parts, strict=True):
        if isinstance(own, Block):
            write(own.state, read(other.state))
    outputs = {port.name for part in plant.service.parts for port in part.outputs}
    for delayed in {i for part in plant.service.parts for i in getattr(part, "inputs", ()) if i.port in outputs}:
        for stamp in range(max(0, tick - delayed.delay), tick):
            plant.graph.put_row(delayed.port, stamp, recorded.graph.row(delayed.port, stamp))
