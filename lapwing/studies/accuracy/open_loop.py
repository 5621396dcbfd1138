"""Errors of the plant alone: a flight is repeated in parts with finer steps or updates, under its recorded commands.

A multirotor is unstable without an autopilot, so the error of an entire flight under recorded commands grows with a
high power of time, while a closed loop damps it within seconds. Therefore a part lasts `PART_LENGTH` seconds, begins at
a recorded state, and overlaps half of the next one. Errors are measured in the second half of each part. The commands
are data, so neither decisions of an autopilot nor the resolution of sensors have an influence. Communication steps may
be shorter than the recorded ones; each recorded command then acts as long as before.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.block_diagram import BlockDiagram, Service
from lapwing.cosim.diagram.compiled_block import Block
from lapwing.cosim.diagram.tick_schedule import LATCHED
from lapwing.flights.flight_data import FlightData
from lapwing.kernels.cell import read, write
from lapwing.messages.topics import Topic
from lapwing.services.process_table import CLOCK_OWNER, create

PART_LENGTH = 2.0  # [s] as in the selection of a solver (`solver_selection`)


class Parts(NamedTuple):
    """Flights of all vehicles in every second part of a run, with finer steps."""

    flights: list[FlightData]
    spans: list[tuple[float, float]]  # [s] intervals to measure: second halves of the parts, end exclusive


class _Plant(NamedTuple):
    """Plant of a run, with recorded inputs."""

    diagram: BlockDiagram
    service: Service


def inputs_of_plant(flight: BlockDiagram) -> list[str]:
    """Return the ports that the plant reads from other services."""
    plant = next(service for service in flight.services if service.name == CLOCK_OWNER)
    own = {port.name for block in plant.blocks for port in block.outputs}
    names = dict.fromkeys(i.port for block in plant.blocks for i in getattr(block, "inputs", ()))
    return [name for name in names if name not in own and flight.ports[name].period != LATCHED]


def fly_parts(
    flight: BlockDiagram, finer: RunConfig, topics: tuple[Topic, ...], observe: Callable[[int], None]
) -> tuple[Parts, Parts]:
    """Repeat a run in parts, from its recorded states and under its recorded commands.

    Args:
        flight: block diagram at the end of the run, with the full history of all ports.
        finer: its configuration with another solver, and communication steps of the same length or whole fractions.
        topics: topics of the plant to return for each vehicle.
        observe: called with each recorded tick at which a part begins.

    Returns:
        Two series of parts, whose spans together cover the run.
    """
    recorded, *replicas = (_plant(flight, config) for config in (flight.config, finer, finer))
    interval = flight.config.interval
    updates = round(interval / finer.interval)
    half = max(1, round(0.5 * PART_LENGTH / interval))
    spans: tuple[list[tuple[float, float]], ...] = ([], [])
    for number, start in enumerate(range(0, flight.tick, half)):
        stop = min(start + half, flight.tick)
        observe(start)
        _restart(replicas[number % 2], recorded, start, updates)
        recorded.diagram.advance(stop)
        for plant in replicas:
            plant.diagram.advance((stop - 1) * updates + 1)
        spans[1 - number % 2].append(((start - 0.5) * interval, (stop - 0.5) * interval))
    one, other = (
        Parts(FlightData.of_each(plant.diagram, topics), list(span))
        for plant, span in zip(replicas, spans, strict=True)
    )
    return one, other


def _plant(flight: BlockDiagram, config: RunConfig) -> _Plant:
    """Return the plant of `config` at tick 0, with its inputs of a finished run."""
    service = create(config, CLOCK_OWNER)
    delays = {i.port: i.delay for block in service.blocks for i in getattr(block, "inputs", ())}
    inputs = inputs_of_plant(flight)
    recorded_ports = {port.name for block in service.blocks for port in block.outputs} | set(inputs)
    diagram = BlockDiagram(config, [service], 1, recorded_ports)
    updates = round(flight.config.interval / config.interval)
    for name in inputs:
        period, recorded_period, delay = diagram.ports[name].period, flight.ports[name].period, delays[name]
        history = flight.history(name, recorded_period)
        ticks = np.arange(0, len(history) * recorded_period * updates, period)
        if period == 1:  # read `delay` ticks later, in a recorded step that read the row of `delay` of its ticks before
            numbers = (-(-(ticks + delay) // updates) - delay) // recorded_period
        else:
            numbers = ticks // (recorded_period * updates)
        rows = history[np.clip(numbers, 0, len(history) - 1)]
        rows[numbers < 0] = 0.0  # as before the first tick of a run
        diagram.put_rows(name, ticks, rows)
    return _Plant(diagram, service)


def _restart(plant: _Plant, recorded: _Plant, tick: int, updates: int) -> None:
    """Set the state of a plant before a recorded `tick` to that of another one with the same blocks.

    The plant has `updates` communication steps in one of the recorded ones. The state includes outputs of previous
    ticks, through which vehicles of a fleet act on each other.
    """
    for own, other in zip(plant.service.blocks, recorded.service.blocks, strict=True):
        if isinstance(own, Block):
            state = read(other.state)
            if hasattr(state, "last"):  # last tick of the run
                state = state._replace(last=(state.last + 1) * updates - 1)
            write(own.state, state)
    outputs = {port.name for block in plant.service.blocks for port in block.outputs}
    first = (tick - 1) * updates + 1  # a step of the flight ends at its tick, which is that of its last update
    for delayed in {i for block in plant.service.blocks for i in getattr(block, "inputs", ()) if i.port in outputs}:
        for back in range(1, min(tick, delayed.delay) + 1):
            plant.diagram.put_row(delayed.port, first - back, recorded.diagram.row(delayed.port, tick - back))
