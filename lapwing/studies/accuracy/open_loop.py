"""Errors of the plant alone: a flight is repeated in parts with finer steps or updates, under its recorded commands.

A multirotor is unstable without an autopilot, so the error of an entire flight under recorded commands grows with a
high power of time, while a closed loop damps it within seconds. Therefore a part lasts `PART_LENGTH` seconds, begins at
a recorded state, and overlaps half of the next one. Errors are measured in the second half of each part. The commands
are data, so neither decisions of an autopilot nor the resolution of sensors have an influence. Communication steps may
be shorter than the recorded ones; each recorded command then acts as long as before.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

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


class Start(NamedTuple):
    """State of a plant before a tick."""

    tick: int
    states: list[Any]  # of each compiled block
    rows: list[tuple[str, int, np.ndarray]]  # (port, ticks back, row) of the outputs that blocks read with a delay


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


def starts_of_parts(flight: BlockDiagram) -> list[Start]:
    """Return the states at which the parts of a run begin.

    Args:
        flight: block diagram at the end of the run, with the full history of all ports.
    """
    recorded, result = _plant(flight, flight.config), []
    for tick in range(0, flight.tick, _half(flight)):
        recorded.diagram.advance(tick)
        result.append(_start(recorded, tick))
    return result


def fly_parts(
    flight: BlockDiagram,
    starts: Sequence[Start],
    finer: RunConfig,
    topics: tuple[Topic, ...],
    observe: Callable[[int], None] = lambda tick: None,
) -> tuple[Parts, Parts]:
    """Repeat a run in parts, from its recorded states and under its recorded commands.

    Args:
        flight: block diagram at the end of the run, with the full history of all ports.
        starts: its `starts_of_parts`.
        finer: its configuration with another solver, and communication steps of the same length or whole fractions.
        topics: topics of the plant to return for each vehicle.
        observe: called with each recorded tick at which a part begins.

    Returns:
        Two series of parts, whose spans together cover the run.
    """
    replicas = [_plant(flight, finer) for _ in range(2)]
    interval = flight.config.interval
    updates = round(interval / finer.interval)
    spans: tuple[list[tuple[float, float]], ...] = ([], [])
    for number, start in enumerate(starts):
        stop = min(start.tick + _half(flight), flight.tick)
        observe(start.tick)
        _restart(replicas[number % 2], start, updates)
        for plant in replicas:
            plant.diagram.advance((stop - 1) * updates + 1)
        spans[1 - number % 2].append(((start.tick - 0.5) * interval, (stop - 0.5) * interval))
    one, other = (
        Parts(FlightData.of_each(plant.diagram, topics), list(span))
        for plant, span in zip(replicas, spans, strict=True)
    )
    return one, other


def _half(flight: BlockDiagram) -> int:
    """Return the ticks in half of a part."""
    return max(1, round(0.5 * PART_LENGTH / flight.config.interval))


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


def _start(recorded: _Plant, tick: int) -> Start:
    """Return the state of a plant before `tick`.

    It includes outputs of previous ticks, through which vehicles of a fleet act on each other.
    """
    blocks = recorded.service.blocks
    states = [read(block.state) for block in blocks if isinstance(block, Block)]
    outputs = {port.name for block in blocks for port in block.outputs}
    delayed = {i for block in blocks for i in getattr(block, "inputs", ()) if i.port in outputs}
    rows = [
        (i.port, back, recorded.diagram.row(i.port, tick - back).copy())
        for i in delayed
        for back in range(1, min(tick, i.delay) + 1)
    ]
    return Start(tick, states, rows)


def _restart(plant: _Plant, start: Start, updates: int) -> None:
    """Set the state of a plant, with `updates` communication steps in one of the recorded ones."""
    for block, state in zip([p for p in plant.service.blocks if isinstance(p, Block)], start.states, strict=True):
        if hasattr(state, "last"):  # last tick of the run
            state = state._replace(last=(state.last + 1) * updates - 1)
        write(block.state, state)
    first = (start.tick - 1) * updates + 1  # a step of the flight ends at its tick, which is that of its last update
    for port, back, row in start.rows:
        plant.diagram.put_row(port, first - back, row)
