"""Compiled blocks do not count references to arrays, which are still freed once, with their last owner."""

import gc
import sys

import numpy as np
import pytest
from numba.core.runtime import _nrt_python, rtsys

from lapwing.cosim.diagram.compiled_block import Block, advance
from lapwing.cosim.diagram.tick_schedule import Port
from lapwing.kernels.cell import Cell, read
from tests.cosim.blocks.arrays import Last, Mean, Sum, weighted
from tests.cosim.blocks.exchanged_array import Exchange
from tests.cosim.blocks.new_arrays import Squares
from tests.cosim.small_graph import graph_of

TICKS = 1000
SUM = Port("sum", Sum(0.0))


def counts(parameters):
    """Return, for each compiled version of blocks of this class, True if it counts references."""
    compiled = [result for result in advance.overloads.values() if parameters.__name__ in str(result.signature)]
    modules = [result.library._get_module_for_linking() for result in compiled]
    return [any(function.name == "NRT_incref" for function in module.functions) for module in modules]


@pytest.fixture
def living():
    """Return numba's live allocations: (array owners, memory blocks)."""
    _nrt_python.memsys_enable_stats()

    def count():
        gc.collect()
        stats = rtsys.get_allocation_stats()
        return stats.mi_alloc - stats.mi_free, stats.alloc - stats.free

    yield count
    _nrt_python.memsys_disable_stats()


def test_arrays_changed_in_place_are_freed_with_owner(living):
    weights, ticks = np.linspace(-1.0, 2.0, 5), np.zeros(5)
    before, owners = (sys.getrefcount(weights), sys.getrefcount(ticks)), living()
    part = Block("mean", Mean(weights), Cell(Last(ticks, 0)), (), (SUM,))
    diagram = graph_of(part)
    diagram.advance(TICKS)
    last = np.array([TICKS - 5 + (i - TICKS) % 5 for i in range(5)], float)
    assert diagram.latest("sum", TICKS - 1).number == pytest.approx(weights @ last)
    assert read(part.state).count == TICKS
    assert counts(Mean) == [False]
    del part, diagram
    assert living() == owners
    assert (sys.getrefcount(weights), sys.getrefcount(ticks)) == before


def test_function_called_from_python_counts_references():
    """The code for blocks has the same name, but does not count references; it must not be used here."""
    p, s = Mean(np.linspace(-1.0, 2.0, 5)), Last(np.arange(5.0), 0)
    diagram = graph_of(Block("mean", p, Cell(s), (), (SUM,)))
    diagram.advance(TICKS)
    before = sys.getrefcount(s.ticks)
    for _ in range(10):
        total = weighted(p, s)[0]
    after = sys.getrefcount(s.ticks)
    assert after == before
    assert total == pytest.approx(p.weights @ s.ticks)


def test_block_that_allocates_arrays_frees_them(living):
    owners = living()
    part = Block("squares", Squares(7), Cell(Last(np.zeros(7), 0)), (), (SUM,))
    diagram = graph_of(part)
    diagram.advance(10)
    allocated = living()
    diagram.advance(TICKS)
    assert living() == allocated
    assert diagram.latest("sum", TICKS - 1).number == 91.0
    assert read(part.state).ticks.tolist() == [0.0, 1.0, 4.0, 9.0, 16.0, 25.0, 36.0]
    assert counts(Squares) == [True]
    del part, diagram
    assert living() == owners


def test_untrusted_block_may_replace_array(living):
    weights, ticks = np.linspace(-1.0, 2.0, 5), np.zeros(5)
    before, owners = (sys.getrefcount(weights), sys.getrefcount(ticks)), living()
    part = Block("exchange", Exchange(weights), Cell(Last(ticks, 0)), (), (SUM,), trusted=False)
    diagram = graph_of(part)
    diagram.advance(1)
    assert diagram.latest("sum", 0).number == 0.0
    diagram.advance(TICKS)
    assert diagram.latest("sum", TICKS - 1).number == -1.0
    del part, diagram
    assert living() == owners
    assert (sys.getrefcount(weights), sys.getrefcount(ticks)) == before
