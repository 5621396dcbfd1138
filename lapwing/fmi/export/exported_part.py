"""The part of a scene to export: its blocks, the ports at its boundary, the image of its memory, and its Python blocks.

The commander of the autopilot is Python code that runs at a few ticks of a mission, and writes its output, gains and
faults into memory that compiled blocks read. A library without Python repeats these writes at the same ticks.
"""

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.block_diagram import NEVER, BlockDiagram, Service, is_connected
from lapwing.cosim.diagram.compiled_block import Block, BoundBlock
from lapwing.cosim.diagram.tick_schedule import LATCHED, Port
from lapwing.fmi.export.memory_image import MemoryImage, image_of
from lapwing.fmi.importer.service_config import fmus_of, replaced_ports
from lapwing.services.plant.service import PropellerFailures
from lapwing.services.process_table import create_all

WORD = 8  # [bytes] compared at once
LONGEST = 600.0  # [s] of the recorded run


class Action(NamedTuple):
    """One execution of a Python block."""

    tick: int
    block: str  # name of the block
    writes: tuple[tuple[int, bytes], ...]  # offset in the image, new bytes


class _Watched(NamedTuple):
    """Memory that Python blocks may write."""

    address: int
    size: int
    offset: int  # position in the image


def record_actions(
    config: RunConfig, services: Sequence[Service], image: MemoryImage, part: BlockDiagram
) -> list[Action]:
    """Run the whole scene and return what the Python blocks of a part wrote.

    Args:
        config: run configuration.
        services: all services; those of the part share their cells with `part`.
        image: memory image of the part.
        part: diagram of the part.

    Raises:
        LockStepError: a state became non-finite.
    """
    whole = BlockDiagram(config, services, 1)
    own = {each.name for each in part._blocks}
    watched = [_Watched(r.address, r.size, r.offset) for r in image.regions if r.header and r.size]
    for block in part._blocks:
        for port in () if hasattr(block, "every") else block.outputs:
            rows = whole._rows[port.name]
            watched.append(_Watched(rows.ctypes.data, rows.nbytes, image.rows[port.name]))
    actions: list[Action] = []
    planned: dict[str, int] = {}  # tick of the next execution of each block

    def observe(block: Any, tick: int) -> int:
        if block.name not in own:
            return block.on_tick(tick)
        before = [_words(each) for each in watched]
        following = block.on_tick(tick)
        writes = [w for each, old in zip(watched, before, strict=True) for w in _changes(each, old)]
        woken, planned[block.name] = planned.get(block.name, 0) != tick, following
        if writes or woken:
            actions.append(Action(tick, block.name, tuple(writes)))
        return following

    whole.advance(min(config.last_tick, round(LONGEST * config.rate)) + 1, observe)
    return actions


