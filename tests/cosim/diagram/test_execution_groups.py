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
from tests.cosim.blocks.counter import Counter
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


def counted(diagram, *names):
    """Return the outputs of each block at every tick before the diagram's."""
    return [[diagram.latest(name, tick) for tick in range(max(0, diagram.tick - 8), diagram.tick)] for name in names]


def test_coupled_blocks_share_execution_group():
    alone = counters(False, a=Counter(3), b=Counter(3))
    assert independent_groups(alone) == [[0], [1]]
    assert independent_groups(counters(True, a=Counter(3), b=Counter(3), c=Counter(3))) == [[0, 1, 2]]
    elsewhere = Block("c", Counter(3), Cell(0), (InputPort("from another process"),), vehicle="a")
    assert independent_groups([*alone, elsewhere]) == [[0, 1, 2]]
    fleet, carried = (
        [block for service in create_all(resolve(load(name))) for block in service.blocks]
        for name in ("fleet", "carried_load")
    )
    assert len(independent_groups(fleet)) == 3
    assert len(independent_groups(carried)) == 1


@pytest.mark.parametrize("together", TOGETHER.values(), ids=TOGETHER)
@pytest.mark.parametrize("last", [(7, 9), (9, 7), (3, 9), (9, 3)])
@pytest.mark.parametrize("stops", [(100,), (4, 8, 12), range(1, 20)])
def test_run_ends_with_last_vehicle_at_equal_ticks(last, stops, together):
    diagram = graph_of(*counters(together, a=Counter(last[0]), b=Counter(last[1])), kept_ticks=16)
    for stop in stops:
        diagram.advance(stop)
    assert (diagram.ended, diagram.tick) == (True, 10)
    assert counted(diagram, "a", "b") == [list(range(2, 10))] * 2


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
    diagram = graph_of(*counters(together, a=a, b=b, c=c), kept_ticks=16)
    failing = next(name for name, p in (("a", a), ("b", b), ("c", c)) if p.fails == 5)
    with pytest.raises(DivergedError, match=f"^{failing}: .* at tick 5$"):
        diagram.advance(12)
    assert (diagram.ended, diagram.tick) == (False, 5)
    assert counted(diagram, "a", "b", "c") == [list(range(5))] * 3


class Speaker:
    """Python block that publishes a message at every third tick."""

    outputs = ()

    def __init__(self, vehicle, messages):
        self.name = self.vehicle = vehicle
        self._messages = messages

    def bind(self, diagram):
        pass

    def on_tick(self, tick):
        self._messages.append((self.vehicle, tick, b""))
        return tick + 3 if tick < 9 else NEVER


@pytest.mark.parametrize("together", TOGETHER.values(), ids=TOGETHER)
def test_messages_are_in_order_of_ticks(together):
    diagram = graph_of(*counters(together, a=Counter(20), b=Counter(20)))
    output = diagram.services[0].messages
    speakers = [Speaker(name, output) for name in "ab"]
    diagram = graph_of(*counters(together, a=Counter(20), b=Counter(20)), *speakers)
    diagram.services[0].messages = output
    diagram.advance(6)
    diagram.advance(12)
    assert output == [(name, tick, b"") for tick in (0, 3, 6, 9) for name in "ab"]
