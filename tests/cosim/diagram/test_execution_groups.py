"""Uncoupled vehicles step separately, several ticks at a time, with the results of lock step."""

import pytest

from lapwing.cosim.diagram.block_diagram import NEVER
from lapwing.cosim.diagram.compiled_block import Block
from lapwing.cosim.diagram.execution_groups import independent_groups
from lapwing.cosim.diagram.tick_schedule import InputPort, Port
from lapwing.cosim.run_errors import DivergedError
from lapwing.kernels.cell import Cell
from lapwing.services.process_table import create_all
from lapwing.services.scene_resolver import load, resolve
from tests.cosim.parts.counter import Counter
from tests.cosim.small_graph import graph_of

TOGETHER = {"together": True, "apart": False}


def counters(together, **parameters):
    """Return a block for each vehicle; `together`: the first block reads the output of the last."""
    names = list(parameters)
    taken = (InputPort(names[-1], 1),) if together else ()
    return [
        Block(name, p, Cell(0), taken if name == names[0] else (), (Port(name, 0),), vehicle=name)
        for name, p in parameters.items()
    ]


def counted(graph, *names):
    """Return the outputs of each block at every tick before the diagram's."""
    return [[graph.latest(name, tick) for tick in range(max(0, graph.tick - 8), graph.tick)] for name in names]


def test_coupled_blocks_share_execution_group():
    alone = counters(False, a=Counter(3), b=Counter(3))
    assert independent_groups(alone) == [[0], [1]]
    assert independent_groups(counters(True, a=Counter(3), b=Counter(3), c=Counter(3))) == [[0, 1, 2]]
    elsewhere = Block("c", Counter(3), Cell(0), (InputPort("from another process"),), vehicle="a")
    assert independent_groups([*alone, elsewhere]) == [[0, 1, 2]]
    fleet, carried = (
        [part for service in create_all(resolve(load(name))) for part in service.parts]
        for name in ("fleet", "carried_load")
    )
    assert len(independent_groups(fleet)) == 3
    assert len(independent_groups(carried)) == 1


@pytest.mark.parametrize("together", TOGETHER.values(), ids=TOGETHER)
@pytest.mark.parametrize("last", [(7, 9), (9, 7), (3, 9), (9, 3)])
@pytest.mark.parametrize("pages", [(100,), (4, 8, 12), range(1, 20)])
def test_run_ends_with_last_vehicle_at_equal_ticks(last, pages, together):
    graph = graph_of(*counters(together, a=Counter(last[0]), b=Counter(last[1])), page=16)
    for stop in pages:
        graph.advance(stop)
    assert (graph.ended, graph.tick) == (True, 10)
    assert counted(graph, "a", "b") == [list(range(2, 10))] * 2


@pytest.mark.parametrize("together", TOGETHER.values(), ids=TOGETHER)
@pytest.mark.parametrize(
    ("a", "b", "c"),
    [
        (Counter(20, 5), Counter(20), Counter(20)),
        (Counter(20), Counter(20), Counter(20, 5)),
        (Counter(20, 6), Counter(20, 5), Counter(20, 7)),
        (Counter(2), Counter(3), Counter(20, 5)),  # two have finished before
        (Counter(2, 5), Counter(20), Counter(20)),  # a finished block fails
        (Counter(2, 5), Counter(20, 7), Counter(20)),
    ],
)
def test_first_failure_is_raised_at_equal_ticks(a, b, c, together):
    graph = graph_of(*counters(together, a=a, b=b, c=c), page=16)
    failing = next(name for name, p in (("a", a), ("b", b), ("c", c)) if p.fails == 5)
    with pytest.raises(DivergedError, match=f"^{failing}: .* at tick 5$"):
        graph.advance(12)
    assert (graph.ended, graph.tick) == (False, 5)
    assert counted(graph, "a", "b", "c") == [list(range(5))] * 3


class Speaker:
    """Python block that publishes a message at every third tick."""

    outputs = ()

    def __init__(self, vehicle, messages):
        self.name = self.vehicle = vehicle
        self._messages = messages

    def bind(self, graph):
        pass

    def on_tick(self, tick):
        self._messages.append((self.vehicle, tick, b""))
        return tick + 3 if tick < 9 else NEVER


@pytest.mark.parametrize("together", TOGETHER.values(), ids=TOGETHER)
def test_messages_are_in_order_of_ticks(together):
    graph = graph_of(*counters(together, a=Counter(20), b=Counter(20)))
    output = graph.services[0].messages
    speakers = [Speaker(name, output) for name in "ab"]
    graph = graph_of(*counters(together, a=Counter(20), b=Counter(20)), *speakers)
    graph.services[0].messages = output
    graph.advance(6)
    graph.advance(12)
    assert output == [(name, tick, b"") for tick in (0, 3, 6, 9) for name in "ab"]


class Clock:
    """Python block that owns the clock."""

    name, outputs = "clock", ()

    def __init__(self, last):
        self._last = last

    def bind(self, graph):
        self._graph = graph

    def on_tick(self, tick):
        if tick == self._last:
            self._graph.finish()
        return tick + 1


def test_python_clock_owner_ends_run():
    graph = graph_of(Clock(3), Block("a", Counter(20), Cell(0), (), (Port("a", 0),)), page=16)
    graph.advance(100)
    assert (graph.ended, graph.tick) == (True, 4)
    assert graph.latest("a", 3) == 3
