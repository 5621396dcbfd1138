"""Compiled parts on rows: trees in and out, signals, states, delays, rings."""

import math

import numpy as np
import pytest

from lapwing.cosim.diagram.compiled_block import Block
from lapwing.cosim.diagram.tick_schedule import LATCHED, InputPort, Port
from lapwing.cosim.run_errors import LockStepError
from lapwing.kernels.cell import Cell, read
from tests.cosim.parts.echo import Echo, Heard
from tests.cosim.parts.readings import LIKE, Readings, expected
from tests.cosim.parts.running_sum import Number, RunningSum
from tests.cosim.small_graph import graph_of

READINGS = Port("readings", LIKE)


def readings(every=1, port=READINGS, **signals):
    return Block("readings", Readings(2.0, **signals), Cell(0), (), (port,), every)


def echo(port=READINGS, delay=0, name="echo"):
    return Block(name, Echo(1.0), Cell(0), (InputPort(port.name, delay),), (Port(name, Heard(False, LIKE, 0.0)),))


def test_trees_of_floats_integers_and_booleans_come_out_as_they_went_in():
    graph = graph_of(readings())
    for tick in range(12):
        graph.advance(tick + 1)
        value = graph.latest("readings", tick)
        assert value == expected(2.0, tick, tick + 1)
        assert [type(x) for x in (*value[:3], *value.rest)] == [float, bool, int, int, int]
        assert type(value.places[0].seen) is bool


@pytest.mark.parametrize("number", [math.inf, -math.inf, -0.0, 5e-324, 2.0**53, -(2.0**53)])
def test_a_part_receives_what_was_put(number):
    graph = graph_of(echo(), ports=(READINGS,))
    given = expected(1.5, 7, 3)._replace(number=number, good=True, rest=(2**53, -(2**53)))
    graph.put("readings", 0, given)
    graph.advance(1)
    heard = graph.latest("echo", 0)
    assert heard == Heard(True, given, 1.0)
    assert math.copysign(1.0, heard.value.number) == math.copysign(1.0, number)


def test_not_a_number_stays_one():
    graph = graph_of(echo(), ports=(READINGS,))
    graph.put("readings", 0, LIKE._replace(number=math.nan))
    graph.advance(1)
    assert math.isnan(graph.latest("echo", 0).value.number)


@pytest.mark.parametrize("delay", [0, 1, 5, 23])
def test_a_delayed_message_is_due_its_delay_later_however_short_the_page(delay):
    graph = graph_of(readings(), echo(delay=delay), page=2)
    for tick in range(100):
        graph.advance(tick + 1)
        heard = graph.latest("echo", tick)
        assert heard.due == (tick >= delay)
        if heard.due:
            assert heard.value == expected(2.0, tick - delay, tick - delay + 1)


@pytest.mark.parametrize("delay", [0, 1, 7])
def test_of_a_slower_port_a_message_is_due_at_its_ticks_only(delay):
    slow = Port("readings", LIKE, 5)
    graph = graph_of(readings(5, slow), echo(slow, delay), page=4)
    for tick in range(60):
        graph.advance(tick + 1)
        heard = graph.latest("echo", tick)
        assert heard.due == (tick >= delay and (tick - delay) % 5 == 0)
        if heard.due:
            assert heard.value == expected(2.0, tick - delay, (tick - delay) // 5 + 1)


def test_what_is_kept_is_due_at_every_tick_until_another_is_given():
    kept = Port("kept", LIKE, LATCHED)
    graph = graph_of(echo(kept), ports=(kept,))
    for tick in range(20):
        if tick in (0, 7, 13):
            given = expected(3.0, tick, 1)
            graph.put("kept", tick, given)
        graph.advance(tick + 1)
        assert graph.latest("echo", tick) == Heard(True, given, 1.0)


def test_a_part_that_steps_more_often_than_its_port_is_due_writes_at_its_ticks_only():
    port = Port("readings", LIKE, 4)
    graph = graph_of(readings(1, port), page=8)
    graph.advance(8)
    assert graph.latest("readings", 3) == expected(2.0, 0, 1)
    assert graph.latest("readings", 7) == expected(2.0, 4, 5)


def test_the_ring_keeps_the_ticks_of_a_page_whatever_has_gone_before():
    graph = graph_of(readings(), page=8)
    for stop in range(8, 400, 8):
        graph.advance(stop)
        ticks = np.arange(stop - 8, stop)
        rows = graph.rows("readings", ticks)
        assert rows[:, 0].tolist() == (2.0 * ticks).tolist()
        assert (-rows[:, 2]).tolist() == (ticks + 1.0).tolist()


def test_the_last_tick_is_stepped_by_all_and_followed_by_none():
    graph = graph_of(readings(end=6), echo(), page=16)
    graph.advance(16)
    assert (graph.tick, graph.ended) == (7, True)
    assert graph.latest("echo", 6).value == expected(2.0, 6, 7)
    graph.advance(16)
    assert graph.tick == 7


def test_a_failure_is_the_parts_own_error_or_names_it():
    for error, said in ((None, "readings: the state is not sound at tick 4"), (lambda tick: ValueError(tick), "4")):
        part = readings(failure=4)
        part.failure = error
        graph = graph_of(part, page=16)
        with pytest.raises(LockStepError if error is None else ValueError, match=f"^{said}$"):
            graph.advance(16)
        assert graph.tick == 4  # the ticks before it can be recorded


def test_parts_of_one_kind_have_states_and_parameters_of_their_own():
    numbers = Port("numbers", Number(0.0))
    parts = [
        Block(f"sum{i}", RunningSum(weight), Cell(0.0), (InputPort("numbers"),), (Port(f"sum{i}", Number(0.0)),))
        for i, weight in enumerate((1.0, -10.0))
    ]
    graph = graph_of(*parts, ports=(numbers,))
    for tick in range(5):
        graph.put("numbers", tick, Number(tick + 1.0))
        graph.advance(tick + 1)
    assert [graph.latest(f"sum{i}", 4).value for i in range(2)] == [15.0, -150.0]
    assert [read(part.state) for part in parts] == [15.0, -150.0]


def test_parts_that_are_given_one_cell_share_their_state():
    numbers, shared = Port("numbers", Number(0.0)), Cell(0.0)
    parts = [
        Block(f"sum{i}", RunningSum(1.0), shared, (InputPort("numbers"),), (Port(f"sum{i}", Number(0.0)),))
        for i in range(2)
    ]
    graph = graph_of(*parts, ports=(numbers,))
    graph.put("numbers", 0, Number(3.0))
    graph.advance(1)
    assert [graph.latest(f"sum{i}", 0).value for i in range(2)] == [3.0, 6.0]


def test_a_part_may_be_bound_in_two_graphs():
    part = readings()
    first, second = graph_of(part), graph_of(part)
    for tick in range(6):
        first.advance(tick + 1)
        second.advance(tick + 1)
        assert first.latest("readings", tick) == expected(2.0, tick, 2 * tick + 1)  # the state is the part's
        assert second.latest("readings", tick) == expected(2.0, tick, 2 * tick + 2)
