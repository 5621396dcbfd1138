"""Compiled blocks on rows: inputs, outputs, statuses, states, delays, ring buffers."""

import math

import numpy as np
import pytest

from lapwing.cosim.diagram.compiled_block import Block
from lapwing.cosim.diagram.tick_schedule import LATCHED, InputPort, Port
from lapwing.cosim.run_errors import LockStepError
from lapwing.kernels.cell import Cell, read
from tests.cosim.blocks.echo import Echo, Heard
from tests.cosim.blocks.readings import EXAMPLE, Readings, expected
from tests.cosim.blocks.running_sum import Number, RunningSum
from tests.cosim.small_graph import graph_of

READINGS = Port("readings", EXAMPLE)


def readings(every=1, port=READINGS, **signals):
    return Block("readings", Readings(2.0, **signals), Cell(0), (), (port,), every)


def echo(port=READINGS, delay=0, name="echo"):
    return Block(name, Echo(1.0), Cell(0), (InputPort(port.name, delay),), (Port(name, Heard(False, EXAMPLE, 0.0)),))


def test_trees_survive_round_trip_through_rows():
    diagram = graph_of(readings())
    for tick in range(12):
        diagram.advance(tick + 1)
        value = diagram.latest("readings", tick)
        assert value == expected(2.0, tick, tick + 1)
        assert [type(x) for x in (*value[:3], *value.rest)] == [float, bool, int, int, int]
        assert type(value.places[0].seen) is bool


@pytest.mark.parametrize("number", [math.inf, -math.inf, -0.0, 5e-324, 2.0**53, -(2.0**53)])
def test_block_reads_value_that_was_put(number):
    diagram = graph_of(echo(), ports=(READINGS,))
    values = expected(1.5, 7, 3)._replace(number=number, good=True, rest=(2**53, -(2**53)))
    diagram.put("readings", 0, values)
    diagram.advance(1)
    received = diagram.latest("echo", 0)
    assert received == Heard(True, values, 1.0)
    assert math.copysign(1.0, received.value.number) == math.copysign(1.0, number)


def test_nan_is_preserved():
    diagram = graph_of(echo(), ports=(READINGS,))
    diagram.put("readings", 0, EXAMPLE._replace(number=math.nan))
    diagram.advance(1)
    assert math.isnan(diagram.latest("echo", 0).value.number)


@pytest.mark.parametrize("delay", [0, 1, 5, 23])
def test_delayed_message_is_due_after_delay_for_any_page(delay):
    diagram = graph_of(readings(), echo(delay=delay), kept_ticks=2)
    for tick in range(100):
        diagram.advance(tick + 1)
        received = diagram.latest("echo", tick)
        assert received.due == (tick >= delay)
        if received.due:
            assert received.value == expected(2.0, tick - delay, tick - delay + 1)


@pytest.mark.parametrize("delay", [0, 1, 7])
def test_message_of_slow_port_is_due_at_its_ticks_only(delay):
    slow = Port("readings", EXAMPLE, 5)
    diagram = graph_of(readings(5, slow), echo(slow, delay), kept_ticks=4)
    for tick in range(60):
        diagram.advance(tick + 1)
        received = diagram.latest("echo", tick)
        assert received.due == (tick >= delay and (tick - delay) % 5 == 0)
        if received.due:
            assert received.value == expected(2.0, tick - delay, (tick - delay) // 5 + 1)


def test_latched_port_is_due_at_every_tick():
    kept = Port("kept", EXAMPLE, LATCHED)
    diagram = graph_of(echo(kept), ports=(kept,))
    for tick in range(20):
        if tick in (0, 7, 13):
            values = expected(3.0, tick, 1)
            diagram.put("kept", tick, values)
        diagram.advance(tick + 1)
        assert diagram.latest("echo", tick) == Heard(True, values, 1.0)


def test_fast_block_writes_slow_port_at_due_ticks_only():
    port = Port("readings", EXAMPLE, 4)
    diagram = graph_of(readings(1, port), kept_ticks=8)
    diagram.advance(8)
    assert diagram.latest("readings", 3) == expected(2.0, 0, 1)
    assert diagram.latest("readings", 7) == expected(2.0, 4, 5)


def test_ring_keeps_history_ticks():
    diagram = graph_of(readings(), kept_ticks=8)
    for stop in range(8, 400, 8):
        diagram.advance(stop)
        ticks = np.arange(stop - 8, stop)
        rows = diagram.rows("readings", ticks)
        assert rows[:, 0].tolist() == (2.0 * ticks).tolist()
        assert (-rows[:, 2]).tolist() == (ticks + 1.0).tolist()


def test_no_block_steps_after_last_tick():
    diagram = graph_of(readings(end=6), echo(), kept_ticks=16)
    diagram.advance(16)
    assert (diagram.tick, diagram.ended) == (7, True)
    assert diagram.latest("echo", 6).value == expected(2.0, 6, 7)
    diagram.advance(16)
    assert diagram.tick == 7


def test_failure_raises_error_of_block_or_names_block():
    for error, output in (
        (None, "readings: non-finite or invalid state at tick 4"),
        (lambda tick: ValueError(tick), "4"),
    ):
        part = readings(failure=4)
        part.failure = error
        diagram = graph_of(part, kept_ticks=16)
        with pytest.raises(LockStepError if error is None else ValueError, match=f"^{output}$"):
            diagram.advance(16)
        assert diagram.tick == 4  # earlier ticks can be recorded


def test_equal_blocks_have_separate_states_and_parameters():
    numbers = Port("numbers", Number(0.0))
    parts = [
        Block(f"sum{i}", RunningSum(weight), Cell(0.0), (InputPort("numbers"),), (Port(f"sum{i}", Number(0.0)),))
        for i, weight in enumerate((1.0, -10.0))
    ]
    diagram = graph_of(*parts, ports=(numbers,))
    for tick in range(5):
        diagram.put("numbers", tick, Number(tick + 1.0))
        diagram.advance(tick + 1)
    assert [diagram.latest(f"sum{i}", 4).value for i in range(2)] == [15.0, -150.0]
    assert [read(part.state) for part in parts] == [15.0, -150.0]


def test_blocks_with_common_cell_share_state():
    numbers, shared = Port("numbers", Number(0.0)), Cell(0.0)
    parts = [
        Block(f"sum{i}", RunningSum(1.0), shared, (InputPort("numbers"),), (Port(f"sum{i}", Number(0.0)),))
        for i in range(2)
    ]
    diagram = graph_of(*parts, ports=(numbers,))
    diagram.put("numbers", 0, Number(3.0))
    diagram.advance(1)
    assert [diagram.latest(f"sum{i}", 0).value for i in range(2)] == [3.0, 6.0]


def test_block_may_be_bound_in_two_diagrams():
    part = readings()
    first, second = graph_of(part), graph_of(part)
    for tick in range(6):
        first.advance(tick + 1)
        second.advance(tick + 1)
        assert first.latest("readings", tick) == expected(2.0, tick, 2 * tick + 1)  # both share the state of the block
        assert second.latest("readings", tick) == expected(2.0, tick, 2 * tick + 2)
