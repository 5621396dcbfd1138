"""Effects of Python blocks on the memory of compiled ones, recorded in a run of the scene.

The commander of the autopilot is Python code that runs at a few ticks of a mission, and writes its output, gains and
faults into memory that compiled blocks read. A library without Python repeats these writes at the same ticks.
"""

import ctypes
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.block_diagram import BlockDiagram, Service
from lapwing.fmi.memory_image import MemoryImage

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
    setup: RunConfig, services: Sequence[Service], image: MemoryImage, part: BlockDiagram
) -> list[Action]:
    """Run the whole scene and return what the Python blocks of a part wrote.

    Args:
        setup: run configuration.
        services: all services; those of the part share their cells with `part`.
        image: memory image of the part.
        part: diagram of the part.

    Raises:
        LockStepError: a state became non-finite.
    """
    whole = BlockDiagram(setup, services, 1)
    own = {each.name for each in part._parts}
    watched = [_Watched(r.address, r.size, r.offset) for r in image.regions if r.header and r.size]
    for block in part._parts:
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

    whole.advance(min(setup.last_tick, round(LONGEST * setup.rate)) + 1, observe)
    return actions


def _words(each: _Watched) -> np.ndarray:
    return np.frombuffer(ctypes.string_at(each.address, -(-each.size // WORD) * WORD), np.int64)


def _changes(each: _Watched, before: np.ndarray) -> list[tuple[int, bytes]]:
    """Return (offset in the image, bytes) of each sequence of changed words."""
    after: Any = _words(each)
    changed = np.flatnonzero(after != before)
    runs = np.split(changed, np.flatnonzero(np.diff(changed) != 1) + 1) if len(changed) else []
    return [(each.offset + WORD * int(r[0]), after[r[0] : r[-1] + 1].tobytes()) for r in runs]