def _words(each: _Watched) -> np.ndarray:
    return np.frombuffer(ctypes.string_at(each.address, -(-each.size // WORD) * WORD), np.int64)


def _changes(each: _Watched, before: np.ndarray) -> list[tuple[int, bytes]]:
    """Return (offset in the image, bytes) of each sequence of changed words."""
    after: Any = _words(each)
    changed = np.flatnonzero(after != before)
    runs = np.split(changed, np.flatnonzero(np.diff(changed) != 1) + 1) if len(changed) else []
    return [(each.offset + WORD * int(r[0]), after[r[0] : r[-1] + 1].tobytes()) for r in runs]


VEHICLE = "vehicle"
PARTS = ("plant", "sensors", "autopilot", "trajectory", VEHICLE)


class ScheduledBlock(NamedTuple):
    """A block in the order of execution, or its replacement; a Python block has neither code nor memory."""

    block: Any  # `Block` or Python block
    bound: BoundBlock | None
    every: int  # [ticks] between two steps
    vehicle: int  # index of the vehicle
    name: str  # of its parameters: "plant", "plant.from_tick_651"
    until: int = NEVER  # first tick of its replacement
    following: int = 0  # index of its replacement


class BoundaryPort(NamedTuple):
    """A port that the part reads from outside or publishes."""

    port: Port
    lag: int  # [ticks] of an input: 0 if its value belongs to the tick that is computed, else 1
    depth: int  # rows in the ring
    ring: str  # name of the port in the diagram; it differs if an FMU computes columns of the port


@dataclass
class ExportedPart:
    """A part of a scene.

    Attributes:
        name: name of the part, e.g. "plant".
        config: run configuration.
        blocks: in the order of execution, followed by replacements at later ticks.
        replacements: number of these.
        events: first ticks whose outputs a propeller failure affects.
        inputs: ports that blocks outside of the part write.
        outputs: ports of the services of the part.
        image: memory before the first tick.
        actions: effects of Python blocks, recorded in a run of the scene.
    """

    name: str
    config: RunConfig
    blocks: list[ScheduledBlock]
    replacements: int
    events: list[int]
    inputs: list[BoundaryPort]
    outputs: list[BoundaryPort]
    image: MemoryImage
    actions: list[Action]


def export_part(config: RunConfig, name: str) -> ExportedPart:
    """Bind the blocks of a part, and record what its Python blocks do in a run of the scene.

    Args:
        config: run configuration of the scene.
        name: one of `PARTS`.

    Raises:
        ValueError: the scene has no such part, or the part has Python code of the user.
    """
    names = config.order if name == VEHICLE else [name]
    if missing := [each for each in names if each not in config.services]:
        raise ValueError(f"--part {name}: scene {config.scene} has no {missing[0]}; use one of {_choices(config)}")
    services = create_all(config)
    own = [service for service in services if service.name in names]
    for block in (block for service in own for block in service.blocks):
        _check(block)
    diagram = BlockDiagram(config, own, 1)
    replacing = [failures for block in diagram._blocks if (failures := _propeller_failures(block))]
    scheduled = _scheduled(diagram)
    blocks = _with_replacements(scheduled, replacing)
    produced = {port.name for block in diagram._blocks for port in block.outputs}
    lags: dict[str, int] = {}
    for block in diagram._blocks:
        for needed in getattr(block, "inputs", ()):
            if needed.port not in produced:
                lags[needed.port] = min(lags.get(needed.port, 1), needed.delay)
    published = [port for each in names for port in config.services[each].ports]
    roots = [(each.name, each.bound.cell) for each in blocks if each.bound]
    image = image_of(roots, diagram._rows)
    python = {each.name for each in blocks if not each.bound}
    actions = [a for a in record_actions(config, services, image, diagram) if a.block in python] if python else []
    originals = {own: port for port, own in replaced_ports(fmus_of(config.services)).items()}

    def boundary(port: Port, lag: int) -> BoundaryPort:
        public = port._replace(name=originals.get(port.name, port.name))
        return BoundaryPort(public, lag, len(diagram._rows[port.name]), port.name)

    return ExportedPart(
        name,
        config,
        blocks,
        len(blocks) - len(scheduled),
        sorted({tick for each in replacing for tick in each.events}),
        [boundary(diagram.ports[port], lag) for port, lag in lags.items()],
        [boundary(port, 0) for port in published if port.name in diagram._rows],
        image,
        actions,
    )


def _check(block: Any) -> None:
    if isinstance(block, Block):
        return
    inner = getattr(block, "_block", block)
    module = type(inner).__module__
    if is_connected(inner):  # a firmware
        raise ValueError(f"{block.name}: connected to a program outside Lapwing; only compiled blocks can be exported")
    if any(port.period != LATCHED for port in block.outputs) or not module.startswith("lapwing."):
        raise ValueError(f"{block.name}: runs Python code of the scene; only compiled blocks can be exported")


def _propeller_failures(block: Any) -> PropellerFailures | None:
    inner = getattr(block, "_block", block)
    return inner if isinstance(inner, PropellerFailures) else None


def _scheduled(diagram: BlockDiagram) -> list[ScheduledBlock]:
    """Return the blocks of a diagram; those that only replace others have no effect of their own."""
    vehicles = list(dict.fromkeys(getattr(block, "vehicle", "") for block in diagram._blocks))
    return [
        ScheduledBlock(
            block, bound, getattr(block, "every", 1), vehicles.index(getattr(block, "vehicle", "")), block.name
        )
        for block, bound in zip(diagram._blocks, diagram._codes, strict=True)
        if not _propeller_failures(block)
    ]


def _with_replacements(
    scheduled: Sequence[ScheduledBlock], replacing: Sequence[PropellerFailures]
) -> list[ScheduledBlock]:
    """Return scheduled blocks linked to those that replace them after propeller failures, which follow at the end."""
    rows = list(scheduled)
    latest = {block.name: k for k, block in enumerate(rows)}
    for failures in replacing:
        for tick, replaced in sorted(failures.replacements.items()):
            for block, bound in replaced:
                k = latest[block.name]
                latest[block.name] = len(rows)
                rows.append(rows[k]._replace(block=block, bound=bound, name=f"{block.name}.from_tick_{tick}"))
                rows[k] = rows[k]._replace(until=tick, following=latest[block.name])
    return rows


def _choices(config: RunConfig) -> str:
    return ", ".join(each for each in PARTS if each in config.services or each == VEHICLE)
