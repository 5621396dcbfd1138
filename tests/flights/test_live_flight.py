"""Flight in steps: its messages and events equal those of the whole flight."""

import itertools

import numpy as np
import pytest

import lapwing
from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.cosim.executors.single_process import KEPT_TICKS
from lapwing.services.common.event_kinds import KINDS
from lapwing.services.process_table import create_all
from lapwing.services.scene_resolver import load, resolve
from lapwing.views.live.live_feed import LiveFlight, new_events

STEP = 50_000_000  # [ns]


@pytest.fixture(scope="module")
def steps():
    """Return the steps of a short mission whose services deliver at different times."""
    config = resolve(load("hover", {"run.duration": 4.0}))
    diagram = BlockDiagram(config, create_all(config), KEPT_TICKS)
    live, result, delayed = LiveFlight(config), [], []
    while not diagram.ended:
        before = diagram.tick
        diagram.advance(min(diagram.tick + 30, config.last_tick + 1))
        pages = list(diagram.record_batches(before, diagram.tick))
        live.add(delayed + [page for page in pages if page.topic.name.endswith("ground_truth")])
        delayed = [page for page in pages if not page.topic.name.endswith("ground_truth")]  # delivered later
        if (step := live.step((before - 1) * config.interval_ns)) is not None:
            result.append(step)
    live.add(delayed)
    return [*result, live.step(config.last_tick * config.interval_ns)]


@pytest.fixture(scope="module")
def whole():
    return lapwing.fly("hover", {"run.duration": 4.0})


def test_steps_begin_with_last_message_before_and_form_flight(steps, whole):
    assert len(steps) > 10
    for one, other in itertools.pairwise(steps):
        assert one.times("ground_truth")[-1] == other.times("ground_truth")[0]
    rows = [step.truth.position[1:] if k else step.truth.position for k, step in enumerate(steps)]
    assert np.array_equal(np.concatenate(rows), whole.truth.position)
    rows = [step.reference[1:] if k else step.reference for k, step in enumerate(steps)]
    assert np.array_equal(np.concatenate(rows), whole.reference)


def test_events_are_reported_once(steps, whole):
    reported, after = [], -1.0
    for step in steps:
        reported += new_events(step, after)
        after = float(step.truth.times[-1])
    assert reported == [event for event in whole.events if not KINDS[event.kind].afterwards]
    assert {event.kind for event in reported} >= {"arming", "mode", "phase", "contact"}
