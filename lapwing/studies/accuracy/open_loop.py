"""Error of the solver alone: a flight is flown again in parts with finer steps, under its recorded commands.

A multirotor does not hold its attitude without an autopilot, so that the error of a whole flight under recorded
commands grows with a high power of time, while a closed loop forgets it within seconds. Therefore a part lasts
`PART` seconds, begins at a recorded state, and overlaps half of the next: each moment is measured where its part is
at least half as old. The commands are data, so that no decision of an autopilot and no digit of a sensor matters.
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

PART = 2.0  # [s] as in the selection of a solver (`solver_selection`)


class Parts(NamedTuple):
    """Flights of all vehicles in every second part of a run, with finer steps."""

    flights: list[FlightData]
    spans: list[tuple[float, float]]  # [s] moments to measure: later halves of the parts, end exclusive


class _Plant(NamedTuple):
    """Plant of a run alone, which reads recorded inputs."""

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
    """Fly a run again in parts, from its own states and under its own commands.

    Args:
        flown: block diagram at the end of the run, with the full history of all ports.
        finer: its configuration with another solver.
        topics: of the plant, to return of each vehicle.
        observe: called with each tick at which a part begins.

    Returns:
        Two series of parts, whose spans together are the whole run.
    """
    recorded, *replicas = (_plant(flight, setup) for setup in (flight.setup, finer, finer))
    interval = flight.setup.interval
    half = max(1, round(0.5 * PART / interval))
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
    """Return the plant of `setup` at tick 0, with the inputs that it had in a finished run."""
    service = create(setup, CLOCK_OWNER)
    inputs = inputs_of_plant(flight)
    whole = {port.name for part in service.parts for port in part.outputs} | set(inputs)
    graph = BlockDiagram(setup, [service], 1, whole)
    for name in inputs:
        history = flight.history(name, flight.ports[name].period)
        graph.put_rows(name, np.arange(len(history)) * flight.ports[name].period, history)
    return _Plant(graph, service)


def _restart(plant: _Plant, recorded: _Plant, tick: int) -> None:
    """Set the state of a plant before `tick` to that of another one with the same blocks.

    Vehicles of a fleet act on each other by outputs of the tick before, which are part of the state.
    """
    for own, other in zip(plant.service.parts, recorded.service.parts, strict=True):
        if isinstance(own, Block):
            write(own.state, read(other.state))
    outputs = {port.name for part in plant.service.parts for port in part.outputs}
    for late in {i for part in plant.service.parts for i in getattr(part, "inputs", ()) if i.port in outputs}:
        for stamp in range(max(0, tick - late.delay), tick):
            plant.graph.put_row(late.port, stamp, recorded.graph.row(late.port, stamp))
